"""Whether commands reach who carries them out in time, by the counter that comes back."""

from typing import Final

from utank_hil.nodes.plausibility import NEVER_HEARD_NS

MOST_BEHIND: Final = 3
"""Commands that may have left since the one that is echoed; one or two have, if all is well."""
_COUNTER_MASK: Final = 15
"""Of a counter of four bits: 16 commands behind looks like none."""


class CommandEcho:
    """The newest command of which its receiver has sent the counter back.

    A receiver that gets every command, each a second late, sends new counters all the time. So an
    echo counts if it is new and not more than `MOST_BEHIND` commands behind. Before the first echo
    `heard_ns` is as given.
    """

    __slots__ = ("_counter", "_sent", "_status_ns", "heard_ns")

    def __init__(self, heard_ns: int = NEVER_HEARD_NS) -> None:
        self.heard_ns = heard_ns  #: When the last echo came that counts.
        self._counter: int | None = None
        self._sent: int | None = None
        self._status_ns = heard_ns

    def sent(self, counter: int) -> None:
        """Note the counter of the command that leaves."""
        self._sent = counter

    def heard(self, counter: int | None, now_ns: int) -> None:
        """Take the counter in a status that came at `now_ns`; None where there is none yet."""
        if now_ns == self._status_ns:  # the same status
            return
        self._status_ns = now_ns
        if counter is None or counter == self._counter or self._sent is None:
            return
        self._counter = counter
        if (self._sent - counter) & _COUNTER_MASK <= MOST_BEHIND:
            self.heard_ns = now_ns
