"""Figure 4.1 and Table 4.1: Patti-B without tank and damping, in calm water."""

import math
from dataclasses import replace
from typing import Final

import numpy as np

from tools.thesis.capsize import PATTI_B, equilibria, safe_basin, without_tank
from tools.thesis.figure import Check, Curve, Figure, Panel, Row, Verdict
from tools.thesis.simulate import simulate
from utank_hil.base.arrays import FloatArray
from utank_hil.dynamics import RollModel
from utank_hil.dynamics.tank import GRAVITY_M_S2

C1_M, C3_M, DISPLACEMENT_N = 0.2138, 0.6713, 2.366e6
_LONG_TON_KG: Final = 1016.047
_GRID: Final = 41


def _undamped() -> RollModel:
    ship = replace(PATTI_B.ship, damping_nms_rad=0.0, quadratic_damping_nms2_rad2=0.0)
    return without_tank(RollModel(ship, PATTI_B.tank))


def figure_4_1() -> Figure:
    """Orbits, saddles and the safe region."""
    model = _undamped()
    saddle = math.sqrt(C1_M / C3_M)
    found = max(each.roll_rad for each in equilibria(model) if not each.stable)
    roll = np.linspace(-saddle, saddle, 401)
    rate = np.sqrt(2 * (_energy(model, np.array(saddle), 0.0) - _energy(model, roll, 0.0)))
    ring_roll, ring_rate = np.append(roll, roll[::-1]), np.append(rate, -rate[::-1])
    inside = simulate(model, 22.0, (0.7 * saddle, 0.0, 0.0, 0.0))
    outside = simulate(model, 30.0, (0.0, 1.05 * float(rate.max()), 0.0, 0.0), capsize_rad=0.9)
    rolls = np.linspace(-1.3 * saddle, 1.3 * saddle, _GRID)
    rates = np.linspace(-1.3 * float(rate.max()), 1.3 * float(rate.max()), _GRID)
    safe = safe_basin(model, rolls, rates, 300.0)
    within = (_energy(model, rolls[None, :], rates[:, None]) < _energy(
        model, np.array(saddle), 0.0)) & (np.abs(rolls)[None, :] < saddle)  # fmt: skip
    return Figure(
        "energy of the ship without tank; orbits by compiled simulation",
        "Nothing: the figure is taken from Jiang et al. (1996), here with the numbers of Patti-B.",
        (
            Panel(
                "",
                "Roll (°)",
                "Roll rate (°/s)",
                (
                    Curve("heteroclinic cycle", np.degrees(ring_roll), np.degrees(ring_rate)),
                    Curve("start inside", *np.degrees(inside.state[:, :2].T)),
                    Curve("start outside", *np.degrees(outside.state[:, :2].T)),
                    Curve(
                        "saddles",
                        [-math.degrees(saddle), math.degrees(saddle)],
                        [0.0, 0.0],
                        marks=True,
                    ),
                ),
            ),
        ),
        rows=(
            Row(
                "angle of vanishing stability, sqrt(c1 / c3)",
                "°",
                math.degrees(saddle),
                math.degrees(found),
                "",
            ),
        ),
        checks=(
            Check(
                "two saddles at sqrt(a13 / a14), a centre between them",
                Verdict.of(
                    [each.stable for each in equilibria(model)] == [False, True, False]
                    and abs(found / saddle - 1) < 1e-6
                ),
                f"equilibria by the model at {math.degrees(found):.2f}° and 0",
            ),
            Check(
                "every start within the heteroclinic cycle leads to bounded motion, every one "
                "outside to capsizing",
                Verdict.of(bool((safe == within).all())),
                f"{int((safe == within).sum())} of {safe.size} starts, 300 s each",
            ),
        ),
        columns=1,
    )


def _energy(model: RollModel, roll: FloatArray, rate: FloatArray | float) -> FloatArray:
    """Energy per inertia, 1/s²."""
    ship = model.ship
    restoring = ship.stiffness_nm_rad * roll**2 / 2 + ship.restoring_odd_nm[0] * roll**4 / 4
    return np.asarray(np.square(rate) / 2 + restoring / ship.inertia_kg_m2)


def table_4_1() -> Figure:
    """What the printed parameters of Patti-B come to."""
    ship = PATTI_B.ship
    w = ship.natural_frequency_rad_s
    return Figure(
        "algebra",
        "The added inertia's frequency is not given. Two rows are named b44; the units of both "
        "dampings are misprinted (errata).",
        rows=(
            Row(
                "displacement",
                "N",
                DISPLACEMENT_N,
                238e3 * GRAVITY_M_S2,
                f"238 t by 9.807 m/s²; 238 long tons are {238 * _LONG_TON_KG * GRAVITY_M_S2:.4g} N",
            ),
            Row(
                "wave frequency per roll frequency",
                "",
                0.6 / w,
                0.6 / w,
                f"0.6 rad/s is printed, the roll frequency follows: {w:.4f} rad/s",
            ),
            Row("inertia I44 + m44", "kg m²", 1.468e6, ship.inertia_kg_m2, ""),
            Row("linear damping b44", "N m s", 3.206e3, ship.damping_nms_rad, ""),
            Row("quadratic damping b44q", "N m s²", 9.882e4, ship.quadratic_damping_nms2_rad2, ""),
            Row("c1", "m", C1_M, ship.stiffness_nm_rad / DISPLACEMENT_N, ""),
            Row("c3", "m", C3_M, -ship.restoring_odd_nm[0] / DISPLACEMENT_N, ""),
        ),
        checks=(
            Check(
                "the second row named b44 is a linear damping in kg m²",
                Verdict.FAILS,
                "it is the factor of (4.1)'s quadratic term, N m s²; at 10° and the roll frequency "
                f"it damps {_share(math.radians(10)):.1f} times as much as the first",
            ),
        ),
    )


def _share(roll_rad: float) -> float:
    """Quadratic damping per linear one for a swing of an amplitude, by equal work."""
    ship = PATTI_B.ship
    rate = roll_rad * ship.natural_frequency_rad_s
    equal = 8 / (3 * math.pi) * ship.quadratic_damping_nms2_rad2 * rate
    return equal / ship.damping_nms_rad
