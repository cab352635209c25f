"""Figures 3.2 to 3.4: the passive tank of the least greatest roll."""

from typing import Final

import numpy as np

from tools.thesis.figure import Check, Curve, Figure, Panel, Verdict
from tools.thesis.ships import first_ship
from tools.thesis.stimulation import tuned_tank
from utank_hil.control.optimal_tank import (
    PassiveOptimum,
    ShipTankRatios,
    passive_optimum,
    roll_magnification,
    ship_ratios,
)

ROLL_DAMPINGS: Final = (0.0, 0.025, 0.05, 0.1)
MASS_RATIOS: Final = np.linspace(0.01, 0.12, 12)
FROM, TO = 0.02, 0.10
COUPLINGS: Final = (0.0, 0.236, 0.6, 0.9)
_WAVES: Final = np.linspace(0.5, 1.5, 1501)
_X: Final = "Wave frequency per roll frequency"


def _first() -> ShipTankRatios:
    """The first ship's ratios with a duct of its frequency; f² as its static coupling."""
    ship, tank = first_ship(4.87e7, 0.1)
    found, _ = ship_ratios(ship, tuned_tank(ship, tank))
    return ShipTankRatios(found.mass_ratio, found.coupling_ratio, found.roll_damping_ratio)


def _optimum(mass_ratio: float, damping: float, coupling: float | None = None) -> PassiveOptimum:
    geometry = _first().coupling_ratio if coupling is None else coupling
    return passive_optimum(ShipTankRatios(mass_ratio, geometry, damping))


def figure_3_2() -> Figure:
    """Frequency and damping ratio over mass ratio, for several ship dampings and couplings."""
    family = {
        damping: [_optimum(float(mu), damping) for mu in MASS_RATIOS] for damping in ROLL_DAMPINGS
    }
    ends = [_optimum(mu, 0.025) for mu in (FROM, TO)]
    frequency = ends[1].frequency_ratio / ends[0].frequency_ratio - 1
    damping = ends[1].damping_ratio / ends[0].damping_ratio - 1
    by_coupling = {
        coupling: [_optimum(mu, 0.025, coupling).frequency_ratio for mu in (FROM, TO)]
        for coupling in COUPLINGS
    }
    most = max(abs(high / low - 1) for low, high in by_coupling.values())
    ratios = [best.frequency_ratio for column in family.values() for best in column]
    at_large = [column[-1].damping_ratio for column in family.values()]
    return Figure(
        "min-max of the printed roll response over all wave frequencies",
        "Range of mass ratio, ship damping and coupling G1 are not given: varied from 0.01 to "
        f"0.12, 0 to 0.1 and {COUPLINGS[0]:g} to {COUPLINGS[-1]:g} (drawn: "
        f"{_first().coupling_ratio:.3f}).",
        tuple(
            Panel(
                title,
                "Mass ratio",
                title,
                tuple(
                    Curve(
                        f"ship damping {each:g}",
                        MASS_RATIOS,
                        [getattr(best, name) for best in column],
                    )
                    for each, column in family.items()
                ),
            )
            for title, name in (
                ("Frequency ratio", "frequency_ratio"),
                ("Damping ratio of the water", "damping_ratio"),
            )
        ),
        checks=(
            Check(
                "the optimal frequency ratio is close to one",
                Verdict.of(min(ratios) > 0.95 and max(ratios) < 1.05),
                f"{min(ratios):.3f} to {max(ratios):.3f}",
            ),
            Check(
                "the optimal damping ratio depends on ship damping and mass ratio",
                Verdict.of(abs(damping) > 0.2 and max(at_large) > 1.01 * min(at_large)),
                f"{damping:+.0%} from mass ratio {FROM:g} to {TO:g}; from ship damping "
                f"{ROLL_DAMPINGS[0]:g} to {ROLL_DAMPINGS[-1]:g} by "
                f"{at_large[-1] / at_large[0] - 1:+.0%} at mass ratio {MASS_RATIOS[-1]:g}",
            ),
            Check(
                "compared with the damping ratio, the optimal frequency ratio is the more "
                "sensitive to the mass ratio",
                Verdict.of(most > abs(damping)),
                f"the reverse: from mass ratio {FROM:g} to {TO:g} the frequency ratio changes by "
                f"{frequency:+.1%}, the damping ratio by {damping:+.0%}; with any coupling G1 "
                f"tried the frequency ratio changes by {most:.1%} at most",
            ),
        ),
    )


def figure_3_3() -> Figure:
    """Roll at the optimal frequency ratio for several dampings of the water."""
    ratios = _first()
    best = passive_optimum(ratios)
    shares = (0.3, 1.0, 3.0)
    family = {
        share: np.abs(
            roll_magnification(_WAVES, best.frequency_ratio, share * best.damping_ratio, ratios)
        )
        for share in shares
    }
    tops = {share: float(y.max()) for share, y in family.items()}
    return Figure(
        "closed form of 3.2",
        "Ship and dampings are not given: the first ship with a duct of its roll frequency "
        f"(mass ratio {ratios.mass_ratio:.3f}), 0.3, 1 and 3 times the optimum.",
        (
            Panel(
                "",
                _X,
                "Roll per static roll",
                tuple(
                    Curve(f"damping ratio {share * best.damping_ratio:.3f}", _WAVES, y)
                    for share, y in family.items()
                ),
            ),
        ),
        checks=(
            Check(
                "the optimal damping gives the least greatest roll (implied)",
                Verdict.of(tops[1.0] == min(tops.values())),
                "greatest roll per static roll "
                + ", ".join(f"{top:.2f} at {share:g} times" for share, top in tops.items())
                + " the optimal damping",
            ),
        ),
        columns=1,
    )


def figure_3_4() -> Figure:
    """Roll at the optimal damping ratio for several frequency ratios."""
    ratios = _first()
    best = passive_optimum(ratios)
    frequencies = (0.85, best.frequency_ratio, 1.15)
    family = {
        each: np.abs(roll_magnification(_WAVES, each, best.damping_ratio, ratios))
        for each in frequencies
    }
    tops = {each: float(y.max()) for each, y in family.items()}
    fine = np.linspace(0.8, 1.2, 401)
    along = [
        float(np.abs(roll_magnification(_WAVES, f, best.damping_ratio, ratios)).max()) for f in fine
    ]
    least = float(fine[int(np.argmin(along))])
    return Figure(
        "closed form of 3.2",
        "Ship and frequency ratios are not given: as in 3.3, 0.85, the optimum and 1.15.",
        (
            Panel(
                "",
                _X,
                "Roll per static roll",
                tuple(Curve(f"frequency ratio {f:.3g}", _WAVES, y) for f, y in family.items()),
            ),
        ),
        checks=(
            Check(
                "the tank is best when its frequency is close to the ship's",
                Verdict.of(abs(least - 1) < 0.03),
                f"least greatest roll at a frequency ratio of {least:.3f}: {min(along):.2f} per "
                "static roll, " + ", ".join(f"{top:.2f} at {f:.3g}" for f, top in tops.items()),
            ),
        ),
        columns=1,
    )
