"""The whole slice in lockstep: ship seconds per second, what a controller's tick and frame cost.

Every node, the whole catalogue, codec and protection at both ends, the controller armed. Processor
time of this process, so that other work on the machine counts less.

Example: .venv/bin/python -m tools.benchmarks.slice --seconds 120
"""

import time
from collections.abc import Callable
from pathlib import Path
from statistics import median

from firmware_sim.scenario import Scenario
from firmware_sim.ship_side import build_ship_side
from tools.printing import command_line, show
from utank_hil.assembly import build_controller_node
from utank_hil.base.compiled import in_use
from utank_hil.canbus import Frame
from utank_hil.configuration import load_config
from utank_hil.runners import Lockstep, Node

STORM = Path(__file__).resolve().parents[2] / "configs" / "scenarios" / "storm.yaml"
WARM_UP_S = 10


class TimedNode:
    """A node whose ticks are timed, with the frames before each; `clock_ns` is the clock."""

    def __init__(self, node: Node, clock_ns: Callable[[], int]) -> None:
        self.name, self.period_ns = node.name, node.period_ns
        self._node, self._clock_ns = node, clock_ns
        self._heard_ns = 0
        self.ticks_ns: list[int] = []
        self.frames_ns: list[int] = []

    def receive(self, frame: Frame, now_ns: int) -> None:
        """Take a frame, on the next tick's account."""
        begin = self._clock_ns()
        self._node.receive(frame, now_ns)
        self.frames_ns.append(self._clock_ns() - begin)
        self._heard_ns += self.frames_ns[-1]

    def tick(self, now_ns: int) -> list[Frame]:
        """Tick and note what this and the frames before it cost."""
        begin = self._clock_ns()
        frames = list(self._node.tick(now_ns))
        self.ticks_ns.append(self._clock_ns() - begin + self._heard_ns)
        self._heard_ns = 0
        return frames


def slice_speed(scenario: Scenario, seconds: int) -> float:
    """Ship seconds per processor second of the whole slice."""
    ship = build_ship_side(scenario, scenario.seed, scenario.operator)
    controller = build_controller_node(next(iter(scenario.controllers.values())), commissioned=True)
    lockstep = Lockstep([*ship.nodes, controller])
    lockstep.run_until(WARM_UP_S * 10**9)
    begin = time.process_time()
    lockstep.run_until((WARM_UP_S + seconds) * 10**9)
    return seconds / (time.process_time() - begin)


def controller_costs_us(scenario: Scenario, seconds: int) -> tuple[list[float], list[float]]:
    """Cost of each controller tick, the frames it heard before included, and of each frame."""
    ship = build_ship_side(scenario, scenario.seed, scenario.operator)
    node = build_controller_node(next(iter(scenario.controllers.values())), commissioned=True)
    timed = TimedNode(node, time.perf_counter_ns)
    lockstep = Lockstep([*ship.nodes, timed])
    lockstep.run_until(WARM_UP_S * 10**9)
    timed.ticks_ns.clear()
    timed.frames_ns.clear()
    lockstep.run_until((WARM_UP_S + seconds) * 10**9)
    return _in_order_us(timed.ticks_ns), _in_order_us(timed.frames_ns)


def _in_order_us(costs_ns: list[int]) -> list[float]:
    return sorted(cost_ns / 1e3 for cost_ns in costs_ns)


def main() -> None:
    """Measure and print."""
    parser = command_line(__doc__)
    parser.add_argument("--seconds", type=int, default=120, help="of ship time in each round")
    parser.add_argument("--rounds", type=int, default=3)
    arguments = parser.parse_args()
    scenario = load_config(STORM, Scenario)
    linear = scenario.model_copy(update={"plant": "linear"})
    # in turns, so that what else the machine does falls on both
    turns = [
        tuple(slice_speed(each, arguments.seconds) for each in (scenario, linear))
        for _ in range(arguments.rounds)
    ]
    speeds = [nonlinear for nonlinear, _ in turns]
    ticks, frames = controller_costs_us(scenario, arguments.seconds)
    result = {
        "compiled": in_use(),
        "ship_seconds_per_cpu_second": median(speeds),
        "fastest_ship_seconds_per_cpu_second": max(speeds),
        "speed_against_linear_plant": median(one / other for one, other in turns),
        "frame_p50_us": frames[len(frames) // 2],
        "tick_p50_us": ticks[len(ticks) // 2],
        "tick_p99_us": ticks[len(ticks) * 99 // 100],
        "tick_p99_share_of_period": ticks[len(ticks) * 99 // 100] / 10e3,
    }
    show(result, arguments)


if __name__ == "__main__":
    main()
