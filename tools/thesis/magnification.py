"""Chapter 2, introduction: magnification factors that it takes from Lewis (1989)."""

import math

from tools.thesis.capsize.contest import PATTI_B
from tools.thesis.capsize.threshold import without_tank
from tools.thesis.figure import Check, Figure, Row, Verdict
from tools.thesis.ships import AS_PRINTED, GREATER
from utank_hil.dynamics.ship import RollShip

_CITED = "cited, not computed; no ship file with heave and pitch is given"


def figure_magnification() -> Figure:
    """Greatest roll per static roll of the source's ships without a tank."""
    first, greater = (_peak(ship) for ship, _ in (AS_PRINTED, GREATER))
    boat = _peak(without_tank(PATTI_B).ship)
    return Figure(
        "linear roll without tank: 1 / (2 zeta sqrt(1 - zeta²))",
        "The ships of the cited figures are not named.",
        rows=(
            Row(
                "roll, bare hull: the first ship",
                "",
                (10.0, math.inf),
                first,
                "with the damping that fits the printed gains",
            ),
            Row(
                "roll, bare hull: the first ship with reservoirs of 25.2 m²",
                "",
                (10.0, math.inf),
                greater,
                "with the damping that fits the printed gains",
            ),
            Row("roll, bare hull: Patti-B, linear damping alone", "", (10.0, math.inf), boat, ""),
            Row("roll with bilge keels", "", (7.0, math.inf), None, "no such ship is given"),
            Row("heave", "", (0.0, 1.3), None, _CITED),
            Row("pitch", "", (0.0, 1.5), None, _CITED),
        ),
        checks=(
            Check(
                "the magnification of roll can be ten or more for a bare hull",
                Verdict.of(max(first, greater, boat) >= 10),
                f"{first:.1f} and {greater:.1f} for the first ship, {boat:.0f} for Patti-B",
            ),
        ),
    )


def _peak(ship: RollShip) -> float:
    critical = 2 * math.sqrt(ship.inertia_kg_m2 * ship.stiffness_nm_rad)
    ratio = ship.damping_nms_rad / critical
    return 1 / (2 * ratio * math.sqrt(1 - ratio**2))
