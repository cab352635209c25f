"""How punctual the real-time loop is, against the barest loop that Python can do.

    python -m tools.benchmarks.realtime [--seconds 10] [--json]

Both run in this process under the scheduling set-up of the deployed loop, in turns of one second,
so that they meet the same disturbances: the bare one does nothing but sleep until the next point
of an absolute grid (clock_nanosleep) and note how late it is. The ratio is what the loop adds; the
absolute numbers are the machine's.
"""

import argparse
import json
from collections.abc import Iterable

from utank_hil.canbus.frame import Frame
from utank_hil.runtime import (
    Histogram,
    LoopStatistics,
    MonotonicClock,
    RealTimeLoop,
    real_time_scheduling,
)

PERIOD_NS = 10_000_000
TURN_NS = 1_000_000_000


class Talker:
    """Sends one frame a tick and ignores what it hears."""

    period_ns = PERIOD_NS

    def __init__(self, name: str, can_id: int) -> None:
        self.name = name
        self._sent = (Frame(can_id, bytes(8)),)

    def receive(self, frame: Frame, now_ns: int) -> None:
        """Hear nothing."""

    def tick(self, now_ns: int) -> Iterable[Frame]:  # noqa: ARG002 - the same at any time
        """Hand out the frame."""
        return self._sent


def run_bare(lateness: Histogram) -> None:
    """Sleep along an absolute grid for one turn."""
    clock = MonotonicClock()
    start_ns = clock.now_ns()
    for deadline_ns in range(start_ns, start_ns + TURN_NS, PERIOD_NS):
        clock.sleep_until(deadline_ns)
        lateness.add(clock.now_ns() - deadline_ns)


def main() -> None:
    """Measure both in turns and print percentiles and ratios."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seconds", type=int, default=10, help="turns of a second for each")
    parser.add_argument("--json", action="store_true", help="print one JSON object")
    arguments = parser.parse_args()
    bare, statistics = Histogram(), LoopStatistics()
    loop = RealTimeLoop([Talker(f"node {i}", i) for i in range(4)], statistics=statistics)
    with real_time_scheduling() as report:
        for _ in range(arguments.seconds):
            run_bare(bare)
            loop.run(duration_ns=TURN_NS)
    rows = {
        "bare lateness": bare.summary(),
        "loop lateness": statistics.lateness.summary(),
        "loop tick duration": statistics.duration.summary(),
    }
    ratios = {
        name: rows["loop lateness"][name] / max(rows["bare lateness"][name], 1)
        for name in ("p50_ns", "p99_ns", "p99_9_ns", "max_ns")
    }
    if arguments.json:
        counted = {"overruns": statistics.overruns, "scheduling": report.lines()}
        print(json.dumps({**rows, "loop to bare": ratios, **counted}))
        return
    print(*report.lines(), sep="\n")
    print(f"{'microseconds':20}{'p50':>10}{'p99':>10}{'p99.9':>10}{'max':>10}")
    for title, row in rows.items():
        print(f"{title:20}" + "".join(f"{row[name] / 1000:10.1f}" for name in ratios))
    print(f"{'loop to bare':20}" + "".join(f"{ratio:10.2f}" for ratio in ratios.values()))
    print(f"overruns: {statistics.overruns} of {statistics.ticks} ticks")


if __name__ == "__main__":
    main()
