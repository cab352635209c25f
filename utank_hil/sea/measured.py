"""A time series of wave spectra measured at one place."""

from collections.abc import Iterator
from dataclasses import dataclass
from datetime import datetime

import numpy as np
import numpy.typing as npt

from utank_hil.base.arrays import FloatArray
from utank_hil.sea.spectrum import Spectrum, band_edges


@dataclass(frozen=True, slots=True, eq=False)
class MeasuredSpectra:
    """A time series of spectra on one frequency grid."""

    source: str  #: Origin, for error messages.
    time: npt.NDArray[np.datetime64]  #: shape (N,): UTC, increasing.
    frequency_hz: FloatArray  #: shape (F,): centre frequencies of the bands.
    density: FloatArray  #: shape (N, F): spectral density in m^2/Hz; nan where the source has none.
    #: shape (N, F): mean direction the waves come from, degrees from true north; nan where the
    #: source has none.
    direction_from_deg: FloatArray | None = None

    def __len__(self) -> int:
        return len(self.time)

    def __iter__(self) -> Iterator[Spectrum]:
        return (self[index] for index in range(len(self)))

    def __getitem__(self, index: int) -> Spectrum:
        """Return the spectrum at a position.

        Missing bands at either end of the grid count as zero. A missing band in between raises a
        ValueError, because its energy is unknown.
        """
        density = self._zero_filled_ends()[index]
        if np.isnan(density).any():
            gap = self.frequency_hz[np.isnan(density)][0]
            raise ValueError(
                f"{self.source}: the spectrum of {self.time[index]} has no value at {gap:g} Hz: "
                "choose another time"
            )
        direction = None if self.direction_from_deg is None else self.direction_from_deg[index]
        return Spectrum(self.frequency_hz, density, direction)

    def at(self, time: str | np.datetime64, within_s: float = 0.0) -> Spectrum:
        """Spectrum measured at a time, or nearest to it.

        Parameters
        ----------
        time : str or datetime64
            Time in UTC, such as ``"2019-02-10T05:40"``.
        within_s : float
            Largest distance in time to the nearest measurement.

        Raises
        ------
        ValueError
            If there is none within that time, or the time cannot be parsed.
        """
        wanted = np.datetime64(str(time), "s")
        index = int(np.argmin(np.abs(self.time - wanted)))
        if not abs((self.time[index] - wanted) / np.timedelta64(1, "s")) <= within_s:
            raise ValueError(
                f"{self.source}: no spectrum within {within_s:g} s of {wanted}; the nearest is of "
                f"{self.time[index]}, all are from {self.time[0]} to {self.time[-1]}"
            )
        return self[index]

    def times(self, first: datetime, last: datetime) -> list[datetime]:
        """Times of the measurements from `first` to `last`, both included, in UTC."""
        inside = (self.time >= np.datetime64(first)) & (self.time <= np.datetime64(last))
        return [each.item() for each in self.time[inside]]

    @property
    def hs_m(self) -> FloatArray:
        """Significant wave heights 4 sqrt(m0), shape (N,); nan if a band in between is missing."""
        widths = np.diff(band_edges(self.frequency_hz))[:, 0]
        heights: FloatArray = 4 * np.sqrt(self._zero_filled_ends() @ widths)
        return heights

    @property
    def tp_s(self) -> FloatArray:
        """Peak periods, shape (N,); nan without energy or if a band in between is missing."""
        density = self._zero_filled_ends()
        period = 1 / self.frequency_hz[np.argmax(density, axis=1)]
        known = np.isfinite(density).all(axis=1) & (density > 0).any(axis=1)
        return np.where(known, period, np.nan)

    def _zero_filled_ends(self) -> FloatArray:
        """Density, with zeros for missing values at either end of a spectrum."""
        present = np.isfinite(self.density)
        begun = np.logical_or.accumulate(present, axis=1)
        ahead = np.logical_or.accumulate(present[:, ::-1], axis=1)[:, ::-1]
        return np.where(begun & ahead, self.density, 0.0)
