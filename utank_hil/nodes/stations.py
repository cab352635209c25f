"""The operator stations: one is in command at a time, and every one can stop.

The first station has the command until the second, where the ship's file declares one, asks for it,
and gets it back the same way. A station takes it only with a live heartbeat of the controller's own
versions. What a station's levers say counts from when it has the command: one that takes it while
the controller is active sends the mode that it finds, with the arm bit set, or else it disarms.
Stop and disarm act from either, declared or not. Alarms can be accepted at both, and retuning be
forbidden.
"""

from typing import Final

from utank_hil.canbus import (
    Address,
    Catalogue,
    Heartbeat,
    Mode,
    OperatorCommand,
    RetuningOrder,
    Station,
)
from utank_hil.canbus.measurements import Wishes
from utank_hil.nodes.orders import Orders
from utank_hil.nodes.plausibility import NEVER_HEARD_NS

ADDRESSES: Final = {
    Station.OPERATOR: Address.OPERATOR,
    Station.OPERATOR_2: Address.OPERATOR_2,
}
LIVE_NS: Final = 600_000_000
"""A station whose heartbeat is older takes no command: six of its cycles."""


class Stations:
    """The orders of all stations.

    Parameters
    ----------
    catalogue : Catalogue
    versions : tuple of int
        Of the controller's catalogue and configuration.
    second : bool
        Whether the second station may take the command.

    Attributes
    ----------
    orders : dict of Orders by Station
    in_command : Station
    """

    def __init__(
        self, catalogue: Catalogue, versions: tuple[int, int], *, second: bool = False
    ) -> None:
        self._versions, self._second = versions, second
        self._beats_ns = dict.fromkeys(ADDRESSES, NEVER_HEARD_NS)
        self._matches = dict.fromkeys(ADDRESSES, False)
        self.orders = {
            station: Orders(catalogue.receiver(OperatorCommand, address))
            for station, address in ADDRESSES.items()
        }
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
        self._matches[station] = (
            beat.catalogue_version,
            beat.configuration_version,
        ) == self._versions

    def started(self, address: int) -> None:
        """Note that the panel with an address has claimed it."""
        for station, orders in self.orders.items():
            if ADDRESSES[station] == address:
                orders.begin_anew()

    def take(self, now_ns: int) -> Wishes:
        """Return what was ordered since the last call; stop and disarm of any station count."""
        wishes = self._leads.take()
        if not self._watches.news:
            return wishes._replace(stop=True) if self._watches.holds_stop(now_ns) else wishes
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
        declared = self._second or station is Station.OPERATOR
        live = now_ns - self._beats_ns[station] <= LIVE_NS
        return declared and live and self._matches[station]

    def take_retuning(self, now_ns: int) -> RetuningOrder:
        """Return what was ordered of the retuning since the last call; each station can forbid it.

        Who takes the command does not lift what the other forbids, and can't know of it.
        """
        order = self._leads.take_retuning()
        if self._watches.forbids_retuning(now_ns):
            return order._replace(forbidden=True)
        return order

    def take_accepted(self) -> list[int | None]:
        """Return the codes of the alarms accepted at any station since the last call."""
        others = self._watches.take_accepted()
        return self._leads.take_accepted() + (others if self._second else [])
