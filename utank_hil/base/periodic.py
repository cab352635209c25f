"""Things a node does less often than it ticks."""


class Schedule:
    """Points of time a period apart, from the first look on.

    Told by the time and not by counting ticks: where the machine left ticks out, what was due is
    done late once and the next is due at its own point again.
    """

    __slots__ = ("_due_ns", "_period_ns")

    def __init__(self, period_ns: int) -> None:
        self._period_ns = period_ns
        self._due_ns: int | None = None

    def due(self, now_ns: int) -> bool:
        """Say whether a point has passed since the last that was, and look to the next if so."""
        due_ns = self._due_ns
        if due_ns is None:
            due_ns = now_ns
        elif now_ns < due_ns:
            return False
        self._due_ns = now_ns + self._period_ns - (now_ns - due_ns) % self._period_ns
        return True
