"""How well the real-time loop keeps its time: counters and histograms that cost it nothing."""

from dataclasses import dataclass, field
from typing import Any, Final

import numpy as np
import numpy.typing as npt

_STEPS: Final = 32
"""Bins to a factor of two, so a bin is at most 1/32 wide relative to its lower edge."""
_LONGEST_BITS: Final = 36  # Values of 2**36 ns (69 s) and more share the last bin.
_BINS: Final = _STEPS * (_LONGEST_BITS - _STEPS.bit_length() + 2)


def _bin_of(value_ns: int) -> int:
    """Return the bin: the value itself below 32, then its exponent and its five next bits."""
    shift = value_ns.bit_length() - _STEPS.bit_length()
    if shift <= 0:
        return value_ns
    return min(shift * _STEPS + (value_ns >> shift), _BINS - 1)


def _largest_in(index: int) -> int:
    if index < 2 * _STEPS:
        return index
    shift = index // _STEPS - 1
    return ((index - shift * _STEPS + 1) << shift) - 1


class Histogram:
    """Distribution of durations over fixed, logarithmically spaced bins.

    Adding takes a few integer operations and allocates no memory. A percentile is at most 1/32
    above the true one and never below it; the maximum is exact. `recent_ns` is the longest duration
    since it was last set to zero, `max_ns` the longest of all, 0 if there is none.
    """

    __slots__ = ("counts", "max_ns", "recent_ns")

    def __init__(self) -> None:
        self.counts: npt.NDArray[np.int64] = np.zeros(_BINS, dtype=np.int64)
        self.max_ns = self.recent_ns = 0

    def add(self, value_ns: int) -> None:
        """Count one duration, 0 ns or more."""
        self.counts[_bin_of(value_ns)] += 1
        if value_ns > self.recent_ns:
            self.recent_ns = value_ns
            if value_ns > self.max_ns:
                self.max_ns = value_ns

    @property
    def recent_s(self) -> float:
        """`recent_ns` in seconds."""
        return self.recent_ns * 1e-9

    def percentile_ns(self, fraction: float) -> int:
        """Return the quantile for a fraction of 0 to 1; 0 if nothing was counted."""
        cumulative = np.cumsum(self.counts)
        wanted = max(fraction * float(cumulative[-1]), 1.0)
        index = int(np.searchsorted(cumulative, wanted))
        return min(_largest_in(index), self.max_ns)

    def summary(self) -> dict[str, int]:
        """Return count, p50_ns, p99_ns, p99_9_ns and max_ns, ready for JSON."""
        return {
            "count": int(self.counts.sum()),
            "p50_ns": self.percentile_ns(0.50),
            "p99_ns": self.percentile_ns(0.99),
            "p99_9_ns": self.percentile_ns(0.999),
            "max_ns": self.max_ns,
        }


@dataclass(slots=True)
class LoopStatistics:
    """Counters of the real-time loop."""

    #: Latency from the deadline to the start of the tick.
    lateness: Histogram = field(default_factory=Histogram)
    duration: Histogram = field(default_factory=Histogram)  #: Execution time of the tick.
    ticks: int = 0  #: Ticks of the loop's base period that were run.
    overruns: int = 0  #: Occasions on which one or more grid points were skipped.
    skipped: int = 0  #: Grid points without a tick.
    frames_sent: int = 0
    frames_received: int = 0
    others_received: int = 0  #: Received frames of other kinds, see `Port.others`.
    send_errors: int = 0  #: `PortError` exceptions of the port.
    receive_errors: int = 0  #: `PortError` exceptions of the port.
    real_time: bool = False  #: Whether the operating system ran the loop with a real-time policy.

    def begin_row(self) -> None:
        """Look at the ticks from here on for the next row of telemetry."""
        self.lateness.recent_ns = self.duration.recent_ns = 0

    def summary(self) -> dict[str, Any]:
        """Return every counter and the summaries of both histograms, ready for JSON."""
        values = {name: getattr(self, name) for name in self.__slots__}
        return {
            name: value.summary() if isinstance(value, Histogram) else value
            for name, value in values.items()
        }
