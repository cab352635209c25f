"""Sections 4.5 and 5.1: by how much each tank and law is said to raise the roll damping."""

import math
from typing import Final, NamedTuple

import numpy as np

from tools.thesis.batch import simulate_batch
from tools.thesis.capsize import PATTI_B, law_factory, without_tank
from tools.thesis.figure import Check, Curve, Figure, Panel, Row, Verdict
from tools.thesis.linear_contest import PASSIVE as PASSIVE_TANK
from tools.thesis.linear_contest import PD, entrants, responses
from tools.thesis.patti_b import LINEARIZED, NO_TANK, PASSIVE, ROBUST, run_controller
from tools.thesis.ships import AS_PRINTED, GREATER
from tools.thesis.simulate import WaveMoment
from utank_hil.base.arrays import ComplexArray, FloatArray
from utank_hil.dynamics import RollModel

START_RAD: Final = math.radians(10)
DURATION_S: Final = 400.0
FALL: Final = 4.0
LAWS: Final = {
    "no tank": NO_TANK,
    "passive": PASSIVE,
    "fuzzy (4.23)": ROBUST,
    "feedback linearization": LINEARIZED,
}
SETTLE_PERIODS = 60  # wave periods before the analysed one
SAMPLES = 256  # integration steps per wave period
_RATIOS: Final = np.linspace(0.3, 1.8, 3001)


class ResponseAmplitude(NamedTuple):
    """First harmonic of the steady oscillation per wave moment."""

    #: roll_rad_per_nm, level_m_per_nm: shape (n,): complex amplitude relative to the wave moment;
    #: NaN where the ship capsized.
    roll_rad_per_nm: ComplexArray
    level_m_per_nm: ComplexArray


def simulated_response(
    model: RollModel, frequency_rad_s: FloatArray, amplitude_nm: float
) -> ResponseAmplitude:
    """Simulate each frequency to the steady state, and take the first harmonic."""
    first = np.empty((2, len(frequency_rad_s)), dtype=np.complex128)
    angle = math.tau * np.arange(SAMPLES) / SAMPLES
    weights = np.exp(-1j * angle) * 2 / SAMPLES / amplitude_nm
    for n, frequency in enumerate(frequency_rad_s):
        step_s = math.tau / frequency / SAMPLES
        result = simulate_batch(
            model,
            (SETTLE_PERIODS + 1) * SAMPLES * step_s,
            wave=WaveMoment([amplitude_nm], [frequency], [0.0]),
            step_s=step_s,
            record_every=1,
        )
        if np.isfinite(result.capsized_s[0]):
            first[:, n] = np.nan
        else:
            steady = result.history[0, -SAMPLES:]
            first[:, n] = steady[:, [0, 2]].T @ weights
    return ResponseAmplitude(first[0], first[1])


def _decay(law: str, *, strong: bool = True) -> tuple[FloatArray, FloatArray]:
    """Time and roll (°) from ten degrees on still water, the tank's water flat."""
    model = without_tank(PATTI_B) if law == NO_TANK else PATTI_B
    level = math.tan(START_RAD) * PATTI_B.tank.width_m / 2
    start = np.array([START_RAD, 0.0, 0.0 if law == NO_TANK else level, 0.0])
    controller = law_factory(law, unlimited=strong)()
    calm = WaveMoment([0.0], [1.0], [0.0])
    run = run_controller(model, controller, calm, DURATION_S, start)
    return run.time_s, run.roll_deg


def _damping(time_s: FloatArray, roll_deg: FloatArray) -> float:
    """Damping ratio of a linear ship whose roll stays below a quarter from the same time on."""
    above = time_s[np.abs(roll_deg) > math.degrees(START_RAD) / FALL]
    cycles = float(above[-1]) * PATTI_B.ship.natural_frequency_rad_s / math.tau
    return math.log(FALL) / (math.tau * cycles)


def _greatest_roll(law: str) -> float:
    """Greatest steady roll over frequency, rad per N m, in waves of 20 kN m."""
    model = without_tank(PATTI_B) if law == NO_TANK else PATTI_B
    found = simulated_response(model, np.linspace(0.35, 0.75, 41), 20e3).roll_rad_per_nm
    return float(np.nanmax(np.abs(found)))


def figure_damping() -> Figure:
    """Free decays, and the gains of damping that they make."""
    runs = {name: _decay(law) for name, law in LAWS.items()}
    ratio = {name: _damping(*run) for name, run in runs.items()}
    tank = ratio["passive"] / ratio["no tank"] - 1
    fuzzy = ratio["fuzzy (4.23)"] / ratio["passive"] - 1
    cautious = _damping(*_decay(ROBUST, strong=False)) / ratio["passive"] - 1
    linearized = ratio["feedback linearization"] / ratio["fuzzy (4.23)"] - 1
    in_waves = _greatest_roll(NO_TANK) / _greatest_roll(PASSIVE) - 1
    own = "fall to a quarter from 10°; the laws' numbers, which decide, are not given"
    pd = {}
    for name, ship in {"printed ship": AS_PRINTED, "25.2 m²": GREATER}.items():
        law = {PD: entrants(*ship)[PD]}
        answers = responses(*ship, law, _RATIOS)
        pd[name] = float(answers[PASSIVE_TANK].roll.max() / answers[PD].roll.max()) - 1
    told = ", ".join(f"{name} {value:.3f}" for name, value in ratio.items())
    return Figure(
        "free decay of Patti-B on still water, nonlinear model; PD: greatest roll in waves of the "
        "linear first ship",
        "How damping is measured is not said, nor are amplitude, friction and the laws' numbers. "
        "Here the damping ratio of a linear ship that falls to a quarter in the same time.",
        (
            Panel(
                "",
                "Time (s)",
                "Roll (°)",
                tuple(
                    Curve(name, time[time < 80], roll[time < 80])
                    for name, (time, roll) in runs.items()
                ),
            ),
        ),
        rows=(
            Row(
                "tank over no tank",
                "%",
                100.0,
                100 * tank,
                "fall to a quarter from 10°; its own damping is small, the tank's share large",
            ),
            Row(
                "the same by the greatest roll in waves of 20 kN m",
                "%",
                100.0,
                100 * in_waves,
                "another measure of damping",
            ),
            Row("fuzzy (4.23) over passive tank", "%", 20.0, 100 * fuzzy, own),
            Row(
                "the same, parameters for a pump of 20 to 100 kPa",
                "%",
                20.0,
                100 * cautious,
                "the laws' numbers are not given: the printed gain lies between",
            ),
            Row("feedback linearization over fuzzy", "%", 20.0, 100 * linearized, own),
            *(
                Row(
                    f"PD over the tank as built, {name}",
                    "%",
                    40.0,
                    100 * value,
                    "by the greatest roll in waves; how far the tank as built is from the optimum "
                    "decides",
                )
                for name, value in pd.items()
            ),
        ),
        checks=(
            Check(
                "a passive tank raises the damping by 100 %",
                Verdict.PARTLY if min(tank, in_waves) > 0 else Verdict.FAILS,
                f"by {tank:.0%} or {in_waves:.0%}, by the measure; damping ratios {told}",
            ),
            Check(
                "adaptive fuzzy control raises it by 20 % over the passive tank",
                Verdict.PARTLY if cautious < 0.2 < fuzzy else Verdict.FAILS,
                f"by {cautious:.0%} or {fuzzy:.0%} by its parameters",
            ),
            Check(
                "feedback linearization raises it by 20 % over adaptive fuzzy control",
                Verdict.of(0.1 < linearized < 0.3),
                f"by {linearized:.0%} with these parameters: its damping is a number of the design",
            ),
            Check(
                "an optimal tank by PD raises the damping by 40 % (5.1)",
                Verdict.PARTLY
                if min(pd.values()) < 0.4 < max(pd.values())
                else Verdict.of(all(abs(value - 0.4) < 0.1 for value in pd.values())),
                ", ".join(f"by {value:.0%} ({name})" for name, value in pd.items()),
            ),
        ),
        columns=1,
    )
