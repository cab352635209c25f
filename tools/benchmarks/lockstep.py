"""How fast the lockstep runner is by itself: nodes that do nothing, the traffic of the catalogue.

    python -m tools.benchmarks.lockstep [--seconds 300] [--json]

What it prints is the cost of the runner alone: scheduling, arbitration, wire time and delivery of
random frames, without codec, protection, control or ship. Times are the processor's: a run is one
thread that never waits, and what else the machine does is not its cost.
"""

import random
import time
from collections.abc import Iterable

from tools.printing import command_line, show
from utank_hil.canbus.frame import Frame
from utank_hil.runners import Lockstep, SimulatedBus

MS = 1_000_000

# Node: (identifier, period in ms) of what it sends, as in the catalogue.
TRAFFIC = {
    "controller": [(0x08FF1080, 20), (0x18FF1180, 100), (0x18FF0080, 100)],
    "drive": [(0x08FF2081, 20), (0x14FF2181, 100), (0x18FF0081, 100)],
    "sensors": [(0x08FF3082, 10), (0x0CFF3182, 20), (0x0CFF3282, 20), (0x18FF0082, 100)],
    "panel": [(0x0CFF4083, 200), (0x18FF0083, 100)],
}


class Talker:
    """Sends prepared frames on time and ignores what it hears."""

    period_ns = 10 * MS

    def __init__(self, name: str, messages: list[tuple[int, int]], seed: int) -> None:
        self.name = name
        generator = random.Random(seed)
        self._prepared = [
            [
                Frame(can_id, generator.randbytes(8))
                for can_id, period_ms in messages
                if tick * 10 % period_ms == 0
            ]
            for tick in range(1000)
        ]

    def receive(self, frame: Frame, now_ns: int) -> None:
        """Hear nothing."""

    def tick(self, now_ns: int) -> Iterable[Frame]:
        """Hand out the next prepared frames."""
        return self._prepared[now_ns // self.period_ns % 1000]


def measure(ship_seconds: int, traffic: dict[str, list[tuple[int, int]]]) -> tuple[float, int]:
    """Return the processor time of a run, in seconds, and the frames it carried."""
    nodes = [Talker(name, sent, seed) for seed, (name, sent) in enumerate(traffic.items())]
    bus = SimulatedBus()
    run = Lockstep(nodes, bus)
    end_ns = ship_seconds * 1000 * MS
    began = time.process_time()
    run.run_until(end_ns)
    return time.process_time() - began, bus.frames


def main() -> None:
    """Measure with the traffic and without, and print what each frame and tick costs."""
    parser = command_line(__doc__)
    parser.add_argument("--seconds", type=int, default=300, help="ship time of a run")
    arguments = parser.parse_args()
    silence: dict[str, list[tuple[int, int]]] = {name: [] for name in TRAFFIC}
    # The fastest of several is the least disturbed.
    silent_s, _ = min(measure(arguments.seconds, silence) for _ in range(5))
    whole_s, frames = min(measure(arguments.seconds, TRAFFIC) for _ in range(5))
    result = {
        "ship_seconds_per_second": arguments.seconds / whole_s,
        "frames_per_ship_second": frames / arguments.seconds,
        "microseconds_per_frame": 1e6 * (whole_s - silent_s) / frames,
        "microseconds_per_tick": 1e6 * silent_s / (len(TRAFFIC) * 100 * arguments.seconds),
    }
    show(result, arguments)


if __name__ == "__main__":
    main()
