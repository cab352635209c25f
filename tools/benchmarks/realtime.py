"""How punctual the real-time loop is, against the barest loop that Python can do.

    python -m tools.benchmarks.realtime [--seconds 10] [--json]

Both run in this process under the scheduling set-up of the deployed loop, in turns of one second,
so that they meet the same disturbances: the bare one does nothing but sleep until the next point
of an absolute grid (clock_nanosleep) and note how late it is. The ratio is what the loop adds; the
absolute numbers are the machine's. Three times: alone, beside as many busy processes as there are
processors, and beside a retuner at work.
"""

import os
import subprocess
import sys
import time
from collections.abc import Callable, Iterable, Iterator
from contextlib import AbstractContextManager, contextmanager, nullcontext
from typing import Any

import numpy as np
import numpy.typing as npt

from tools.printing import command_line, show
from utank_hil.base.arrays import FloatArray
from utank_hil.canbus.frame import Frame
from utank_hil.retuning import Answer, RetunerProcess, Work
from utank_hil.runners import (
    Histogram,
    LoopStatistics,
    MonotonicClock,
    RealTimeLoop,
    real_time_scheduling,
)

PERIOD_NS = 10_000_000
TURN_NS = 1_000_000_000
RECORD = (2500, 60)
SHOWN = ("p50_ns", "p99_ns", "p99_9_ns", "max_ns")
RESAMPLES = 1000


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


@contextmanager
def beside_busy_processes() -> Iterator[None]:
    """As many processes as processors, that compute all the time."""
    spin = [sys.executable, "-c", "while True: pass"]
    busy = [subprocess.Popen(spin) for _ in range(os.cpu_count() or 1)]
    try:
        yield
    finally:
        for process in busy:
            process.kill()
            process.wait()


def compute(record: FloatArray) -> Answer:
    """What a retuner does most: least squares, for longer than the measurement."""
    while True:
        np.linalg.lstsq(record, record[:, 0], rcond=None)


@contextmanager
def beside_a_retuner() -> Iterator[None]:
    """A retuner's processes at work on a record."""
    with RetunerProcess(Work(compute, FloatArray, RECORD[0] * RECORD[1])) as retuner:
        retuner.desks[0].submit(1, np.random.default_rng(1).standard_normal(RECORD), 0)
        time.sleep(1.0)
        yield


SITUATIONS: dict[str, Callable[[], AbstractContextManager[None]]] = {
    "alone": nullcontext,
    "under load": beside_busy_processes,
    "while retuning": beside_a_retuner,
}


def compared(turns: int) -> dict[str, Any]:
    """Lateness of both, in turns, and their ratio."""
    bare, statistics = Histogram(), LoopStatistics()
    loop = RealTimeLoop([Talker(f"node {i}", i) for i in range(4)], statistics=statistics)
    counts = []
    with real_time_scheduling() as report:
        for _ in range(turns):
            run_bare(bare)
            loop.run(duration_ns=TURN_NS)
            counts.append((bare.counts.copy(), statistics.lateness.counts.copy()))
    rows = {
        "bare lateness": bare.summary(),
        "loop lateness": statistics.lateness.summary(),
        "loop tick duration": statistics.duration.summary(),
    }
    ratios = {
        name: rows["loop lateness"][name] / max(rows["bare lateness"][name], 1) for name in SHOWN
    }
    of_turns = np.diff(np.array(counts), axis=0, prepend=0)
    interval = {"p99_9_ns of loop to bare, 90 % interval": ratio_interval(of_turns)}
    counted = {"overruns": statistics.overruns, "ticks": statistics.ticks}
    return {**rows, "loop to bare": ratios, **interval, **counted, "scheduling": report}


def ratio_interval(of_turns: npt.NDArray[np.int64]) -> list[float]:
    """Percentile bootstrap of the ratio at the 99.9th percentile, over turns.

    Parameters
    ----------
    of_turns : ndarray of int64, shape (turns, 2, bins)
        Lateness of bare loop and real-time loop in each turn.
    """
    random = np.random.default_rng(1)
    ratios = []
    for _ in range(RESAMPLES):
        drawn = of_turns[random.integers(len(of_turns), size=len(of_turns))].sum(axis=0)
        bare, loop = (percentile_ns(counts) for counts in drawn)
        ratios.append(loop / max(bare, 1))
    return [float(each) for each in np.quantile(ratios, (0.05, 0.95))]


def percentile_ns(counts: npt.NDArray[np.int64]) -> int:
    """The 99.9th percentile of what is counted."""
    histogram = Histogram()
    histogram.counts, histogram.max_ns = counts, 1 << 62
    return histogram.percentile_ns(0.999)


def main() -> None:
    """Measure both in turns in each situation, and print percentiles and ratios."""
    parser = command_line(__doc__)
    parser.add_argument("--seconds", type=int, default=10, help="turns of a second for each")
    arguments = parser.parse_args()
    found = {}
    for situation, beside in SITUATIONS.items():
        with beside():
            found[situation] = compared(arguments.seconds)
    show(found, arguments)


if __name__ == "__main__":
    main()
