"""The whole slice in lockstep: ship seconds per second, what a controller's tick and frame cost.

Every node, the whole catalogue, codec and protection at both ends, the controller armed. Processor
time of this process, so that other work on the machine counts less. The tick is measured with the
devices of `thesis_first_devices.yaml`, too, and compared with that of the same ship without them:
the frames of both runs are played to both controllers, a second of the one and of the other in
turns. In lockstep the emulated devices would have part in it, since they share the caches.

Example: .venv/bin/python -m tools.benchmarks.slice --seconds 120
"""

import gc
import pickle
import time
from pathlib import Path
from statistics import median

from firmware_sim.scenario import Scenario
from firmware_sim.ship_side import build_ship_side
from tools.printing import command_line, show
from utank_hil.assembly import build_controller_node
from utank_hil.base.compiled import in_use
from utank_hil.canbus import Frame, Mode
from utank_hil.configuration import Vessel, load_config
from utank_hil.runners import Lockstep, Node
from utank_hil.runners.bus_model import SimulatedBus
from utank_hil.runners.lockstep import with_more

CONFIGS = Path(__file__).resolve().parents[2] / "configs"
STORM = CONFIGS / "scenarios" / "storm.yaml"
DEVICES = CONFIGS / "ships" / "thesis_first_devices.yaml"
WARM_UP_S = 10
PART = 100  #: Ticks of one controller in succession.
Heard = list[tuple[Frame, int]]
"""Frames and the times at which they came."""


class TimedNode:
    """A node whose ticks are timed, with the frames before each, which it takes then."""

    def __init__(self, node: Node) -> None:
        self.name, self.period_ns = node.name, node.period_ns
        self._node = node
        self._heard: Heard = []
        self.past: list[tuple[int, Heard]] = []  #: Time of each tick, and what was heard before.
        self.ticks_ns: list[int] = []
        self.frames_ns: list[float] = []

    def receive(self, frame: Frame, now_ns: int) -> None:
        """Keep a frame for the next tick."""
        self._heard.append((frame, now_ns))

    def tick(self, now_ns: int) -> list[Frame]:
        """Tick and note what this and the frames before it cost."""
        receive, heard, clock_ns = self._node.receive, self._heard, time.perf_counter_ns
        begin_ns = clock_ns()
        for frame, came_ns in heard:
            receive(frame, came_ns)
        heard_ns = clock_ns()
        frames = list(self._node.tick(now_ns))
        self.ticks_ns.append(clock_ns() - begin_ns)
        if heard:
            self.frames_ns.append((heard_ns - begin_ns) / len(heard))
        self.past.append((now_ns, heard))
        self._heard = []
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


def timed_run(scenario: Scenario, seconds: int) -> TimedNode:
    """The controller's node after a run, with the costs of its ticks without those at first."""
    ship = build_ship_side(scenario, scenario.seed, scenario.operator)
    node = build_controller_node(next(iter(scenario.controllers.values())), commissioned=True)
    timed = TimedNode(node)
    more = len(scenario.vessel.foreign.buses) - 1
    bus = with_more(SimulatedBus(), more, next(iter(scenario.controllers.values())).bit_rate)
    lockstep = Lockstep([*ship.nodes, timed], bus)
    lockstep.run_until(WARM_UP_S * 10**9)
    timed.ticks_ns.clear()
    timed.frames_ns.clear()
    lockstep.run_until((WARM_UP_S + seconds) * 10**9)
    return timed


def cost_of_devices(scenario: Scenario, seconds: int) -> float:
    """Processor time of a tick with devices of other makers, over that with native nodes."""
    foreign = load_config(DEVICES, Vessel)
    name, config = next(iter(scenario.controllers.items()))
    runs = []
    for vessel in (foreign, foreign.model_copy(update={"devices": None})):
        controllers = {name: config.model_copy(update={"vessel": vessel})}
        changed = scenario.model_copy(update={"vessel": vessel, "controllers": controllers})
        past = timed_run(changed, seconds).past
        runs.append((build_controller_node(controllers[name], commissioned=True), past))
    gc.collect()
    gc.disable()  # as on board
    ratios = []
    for begin in range(0, len(runs[0][1]), PART):
        costs_ns = []
        for node, past in runs:
            # as just read from a socket, and not out of the caches
            part = pickle.loads(pickle.dumps(past[begin : begin + PART]))
            begin_ns = time.process_time_ns()
            for now_ns, heard in part:
                for frame, came_ns in heard:
                    node.receive(frame, came_ns)
                node.tick(now_ns)
            costs_ns.append(time.process_time_ns() - begin_ns)
        ratios.append(costs_ns[0] / costs_ns[1])
    gc.enable()
    assert all(node.mode is Mode.ACTIVE for node, _ in runs)
    return median(ratios[WARM_UP_S:])


def main() -> None:
    """Measure and print."""
    parser = command_line(__doc__)
    parser.add_argument("--seconds", type=int, default=120, help="of ship time in each round")
    parser.add_argument("--rounds", type=int, default=3)
    arguments = parser.parse_args()
    scenario = load_config(STORM, Scenario)
    speeds = [slice_speed(scenario, arguments.seconds) for _ in range(arguments.rounds)]
    timed = timed_run(scenario, arguments.seconds)
    ticks = sorted(ns / 1e3 for ns in timed.ticks_ns)
    frames = sorted(ns / 1e3 for ns in timed.frames_ns)
    result = {
        "compiled": in_use(),
        "ship_seconds_per_cpu_second": median(speeds),
        "fastest_ship_seconds_per_cpu_second": max(speeds),
        "frame_p50_us": frames[len(frames) // 2],
        "tick_p50_us": ticks[len(ticks) // 2],
        "tick_p99_us": ticks[len(ticks) * 99 // 100],
        "tick_p99_share_of_period": ticks[len(ticks) * 99 // 100] / 10e3,
        "tick_with_devices_against_native": cost_of_devices(scenario, arguments.seconds),
    }
    show(result, arguments)


if __name__ == "__main__":
    main()
