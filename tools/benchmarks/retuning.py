"""What retuning costs the real-time loop: overruns with and without it, in turns, and each step.

    python -m tools.benchmarks.retuning [--turns 8] [--json]

Each turn sails the adaptive scenario (roll alone, ARX order 200, 500 s of pulses) in simulated time
up to the end of the pulses and goes on with the very same nodes in real time: the record goes to a
real process, which identifies and designs while the loop runs; the answer comes back, the new law's
memory is filled, and it takes over. Every second turn orders nothing and is the measure for
what the machine itself does to the loop.

The costs of the controller's single steps are measured after that, in a plain loop on a linear
ship, with the retuner's process at work beside it.
"""

import math
import sys
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
from scipy.stats import binomtest, chi2

from firmware_sim.scenario import Scenario
from firmware_sim.ship_side import build_ship_side
from tools.printing import command_line, show
from utank_hil.assembly import build_controller_node, retuner_work
from utank_hil.base.arrays import FloatArray
from utank_hil.canbus import RetuningOrder, RetuningState
from utank_hil.configuration import ControllerConfig, load_config
from utank_hil.control import PredictiveDesign
from utank_hil.dynamics import coupled_model
from utank_hil.dynamics.sampling import sample
from utank_hil.nodes.panel import Action, TimedAction
from utank_hil.nodes.signals import SIGNALS
from utank_hil.retuning import AdaptiveController, RetunerProcess, ShipFigures, make_pulses
from utank_hil.runners import (
    Lockstep,
    LoopStatistics,
    MonotonicClock,
    Node,
    RealTimeLoop,
    real_time_scheduling,
)

SCENARIO = Path(__file__).resolve().parents[2] / "configs" / "scenarios" / "adaptive.yaml"
CONTROLLER = "gpc-roll"
ORDERED_S, REAL_TIME_S = 40.0, 20.0
SECOND_NS = 1_000_000_000
PERIOD_S = 7.5  # of the ship that the costs are measured with
WAVE_NM, WAVE_RAD_S = 2e7, 0.6
BEGUN, REPEATS = 200, 5


class ShiftedClock:
    """The monotonic clock, reading `start_ns` now."""

    def __init__(self, start_ns: int) -> None:
        self._clock = MonotonicClock()
        self._shift_ns = start_ns - self._clock.now_ns()

    def now_ns(self) -> int:
        """Return the shifted time."""
        return self._clock.now_ns() + self._shift_ns

    def sleep_until(self, time_ns: int) -> None:
        """Sleep until a shifted time."""
        self._clock.sleep_until(time_ns - self._shift_ns)


def turn(scenario: Scenario, statistics: LoopStatistics, *, retuning: bool) -> tuple[bool, float]:
    """One turn; whether a new law took over, and the steepest change of the command in Pa/s."""
    config = scenario.controllers[CONTROLLER].model_copy(update={"command_timeout_ms": 100.0})
    # a machine that stalls for longer than the safety limits ends a voyage; here it is counted
    limits = replace(config.safety, motion_age_ms=90.0, long_overrun_ms=90.0, drive_age_ms=90.0)
    config = config.model_copy(update={"safety": limits})
    assert config.retuning is not None
    script: tuple[TimedAction, ...] = (TimedAction(5.0, Action.ARM),)
    if retuning:
        script += (TimedAction(ORDERED_S, Action.RETUNE),)
    ship = build_ship_side(scenario, scenario.seed, script)
    work = retuner_work(config)
    assert work is not None
    rows = []
    with RetunerProcess(work) as process:
        (retuner,) = process.desks
        node = build_controller_node(
            config,
            commissioned=True,
            retuner=retuner,
            statistics=statistics,
            sink=lambda row: rows.append(row[[0, SIGNALS.index("pressure_command_pa")]]),
        )
        nodes: list[Node] = [*ship.nodes, node]
        lockstep = Lockstep(nodes)
        lockstep.run_until(round((ORDERED_S + config.retuning.identification_s) * SECOND_NS))
        rows.clear()
        with real_time_scheduling():
            loop = RealTimeLoop(nodes, statistics=statistics, clock=ShiftedClock(lockstep.now_ns))
            loop.run(duration_ns=round(REAL_TIME_S * SECOND_NS))
    told = np.array(rows)
    steepest = np.abs(np.diff(told[:, 1])) / np.maximum(np.diff(told[:, 0]), 1e-9)
    for event in node.law.events:
        print(
            f"{event.time_ns / SECOND_NS:8.2f} s", event.state.name, *event.reasons, file=sys.stderr
        )
    swapped = any(event.state is RetuningState.TRIAL for event in node.law.events)
    return swapped, float(steepest.max())


def costs(config: ControllerConfig, repeats: int) -> dict[str, float]:
    """Median times in us of the adaptive controller's steps, and of the retuner's whole work."""
    times: dict[str, list[float]] = {}
    for _ in range(repeats):
        retune_once(config, times)
    return {name: 1e6 * float(np.median(values)) for name, values in times.items()}


def retune_once(config: ControllerConfig, times: dict[str, list[float]]) -> None:
    """Retune on order, and add the time of each step under its name."""
    design, settings, plant = config.law, config.retuning, config.plant
    work = retuner_work(config)
    assert isinstance(design, PredictiveDesign)
    assert settings is not None
    assert work is not None
    period_s = design.predictor.sample_time_s
    with RetunerProcess(work) as process:
        (retuner,) = process.desks
        law = design.law(plant)
        controller = AdaptiveController(
            law,
            law.controller(),
            ShipFigures(
                plant.ship.stiffness_nm_rad, plant.ship.inertia_kg_m2, plant.ship.damping_nms_rad
            ),
            design.predictor.measured.index("roll_rad"),
            settings,
            make_pulses(settings, plant, period_s),
            retuner,
        )
        ship = _Rolling(config)
        handed_over = 0.0
        for k in range(round((settings.identification_s + 2 * settings.trial_s) / period_s)):
            before, candidate = controller.state, controller.candidate
            if before is RetuningState.DESIGN and candidate is None:
                time.sleep(period_s)  # the other process works in true time
            pressed = RetuningOrder(retune=k == BEGUN)
            start = time.perf_counter()
            controller.update(round(k * period_s * SECOND_NS), pressed, engaged=True, fresh=True)
            middle = time.perf_counter()
            answer = controller.step(ship.outputs)
            end = time.perf_counter()
            now = controller.state
            if before is RetuningState.IDENTIFY and now is RetuningState.DESIGN:
                handed_over = end
                times.setdefault("handing the record over", []).append(middle - start)
            elif controller.candidate is not candidate:
                times.setdefault("identification and design", []).append(end - handed_over)
                times.setdefault("taking the law in", []).append(middle - start)
            elif now is RetuningState.DESIGN and candidate is None:
                times.setdefault("looking for the law", []).append(middle - start)
            elif now is RetuningState.DESIGN:
                times.setdefault("step, filling the law's memory", []).append(end - middle)
            else:
                times.setdefault(f"step, {now.name}", []).append(end - middle)
                times.setdefault(f"update, {now.name}", []).append(middle - start)
            controller.applied(ship.push(answer))
    assert controller.state is RetuningState.RETUNED, controller.events


class _Rolling:
    """A linear ship of another loading in a regular wave."""

    def __init__(self, config: ControllerConfig) -> None:
        design, plant = config.law, config.plant
        assert isinstance(design, PredictiveDesign)
        stiffness = plant.ship.inertia_kg_m2 * (2 * math.pi / PERIOD_S) ** 2
        ship = replace(plant.ship, stiffness_nm_rad=stiffness)
        self._period_s = design.predictor.sample_time_s
        names = list(design.predictor.measured)
        model = coupled_model(ship, plant.tank)
        both = model[names, ["pressure_pa", "wave_moment_nm"]]
        self._plant = sample(both, self._period_s, plant.delay_s, plant.lag_s)
        self._noise = np.random.default_rng(1)
        self._deviation = np.array(design.predictor.measurement_std) / 10
        self._limit_pa = plant.limits.pressure_pa
        self._state = np.zeros(len(self._plant.A))
        self._steps = 0
        self.outputs = np.zeros(len(names))

    def push(self, pressure_pa: FloatArray) -> FloatArray:
        """Let a sample time pass; what of the pressure was within the pump's limit."""
        applied = np.clip(pressure_pa, -self._limit_pa, self._limit_pa)
        wave_nm = WAVE_NM * math.cos(WAVE_RAD_S * self._period_s * self._steps)
        self._steps += 1
        inputs = np.array([float(applied[0]), wave_nm])
        noise = self._deviation * self._noise.standard_normal(len(self.outputs))
        self.outputs = self._plant.C @ self._state + self._plant.D @ inputs + noise
        self._state = self._plant.A @ self._state + self._plant.B @ inputs
        return applied


def interval(count: int) -> tuple[float, float]:
    """95 % confidence interval of the mean of a Poisson count."""
    low = chi2.ppf(0.025, 2 * count) / 2 if count else 0.0
    return float(low), float(chi2.ppf(0.975, 2 * count + 2) / 2)


def main() -> None:
    """Measure and print."""
    parser = command_line(__doc__)
    parser.add_argument("--turns", type=int, default=8, help="half of them with retuning")
    arguments = parser.parse_args()
    if arguments.turns < 2:
        parser.error("--turns must be 2 or more: one with retuning and one without")
    scenario = load_config(SCENARIO, Scenario)
    sums = {"without": LoopStatistics(), "with": LoopStatistics()}
    swaps, steepest = 0, 0.0
    for index in range(arguments.turns):
        name = "with" if index % 2 else "without"
        swapped, slope = turn(scenario, sums[name], retuning=name == "with")
        swaps += swapped
        steepest = max(steepest, slope)
    result: dict[str, dict[str, float]] = {
        name: {
            "ticks": here.ticks,
            "overruns": here.overruns,
            "overruns_at_least": interval(here.overruns)[0],
            "overruns_at_most": interval(here.overruns)[1],
            "lateness_p50_us": here.lateness.percentile_ns(0.5) / 1e3,
            "lateness_p99_us": here.lateness.percentile_ns(0.99) / 1e3,
            "duration_p50_us": here.duration.percentile_ns(0.5) / 1e3,
            "duration_p99_us": here.duration.percentile_ns(0.99) / 1e3,
            "duration_max_us": here.duration.max_ns / 1e3,
        }
        for name, here in sums.items()
    }
    result["swaps"] = {"done": swaps, "steepest_command_pa_s": steepest}
    more, fewer = sums["with"], sums["without"]
    share = more.ticks / max(1, more.ticks + fewer.ticks)
    both = more.overruns + fewer.overruns
    chance = binomtest(more.overruns, both, share, "greater").pvalue if both else 1.0
    # small: so many more overruns with retuning would be unlikely if it did nothing
    result["comparison"] = {"chance_of_so_many_with_retuning": float(chance)}
    result["costs_us"] = costs(scenario.controllers[CONTROLLER], REPEATS)
    show(result, arguments)


if __name__ == "__main__":
    main()
