"""What retuning costs the real-time loop: overruns with and without it, in turns.

    python tools/benchmark_retuning.py [--turns 8] [--json]

Each turn sails the adaptive scenario (roll alone, ARX order 200, 500 s of pulses) in simulated time
up to the end of the pulses and goes on with the very same nodes in real time: the record goes to a
real process, which identifies and designs while the loop runs; the answer comes back, the new law's
memory is filled, and it takes over. Every second turn orders nothing and is the measure for
what the machine itself does to the loop.
"""

import argparse
import json
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np

from firmware_sim.assembly import build_ship_side
from firmware_sim.scenario import Scenario
from utank_hil.analysis.retune import retuner_work
from utank_hil.canbus import RetuningState
from utank_hil.config_files import load_config
from utank_hil.runtime import (
    Lockstep,
    LoopStatistics,
    MonotonicClock,
    Node,
    RealTimeLoop,
    real_time_scheduling,
)
from utank_hil.runtime.assembly import build_controller_node
from utank_hil.runtime.panel import Action, TimedAction
from utank_hil.runtime.retuning import RetunerProcess
from utank_hil.runtime.signals import SIGNALS

SCENARIO = Path(__file__).resolve().parents[1] / "configs" / "scenarios" / "adaptive.yaml"
CONTROLLER = "gpc-roll"
ORDERED_S, REAL_TIME_S = 15.0, 20.0
SECOND_NS = 1_000_000_000


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
    with RetunerProcess(*work) as retuner:
        node = build_controller_node(
            config,
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
    for event in node.retuning_events:
        print(
            f"{event.time_ns / SECOND_NS:8.2f} s", event.state.name, *event.reasons, file=sys.stderr
        )
    swapped = any(event.state is RetuningState.TRIAL for event in node.retuning_events)
    return swapped, float(steepest.max())


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--turns", type=int, default=8, help="half of them with retuning")
    parser.add_argument("--json", action="store_true")
    arguments = parser.parse_args()
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
            "lateness_p50_us": here.lateness.percentile_ns(0.5) / 1e3,
            "lateness_p99_us": here.lateness.percentile_ns(0.99) / 1e3,
            "duration_p50_us": here.duration.percentile_ns(0.5) / 1e3,
            "duration_p99_us": here.duration.percentile_ns(0.99) / 1e3,
            "duration_max_us": here.duration.max_ns / 1e3,
        }
        for name, here in sums.items()
    }
    result["swaps"] = {"done": swaps, "steepest_command_pa_s": steepest}
    if arguments.json:
        print(json.dumps(result))
        return
    for name, values in result.items():
        print(name, ", ".join(f"{key} {value:g}" for key, value in values.items()), sep=": ")


if __name__ == "__main__":
    main()
