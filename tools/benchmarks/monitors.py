"""What each monitor costs in a tick of the controller.

    python -m tools.benchmarks.monitors --minutes 5      # --json

The first ship sails the storm in lockstep under the GPC, and each call of a monitor is timed there:
with its own data, and with caches that the rest of the tick has used meanwhile. The last thousand
calls of each are then done again and again, nothing between them. An empty call that is timed in
the same way is taken off both. Most monitors look at every fifth or tenth tick: a tick bears their
share. The process is scheduled as the deployed loop is, as far as the system permits; nothing is
compiled, as on a ship's PC.
"""

import math
import os
import sys
import time
from collections import deque
from collections.abc import Callable
from functools import partial
from typing import Any, Final

import numpy as np

from firmware_sim.scenario import Scenario
from firmware_sim.ship_side import build_ship_side
from tools.evidence import ROOT
from tools.printing import command_line, show
from tools.studies.monitor_margins import controller_of
from utank_hil.base.tick import TICK_NS
from utank_hil.configuration import load_config
from utank_hil.nodes.plausibility import LevelGates, MotionSensor
from utank_hil.runners import Lockstep, SimulatedBus
from utank_hil.runners.process_priority import real_time_scheduling
from utank_hil.safety.monitors.drive import DriveFollowing, Saturation
from utank_hil.safety.monitors.level_stuck import LevelStuck
from utank_hil.safety.monitors.motion import RollAgainstRate
from utank_hil.safety.monitors.motion_watch import MotionWatch
from utank_hil.safety.monitors.senders import Senders
from utank_hil.safety.monitors.tank_equation import TankEquation
from utank_hil.safety.monitors.volume import Volume
from utank_hil.safety.passive_twin import PassiveTwin

LAW: Final = "gpc"
AGAIN: Final = 1000
ROUNDS: Final = 100
HELD_UP: Final = 10.0  #: A call of so many medians was held up by something else on the machine.


class Empty:
    """A monitor that does nothing."""

    def update(self, first: float, second: float) -> int:  # noqa: ARG002
        """Do nothing."""
        return 0


MONITORS: Final[dict[str, tuple[type, str]]] = {
    "passive twin": (PassiveTwin, "update"),
    "motion samples: spikes": (MotionSensor, "take"),
    "gauge samples: spikes": (LevelGates, "passes"),
    "motion sensor in all": (MotionWatch, "update"),
    "roll against rate (part of it)": (RollAgainstRate, "update"),
    "senders": (Senders, "update"),
    "tank equation": (TankEquation, "update"),
    "drive follows": (DriveFollowing, "update"),
    "volume": (Volume, "update"),
    "saturation": (Saturation, "update"),
    "level against roll": (LevelStuck, "update"),
}


class Timed:
    """A method of a class whose calls are timed until `restore`, and the last of them kept."""

    def __init__(self, owner: type, method: str) -> None:
        self.took_ns: list[int] = []
        self._calls: deque[Callable[[], Any]] = deque(maxlen=AGAIN)
        original: Callable[..., Any] = getattr(owner, method)
        self.restore = partial(setattr, owner, method, original)

        def timed(*arguments: Any, **named: Any) -> Any:
            begin_ns = time.perf_counter_ns()
            result = original(*arguments, **named)
            self.took_ns.append(time.perf_counter_ns() - begin_ns)
            self._calls.append(partial(original, *arguments, **named))
            return result

        setattr(owner, method, timed)

    def in_the_loop_us(self) -> float:
        """Mean of the calls that nothing held up."""
        each = np.array(self.took_ns)
        return float(each[each <= HELD_UP * np.median(each)].mean()) / 1e3

    def in_a_row_us(self) -> float:
        """Mean of the calls one after the other, of the best round."""
        shortest_ns = math.inf
        for _ in range(ROUNDS):
            begin_ns = time.thread_time_ns()
            for call in self._calls:
                call()
            shortest_ns = min(shortest_ns, time.thread_time_ns() - begin_ns)
        return shortest_ns / len(self._calls) / 1e3


def measure(minutes: float) -> dict[str, dict[str, float]]:
    """Costs by monitor."""
    scenario = load_config(ROOT / "configs/scenarios/storm.yaml", Scenario)
    node = controller_of(scenario, LAW)
    ship = build_ship_side(scenario, 1, scenario.operator)
    bus = SimulatedBus(bit_rate=scenario.controllers[LAW].bit_rate)
    lockstep = Lockstep([*ship.nodes, node], bus)
    ticks = round(minutes * 60e9 / TICK_NS)
    floor, empty = Timed(Empty, "update"), Empty()
    monitors = {name: Timed(*method) for name, method in MONITORS.items()}
    with real_time_scheduling():
        for _ in range(ticks):
            lockstep.run_until(lockstep.now_ns + TICK_NS)
            empty.update(0.0, 0.0)
        for each in (floor, *monitors.values()):
            each.restore()
        nothing_us = floor.in_the_loop_us(), floor.in_a_row_us()
        rows = {}
        for name, each in monitors.items():
            share = len(each.took_ns) / ticks
            rows[name] = {
                "ticks_between_calls": 1 / share,
                "in_the_loop_us_a_tick": share * (each.in_the_loop_us() - nothing_us[0]),
                "in_a_row_us_a_tick": share * (each.in_a_row_us() - nothing_us[1]),
            }
    return rows


def main() -> None:
    """Measure and print."""
    parser = command_line(__doc__)
    parser.add_argument("--minutes", type=float, default=5.0, help="of the ship (%(default)s)")
    arguments = parser.parse_args()
    if not arguments.minutes >= 1:
        parser.error("--minutes must be 1 or more: the controller is not in charge before")
    if os.environ.get("UTANK_HIL_COMPILED") != "0":  # compiled classes can't be watched
        command = [sys.executable, "-m", "tools.benchmarks.monitors", *sys.argv[1:]]
        os.execve(sys.executable, command, {**os.environ, "UTANK_HIL_COMPILED": "0"})
    show(measure(arguments.minutes), arguments)


if __name__ == "__main__":
    main()
