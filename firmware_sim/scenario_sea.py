"""Sea of a scenario: an irregular one with any spectrum, one regular wave, or given components.

Irregular seas differ in their spectrum only; heading, speed, spreading and effective slope have the
same keys in all.
"""

import math
from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import replace
from datetime import datetime
from functools import partial
from pathlib import Path
from typing import Annotated, Any, Final, Literal, Protocol, Self

from pydantic import (
    Field,
    SerializerFunctionWrapHandler,
    ValidationInfo,
    field_validator,
    model_serializer,
    model_validator,
)

from utank_hil.base.arrays import ComplexArray, FloatArray
from utank_hil.base.parameters import NotNegative, Problem, Range, refuse
from utank_hil.base.text_files import kind_of
from utank_hil.configuration import Section
from utank_hil.configuration.files import readable
from utank_hil.configuration.spectra import (
    IttcSpectrum,
    JonswapSpectrum,
    MeasuredSpectrum,
    PiersonMoskowitzSpectrum,
    TabulatedSpectrum,
    read_spectra,
    utc,
)
from utank_hil.dynamics.tank import GRAVITY_M_S2
from utank_hil.sea import EffectiveSlope, Harmonics, Sea, Spectrum
from utank_hil.sea.components import read_components
from utank_hil.sea.measured import SUFFIXES
from utank_hil.sea.moment_table import MomentTable
from utank_hil.sea.sea import PassingSea

Bearing = Annotated[float, Range(least=-360, most=360)]
Speed = Annotated[float, Range(least=0, most=40)]
"""Speed of a ship in m/s; the fastest ferries reach 30."""
_FAST_M_S: Final = 20.0  # Speed above which a warning is given. Chosen; no study.
LEAST_SPEED_M_S: Final = 0.05
"""Speed below which a ship would be said to be at rest. Chosen; no study."""
LEAST_SLOPE: Final = 0.05
"""Effective slope that no ship falls short of near its roll period. Chosen; no study."""
_STEEPEST: Final = 1 / 7
"""Steepness (height per length) at which a regular wave breaks in deep water (Michell 1893)."""


class SpectrumSection(Protocol):
    """Section that names a spectrum."""

    def spectrum(self) -> Spectrum:
        """Spectrum of the section."""


class _AnySea(Section):
    """Encounter of ship and waves, and the share of their slope that acts on the ship."""

    heading_deg: Bearing = 90.0
    """Direction in which the waves go relative to the ship: 0 following, 180 head, 90 from port to
    starboard."""
    speed_m_s: Speed = 0.0
    effective_slope: EffectiveSlope = EffectiveSlope()
    roll_moment_table: Annotated[Path, readable(MomentTable.read)] | None = None
    """Roll moment against frequency and heading (`MomentTable`), instead of the effective slope."""

    @model_validator(mode="after")
    def _slope_or_table(self) -> Self:
        if self.roll_moment_table is not None and "effective_slope" in self.model_fields_set:
            reason = "and effective_slope exclude each other: remove one"
            refuse("sea", [("roll_moment_table", reason)])
        return self

    def moment(self, stiffness_nm_rad: float) -> Callable[[FloatArray, FloatArray], ComplexArray]:
        """Complex roll moment per m of amplitude, as a function of frequency and heading."""
        if self.roll_moment_table is not None:
            return MomentTable.read(self.roll_moment_table).moment
        return partial(self.effective_slope.moment, stiffness_nm_rad=stiffness_nm_rad)

    def roll_moment(self, sea: Sea, stiffness_nm_rad: float) -> Harmonics:
        """Roll moment of a realisation on a ship that keeps course and speed."""
        moment = self.moment(stiffness_nm_rad)(sea.omega_rad_s, sea.heading_rad)
        return sea.harmonics(sea.amplitude_m * moment)

    @property
    def turn_deg(self) -> tuple[float, bool]:
        """Initial direction of the ship in degrees, and whether it is a course."""
        return self.heading_deg, False

    def warnings(self) -> list[Problem]:
        """Warnings of unusual values in the sea and its encounter."""
        found = super().warnings()
        knots = self.speed_m_s * 3600 / 1852
        if self.speed_m_s > _FAST_M_S or 0 < self.speed_m_s < LEAST_SPEED_M_S:
            found.append(("speed_m_s", f"is {knots:.2g} knots: it is in m/s"))
        share = self.effective_slope.coefficient
        if 0 < share < LEAST_SLOPE:
            reason = f"of {share:g} hardly rolls the ship: ships have 0.2 to 1"
            found.append(("effective_slope.coefficient", reason))
        return found

    def without_moment(self) -> list[Problem]:
        """Problems of waves that do not roll the ship at all."""
        if self.effective_slope.coefficient == 0:
            return [("sea.effective_slope.coefficient", "of 0 takes all of the waves' moment")]
        reason = (
            f"of {self.heading_deg:g} gives no roll moment: waves from straight ahead or astern do "
            "not roll a ship in this model; choose another heading, or give a spreading"
        )
        return [("sea.heading_deg", reason)]


class IrregularSea(_AnySea, ABC):
    """Sea drawn from a spectrum."""

    spreading: NotNegative | None = None
    """Exponent s of the spreading cos^2s(theta / 2); the sea is long-crested without it."""

    def warnings(self) -> list[Problem]:
        """Warnings of unusual values in the sea, its encounter and its spreading."""
        found, exponent = super().warnings(), self.spreading
        if exponent is not None and not (exponent == 0 or 0.5 <= exponent <= 100):
            reason = f"is {exponent:g}: wind seas have about 10, long swell 75 (Goda 1985)"
            found.append(("spreading", reason))
        return found

    @abstractmethod
    def spectrum(self) -> Spectrum:
        """Spectrum from which the waves are drawn."""

    def heading_rad(self, spectrum: Spectrum) -> FloatArray | float:  # noqa: ARG002, one for all
        """Direction of the waves relative to the ship, for all or for each band."""
        return math.radians(self.heading_deg)

    def sea(self, seed: int) -> Sea:
        """Realisation of the spectrum."""
        spectrum = self.spectrum()
        return Sea.irregular(
            spectrum,
            seed,
            heading_rad=self.heading_rad(spectrum),
            spreading=self.spreading,
            speed_m_s=self.speed_m_s,
        )

    def passing_sea(
        self, known: Sequence[tuple[float, "SpectrumSection"]], seed: int
    ) -> PassingSea:
        """Realisation that passes from one spectrum to the next.

        `known` has times in s with their spectra; the first is that of this sea.
        """
        if len(known) == 1:
            return PassingSea.of(self.sea(seed))
        spectra = [section.spectrum() for _, section in known]
        return PassingSea.drawn(
            [time_s for time_s, _ in known],
            spectra,
            seed,
            heading_rad=[self.heading_rad(spectrum) for spectrum in spectra],
            spreading=self.spreading,
        )

    @property
    def spectra(self) -> list[tuple[float, SpectrumSection]]:
        """Spectra of the sea with their times in s."""
        return [(0.0, self)]


class JonswapSea(JonswapSpectrum, IrregularSea):
    """Growing sea."""


class IttcSea(IttcSpectrum, IrregularSea):
    """Sea of given height and period."""


class PiersonMoskowitzSea(PiersonMoskowitzSpectrum, IrregularSea):
    """Fully developed sea."""


class TabulatedSea(TabulatedSpectrum, IrregularSea):
    """Sea of a spectrum from any source."""


class MeasuredSea(MeasuredSpectrum, IrregularSea):
    """Hour of a buoy's record or of a wave model, in one direction or in those of the file."""

    direction_file: Path | None = None
    """File of the same station's mean directions; it requires `course_deg` instead of
    `heading_deg`. A file of directional spectra needs none."""
    course_deg: Bearing | None = None  #: Ship's course, degrees clockwise from true north.
    until: datetime | None = None
    """Time of the last record: the sea passes linearly from each record to the next."""

    @field_validator("until")
    @classmethod
    def _later_record(cls, until: datetime | None, info: ValidationInfo) -> datetime | None:
        if until is not None and "file" in info.data and "time" in info.data:
            until = utc(until)
            if until <= info.data["time"]:
                raise ValueError(f"must be after time, {info.data['time'].isoformat()}")
            spectra = read_spectra(info.data["file"], place=info.data.get("place"))
            for time in (until, *spectra.times(info.data["time"], until)):
                cls._hour_is_there(time, info)
        return until

    @field_validator("direction_file")
    @classmethod
    def _belongs_to_file(cls, direction_file: Path | None, info: ValidationInfo) -> Path | None:
        if direction_file is not None and "file" in info.data:
            read_spectra(info.data["file"], direction_file, info.data.get("place"))
        return direction_file

    @model_validator(mode="after")
    def _one_direction_for_each_band(self) -> Self:
        problems: list[Problem] = []
        directional = kind_of(self.file) in SUFFIXES
        if self.course_deg is None:
            if self.direction_file is not None:
                problems.append(("course_deg", "is required with direction_file: from true north"))
            elif directional and "heading_deg" not in self.model_fields_set:
                reason = "is required, or heading_deg for waves from one direction"
                problems.append(("course_deg", reason))
        elif self.direction_file is None and not directional:
            problems.append(("course_deg", "needs direction_file; without it give heading_deg"))
        elif "heading_deg" in self.model_fields_set:
            other = "course_deg" if directional else "direction_file"
            problems.append(("heading_deg", f"and {other} exclude each other: remove one"))
        if self.course_deg is not None and directional and self.spreading is not None:
            problems.append(("spreading", "is in the file: remove the key"))
        refuse("sea", problems)
        try:
            self.heading_rad(self.spectrum())
        except ValueError as error:  # energy without a direction
            refuse("sea", [("direction_file", str(error))])
        return self

    @model_serializer(mode="wrap")
    def _as_it_can_be_read(self, handler: SerializerFunctionWrapHandler) -> dict[str, Any]:
        content: dict[str, Any] = handler(self)
        if self.course_deg is not None:
            del content["heading_deg"]
        return content

    def spectrum(self) -> Spectrum:
        """Spectrum of the hour, with the directions if measured."""
        spectra = read_spectra(self.file, self.direction_file, self.place)
        spectrum = spectra.at(self.time.isoformat())
        return spectrum if self.course_deg is not None else replace(spectrum, spread=None)

    @property
    def spectra(self) -> list[tuple[float, SpectrumSection]]:
        """Spectra of all records from `time` to `until`."""
        if self.until is None:
            return super().spectra
        times = read_spectra(self.file, place=self.place).times(self.time, self.until)
        return [
            ((time - self.time).total_seconds(), self.model_copy(update={"time": time}))
            for time in times
        ]

    @property
    def turn_deg(self) -> tuple[float, bool]:
        """Course, if there is one, else the heading."""
        return super().turn_deg if self.course_deg is None else (self.course_deg, True)

    def heading_rad(self, spectrum: Spectrum) -> FloatArray | float:
        """Measured directions, or `heading_deg` for all bands."""
        if self.course_deg is None:
            return super().heading_rad(spectrum)
        return spectrum.heading_rad(self.course_deg)


class _GivenWaves(_AnySea):
    """Waves with nothing to draw, and no spectrum to pass to another."""

    def passing_sea(self, known: Sequence[tuple[float, SpectrumSection]], seed: int) -> PassingSea:  # noqa: ARG002
        """The waves; they do not change."""
        return PassingSea.of(self.sea(seed))

    @abstractmethod
    def sea(self, seed: int) -> Sea:
        """The waves."""

    @property
    def spectra(self) -> list[tuple[float, SpectrumSection]]:
        """Empty list."""
        return []


class RegularSea(_GivenWaves):
    """Regular wave."""

    kind: Literal["regular"]
    amplitude_m: NotNegative
    period_s: Annotated[float, Range(above=0, most=60)]

    @model_validator(mode="after")
    def _not_broken(self) -> Self:
        length_m = GRAVITY_M_S2 * self.period_s * self.period_s / (2 * math.pi)
        if 2 * self.amplitude_m > _STEEPEST * length_m:
            reason = (
                f"of {self.amplitude_m:g} m in a wave {length_m:.3g} m long: it breaks above "
                f"{_STEEPEST * length_m / 2:.2g} m; lower it, or raise period_s"
            )
            refuse("sea", [("amplitude_m", reason)])
        return self

    def sea(self, seed: int) -> Sea:  # noqa: ARG002, a regular sea has nothing to draw
        """The regular wave; it does not depend on the seed."""
        return Sea.regular(
            self.amplitude_m,
            2 * math.pi / self.period_s,
            heading_rad=math.radians(self.heading_deg),
            speed_m_s=self.speed_m_s,
        )


class ComponentsSea(_GivenWaves):
    """Waves one by one, of a record (`utank-hil identify sea`) or another program."""

    kind: Literal["components"]
    file: Annotated[Path, readable(read_components)]
    """CSV: `omega_rad_s`, `amplitude_m`, `phase_rad` at the ship at the start, and, if not all come
    from `heading_deg`, `heading_deg`."""

    def sea(self, seed: int) -> Sea:  # noqa: ARG002, nothing is drawn
        """The waves of the file; they do not depend on the seed."""
        return replace(
            read_components(self.file, math.radians(self.heading_deg)), speed_m_s=self.speed_m_s
        )


ScenarioSea = Annotated[
    MeasuredSea
    | TabulatedSea
    | JonswapSea
    | IttcSea
    | PiersonMoskowitzSea
    | RegularSea
    | ComponentsSea,
    Field(discriminator="kind"),
]  #: Section ``sea`` of a scenario.
