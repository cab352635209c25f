"""The operator stations: one is in command at a time, and every one can stop.

The first station has the command until the second asks for it, and gets it back the same way. So a
ship with one station needs to know nothing of this. What a station's levers say counts from when it
has the command: one that takes it while the controller is active sends the mode that it finds, with
the arm bit set, or else it disarms. Alarms can be accepted at both, and retuning be forbidden.
"""

from typing import Final

from utank_hil.canbus import Address, Catalogue, Mode, OperatorCommand, RetuningOrder, Station
from utank_hil.canbus.measurements import Wishes
from utank_hil.nodes.orders import Orders

ADDRESSES: Final = {
    Station.OPERATOR: Address.OPERATOR,
    Station.OPERATOR_2: Address.OPERATOR_2,
}


class Stations:
    """The orders of all stations.

    Parameters
    ----------
    catalogue : Catalogue

    Attributes
    ----------
    orders : dict of Orders by Station
    in_command : Station
    """

    def __init__(self, catalogue: Catalogue) -> None:
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
        """When the last accepted frame of the station in command came."""
        return self._leads.heard_ns

    def started(self, address: int) -> None:
        """Note that the panel with an address has claimed it."""
        for station, orders in self.orders.items():
            if ADDRESSES[station] == address:
                orders.begin_anew()

    def take(self, now_ns: int) -> Wishes:
        """Return what was ordered since the last call; a stop of any station counts."""
        wishes = self._leads.take()
        if not self._watches.news:
            return wishes._replace(stop=True) if self._watches.holds_stop(now_ns) else wishes
        takes_command = self._watches.takes_command
        other = self._watches.take()
        stop = wishes.stop or other.stop
        if not takes_command:
            return wishes._replace(stop=stop)
        self._leads, self._watches = self._watches, self._leads
        self.in_command = next(
            station for station, orders in self.orders.items() if orders is self._leads
        )
        self._leads.take_retuning()  # what was pressed without the command was no order
        # what either has disarmed since the last call stays disarmed
        armed = wishes.armed and other.armed
        return Wishes(armed, stop, arm_edge=False, reset_edge=False, passive_edge=False)

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
        return self._leads.take_accepted() + self._watches.take_accepted()
