"""The operator stations: one is in command at a time, and every one can stop.

The first station has the command until the second, where the ship's file declares one, asks for it,
and gets it back the same way. A station takes it only with a live heartbeat of the controller's own
versions. What a station's levers say counts from when it has the command: one that takes it while
the controller is active sends the mode that it finds, with the arm bit set, or else it disarms.
Stop, disarm and a ban on retuning act from either, declared or not; alarms can be accepted at both
where the second is declared.
"""

from typing import Final

from utank_hil.canbus import (
    Address,
    Catalogue,
    Frame,
    Heartbeat,
    Mode,
    OperatorCommand,
    Receiver,
    RetuningOrder,
    Station,
)
from utank_hil.canbus.endpoints import MAX_LOST, Rejection
from utank_hil.canbus.measurements import Wishes
from utank_hil.canbus.profiles.acting import ProfiledPanel
from utank_hil.nodes.plausibility import NEVER_HEARD_NS

_NOTHING: Final = RetuningOrder()
_ACTIVE: Final = Mode.ACTIVE
_PASSIVE: Final = Mode.PASSIVE
# a NamedTuple's own constructor takes twice the time
_new: Final = tuple.__new__


class Orders:
    """What the operator orders, from the frames of one panel.

    Only an accepted frame can ask for something. Whatever says stop or disarms acts from any intact
    frame, in or out of sequence: after a gap the first frames are not accepted, and a stop is not
    to wait for them, nor to be lost with them. What a frame says between two looks is kept for the
    next.

    A bit that is set in the first frame is no edge: nobody knows when it was pressed. Nor is one in
    the first frame after a gap longer than the counter bridges, or of a panel that has started
    anew: it has claimed its address, or frames before it were out of sequence.
    """

    def __init__(self, receiver: Receiver[OperatorCommand] | ProfiledPanel) -> None:
        self.receiver = receiver
        self._gap_ns = (MAX_LOST + 1) * receiver.cycle_ns
        self.requested_mode = Mode.STANDBY
        self.last: OperatorCommand | None = None  #: Latest accepted frame,
        self.heard_ns = NEVER_HEARD_NS  #: and when it came.
        self._stop_heard = self._disarm_heard = False
        self._arm_edge = self._reset_edge = self._passive_edge = False
        self._anew = True
        self._out_of_sequence = 0
        self._retuning = _NOTHING
        self._accepted: list[int | None] = []
        #: Since the last `take`: whether a frame came, the wish for the command rose, or an intact
        #: frame disarmed what an accepted one had armed.
        self.news = self.takes_command = self.lets_go = False
        self._lasting = Wishes()  # without edges

    def accept(self, frame: Frame) -> OperatorCommand | None:
        """Return the message of a frame, None if it is rejected; hear its stop or disarm."""
        receiver = self.receiver
        assert isinstance(receiver, Receiver)
        order = receiver.accept(frame)
        heard = order or receiver.intact(frame)
        if heard is not None:
            self.overhear(heard)
        return order

    def overhear(self, heard: OperatorCommand) -> None:
        """Take a stop, or what disarms, of an intact frame."""
        self.news = True
        self._stop_heard |= heard.stop
        # where it was not pressed before, what is pressed later in the tick counts
        before = self.last is None or _arms(self.last)
        disarms = before and not _arms(heard)
        self._disarm_heard |= disarms
        self.lets_go |= disarms and self.last is not None

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
            before, self._arm_edge = order, False
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
        self.receiver.changed(order != before)
        self.last, self.heard_ns = order, now_ns
        self.requested_mode = Mode.STANDBY if asked is None else asked

    def recent(self, now_ns: int) -> OperatorCommand | None:
        """The last accepted frame, if that is not long ago."""
        return self.last if now_ns - self.heard_ns <= self._gap_ns else None

    def take(self) -> Wishes:
        """Return what was ordered since the last call."""
        if not self.news:
            return self._lasting
        last, proved = self.last, self.receiver.proved
        armed, stop = last is not None and last.arm, last is not None and last.stop
        wishes = (
            armed and proved and not self._disarm_heard,
            self._stop_heard or stop,
            self._arm_edge and proved,
            self._reset_edge,
            self._passive_edge,
        )
        self._lasting = Wishes(armed and proved, stop)
        # an arm that was pressed waits for its proof, but no stop or disarm between
        waits = armed and not (proved or self._stop_heard or stop or self._disarm_heard)
        self._arm_edge = self._arm_edge and waits
        self._stop_heard = self._disarm_heard = False
        self._reset_edge = self._passive_edge = False
        self.news = self.takes_command = self.lets_go = False
        return _new(Wishes, wishes)

    def take_retuning(self) -> RetuningOrder:
        """Return what was ordered of the retuning since the last call, a sample of the law ago."""
        order, last = self._retuning, self.last
        self._retuning = _NOTHING
        return order if last is None or not last.forbid_retuning else order._replace(forbidden=True)

    def take_accepted(self) -> list[int | None]:
        """Return the codes of the alarms that were accepted since the last call; None for all."""
        accepted, self._accepted = self._accepted, []
        return accepted


def _arms(order: OperatorCommand) -> bool:
    """Whether it asks for the law; any other mode disarms, too."""
    return order.arm and order.mode_request is _ACTIVE


ADDRESSES: Final = {Station.OPERATOR: Address.OPERATOR, Station.OPERATOR_2: Address.OPERATOR_2}
LIVE_NS: Final = 600_000_000
"""A station whose heartbeat is older takes no command: six of its cycles."""


class Stations:
    """The orders of all stations.

    `versions` are those of the controller's catalogue and configuration; `second` says whether the
    second station may take the command. The first is the `panel` of another maker, if there is one.
    """

    def __init__(
        self,
        catalogue: Catalogue,
        versions: tuple[int, int],
        *,
        second: bool = False,
        panel: ProfiledPanel | None = None,
    ) -> None:
        self._versions, self._second = versions, second
        self._beats_ns = dict.fromkeys(ADDRESSES, NEVER_HEARD_NS)
        self._matches = dict.fromkeys(ADDRESSES, False)
        self.orders = {
            station: Orders(catalogue.receiver(OperatorCommand, address))
            for station, address in ADDRESSES.items()
        }
        if panel is not None:
            self.orders[Station.OPERATOR] = orders = Orders(panel)
            panel.overhear, panel.deliver = orders.overhear, self._obey
        self.in_command = Station.OPERATOR
        self._leads = self.orders[Station.OPERATOR]
        self._watches = self.orders[Station.OPERATOR_2]

    @property
    def requested_mode(self) -> Mode:
        """Mode that the station in command asks for."""
        return self._leads.requested_mode

    @property
    def heard_ns(self) -> int:
        """When the station in command was last heard: the older of its order and its heartbeat."""
        return min(self._leads.heard_ns, self._beats_ns[self.in_command])

    @property
    def matches(self) -> bool:
        """Whether the station in command runs the controller's versions."""
        return self._matches[self.in_command]

    def beat(self, station: Station, beat: Heartbeat, now_ns: int) -> None:
        """Take the heartbeat of a station's panel."""
        self._beats_ns[station] = now_ns
        versions = beat.catalogue_version, beat.configuration_version
        self._matches[station] = versions == self._versions

    def _obey(self, order: OperatorCommand, now_ns: int) -> None:
        """Take an order of a panel of another maker: it is the ship's, well and alive."""
        self._beats_ns[Station.OPERATOR], self._matches[Station.OPERATOR] = now_ns, True
        self.orders[Station.OPERATOR].obey(order, now_ns)

    def started(self, address: int) -> None:
        """Note that the panel with an address has claimed it."""
        for station, orders in self.orders.items():
            if ADDRESSES[station] == address:
                orders.begin_anew()

    def take(self, now_ns: int) -> Wishes:
        """Return what was ordered since the last call; stop and disarm of any station count."""
        wishes = self._leads.take()
        if not self._watches.news:
            last = self._watches.recent(now_ns)
            return wishes if last is None or not last.stop else wishes._replace(stop=True)
        takes_command = self._watches.takes_command and self._may_lead(now_ns)
        lets_go = self._watches.lets_go
        other = self._watches.take()
        stop = wishes.stop or other.stop
        if not takes_command:
            return wishes._replace(stop=stop, armed=wishes.armed and not lets_go)
        self._leads, self._watches = self._watches, self._leads
        self.in_command = next(
            station for station, orders in self.orders.items() if orders is self._leads
        )
        self._leads.take_retuning()  # what was pressed without the command was no order
        # what either has disarmed since the last call stays disarmed
        armed = wishes.armed and other.armed
        return Wishes(armed, stop, arm_edge=False, reset_edge=False, passive_edge=False)

    def _may_lead(self, now_ns: int) -> bool:
        """Whether the station that watches may take the command."""
        station = next(each for each in ADDRESSES if each is not self.in_command)
        live = now_ns - self._beats_ns[station] <= LIVE_NS  # pragma: no mutate: a tick more or less
        return self._second and live and self._matches[station]

    def take_retuning(self, now_ns: int) -> RetuningOrder:
        """Return what was ordered of the retuning since the last call; each station can forbid it.

        Who takes the command does not lift what the other forbids, and can't know of it.
        """
        order, last = self._leads.take_retuning(), self._watches.recent(now_ns)
        return order if last is None or not last.forbid_retuning else order._replace(forbidden=True)

    def take_accepted(self) -> list[int | None]:
        """Return the codes of the alarms accepted at any station since the last call."""
        others = self._watches.take_accepted()
        return self._leads.take_accepted() + (others if self._second else [])
