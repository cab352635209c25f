"""The sea of a scenario: an irregular one of any spectrum, or one regular wave.

Irregular seas differ in their spectrum only; heading, speed, spreading and effective slope are the
same keys for all of them.
"""

import math
from abc import ABC, abstractmethod
from pathlib import Path
from typing import Annotated, Final, Literal, Self

from pydantic import Field, ValidationInfo, field_validator, model_validator

from utank_hil.arrays import FloatArray
from utank_hil.configuration import Section
from utank_hil.configuration.spectra import (
    IttcSpectrum,
    JonswapSpectrum,
    MeasuredSpectrum,
    PiersonMoskowitzSpectrum,
    read_spectra,
)
from utank_hil.dynamics.tank import GRAVITY_M_S2
from utank_hil.parameters import NotNegative, Problem, Range, refuse
from utank_hil.sea import EffectiveSlope, Sea, Spectrum

Bearing = Annotated[float, Range(least=-360, most=360)]
_FAST_M_S: Final = 20.0
_STEEPEST: Final = 1 / 7
"""Height per length at which a regular wave breaks in deep water (Michell 1893)."""


class _AnySea(Section):
    """How the ship meets the waves, and how much of their slope acts on it."""

    heading_deg: Bearing = 90.0
    """Where the waves go relative to the ship: 0 following, 180 head, 90 from port to starboard."""
    speed_m_s: Annotated[float, Range(least=0, most=40)] = 0.0
    """The ship's speed; the fastest ferries make 30."""
    effective_slope: EffectiveSlope = EffectiveSlope()

    def warnings(self) -> list[Problem]:
        """What is unusual in the sea and the way the ship meets it."""
        if self.speed_m_s <= _FAST_M_S:
            return super().warnings()
        knots = self.speed_m_s * 3600 / 1852
        return [*super().warnings(), ("speed_m_s", f"is {knots:.0f} knots: it is in m/s")]

    def without_moment(self) -> list[Problem]:
        """Why these waves do not roll the ship at all."""
        if self.effective_slope.coefficient == 0:
            return [("sea.effective_slope.coefficient", "of 0 takes all of the waves' moment")]
        reason = (
            f"of {self.heading_deg:g} gives no roll moment: waves from straight ahead or astern do "
            "not roll a ship in this model; choose another heading, or give a spreading"
        )
        return [("sea.heading_deg", reason)]


class _IrregularSea(_AnySea, ABC):
    """A sea drawn from a spectrum."""

    spreading: NotNegative | None = None
    """Exponent s of the spreading cos^2s(theta / 2); long-crested without it."""

    @abstractmethod
    def spectrum(self) -> Spectrum:
        """What the waves are drawn from."""

    def heading_rad(self, spectrum: Spectrum) -> FloatArray | float:  # noqa: ARG002, one for all
        """Where the waves go relative to the ship, for all or for each band."""
        return math.radians(self.heading_deg)

    def sea(self, seed: int) -> Sea:
        """A realisation of the spectrum."""
        spectrum = self.spectrum()
        return Sea.irregular(
            spectrum,
            seed,
            heading_rad=self.heading_rad(spectrum),
            spreading=self.spreading,
            speed_m_s=self.speed_m_s,
        )


class JonswapSea(JonswapSpectrum, _IrregularSea):
    """A growing sea."""


class IttcSea(IttcSpectrum, _IrregularSea):
    """A sea of given height and period."""


class PiersonMoskowitzSea(PiersonMoskowitzSpectrum, _IrregularSea):
    """A fully developed sea."""


class MeasuredSea(MeasuredSpectrum, _IrregularSea):
    """One hour of a buoy's record, in one direction or in the directions measured."""

    direction_file: Path | None = None
    """Mean direction of the same station; then `course_deg` instead of `heading_deg`."""
    course_deg: Bearing | None = None
    """The ship's course, degrees clockwise from true north."""

    @field_validator("direction_file")
    @classmethod
    def _belongs_to_file(cls, direction_file: Path | None, info: ValidationInfo) -> Path | None:
        if direction_file is not None and "file" in info.data:
            read_spectra(info.data["file"], direction_file)
        return direction_file

    @model_validator(mode="after")
    def _one_direction_for_each_band(self) -> Self:
        problems: list[Problem] = []
        if self.direction_file is None:
            if self.course_deg is not None:
                problems.append(("course_deg", "needs direction_file; without it give heading_deg"))
        else:
            if self.course_deg is None:
                problems.append(("course_deg", "is required with direction_file: from true north"))
            if "heading_deg" in self.model_fields_set:
                problems.append(
                    ("heading_deg", "and direction_file exclude each other: remove one")
                )
        refuse("sea", problems)
        try:
            self.heading_rad(self.spectrum())
        except ValueError as error:  # energy without a direction
            refuse("sea", [("direction_file", str(error))])
        return self

    def spectrum(self) -> Spectrum:
        """The hour's spectrum, with the directions where there are any."""
        return read_spectra(self.file, self.direction_file).at(self.time.isoformat())

    def heading_rad(self, spectrum: Spectrum) -> FloatArray | float:
        """As measured, or `heading_deg` for all bands."""
        if self.course_deg is None:
            return super().heading_rad(spectrum)
        return spectrum.heading_rad(self.course_deg)


class RegularSea(_AnySea):
    """One wave."""

    kind: Literal["regular"]
    amplitude_m: NotNegative
    period_s: Annotated[float, Range(above=0, most=60)]

    @model_validator(mode="after")
    def _not_broken(self) -> Self:
        length_m = GRAVITY_M_S2 * self.period_s**2 / (2 * math.pi)
        if 2 * self.amplitude_m > _STEEPEST * length_m:
            reason = (
                f"of {self.amplitude_m:g} m in a wave {length_m:.3g} m long: it breaks above "
                f"{_STEEPEST * length_m / 2:.2g} m; lower it, or raise period_s"
            )
            refuse("sea", [("amplitude_m", reason)])
        return self

    def sea(self, seed: int) -> Sea:  # noqa: ARG002, a regular sea has nothing to draw
        """The wave."""
        return Sea.regular(
            self.amplitude_m,
            2 * math.pi / self.period_s,
            heading_rad=math.radians(self.heading_deg),
            speed_m_s=self.speed_m_s,
        )


ScenarioSea = Annotated[
    MeasuredSea | JonswapSea | IttcSea | PiersonMoskowitzSea | RegularSea,
    Field(discriminator="kind"),
]
"""The section ``sea`` of a scenario."""
