"""Printed numbers: gains and first ship of section 3.8, magnification factors of chapter 2."""

import math
from typing import Final

from tools.thesis.capsize import PATTI_B, without_tank
from tools.thesis.figure import Check, Figure, Row, Verdict
from tools.thesis.linear_contest import (
    DPC_BOTH,
    DPC_ROLL,
    GPC_BOTH,
    GPC_ROLL,
    PRINTED,
    PRINTED_ARX,
    designed_laws,
    deviations,
)
from tools.thesis.ships import AS_PRINTED, FITTED, GREATER, INERTIA_KG_M2, ROLL_RAD_S
from utank_hil.control.optimal_tank import ship_ratios
from utank_hil.control.predictive.law import PredictiveLaw, design_dpc, design_gpc
from utank_hil.dynamics.ship import RollShip

ROLL_DAMPING: Final = 4.87e8  #: As printed; a tenth of it fits.


def figure_gains() -> Figure:
    """The 28 printed coefficients beside those designed here."""
    ship, tank = GREATER
    ours: dict[str, PredictiveLaw] = {
        **designed_laws(ship, tank),
        GPC_ROLL: design_gpc(PRINTED_ARX),
        DPC_ROLL: design_dpc(PRINTED_ARX),
    }
    rows = [
        row
        for name in (DPC_ROLL, GPC_ROLL, DPC_BOTH, GPC_BOTH)
        for row in _rows(name, ours[name], tank.width_m / 2)
    ]
    of_arx = [abs(row.deviation or 0.0) for row in rows if "(roll):" in row.quantity]
    both = [abs(row.deviation or 0.0) for row in rows if "(roll, level):" in row.quantity]
    as_printed, fitted = deviations(*AS_PRINTED), deviations(*FITTED)
    return Figure(
        "designed at 0.2 s: the laws on roll from the ARX(4) model recovered from them (docs/"
        "control.md), those on roll and tank angle from the ship with reservoirs of 25.2 m²",
        "Sample time, prediction horizon, friction of the tank and model are not given. They "
        "follow from the gains: 0.2 s, hp = hc for GPC, hp = hc + 4 and + 2 for DPC, a model with "
        "larger reservoirs than printed.",
        rows=tuple(rows),
        checks=(
            Check(
                "DPC and GPC designed with the printed horizons have the printed gains",
                Verdict.of(max(of_arx) < 1e-3 and max(both) < 0.05),
                f"the sixteen of the laws on roll deviate by {max(of_arx):.1e} at most, the twelve "
                f"on roll and tank angle by {max(both):.1%}",
            ),
            Check(
                "they are those of the printed ship",
                Verdict.of(max(as_printed.roll_only, as_printed.both, as_printed.angle) < 0.05),
                f"its own laws deviate by up to {as_printed.roll_only:.1%} (roll), "
                f"{as_printed.both:.1%} (both) and {as_printed.angle:.0%} (tank angle); with "
                f"reservoirs of {FITTED[1].reservoir_area_m2:.1f} m² the laws on roll by "
                f"{fitted.roll_only:.2%}",
            ),
        ),
    )


def _rows(name: str, law: PredictiveLaw, half_m: float) -> list[Row]:
    printed = PRINTED[name]
    outputs = law.output_gains[:, 0]
    parts = [("u", "", printed.input_gains, law.input_gains[:, 0, 0])]
    if printed.angle_gains:
        parts.append(("tank angle", "Pa/rad", printed.angle_gains, outputs[:, 0] * half_m))
    parts.append(("roll", "Pa/rad", printed.roll_gains, outputs[:, -1]))
    reason = "print has five digits" if not printed.angle_gains else "friction is not given"
    slips = {
        (DPC_BOTH, "u", 2): "printed -2.9047e-2: a misprint of the exponent",
        **{(GPC_BOTH, "roll", k): "printed with e8: a misprint of the exponent" for k in (1, 2)},
    }
    return [
        Row(f"{name}: {what}(k-{k})", unit, theirs, float(mine), slips.get((name, what, k), reason))
        for what, unit, given, made in parts
        for k, (theirs, mine) in enumerate(zip(given, made, strict=True), 1)
    ]


def figure_first_ship() -> Figure:
    """What the printed numbers of the first ship come to."""
    ship, tank = AS_PRINTED
    ratios, _ = ship_ratios(ship, tank)
    critical = 2 * INERTIA_KG_M2 * ROLL_RAD_S
    return Figure(
        "algebra",
        "The friction of the tank and the ship's stiffness k1 are not given; k1 = I w².",
        rows=(
            Row("roll period", "s", 12.5, math.tau / ROLL_RAD_S, "2 pi / 0.5, rounded in print"),
            Row("fall of the roll period to 7.5 s", "%", 40.0, 100 * (1 - 7.5 / 12.5), ""),
            Row(
                "roll damping d1",
                "N m s/rad",
                ROLL_DAMPING,
                ship.damping_nms_rad,
                f"as printed it is {ROLL_DAMPING / critical:.2f} of critical, "
                "and the printed gains do not follow; about a tenth fits them",
            ),
            Row(
                "frequency of the water per roll frequency",
                "",
                1.0,
                tank.natural_frequency_rad_s / ROLL_RAD_S,
                "the tank is not tuned, though 2.6 and 3.2 ask for it; with reservoirs of 25.2 m² "
                f"it is {GREATER[1].natural_frequency_rad_s / ROLL_RAD_S:.3f}",
            ),
            Row(
                "reservoir area",
                "m²",
                17.11,
                GREATER[1].reservoir_area_m2,
                "the printed gains ask for 24.4 to 25.2 m²; 17.11 looks like the width, 17.1 m",
            ),
            Row("mass ratio", "", (0.02, 0.04), ratios.mass_ratio, "range asked for in 2.4"),
        ),
        checks=(
            Check(
                "the tank has the ship's roll frequency",
                Verdict.of(abs(tank.natural_frequency_rad_s / ROLL_RAD_S - 1) < 0.05),
                f"{tank.natural_frequency_rad_s:.3f} against {ROLL_RAD_S:g} rad/s",
            ),
        ),
    )


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
