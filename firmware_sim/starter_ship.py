"""Ship of a starter project."""

import math
from dataclasses import dataclass
from typing import Annotated, Final

from utank_hil.base.parameters import Positive, Problem, Range, range_problems, refuse
from utank_hil.configuration.ship_keys import weather_criterion_period_s
from utank_hil.dynamics.roll_damping import HullForm, estimated_roll_damping
from utank_hil.dynamics.tank import GRAVITY_M_S2

USUAL_DAMPING_RATIO: Final = 0.05
"""Damping ratio of a ship that nothing is known of. Chosen; no study."""
ESTIMATED_AT_RAD: Final = math.radians(5)
"""Amplitude of the estimate: a tank leaves a few degrees."""
_LEAST_DAMPING, _MOST_DAMPING = 0.004, 0.3
"""Range of an estimate; a bare tanker's measured damping below 5 degrees is the least."""
_GYRATION_PER_BEAM: Final = (0.1, 1.2)
"""Plausible radius of gyration per beam; usual ships have about 0.4."""
_DEPTH_PER_BEAM: Final = (0.01, 1.0)
"""Plausible ratio of displaced volume to length times squared beam."""


@dataclass(frozen=True, slots=True)
class StarterShip:
    """Ship as a naval architect knows it, without the tank's water.

    Raises `ValueError` if a value is out of its range, neither period nor draught is given, or
    displacement and length, or GM and period, are inconsistent.
    """

    name: str
    length_m: Positive
    beam_m: Positive
    displacement_t: Positive
    gm_m: Positive
    #: Roll period; by default from the weather criterion's formula, which needs the draught.
    roll_period_s: Positive | None = None
    draught_m: Positive | None = None
    #: Of the roll; by default estimated from the draught, without it `USUAL_DAMPING_RATIO`.
    roll_damping_ratio: Annotated[float, Range(above=0, most=0.3)] | None = None

    def __post_init__(self) -> None:
        problems = range_problems(self)
        if self.roll_period_s is None and self.draught_m is None:
            reason = "is needed, or else the draught for the weather criterion's period"
            problems.append(("roll_period_s", reason))
        refuse("ship", problems or self._shape_problems())

    def _shape_problems(self) -> list[Problem]:
        """Implausible combinations for the beam: displacement and length, period and GM."""
        depth_m = self.displacement_t / (self.length_m * self.beam_m)  # in fresh water
        least, most = _DEPTH_PER_BEAM
        if not least <= depth_m / self.beam_m <= most:
            reason = (
                f"is {depth_m:.3g} m of water on {self.length_m:g} m by {self.beam_m:g} m: the "
                "displacement is in tonnes, length and beam in metres"
            )
            return [("displacement_t", reason)]
        gyration_m = self.period_s / (2 * math.pi) * math.sqrt(GRAVITY_M_S2 * self.gm_m)
        least, most = _GYRATION_PER_BEAM
        if least <= gyration_m / self.beam_m <= most:
            return []
        reason = (
            f"gives a radius of gyration of {gyration_m:.3g} m at a roll period of "
            f"{self.period_s:.3g} s; it is about 0.4 of the beam, {0.4 * self.beam_m:.3g} m: GM is "
            "in metres, the period in seconds"
        )
        return [("gm_m", reason)]

    @property
    def damping(self) -> tuple[float, str]:
        """Damping ratio of the roll, and where it comes from."""
        if self.roll_damping_ratio is not None:
            return self.roll_damping_ratio, "as given"
        if self.draught_m is None:
            return USUAL_DAMPING_RATIO, "assumed, --draught estimates it"
        hull = HullForm.usual(
            self.length_m, self.beam_m, self.draught_m, self.displacement_t, self.gm_m
        )
        frequency = 2 * math.pi / self.period_s
        stiffness = 1e3 * self.displacement_t * GRAVITY_M_S2 * self.gm_m
        found = estimated_roll_damping(hull, ESTIMATED_AT_RAD, frequency).total
        ratio = found * hull.unit_nms_rad * frequency / (2 * stiffness)
        outside = hull.outside(frequency)
        words = (
            f"estimated at {math.degrees(ESTIMATED_AT_RAD):g} degrees, Ikeda's method by "
            f"regression, usual bilge keels: a factor of {2 if outside else 1.5:g} either way"
        )
        if outside:
            words += f" ({'; '.join(outside)})"
        return min(max(ratio, _LEAST_DAMPING), _MOST_DAMPING), words

    @property
    def period_s(self) -> float:
        """Roll period, given or by formula."""
        if self.roll_period_s is not None:
            return self.roll_period_s
        assert self.draught_m is not None
        return weather_criterion_period_s(self.beam_m, self.draught_m, self.length_m, self.gm_m)
