"""Figures 3.11 to 3.15: adaptive DPC and GPC when the roll period falls from 12.5 s to 7.5 s."""

import math
from collections.abc import Mapping
from dataclasses import replace
from typing import Final

import numpy as np

from tools.thesis.figure import Check, Curve, Figure, Panel, Row, Verdict
from tools.thesis.linear_contest import SAMPLE_TIME_S, Entrant, held_model, radius, responses
from tools.thesis.loading_change import (
    NEW_LAW_S,
    NEW_PERIOD_S,
    PULSES_S,
    Adaptation,
    Voyage,
    Wave,
    changed,
    voyage,
    with_noise,
)
from tools.thesis.ships import AS_PRINTED, GREATER
from utank_hil.analysis.loop.margins import margins
from utank_hil.base.arrays import FloatArray
from utank_hil.control.optimal_tank import ship_ratios
from utank_hil.control.predictive.law import design_dpc, design_gpc
from utank_hil.dynamics.linear import pump_model
from utank_hil.dynamics.ship import RollShip
from utank_hil.dynamics.tank import Tank

PRINTED_GAIN: Final = 40.0
NOISE: Final = 0.01
BOTH, ROLL = ("level_m", "roll_rad"), ("roll_rad",)
OWN_WAVE: Final = Wave(math.tau / NEW_PERIOD_S, 0.005)
_WAVES_RAD_S: Final = np.linspace(0.4, 1.4, 201)
_METHOD: Final = "linear ship, sampled laws, OKID and ERA on the simulated record; without bus"
_OPEN: Final = (
    "Wave, pulses, noise and the ship's tank are not given: a regular wave of the new roll period "
    "and 0.005 rad of slope, pulses of 1 to 5 s up to 20 kPa, no noise (1 % is judged beside it), "
    "reservoirs of 25.2 m² (the printed ones are judged beside them). The linear water knows no "
    "end of the reservoirs; theirs is at a tank angle of 33°."
)


def dpc_both(horizon: int) -> Adaptation:
    """DPC on roll and level."""
    return Adaptation(lambda arx: design_dpc(arx, horizon, horizon + 2), BOTH, 120)


def dpc_roll(horizon: int) -> Adaptation:
    """DPC on roll; the pulses are shorter and smaller, as the text says of Fig. 3.14."""
    design = Adaptation(lambda arx: design_dpc(arx, horizon, horizon + 4), ROLL, 200)
    return replace(design, pulse_pa=10e3, pulse_s=(0.4, 2.0))


def gpc_roll() -> Adaptation:
    """GPC on roll."""
    return Adaptation(lambda arx: design_gpc(arx, 50, 50, 1e14), ROLL, 200)


def _pair(ship: RollShip, tank: Tank, old: Adaptation, new: Adaptation) -> tuple[Entrant, Entrant]:
    """Old law, and the new law as exact identification gives it."""
    truth = held_model(changed(ship), tank, new.measured)
    return (
        Entrant(old.old_law(ship, tank), old.measured, SAMPLE_TIME_S),
        Entrant(new.law(truth), new.measured, SAMPLE_TIME_S),
    )


def _less_roll(ship: RollShip, tank: Tank, old: Adaptation, new: Adaptation) -> FloatArray:
    """Share of roll that the new law takes off the old one's, %, over the wave's frequency."""
    first, second = _pair(ship, tank, old, new)
    ratio = _WAVES_RAD_S / ship_ratios(changed(ship), tank)[1]
    answers = responses(changed(ship), tank, {"old": first, "new": second}, ratio)
    return 100 * (1 - answers["new"].roll / answers["old"].roll)


def _history_panels(found: Voyage, tank: Tank) -> tuple[Panel, ...]:
    """Roll and water over the whole voyage."""
    return tuple(
        Panel(
            "",
            "Time (s)",
            label,
            (Curve("old law, pulses, new law", found.time_s, y),),
            span=(PULSES_S, NEW_LAW_S),
            span_label="identification",
        )
        for label, y in (
            ("Roll (°)", np.degrees(found.roll_rad)),
            ("Tank angle (°)", np.degrees(2 * found.level_m / tank.width_m)),
        )
    )


def _reduced(found: Voyage) -> float:
    return 100 * (1 - found.after_rad / found.before_rad)


def _over_waves(curves: Mapping[str, FloatArray]) -> Panel:
    return Panel(
        "Roll by the new law below that by the old one",
        "Wave frequency (rad/s)",
        "Reduction (%)",
        (
            *(Curve(name, _WAVES_RAD_S, y) for name, y in curves.items()),
            Curve("printed: about 40 %", [0.4, 1.4], [PRINTED_GAIN] * 2),
        ),
        y_limits=(-250.0, 100.0),
    )


def _gain_check(curves: Mapping[str, FloatArray], rows: tuple[Row, ...]) -> Check:
    """Holds if it does in the drawn wave, in part if it does in any wave."""
    ours = [row.ours for row in rows if row.ours is not None]
    near = [30 <= value <= 65 for value in ours]
    told = []
    for name, y in curves.items():
        good = _WAVES_RAD_S[y >= 30]
        where = f"{good[0]:.2f} to {good[-1]:.2f} rad/s" if good.size else "no wave"
        told.append(f"{name}: {y.min():.0f} to {y.max():.0f} %, 30 % and more in {where}")
    somewhere = any(bool((y >= 30).any()) for y in curves.values())
    return Check(
        "roll mitigation is improved by about 40 % after updating the controller",
        Verdict.of_all([*near, somewhere]),
        "in waves of 0.4 to 1.4 rad/s: " + "; ".join(told),
    )


def _identified_check(order: int, found: Voyage, adaptation: Adaptation) -> Check:
    exact = _error(found.found_rad_s, found.true_rad_s)
    frequencies, eigenvalue = with_noise(*GREATER, adaptation, OWN_WAVE, NOISE)
    noisy = _error(frequencies, found.true_rad_s)
    noise_told = f"to {noisy:.1%}" if noisy < 1 else "one of them is not found"
    fit = exact < 1e-3 and noisy < 0.02 and eigenvalue < 1
    return Check(
        f"ARX order {order} and system order four identify the ship under the wave",
        Verdict.HOLDS if fit else Verdict.PARTLY if exact < 1e-3 else Verdict.FAILS,
        f"frequencies of both modes to {exact:.1e} without noise; with {NOISE:.0%} of noise on the "
        f"sensors {noise_told}, and the law designed on that has a greatest eigenvalue of "
        f"{eigenvalue:.3f} on the ship",
    )


def _error(found: tuple[float, ...], true: tuple[float, ...]) -> float:
    """Greatest relative deviation of the modes' frequencies; infinite if one is missing."""
    if len(found) != len(true):
        return math.inf
    return max(abs(mine / exact - 1) for mine, exact in zip(found, true, strict=True))


def figure_3_11() -> Figure:
    """Adaptive DPC on roll and level."""
    found = voyage(*GREATER, dpc_both(50), OWN_WAVE)
    printed_ship = voyage(*AS_PRINTED, dpc_both(50), OWN_WAVE)
    short = voyage(*GREATER, dpc_both(25), OWN_WAVE)
    curves = {
        "hc 50": _less_roll(*GREATER, dpc_both(50), dpc_both(50)),
        "hc 25": _less_roll(*GREATER, dpc_both(25), dpc_both(25)),
        "hc 25, then 50": _less_roll(*GREATER, dpc_both(25), dpc_both(50)),
    }
    others = {"hc 50, printed reservoirs": _less_roll(*AS_PRINTED, dpc_both(50), dpc_both(50))}
    reason = "the wave is not given, and decides"
    rows = (
        Row("roll reduced by the new law, hc 50", "%", PRINTED_GAIN, _reduced(found), reason),
        Row("the same, printed reservoirs", "%", PRINTED_GAIN, _reduced(printed_ship), reason),
        Row("the same, hc 25", "%", PRINTED_GAIN, _reduced(short),
            "the text says hc = 25 and, at its end, 50"),
    )  # fmt: skip
    return Figure(
        _METHOD,
        _OPEN + " The text gives the control horizon as 25 and as 50: 50 is drawn.",
        (*_history_panels(found, GREATER[1]), _over_waves(curves)),
        rows,
        (_gain_check(curves | others, rows), _identified_check(120, found, dpc_both(50))),
        columns=1,
    )


def _record(found: Voyage, tank: Tank, *, water: bool) -> tuple[Panel, ...]:
    part = (found.time_s >= PULSES_S) & (found.time_s < NEW_LAW_S)
    signals = [
        ("Pressure (kPa)", found.pressure_pa / 1e3),
        ("Roll (°)", np.degrees(found.roll_rad)),
    ]
    if water:
        signals.append(("Tank angle (°)", np.degrees(2 * found.level_m / tank.width_m)))
    return tuple(
        Panel("", "Time (s)", label, (Curve(label.split(" (")[0], found.time_s[part], y[part]),))
        for label, y in signals
    )


def figure_3_12() -> Figure:
    """The record for identification with two outputs."""
    found = voyage(*GREATER, dpc_both(50), OWN_WAVE)
    return Figure(
        _METHOD,
        _OPEN,
        _record(found, GREATER[1], water=True),
        checks=(_identified_check(120, found, dpc_both(50)),),
        columns=1,
    )


def figure_3_13() -> Figure:
    """Adaptive DPC on roll alone."""
    found = voyage(*GREATER, dpc_roll(70), OWN_WAVE)
    printed_ship = voyage(*AS_PRINTED, dpc_roll(70), OWN_WAVE)
    curves = {
        "hc 70": _less_roll(*GREATER, dpc_roll(70), dpc_roll(70)),
        "hc 50": _less_roll(*GREATER, dpc_roll(50), dpc_roll(50)),
        "hc 70, printed reservoirs": _less_roll(*AS_PRINTED, dpc_roll(70), dpc_roll(70)),
    }
    others = {
        "hc 70, then 50": _less_roll(*GREATER, dpc_roll(70), dpc_roll(50)),
        "hc 50, printed reservoirs": _less_roll(*AS_PRINTED, dpc_roll(50), dpc_roll(50)),
    }
    reason = "the wave is not given, and decides; the old law is not bad on the changed ship"
    rows = (
        Row("roll reduced by the new law, hc 70", "%", PRINTED_GAIN, _reduced(found), reason),
        Row("the same, printed reservoirs", "%", PRINTED_GAIN, _reduced(printed_ship), reason),
    )
    return Figure(
        _METHOD,
        _OPEN + " Pulses as in 3.14.",
        (*_history_panels(found, GREATER[1]), _over_waves(curves)),
        rows,
        (_gain_check(curves | others, rows), _identified_check(200, found, dpc_roll(70))),
        columns=1,
    )


def figure_3_14() -> Figure:
    """The record for identification with roll alone."""
    found = voyage(*GREATER, dpc_roll(70), OWN_WAVE)
    slow, quick = dpc_both(50).excitation(), dpc_roll(70).excitation()
    centre = [_mean_frequency(u) for u in (slow, quick)]
    return Figure(
        _METHOD,
        _OPEN + " Here pulses of 0.4 to 2 s up to 10 kPa.",
        _record(found, GREATER[1], water=False),
        checks=(
            Check(
                "the stimulation has a higher frequency with smaller amplitude, and identifies the "
                "ship all the same",
                Verdict.of(
                    centre[1] > centre[0]
                    and np.abs(quick).max() < np.abs(slow).max()
                    and _error(found.found_rad_s, found.true_rad_s) < 1e-3
                ),
                f"mean frequency {centre[1]:.1f} against {centre[0]:.1f} rad/s, "
                f"{np.abs(quick).max() / 1e3:.0f} against {np.abs(slow).max() / 1e3:.0f} kPa",
            ),
        ),
        columns=1,
    )


def _mean_frequency(u: FloatArray) -> float:
    """Mean frequency of a signal's power, rad/s."""
    power = np.abs(np.fft.rfft(u)) ** 2
    return float(power @ (math.tau * np.fft.rfftfreq(len(u), SAMPLE_TIME_S)) / power.sum())


def figure_3_15() -> Figure:
    """Adaptive GPC on roll alone."""
    found = voyage(*GREATER, gpc_roll(), OWN_WAVE)
    ship, tank = GREATER
    pair = _pair(ship, tank, gpc_roll(), gpc_roll())
    eigenvalues = [radius(changed(ship), tank, each) for each in pair]
    peaks = [
        margins(
            each.law, pump_model(changed(ship), tank, each.measured), SAMPLE_TIME_S, 0.0
        ).peak_sensitivity
        for each in pair
    ]
    ratio = found.after_rad / found.before_rad
    over = _less_roll(ship, tank, gpc_roll(), gpc_roll())
    alike = _WAVES_RAD_S[np.abs(over) < 20]
    return Figure(
        _METHOD,
        _OPEN,
        (*_history_panels(found, tank), _over_waves({"hc 50": over})),
        checks=(
            Check(
                "the roll amplitude is almost the same before and after updating",
                Verdict.of(0.8 < ratio < 1.25) if not alike.size else Verdict.PARTLY,
                f"in the drawn wave {ratio:.2f} times the old one; within 20 % in "
                f"{len(alike) / len(_WAVES_RAD_S):.0%} of the waves from 0.4 to 1.4 rad/s",
            ),
            Check(
                "after updating the system is more stable",
                Verdict.of_all([eigenvalues[1] < eigenvalues[0], peaks[1] < peaks[0]]),
                f"greatest eigenvalue {eigenvalues[0]:.3f} before, {eigenvalues[1]:.3f} after; "
                f"peak sensitivity {peaks[0]:.1f} before, {peaks[1]:.1f} after",
            ),
            _identified_check(200, found, gpc_roll()),
        ),
        columns=1,
    )
