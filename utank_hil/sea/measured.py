"""A time series of wave spectra measured at one place."""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from datetime import datetime

import numpy as np
import numpy.typing as npt

from utank_hil.base.arrays import FloatArray
from utank_hil.sea.spectrum import Spectrum, Spread, band_edges


@dataclass(frozen=True, slots=True, eq=False)
class MeasuredSpectra:
    """A time series of spectra, each on its own frequencies."""

    source: str  #: Origin, for error messages.
    time: npt.NDArray[np.datetime64]  #: shape (N,): UTC, increasing.
    #: shape (N, F): centre frequencies; nan behind the last band of a spectrum of fewer.
    frequency_hz: FloatArray
    density: FloatArray  #: shape (N, F): spectral density in m^2/Hz; nan where the source has none.
    #: shape (N, F): mean direction the waves come from, degrees from true north; nan where the
    #: source has none.
    direction_from_deg: FloatArray | None = None
    spread: Spread | None = None  #: Spread of all spectra, energy of shape (N, F, D).
    notes: tuple[str, ...] = ()  #: Rows of the source that are left out, with place and reason.

    def __len__(self) -> int:
        return len(self.time)

    def __iter__(self) -> Iterator[Spectrum]:
        return (self[index] for index in range(len(self)))

    def __getitem__(self, index: int) -> Spectrum:
        """Return the spectrum at a position.

        Missing bands at either end of the grid count as zero. A missing band in between raises a
        ValueError, because its energy is unknown.
        """
        frequency_hz, density = self._bands(index)
        if np.isnan(density).any():
            gap = frequency_hz[np.isnan(density)][0]
            raise ValueError(
                f"{self.source}: the spectrum of {self.time[index]} has no value at {gap:g} Hz: "
                "choose another time"
            )
        direction, spread = None, None
        if self.direction_from_deg is not None:
            direction = self.direction_from_deg[index, : len(density)]
        if self.spread is not None:
            spread = replace(self.spread, energy=self.spread.energy[index])
        return Spectrum(frequency_hz, density, direction, spread)

    def at(self, time: str | np.datetime64, within_s: float = 0.0) -> Spectrum:
        """Spectrum measured at a time, or nearest to it.

        `time` is in UTC, such as ``"2019-02-10T05:40"``; `within_s` is the largest distance in time
        to the nearest measurement. ValueError is raised if there is none within that time, or the
        time cannot be parsed.
        """
        wanted = np.datetime64(str(time), "s")
        index = int(np.argmin(np.abs(self.time - wanted)))
        if not abs((self.time[index] - wanted) / np.timedelta64(1, "s")) <= within_s:
            left_out = ""
            if self.notes:
                left_out = f"; {len(self.notes)} rows are left out, the first: {self.notes[0]}"
            raise ValueError(
                f"{self.source}: no spectrum within {within_s:g} s of {wanted}; the nearest is of "
                f"{self.time[index]}, all are from {self.time[0]} to {self.time[-1]}{left_out}"
            )
        return self[index]

    def times(self, first: datetime, last: datetime) -> list[datetime]:
        """Times of the measurements from `first` to `last`, both included, in UTC."""
        inside = (self.time >= np.datetime64(first)) & (self.time <= np.datetime64(last))
        return [each.item() for each in self.time[inside]]

    @property
    def hs_m(self) -> FloatArray:
        """Significant wave heights 4 sqrt(m0), shape (N,); nan if a band in between is missing."""
        bands = [self._bands(index) for index in range(len(self))]
        energy = [density @ np.diff(band_edges(hz))[:, 0] for hz, density in bands]
        return 4 * np.sqrt(np.array(energy))

    @property
    def tp_s(self) -> FloatArray:
        """Peak periods, shape (N,); nan without energy or if a band in between is missing."""
        bands = [self._bands(index) for index in range(len(self))]
        # The greatest of densities with a nan among them is nan, which is not above zero.
        return np.array(
            [1 / hz[np.argmax(d)] if np.max(d) > 0 else np.nan for hz, d in bands], dtype=np.float64
        )

    def _bands(self, index: int) -> tuple[FloatArray, FloatArray]:
        """Frequencies and densities, with zeros for missing densities at either end."""
        frequency_hz = self.frequency_hz[index][np.isfinite(self.frequency_hz[index])]
        density = self.density[index, : len(frequency_hz)]
        present = np.isfinite(density)
        begun, ahead = np.logical_or.accumulate(present), np.logical_or.accumulate(present[::-1])
        return frequency_hz, np.where(begun & ahead[::-1], density, 0.0)
