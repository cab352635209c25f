"""Section 3.2: what the height Lz of the tank in the ship does to the passive tank."""

from dataclasses import replace
from typing import Final

import numpy as np

from tools.thesis.figure import Check, Curve, Figure, Panel, Row, Verdict
from tools.thesis.ships import first_ship
from tools.thesis.stimulation import tuned_tank
from utank_hil.control.optimal_tank import (
    ShipTankRatios,
    passive_optimum,
    roll_magnification,
    ship_ratios,
)
from utank_hil.dynamics.linear import coupled_matrices
from utank_hil.dynamics.ship import RollShip
from utank_hil.dynamics.tank import GRAVITY_M_S2, Tank

PLACES_M: Final = (-8.0, -4.0, 0.0, 4.0)
_ALONG_M: Final = np.linspace(-10.0, 5.0, 16)
_WAVES: Final = np.linspace(0.5, 1.5, 1201)
_DAMPING: Final = 0.15


def figure_tank_place() -> Figure:
    """Roll, greatest roll and stiffness over Lz; the printed moments."""
    ship, tank = _tuned()
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
            Panel(
                "Roll by waves",
                "Wave frequency per 0.5 rad/s",
                "Roll per static roll without tank",
                tuple(Curve(f"Lz {z:g} m", _WAVES, y) for z, y in roll.items()),
            ),
            Panel(
                "Greatest roll",
                "Lz (m); above the centre of gravity is negative",
                "Roll per static roll without tank",
                (
                    Curve("one tank, moved", _ALONG_M, top),
                    Curve("water at its optimum at each Lz", _ALONG_M, best),
                ),
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


def _tuned() -> tuple[RollShip, Tank]:
    ship, tank = first_ship(4.87e7, _DAMPING)
    return ship, tuned_tank(ship, tank)


def _roll(ship: RollShip, tank: Tank) -> np.ndarray[tuple[int], np.dtype[np.float64]]:
    """Roll amplitude by a moment of k1."""
    mass, damping, stiffness = coupled_matrices(ship, tank)
    w = (ship.natural_frequency_rad_s * _WAVES)[:, None, None]
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
