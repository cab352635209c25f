"""What the operator orders, from the frames of a panel.

Only an accepted frame can ask for something. Whatever says stop or disarms acts from any intact
frame, in or out of sequence: after a gap the first frames are not accepted, and a stop is not to
wait for them, nor to be lost with them. What a frame says between two looks is kept for the next.
"""

from typing import Final

from utank_hil.canbus import Frame, Mode, OperatorCommand, Receiver, RetuningOrder
from utank_hil.canbus.endpoints import MAX_LOST, Rejection
from utank_hil.canbus.measurements import Wishes
from utank_hil.nodes.plausibility import NEVER_HEARD_NS

_NOTHING: Final = RetuningOrder()
_ACTIVE: Final = Mode.ACTIVE
_PASSIVE: Final = Mode.PASSIVE
# a NamedTuple's own constructor takes twice the time
_new: Final = tuple.__new__


class Orders:
    """The orders of one panel.

    A bit that is set in the first frame is no edge: nobody knows when it was pressed. Nor is one in
    the first frame after a gap longer than the counter bridges, or of a panel that has started
    anew: it has claimed its address, or frames before it were out of sequence.

    Parameters
    ----------
    receiver : Receiver of OperatorCommand

    Attributes
    ----------
    receiver : Receiver of OperatorCommand
        As given.
    requested_mode : Mode
        Mode the operator wants; STANDBY as long as none was asked for.
    last : OperatorCommand or None
        Latest accepted frame.
    heard_ns : int
        When it came.
    changes : int
        Accepted frames so far whose content was new: they come on top of the cycle's.
    news : bool
        Whether a frame has come since the last `take`.
    takes_command : bool
        Rising edge of the wish for the command since the last `take`.
    lets_go : bool
        An intact frame since the last `take` disarmed what an accepted one had armed.
    """

    def __init__(self, receiver: Receiver[OperatorCommand]) -> None:
        self.can_id = receiver.can_id
        self.receiver = receiver
        self.cycle_ns = receiver.cycle_ns
        self.rejected = receiver.rejected
        self.changes = 0
        self._gap_ns = (MAX_LOST + 1) * receiver.cycle_ns
        self.requested_mode = Mode.STANDBY
        self.last: OperatorCommand | None = None
        self.heard_ns = NEVER_HEARD_NS
        self._stop_heard = self._disarm_heard = False
        self._arm_edge = self._reset_edge = self._passive_edge = False
        self._anew = True
        self._out_of_sequence = 0
        self._retuning = _NOTHING
        self._accepted: list[int | None] = []
        self.news = self.takes_command = self.lets_go = False
        self._lasting = Wishes()  # without edges

    @property
    def heard(self) -> int:
        """Accepted frames so far."""
        return self.receiver.heard

    @property
    def lost(self) -> int:
        """Frames so far that are missing by the counter."""
        return self.receiver.lost

    def accept(self, frame: Frame) -> OperatorCommand | None:
        """Return the message of a frame, None if it is rejected; hear its stop or disarm."""
        order = self.receiver.accept(frame)
        heard = order or self.receiver.intact(frame)
        if heard is not None:
            self.news = True
            self._stop_heard |= heard.stop
            # where it was not pressed before, what is pressed later in the tick counts
            before = self.last is None or _arms(self.last)
            disarms = before and not _arms(heard)
            self._disarm_heard |= disarms
            self.lets_go |= disarms and self.last is not None
        return order

    def begin_anew(self) -> None:
        """Take no bit of the next frame for an edge: the panel has started."""
        self._anew = True

    def obey(self, order: OperatorCommand, now_ns: int) -> None:
        """Take an accepted message."""
        rejected = self.receiver.rejected
        out_of_sequence = rejected[Rejection.SEQUENCE] + rejected[Rejection.REPEATED]
        self._anew |= out_of_sequence != self._out_of_sequence
        self._out_of_sequence = out_of_sequence
        before = self.last
        if before is None or self._anew or now_ns - self.heard_ns > self._gap_ns:
            before = order
        self._anew = False
        asked = order.mode_request
        self._passive_edge |= asked is _PASSIVE and before.mode_request is not _PASSIVE
        self._arm_edge |= order.arm and not before.arm
        self._reset_edge |= order.reset and not before.reset
        self.takes_command |= order.take_command and not before.take_command
        if order.acknowledge and not before.acknowledge:
            self._accepted.append(order.acknowledge_code)
        retune, undo, forbidden = self._retuning
        self._retuning = RetuningOrder(
            retune or (order.retune and not before.retune),
            undo or (order.undo and not before.undo),
            forbidden or order.forbid_retuning,
        )
        self.changes += order != before
        self.last, self.heard_ns = order, now_ns
        self.requested_mode = Mode.STANDBY if asked is None else asked

    def holds_stop(self, now_ns: int) -> bool:
        """Whether the stop bit is set in the last accepted frame, and that is not long ago."""
        return self.last is not None and self.last.stop and self._is_fresh(now_ns)

    def forbids_retuning(self, now_ns: int) -> bool:
        """Whether that frame forbids retuning, likewise."""
        return self.last is not None and self.last.forbid_retuning and self._is_fresh(now_ns)

    def _is_fresh(self, now_ns: int) -> bool:
        return now_ns - self.heard_ns <= self._gap_ns

    def take(self) -> Wishes:
        """Return what was ordered since the last call."""
        if not self.news:
            return self._lasting
        last = self.last
        armed, stop = last is not None and last.arm, last is not None and last.stop
        wishes = (
            armed and not self._disarm_heard,
            self._stop_heard or stop,
            self._arm_edge,
            self._reset_edge,
            self._passive_edge,
        )
        self._lasting = Wishes(armed, stop)
        self._stop_heard = self._disarm_heard = False
        self._arm_edge = self._reset_edge = self._passive_edge = False
        self.news = self.takes_command = self.lets_go = False
        return _new(Wishes, wishes)

    def take_retuning(self) -> RetuningOrder:
        """Return what was ordered of the retuning since the last call, a sample of the law ago."""
        order, last = self._retuning, self.last
        self._retuning = _NOTHING
        if last is not None and last.forbid_retuning:
            return order._replace(forbidden=True)
        return order

    def take_accepted(self) -> list[int | None]:
        """Return the codes of the alarms that were accepted since the last call; None for all."""
        accepted, self._accepted = self._accepted, []
        return accepted


def _arms(order: OperatorCommand) -> bool:
    """Whether it asks for the law; any other mode disarms, too."""
    return order.arm and order.mode_request is _ACTIVE
