"""A time series of wave spectra measured at one place.

Directional spectra of wave models and buoys are read by the package wavespectra.

Formats: WAVEWATCH III (netCDF, text), SWAN (netCDF, text), ERA5, NDBC's netCDF, Sofar Spotter
(JSON) and Datawell (``.spt``). Spectra of one frequency and no direction are read by `load_ndbc`.
"""

import re
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from datetime import datetime
from pathlib import Path
from shutil import copyfileobj
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any, Final, Literal

import numpy as np
import numpy.typing as npt

from utank_hil.base.arrays import FloatArray
from utank_hil.base.text_files import open_content
from utank_hil.sea.spectrum import Spectrum, Spread, band_edges

if TYPE_CHECKING:
    from xarray import Dataset


@dataclass(frozen=True, slots=True, eq=False)
class MeasuredSpectra:
    """A time series of spectra."""

    source: str  #: Origin, for error messages.
    time: npt.NDArray[np.datetime64]  #: shape (N,): UTC, increasing.
    #: shape (F,): centre frequencies; (N, F) where they change within the source, with nan behind
    #: the last band of a spectrum of fewer.
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
        """Spectrum at a position: zero beyond its bands, ValueError for one missing between."""
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
            near = f"within {within_s:g} s of" if within_s else "of"
            raise ValueError(
                f"{self.source}: no spectrum {near} {wanted}; the nearest is of "
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
        bands_hz = self.frequency_hz if self.frequency_hz.ndim == 1 else self.frequency_hz[index]
        frequency_hz = bands_hz[np.isfinite(bands_hz)]
        density = self.density[index, : len(frequency_hz)]
        present = np.isfinite(density)
        begun, ahead = np.logical_or.accumulate(present), np.logical_or.accumulate(present[::-1])
        return frequency_hz, np.where(begun & ahead[::-1], density, 0.0)


SUFFIXES: Final = (".nc", ".spec", ".json", ".spt")
"""Suffixes of files that hold directional spectra."""
_NETCDF: Final = {
    "d2fd": "read_era5",
    "spectral_wave_density": "read_ndbc",
    "density": "read_ncswan",
    "efth": "read_ww3",
}  # Readers of netCDF files, by a variable that the file of the program has.
_TEXT: Final = {"SWAN": "read_swan", "'WAVEWATCH": "read_ww3_station"}
"""Readers of ``.spec`` files, by their first word."""
_COUNTS: Final = re.compile(rb"(?:LONLAT|LOCATIONS|[AR]FREQ|[NC]DIR)[^\n]*\n[^\n\d]*(\d{1,18})")
"""Numbers of lines that follow, in SWAN's files."""
_NEAR_DEG: Final = 0.5
"""Largest distance in latitude or longitude: the spacing of global wave models."""


def load_directional(path: Path, place: tuple[float, float] | None = None) -> MeasuredSpectra:
    """Load the directional spectra of one place.

    The file may be compressed with gzip. `place` is latitude and longitude in degrees, and may be
    omitted for a file of one place. Each band has its mean direction and spread; heights are those
    of the bands, without a tail beyond the last one. Spectra without values are left out and named
    in the notes. ValueError is raised if the file can't be read, holds no spectra, or the place is
    none of its places. OSError is raised if it can't be opened.
    """
    if path.suffix.lower() == ".gz":
        with TemporaryDirectory() as folder, open_content(path) as content:
            file = Path(folder, path.stem)
            with file.open("wb") as unpacked:
                copyfileobj(content, unpacked)
            try:
                found = load_directional(file, place)
            except ValueError as error:
                raise ValueError(str(error).replace(str(file), str(path))) from error
        named = tuple(note.replace(str(file), str(path)) for note in found.notes)
        return replace(found, source=str(path), notes=named)
    path.open("rb").close()  # Readers give a less precise reason.
    try:
        import dask
        import wavespectra
    except ImportError as error:
        reason = "directional spectra need wavespectra: pip install 'utank-hil[files]'"
        raise ValueError(f"{path}: {reason}") from error
    name = _reader(path)
    try:
        # one thread: those of dask were seen to wait for each other for ever
        with dask.config.set(scheduler="synchronous"):
            content = getattr(wavespectra, name)(str(path)).load()
    except Exception as error:  # Readers raise any exception at a damaged file.
        program = name.removeprefix("read_")
        raise ValueError(f"{path}: can't be read as a file of {program}: {error}") from error
    content = _at_place(path, content, place).efth
    time = content.time.values.astype("datetime64[s]")
    density = content.transpose("time", "freq", "dir").values.astype(float)  # m2/Hz/degree
    order = np.argsort(time, kind="stable")
    empty = ~np.isfinite(density).any(axis=(1, 2))
    twice = np.r_[False, np.diff(time[order]) == np.timedelta64(0, "s")]
    notes = [f"{path}: the spectrum of {each} has no values" for each in time[order][empty[order]]]
    notes += [f"{path}: {each} has a second spectrum" for each in time[order][twice]]
    kept = order[~empty[order] & ~twice]
    if not len(kept):
        raise ValueError(f"{path}: no spectrum at this place has values")
    return _spectra(path, time[kept], content.freq.values, content.dir.values, density[kept], notes)


@contextmanager
def open_netcdf(path: Path) -> "Iterator[Dataset]":
    """Open a netCDF file of any version; any exception may be raised at a damaged one."""
    import h5netcdf  # type: ignore[import-untyped]
    import xarray

    # Where opening fails its end needs this, and else writes to standard error.
    h5netcdf.File._writable = False
    with path.open("rb") as file:  # The libraries leave open what they can't read.
        engine: Literal["scipy", "h5netcdf"] = "scipy" if file.read(3) == b"CDF" else "h5netcdf"
        file.seek(0)
        with xarray.open_dataset(file, engine=engine) as content:
            yield content


def _reader(path: Path) -> str:
    """Return the name of the reader of a file, by what the file holds."""
    suffix = path.suffix.lower()
    if suffix == ".nc":
        try:
            with open_netcdf(path) as content:
                known = [reader for name, reader in _NETCDF.items() if name in content.variables]
                found = ", ".join(map(str, content.variables))
        except Exception as error:  # Its engines raise any exception at a damaged file.
            raise ValueError(f"{path}: is no netCDF file that can be read: {error}") from error
        if known:
            return known[0]
        raise ValueError(f"{path}: holds none of {', '.join(_NETCDF)}; it has {found}")
    if suffix == ".spec":
        whole = path.read_bytes()
        first = whole[:80].split(b"\n")[0].decode("utf-8", "replace").split()[:1]
        reader = _TEXT.get(first[0]) if first else None
        lines = whole.count(b"\n")
        for count in _COUNTS.finditer(whole):  # the reader reads as many, also past the end
            if int(count[1]) > lines:
                said = f"{count[0].split()[0].decode()} says {int(count[1])}"
                raise ValueError(f"{path}: {said}, and the file has {lines} lines")
        if reader is None:
            raise ValueError(f"{path}: does not begin as a file of SWAN or WAVEWATCH III does")
        return reader
    if suffix in (".json", ".spt"):
        return {".json": "read_spotter", ".spt": "read_datawell"}[suffix]
    raise ValueError(f"{path}: must be a file of {', '.join(SUFFIXES)}")


def _at_place(path: Path, content: Any, place: tuple[float, float] | None) -> Any:
    """Return the spectra of one place of a file's sites or grid."""
    if other := sorted({*content.efth.dims} - {"time", "freq", "dir", "site", "lat", "lon"}):
        raise ValueError(f"{path}: has spectra along {', '.join(other)}, not along lat and lon")
    axes = [axis for axis in ("site", "lat", "lon") if axis in content.efth.dims]
    if all(content.sizes[axis] == 1 for axis in axes):
        return content.isel(dict.fromkeys(axes, 0))
    if "site" in axes:
        still = content.isel(time=0)  # A station does not drift.
        latitude, longitude = still.lat.values, still.lon.values
        sites = [{"site": index} for index in range(content.sizes["site"])]
    else:
        latitude, longitude = (
            part.ravel() for part in np.meshgrid(content.lat.values, content.lon.values)
        )
        grid = np.ndindex(content.sizes["lon"], content.sizes["lat"])
        sites = [{"lat": row, "lon": column} for column, row in grid]
    if place is None:
        shown = [f"[{a:g}, {b:g}]" for a, b in zip(latitude, longitude, strict=True)]
        several = f"{path}: holds {len(shown)} places: choose one by its latitude and longitude"
        raise ValueError(f"{several}, place: {', '.join(shown[:5])}")
    apart = np.abs(np.stack([latitude - place[0], (longitude - place[1] + 180) % 360 - 180]))
    nearest = int(np.argmin(np.hypot(*apart)))
    if apart[:, nearest].max() > _NEAR_DEG:
        where = f"[{latitude[nearest]:g}, {longitude[nearest]:g}]"
        raise ValueError(f"{path}: no place within {_NEAR_DEG} degrees; the nearest is {where}")
    return content.isel(sites[nearest])


def _spectra(
    path: Path,
    time: Any,
    frequency_hz: FloatArray,
    direction_deg: FloatArray,
    density: FloatArray,
    notes: list[str],
) -> MeasuredSpectra:
    """Return spectra with mean direction and spread, of densities in m2/Hz/degree."""
    if len(direction_deg) < 3:
        raise ValueError(f"{path}: has {len(direction_deg)} directions: a sector has three or more")
    order = np.argsort(direction_deg)
    direction_deg, density = direction_deg[order].astype(float), density[:, :, order]
    gap_deg = np.diff(direction_deg, append=direction_deg[0] + 360)
    usual_deg, last = np.median(gap_deg), int(np.argmax(gap_deg))
    if gap_deg[last] > 2 * usual_deg:  # Beyond a sector there is no energy.
        ends = direction_deg[last] + usual_deg, direction_deg[last] + gap_deg[last] - usual_deg
        direction_deg = np.insert(direction_deg, last + 1, ends)
        density = np.insert(density, [last + 1] * 2, 0.0, axis=2)
    width_deg = (np.roll(direction_deg, -1) - np.roll(direction_deg, 1)) % 360 / 2
    energy = np.nan_to_num(density) * width_deg
    total = np.where(np.isnan(density).any(axis=2), np.nan, np.maximum(energy.sum(axis=2), 0.0))
    # A spread made of four Fourier coefficients is below 0 in places.
    energy = np.maximum(energy, 0.0)
    mean_deg = np.degrees(np.angle(energy @ np.exp(1j * np.radians(direction_deg)))) % 360
    spread = Spread(direction_deg, energy)
    bands_hz = frequency_hz.astype(float)
    return MeasuredSpectra(str(path), time, bands_hz, total, mean_deg, spread, tuple(notes))
