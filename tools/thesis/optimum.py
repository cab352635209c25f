"""Figures 3.2 to 3.4: the passive tank of the least greatest roll; and its height Lz."""

from dataclasses import replace
from typing import Final

import numpy as np

from tools.thesis.figure import Check, Figure, Row, Verdict, panel_of
from tools.thesis.ships import tuned_ship
from utank_hil.control.optimal_tank import (
    PassiveOptimum,
    ShipTankRatios,
    passive_optimum,
    roll_magnification,
    ship_ratios,
)
from utank_hil.dynamics.linear import coupled_matrices
from utank_hil.dynamics.ship import RollShip
from utank_hil.dynamics.tank import GRAVITY_M_S2, Tank

ROLL_DAMPINGS: Final = (0.0, 0.025, 0.05, 0.1)
MASS_RATIOS: Final = np.linspace(0.01, 0.12, 12)
FROM, TO = 0.02, 0.10
COUPLINGS: Final = (0.0, 0.236, 0.6, 0.9)
_WAVES: Final = np.linspace(0.5, 1.5, 1501)
_X: Final = "Wave frequency per roll frequency"


def _first() -> ShipTankRatios:
    """The first ship's ratios with a duct of its frequency; f² as its static coupling."""
    found, _ = ship_ratios(*tuned_ship(0.1))
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
            panel_of(
                title,
                "Mass ratio",
                title,
                MASS_RATIOS,
                {
                    f"ship damping {each:g}": [getattr(best, name) for best in column]
                    for each, column in family.items()
                },
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
            panel_of(
                "",
                _X,
                "Roll per static roll",
                _WAVES,
                {f"damping ratio {k * best.damping_ratio:.3f}": y for k, y in family.items()},
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
            panel_of(
                "",
                _X,
                "Roll per static roll",
                _WAVES,
                {f"frequency ratio {f:.3g}": y for f, y in family.items()},
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


PLACES_M: Final = (-8.0, -4.0, 0.0, 4.0)
_ALONG_M: Final = np.linspace(-10.0, 5.0, 16)
_PLACE_WAVES: Final = np.linspace(0.5, 1.5, 1201)
_DAMPING: Final = 0.15


def figure_tank_place() -> Figure:
    """Roll, greatest roll and stiffness over Lz; the printed moments."""
    ship, tank = tuned_ship(_DAMPING)
    roll = {z: _roll(ship, replace(tank, lz_m=z)) for z in PLACES_M}
    top = [float(_roll(ship, replace(tank, lz_m=float(z))).max()) for z in _ALONG_M]
    best = [_best_peak(ship, replace(tank, lz_m=float(z))) for z in _ALONG_M]
    stiffness = np.array([_stiffness(ship, replace(tank, lz_m=float(z))) for z in _ALONG_M])
    higher = Verdict.FAILS
    if (np.diff(best) > 0).all():
        higher = Verdict.HOLDS if (np.diff(top) > 0).all() else Verdict.PARTLY
    acting = [_couplings(ship, replace(tank, lz_m=z)) for z in (PLACES_M[0], PLACES_M[-1])]
    return Figure(
        "linear model; moments by difference of the model at Lz and at 0",
        "Only the trend is described. The first ship with a duct of its roll frequency and a "
        f"damping ratio of {_DAMPING:g}; Lz from -10 m (above the centre of gravity) to 5 m, also "
        "with frequency and damping at their optimum for each Lz.",
        (
            panel_of(
                "Roll by waves",
                "Wave frequency per 0.5 rad/s",
                "Roll per static roll without tank",
                _PLACE_WAVES,
                {f"Lz {z:g} m": y for z, y in roll.items()},
            ),
            panel_of(
                "Greatest roll",
                "Lz (m); above the centre of gravity is negative",
                "Roll per static roll without tank",
                _ALONG_M,
                {"one tank, moved": top, "water at its optimum at each Lz": best},
                y_limits=(0.0, 1.1 * max(top)),
            ),
        ),
        rows=_moment_rows(ship, tank),
        checks=(
            Check(
                "the tank is the more effective the higher it stands",
                higher,
                f"with the water at its optimum the greatest roll is {best[0]:.2f} at "
                f"{_ALONG_M[0]:g} m and {best[-1]:.2f} at {_ALONG_M[-1]:g} m; one tank moved up "
                f"has its least, {min(top):.2f}, at {_ALONG_M[int(np.argmin(top))]:g} m: beyond "
                "that its frequency and friction no longer fit",
            ),
            Check(
                "a higher tank reduces the ship's stability",
                Verdict.of(bool((np.diff(stiffness) > 0).all())),
                f"roll stiffness {stiffness[0]:.3f} of k1 at {_ALONG_M[0]:g} m, "
                f"{stiffness[-1]:.3f} at {_ALONG_M[-1]:g} m",
            ),
            Check(
                "at the roll frequency the part by Lz acts against the wave above the centre of "
                "gravity",
                Verdict.of(acting[0] > 1 > acting[1]),
                "moment of the water on the ship, per that at Lz = 0: "
                f"{acting[0]:.2f} at {PLACES_M[0]:g} m, {acting[1]:.2f} at {PLACES_M[-1]:g} m",
            ),
        ),
    )


def _roll(ship: RollShip, tank: Tank) -> np.ndarray[tuple[int], np.dtype[np.float64]]:
    """Roll amplitude by a moment of k1."""
    mass, damping, stiffness = coupled_matrices(ship, tank)
    w = (ship.natural_frequency_rad_s * _PLACE_WAVES)[:, None, None]
    dynamic = stiffness - w**2 * mass + 1j * w * damping
    answer = np.linalg.solve(dynamic, np.array([[ship.stiffness_nm_rad], [0.0]])[None])
    return np.abs(answer[:, 0, 0])


def _best_peak(ship: RollShip, tank: Tank) -> float:
    """Greatest roll by a moment of k1 with the water at its optimum."""
    ratios, _ = ship_ratios(ship, tank)
    free = ShipTankRatios(ratios.mass_ratio, ratios.coupling_ratio, ratios.roll_damping_ratio)
    found = passive_optimum(free)
    waves = np.geomspace(0.05, 5.0, 4000)
    roll = roll_magnification(waves, found.frequency_ratio, found.damping_ratio, free)
    return float(np.abs(roll).max()) / _stiffness(ship, tank)


def _stiffness(ship: RollShip, tank: Tank) -> float:
    """Roll stiffness with the water at rest in the tank, per k1."""
    return float(coupled_matrices(ship, tank)[2][0, 0] / ship.stiffness_nm_rad)


def _couplings(ship: RollShip, tank: Tank) -> float:
    """Moment of the swinging water on the ship per tank angle, relative to Lz = 0."""
    at_zero = replace(tank, lz_m=0.0)
    w2 = ship.natural_frequency_rad_s**2
    here, there = (
        abs(stiffness[0, 1] - w2 * mass[0, 1])
        for mass, _, stiffness in (coupled_matrices(ship, each) for each in (tank, at_zero))
    )
    return float(here / there)


def _moment_rows(ship: RollShip, tank: Tank) -> tuple[Row, ...]:
    """The printed moments by Lz = 1 m, for a tank angle and a roll of 1 rad."""
    one, zero = (coupled_matrices(ship, replace(tank, lz_m=z)) for z in (1.0, 0.0))
    mass, stiffness = zero[0], zero[2]
    half = tank.width_m / 2
    k1, w2 = ship.stiffness_nm_rad, stiffness[0, 0] / mass[0, 0]
    mu = mass[1, 1] * half**2 / mass[0, 0]
    f2 = tank.natural_frequency_rad_s**2 / w2
    at_own = float(f2 * mu * w2 * k1 / GRAVITY_M_S2)
    slow = float(
        4 * f2 * mu * tank.height_m * k1 / tank.width_m**2
        + 2 * f2 * mu * tank.duct_area_m2 * k1 / (tank.width_m * tank.reservoir_area_m2)
    )
    reason = "the print has k1 where the stiffness with the tank's water belongs"
    return (
        Row(
            "moment by Lz at the roll frequency, per tank angle and metre",
            "N",
            at_own,
            float(abs((one[0][0, 1] - mass[0, 1]) * half * w2)),
            reason,
        ),
        Row(
            "moment by Lz at low frequency, per roll and metre",
            "N",
            slow,
            float(one[2][0, 0] - stiffness[0, 0]),
            reason,
        ),
    )
