"""Figures 3.6 to 3.10: PD, LQR, GPC and DPC on the first ship."""

import math
from collections.abc import Mapping
from itertools import pairwise
from typing import Final

import numpy as np

from tools.thesis.figure import Check, Curve, Figure, Panel, Row, Verdict, panel_of
from tools.thesis.linear_contest import (
    DPC_BOTH,
    DPC_ROLL,
    GPC_BOTH,
    GPC_ROLL,
    LQR,
    PASSIVE,
    PD,
    PRINTED,
    ROLL_ONLY,
    SAMPLE_TIME_S,
    WHOLE,
    Entrant,
    History,
    Response,
    entrants,
    held_model,
    lqr_as_printed,
    radius,
    regular_wave_run,
    responses,
)
from tools.thesis.ships import AS_PRINTED, GREATER, ROLL_RAD_S
from utank_hil.base.arrays import FloatArray
from utank_hil.control.arx import ARX
from utank_hil.control.predictive.law import PredictiveLaw, design_dpc
from utank_hil.dynamics.ship import RollShip
from utank_hil.dynamics.tank import Tank

RATIOS: Final = np.linspace(0.01, 2.0, 2000)  #: The source does not say how far it went.
HORIZONS: Final = (8, 15, 25, 50)
DURATION_S: Final = 120.0
SLOPE_RAD: Final = 0.02
WAVES_RAD_S: Final = (0.4, 0.5, 0.6)
PRINTED_INDEX: Final = {**{name: law.index for name, law in PRINTED.items()}, LQR: 504.0}
_Q: Final = "Wave frequency per roll frequency"
_AXES: Final = (_Q, "Roll per static roll")
_METHOD: Final = "sampled loop on the continuous ship, exact linear theory"
_OPEN: Final = (
    "The tank's friction and the ship's right damping are not given, and the printed gains belong "
    "to a ship with larger reservoirs than the printed ones (25.2 m², group `gains`): this ship is "
    "drawn, the printed one is judged beside it. PD is tuned to the passive optimum. LQR is "
    "printed with a weight of 1e14 on all four states, but only with the weight on roll alone, as "
    "GPC has it, does it quiet the ship and come near the printed index; it is drawn so."
)
_SHIPS: Final = {"25.2 m²": GREATER, "printed ship": AS_PRINTED}


def figure_3_6() -> Figure:
    """Roll over frequency with each law."""
    found = {name: responses(*ship, entrants(*ship), RATIOS) for name, ship in _SHIPS.items()}
    as_printed = {
        name: responses(*ship, {LQR: lqr_as_printed(*ship)}, RATIOS)[LQR]
        for name, ship in _SHIPS.items()
    }
    drawn = found["25.2 m²"]
    weights = {
        PASSIVE: drawn[PASSIVE].roll,
        "weight on roll": drawn[LQR].roll,
        "weight on all, as printed": as_printed["25.2 m²"].roll,
    }
    shown = (
        ("25.2 m²: roll or level fed back", ROLL_ONLY, drawn),
        ("25.2 m²: both fed back", WHOLE, drawn),
        ("Printed ship: both fed back", WHOLE, found["printed ship"]),
    )
    return Figure(
        _METHOD,
        _OPEN,
        (
            *(
                panel_of(title, *_AXES, RATIOS, {name: answers[name].roll for name in names})
                for title, names, answers in shown
            ),
            panel_of("25.2 m²: which weight of LQR", *_AXES, RATIOS, weights),
        ),
        checks=(
            *(
                Check(
                    f"all active controllers are effective in roll mitigation ({name})",
                    _effective(answers),
                    _tops(answers) + "; " + _stability(name),
                )
                for name, answers in found.items()
            ),
            Check(
                "LQR with the weight 1e14 on all four states is effective",
                Verdict.of(
                    all(
                        as_printed[name].roll.max() < found[name][PASSIVE].roll.max()
                        for name in _SHIPS
                    )
                ),
                "greatest roll per static roll: "
                + ", ".join(
                    f"{each.roll.max():.1f} ({name}), passive {found[name][PASSIVE].roll.max():.1f}"
                    for name, each in as_printed.items()
                )
                + ": it holds the water as still as the ship",
            ),
        ),
    )


def _tops(answers: Mapping[str, Response]) -> str:
    return "greatest roll per static roll: " + ", ".join(
        f"{law} {each.roll.max():.2f}" for law, each in answers.items()
    )


def _effective(answers: Mapping[str, Response]) -> Verdict:
    passive = answers[PASSIVE].roll.max()
    return Verdict.of_all(
        each.roll.max() < passive for law, each in answers.items() if law != PASSIVE
    )


def _stability(name: str) -> str:
    ship = _SHIPS[name]
    unstable = [law for law, each in entrants(*ship).items() if radius(*ship, each) >= 1]
    return f"unstable: {', '.join(unstable)}" if unstable else "all loops stable"


def _histories(wave_rad_s: float) -> dict[str, History]:
    ship, tank = GREATER
    laws = entrants(ship, tank)
    moment_nm = SLOPE_RAD * ship.stiffness_nm_rad
    return {
        name: regular_wave_run(ship, tank, laws.get(name), moment_nm, wave_rad_s, DURATION_S)
        for name in dict.fromkeys((*ROLL_ONLY, *WHOLE))
    }


def _late(record: FloatArray) -> float:
    """Amplitude over the last quarter."""
    return float(np.abs(record[-len(record) // 4 :]).max())


def _early(record: FloatArray) -> float:
    """Greatest value of the first quarter."""
    return float(np.abs(record[: len(record) // 4]).max())


def figure_3_7() -> Figure:
    """Roll over time in a regular wave."""
    found = {w: _histories(w) for w in WAVES_RAD_S}
    drawn = found[ROLL_RAD_S]
    late = {w: {name: _late(run.roll_rad) for name, run in runs.items()}
            for w, runs in found.items()}  # fmt: skip
    worst = {w: max((name for name in each if name != PASSIVE), key=each.__getitem__)
             for w, each in late.items()}  # fmt: skip
    return Figure(
        "sampled loop on the linear ship, simulated without bus",
        _OPEN + " Wave: 0.02 rad of effective slope at 0.5 rad/s from t = 0; 0.4 and 0.6 rad/s are "
        "judged beside it.",
        tuple(
            Panel(
                title,
                "Time (s)",
                "Roll (°)",
                tuple(
                    Curve(name, drawn[name].time_s, np.degrees(drawn[name].roll_rad))
                    for name in names
                ),
            )
            for title, names in (("Roll or level fed back", ROLL_ONLY), ("Both fed back", WHOLE))
        ),
        checks=(
            Check(
                "the PD control has the worst performance",
                Verdict.of_all([name == PD for name in worst.values()]),
                "; ".join(
                    f"{w:g} rad/s: "
                    + ", ".join(
                        f"{name} {math.degrees(roll):.2f}°" for name, roll in late[w].items()
                    )
                    for w in WAVES_RAD_S
                ),
            ),
        ),
        columns=1,
    )


def figure_3_8() -> Figure:
    """Pump pressure over time in a regular wave."""
    drawn = _histories(ROLL_RAD_S)
    early = {name: _early(run.pressure_pa) for name, run in drawn.items() if name != PASSIVE}
    late = {name: _late(drawn[name].pressure_pa) for name in early}
    roll_laws = [early[name] / late[name] for name in (GPC_ROLL, DPC_ROLL)]
    others = [early[name] / late[name] for name in (LQR, GPC_BOTH, DPC_BOTH)]
    return Figure(
        "as 3.7",
        _OPEN + " Wave as in 3.7.",
        tuple(
            Panel(
                title,
                "Time (s)",
                "Pressure (kPa)",
                tuple(
                    Curve(name, drawn[name].time_s, drawn[name].pressure_pa / 1e3) for name in names
                ),
            )
            for title, names in (
                ("Roll or level fed back", ROLL_ONLY[1:]),
                ("Both fed back", WHOLE[1:]),
            )
        ),
        checks=(
            Check(
                "DPC and GPC with roll feedback have high control effort at the beginning",
                Verdict.of(min(roll_laws) > max(1.1, *others)),
                "greatest pressure of the first quarter per amplitude of the last: "
                + ", ".join(f"{name} {early[name] / late[name]:.2f}" for name in early),
            ),
        ),
        columns=1,
    )


def figure_3_9() -> Figure:
    """Roll over frequency for several control horizons of DPC (roll, level)."""
    ratio = np.linspace(0.2, 2.0, 1801)
    told, panels, verdicts = [], [], []
    for name, (ship, tank) in _SHIPS.items():
        laws = {
            f"hc {horizon}": Entrant(_dpc(ship, tank, horizon), PRINTED[DPC_BOTH].measured,
                                     SAMPLE_TIME_S)
            for horizon in HORIZONS
        }  # fmt: skip
        answers = responses(ship, tank, laws, ratio)
        tops = [float(answers[label].roll.max()) for label in laws]
        below = [
            float(np.mean(answers[f"hc {less}"].roll <= answers[f"hc {more}"].roll))
            for less, more in pairwise(HORIZONS)
        ]
        verdicts.append(tops == sorted(tops) and all(
            radius(ship, tank, law) < 1 for law in laws.values()))  # fmt: skip
        passive = answers[PASSIVE].roll.max()
        told.append(
            f"{name}: greatest roll per static roll "
            + ", ".join(f"{top:.2f} with {label}" for label, top in zip(laws, tops, strict=True))
            + f", passive {passive:.2f}; the shorter of two horizons rolls less in "
            + ", ".join(f"{share:.0%}" for share in below)
            + " of the band"
        )
        panels.append(panel_of(name, *_AXES, ratio, {label: answers[label].roll for label in laws}))
    return Figure(
        f"{_METHOD}; p = 2, hp = hc + 2",
        "The horizons of the family are not known: 8 to 50 samples of 0.2 s. Ships as in 3.6.",
        tuple(panels),
        checks=(
            Check(
                "the lower the control horizon, the more the roll is reduced",
                Verdict.of_all(verdicts),
                "; ".join(told),
            ),
        ),
    )


def _dpc(ship: RollShip, tank: Tank, horizon: int) -> PredictiveLaw:
    arx = ARX.from_state_space(held_model(ship, tank, PRINTED[DPC_BOTH].measured), 2)
    return design_dpc(arx, horizon, horizon + 2)


def index_of(answers: Mapping[str, Response], name: str) -> float:
    """Yardstick of Fig. 3.10 in rad/Pa: roll taken from the passive tank, per pressure.

    It is the integral over the frequency ratio of the difference of amplitudes, per pressure. That
    of the complex answers is the same for every law: it is what the pressure does to the ship.
    """
    gain = _gain(answers, name)
    return float(np.trapezoid(np.abs(gain), RATIOS))


def _gain(answers: Mapping[str, Response], name: str) -> FloatArray:
    """Roll taken off the passive tank per pressure, rad/Pa."""
    roll, pressure_pa = answers[name].roll, answers[name].pressure_pa
    return (answers[PASSIVE].roll - roll) / pressure_pa


def figure_3_10() -> Figure:
    """Roll taken off the passive tank per pressure, over frequency, and its integral."""
    found = {name: responses(*ship, entrants(*ship), RATIOS) for name, ship in _SHIPS.items()}
    laws = (GPC_ROLL, LQR, DPC_BOTH, DPC_ROLL, GPC_BOTH)
    index = {name: {law: index_of(answers, law) for law in laws} for name, answers in found.items()}
    drawn = {law: _gain(found["25.2 m²"], law) for law in laws}
    low = RATIOS < 0.9
    middle = (RATIOS > 0.95) & (RATIOS < 1.8)
    best_low = max(laws, key=lambda law: float(np.trapezoid(drawn[law][low], RATIOS[low])))
    in_middle = {law: float(np.mean(drawn[law][middle])) for law in laws}
    least = min(in_middle[law] for law in (GPC_ROLL, DPC_ROLL, DPC_BOTH))
    order = {name: sorted(laws, key=lambda law: -each[law]) for name, each in index.items()}
    printed_order = sorted(laws, key=lambda law: -PRINTED_INDEX[law])
    without = [law for law in printed_order if law != LQR]
    same = [[law for law in each if law != LQR] == without for each in order.values()]
    return Figure(
        _METHOD,
        _OPEN + " Range and unit of the integral are not given: q from 0.01 to 2, and indices "
        "relative to DPC (roll).",
        tuple(
            panel_of(
                title,
                _Q,
                "1e-6 rad per Pa",
                RATIOS,
                {law: 1e6 * drawn[law] for law in shown},
                span=(0.95, 1.8),
                span_label="0.95 to 1.8",
            )
            for title, shown in (
                ("Roll fed back", (GPC_ROLL, DPC_ROLL, LQR)),
                ("Roll and level fed back", (GPC_BOTH, DPC_BOTH, LQR)),
            )
        ),
        rows=(
            *(
                Row(
                    f"index of {law} per that of DPC (roll), {name}",
                    "",
                    PRINTED_INDEX[law] / PRINTED_INDEX[DPC_ROLL],
                    index[name][law] / index[name][DPC_ROLL],
                    _index_reason(name, law),
                )
                for name in _SHIPS
                for law in laws
            ),
            *(
                Row(
                    f"index of {law}",
                    "m²/N",
                    PRINTED_INDEX[law],
                    index["25.2 m²"][law] * GREATER[0].stiffness_nm_rad * ROLL_RAD_S,
                    "read as roll per static roll over pressure per moment, integrated over rad/s: "
                    "one reading that gives the size, though not the unit; ratios are the test",
                )
                for law in laws
            ),
        ),
        checks=(
            Check(
                "at low frequency GPC with roll feedback is best",
                Verdict.of(best_low == GPC_ROLL),
                f"below q = 0.9: {best_low}",
            ),
            Check(
                "between 0.95 and 1.8 GPC (roll), DPC (roll) and DPC (roll, level) are above LQR "
                "and GPC (roll, level)",
                Verdict.of(least > max(in_middle[LQR], in_middle[GPC_BOTH])),
                "means there, 1e-6 rad/Pa: "
                + ", ".join(f"{law} {1e6 * value:.2f}" for law, value in in_middle.items()),
            ),
            Check(
                "order of the index: " + ", ".join(printed_order),
                _order_verdict(same, order, printed_order),
                "; ".join(f"{name}: {', '.join(each)}" for name, each in order.items()),
            ),
        ),
    )


def _index_reason(name: str, law: str) -> str:
    if law == LQR:
        ship, tank = _SHIPS[name]
        laws = {LQR: lqr_as_printed(ship, tank), DPC_ROLL: entrants(ship, tank)[DPC_ROLL]}
        answers = responses(ship, tank, laws, RATIOS)
        printed = index_of(answers, LQR) / index_of(answers, DPC_ROLL)
        return f"weight on roll alone; with the printed weight on all states {printed:.2f}"
    if name == "printed ship":
        return "the printed laws were not made for the printed ship"
    return "" if law == DPC_ROLL else "friction and damping of the ship are not given"


def _order_verdict(
    same: list[bool], order: Mapping[str, list[str]], printed_order: list[str]
) -> Verdict:
    if all(each == printed_order for each in order.values()):
        return Verdict.HOLDS
    return Verdict.PARTLY if any(same) else Verdict.FAILS
