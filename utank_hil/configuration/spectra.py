"""Seas in configuration files: spectra for scenarios and laws.

A scenario draws its waves from a spectrum; a law that foresees waves is designed for one.
"""

import math
from contextlib import suppress
from dataclasses import fields
from datetime import UTC, datetime
from functools import lru_cache
from pathlib import Path
from typing import Annotated, Any, Final, Literal, Self

import numpy as np
from pydantic import (
    BeforeValidator,
    Field,
    TypeAdapter,
    ValidationInfo,
    field_validator,
    model_validator,
)

from utank_hil.base.parameters import ParameterError, Problem, Range, refuse
from utank_hil.base.text_files import kind_of, read_number_table, unread
from utank_hil.configuration.files import Section
from utank_hil.control.sea_model import SeaModel
from utank_hil.dynamics.tank import GRAVITY_M_S2
from utank_hil.sea import MeasuredSpectra, Spectrum, ittc, jonswap, load_ndbc, pierson_moskowitz
from utank_hil.sea.measured import SUFFIXES, load_directional
from utank_hil.sea.ndbc import HIGHEST_M, breaking

WaveHeight = Annotated[float, Range(above=0, most=HIGHEST_M)]
"""Significant height in m; the greatest ever measured is 19 m."""
WavePeriod = Annotated[float, Range(above=0, most=40)]
Latitude = Annotated[float, Range(least=-90, most=90)]
Longitude = Annotated[float, Range(least=-360, most=360)]
_STEEPEST: Final = 0.1  #: Of a sea that does not break: Hs over wave length.
_BANDS: Final = ("frequency_hz", "density_m2_hz")


class _GivenSea(Section):
    """A sea of given height and period."""

    hs_m: WaveHeight
    tp_s: WavePeriod

    @model_validator(mode="after")
    def _not_broken(self) -> Self:
        steepness = _steepness(self.hs_m, self.tp_s)
        if steepness > _STEEPEST:
            reason = (
                f"of {self.hs_m:g} m at a peak period of {self.tp_s:g} s is a steepness of "
                f"1/{1 / steepness:.2g}: such waves break; lower it, or raise tp_s"
            )
            refuse("sea", [("hs_m", reason)])
        return self

    def warnings(self) -> list[Problem]:
        """Warn of waves steeper than in storms: DNV-RP-C205, limiting average steepness."""
        limit = float(np.interp(self.tp_s, (8, 15), (1 / 15, 1 / 25)))
        steepness = _steepness(self.hs_m, self.tp_s)
        if steepness <= limit:
            return super().warnings()
        reason = (
            f"of {self.hs_m:g} m at a peak period of {self.tp_s:g} s is a steepness of "
            f"1/{1 / steepness:.3g}; seas of this period hardly pass 1/{1 / limit:.3g}"
        )
        return [*super().warnings(), ("hs_m", reason)]


def _steepness(hs_m: float, tp_s: float) -> float:
    return 2 * math.pi * hs_m / (GRAVITY_M_S2 * tp_s**2)


class JonswapSpectrum(_GivenSea):
    """A growing sea."""

    kind: Literal["jonswap"]
    gamma: Annotated[float, Range(least=1, most=7)] = 3.3

    def spectrum(self) -> Spectrum:
        """JONSWAP spectrum."""
        return jonswap(self.hs_m, self.tp_s, self.gamma)


class IttcSpectrum(_GivenSea):
    """A sea of given height and period, Bretschneider's two-parameter spectrum."""

    kind: Literal["ittc"]

    def spectrum(self) -> Spectrum:
        """ITTC spectrum."""
        return ittc(self.hs_m, self.tp_s)


class PiersonMoskowitzSpectrum(Section):
    """A fully developed sea, whose period follows from its height."""

    kind: Literal["pierson_moskowitz"]
    hs_m: WaveHeight

    def spectrum(self) -> Spectrum:
        """Pierson-Moskowitz spectrum."""
        return pierson_moskowitz(self.hs_m)


class MeasuredSpectrum(Section):
    """One hour of a buoy's record."""

    kind: Literal["measured"]
    place: tuple[Latitude, Longitude] | None = None
    """Latitude and longitude in degrees; only for a file of several places."""
    file: Path
    """File of the spectral density in NDBC's yearly or 45-day layout, or of directional spectra:
    WAVEWATCH III, SWAN, ERA5, NDBC's netCDF, Spotter, Datawell."""
    time: datetime
    """Start of the record's hour as written in the file, UTC unless it names another zone."""

    @model_validator(mode="before")
    @classmethod
    def _times_are_named(cls, content: Any) -> Any:
        times: list[Any] = []
        if isinstance(content, dict) and "file" in content and "time" not in content:
            with suppress(OSError, TypeError, ValueError):  # said of the file itself
                times = [*read_spectra(Path(content["file"]), place=content.get("place")).time]
        if times:
            reason = f"is required but missing: the file has {times[0]} to {times[-1]}"
            raise ParameterError("", [("time", reason)])
        return content

    @field_validator("file")
    @classmethod
    def _readable(cls, file: Path, info: ValidationInfo) -> Path:
        read_spectra(file, place=info.data.get("place"))
        return file

    @field_validator("time")
    @classmethod
    def _hour_is_there(cls, time: datetime, info: ValidationInfo) -> datetime:
        time = utc(time)
        if "file" in info.data:
            spectra = read_spectra(info.data["file"], place=info.data.get("place"))
            if spectra.at(time.isoformat()).moment(0) == 0:
                raise ValueError("the spectrum holds no energy: choose another hour")
        return time

    def spectrum(self) -> Spectrum:
        """The hour's spectrum."""
        return read_spectra(self.file, place=self.place).at(self.time.isoformat())

    def warnings(self) -> list[Problem]:
        """Warn of rows of the file that are left out."""
        notes, found = read_spectra(self.file, place=self.place).notes, super().warnings()
        if notes:
            reason = f"has rows that are left out, {len(notes)}; the first: {notes[0]}"
            found.append(("file", reason))
        return found


class TabulatedSpectrum(Section):
    """A spectrum from a table of any source."""

    kind: Literal["tabulated"]
    file: Path
    """CSV file with the columns ``frequency_hz`` and ``density_m2_hz``, frequencies increasing."""

    @model_validator(mode="after")
    def _readable(self) -> Self:
        try:
            spectrum = self.spectrum()
            height_m = spectrum.hs_m
        except ValueError as error:
            refuse("sea", [("file", str(error))])
        if not 0 < height_m <= HIGHEST_M:
            reason = f"holds a sea of {height_m:.3g} m: is the density in m2/Hz, of waves?"
            refuse("sea", [("file", reason)])
        peak = [spectrum.density.argmax()]
        reason = breaking(spectrum.frequency_hz[peak], spectrum.density[peak])
        if reason:
            refuse("sea", [("file", f"{reason}: frequencies in rad/s are divided by 2 pi, and "
                            "their densities multiplied by it")])  # fmt: skip
        return self

    def spectrum(self) -> Spectrum:
        """The table's spectrum."""
        try:
            columns = read_number_table(self.file)
        except OSError as error:
            raise ValueError(unread(error)) from error
        except ValueError as error:
            other = f"a table has the columns {' and '.join(_BANDS)}"
            measured = "a file of a buoy or of a wave model is kind: measured"
            raise ValueError(f"{error}; {other}, {measured}") from error
        if set(columns) != set(_BANDS):
            has = ", ".join(columns)
            raise ValueError(f"{self.file} needs the columns {' and '.join(_BANDS)}, has {has}")
        try:
            return Spectrum(columns["frequency_hz"], columns["density_m2_hz"])
        except ValueError as error:
            raise ValueError(f"{self.file}: {error}") from error


def utc(time: datetime) -> datetime:
    """Return a time in UTC without a zone; a time without a zone is UTC."""
    return time if time.tzinfo is None else time.astimezone(UTC).replace(tzinfo=None)


AnySpectrum = Annotated[
    MeasuredSpectrum
    | TabulatedSpectrum
    | JonswapSpectrum
    | IttcSpectrum
    | PiersonMoskowitzSpectrum,
    Field(discriminator="kind"),
]  #: A spectrum, chosen by its kind.

_SPECTRUM: Final[TypeAdapter[Any]] = TypeAdapter(AnySpectrum)


def _bands_of(content: Any) -> Any:
    """Return the section ``sea`` of a law with a spectrum named by kind as bands."""
    if not (isinstance(content, dict) and "kind" in content):
        return content
    given = [name for name in _BANDS if name in content]
    if given:
        reason = "and kind exclude each other: remove one"
        raise ParameterError("sea", [(name, reason) for name in given])
    model_keys = {each.name for each in fields(SeaModel)}
    named = {name: value for name, value in content.items() if name not in model_keys}
    spectrum = _SPECTRUM.validate_python(named).spectrum()
    return {
        **{name: value for name, value in content.items() if name in model_keys},
        "frequency_hz": tuple(spectrum.frequency_hz.tolist()),
        "density_m2_hz": tuple(spectrum.density.tolist()),
    }


LawSea = Annotated[SeaModel, BeforeValidator(_bands_of)]
"""The section ``sea`` of a law: bands, or a spectrum by its kind, and the keys of `SeaModel`."""


def read_spectra(
    file: Path, direction_file: Path | None = None, place: tuple[float, float] | None = None
) -> MeasuredSpectra:
    """Return the spectra of a file; any error is a ValueError, which pydantic lists by key."""
    try:
        written = tuple(each.stat().st_mtime_ns for each in (file, direction_file) if each)
        return _loaded(file, direction_file, place, written)
    except OSError as error:
        raise ValueError(unread(error)) from error


@lru_cache(maxsize=4)
def _loaded(
    file: Path,
    direction_file: Path | None,
    place: tuple[float, float] | None,
    written: tuple[int, ...],  # noqa: ARG001, a file that is written anew is read anew
) -> MeasuredSpectra:
    if kind_of(file) not in SUFFIXES:
        if place is not None:
            raise ValueError(f"{file}: is of one place: remove the key place")
        return load_ndbc(file, direction_file)
    if direction_file is not None:
        raise ValueError(f"{file}: holds its directions: remove the key direction_file")
    return load_directional(file, place)
