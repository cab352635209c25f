"""Several simulated buses between the same nodes."""

from utank_hil.canbus.frame import BUS_SHIFT, OTHER_BUS, Frame
from utank_hil.runners.bus_model import SimulatedBus
from utank_hil.runners.lockstep import Bus


class SeveralBuses:
    """The controller's own bus and more of them: a frame's identifier tells which carries it."""

    def __init__(self, first: Bus, more: int, bit_rate: int) -> None:
        self._buses = (first, *(SimulatedBus(bit_rate) for _ in range(more)))

    def queue(self, sender: int, frame: Frame, now_ns: int) -> None:
        """Take a frame to be sent on its bus."""
        bare = Frame(frame.can_id & (OTHER_BUS - 1), frame.data)
        self._buses[frame.can_id >> BUS_SHIFT].queue(sender, bare, now_ns)

    def carry_until(self, before_ns: int) -> list[tuple[int, int, Frame]]:
        """Advance, and return what has arrived on any bus, oldest first."""
        arrived = [
            (time_ns, sender, Frame(number << BUS_SHIFT | frame.can_id, frame.data))
            for number, bus in enumerate(self._buses)
            for time_ns, sender, frame in bus.carry_until(before_ns)
        ]
        return sorted(arrived, key=lambda each: each[0])

    def load(self, now_ns: int) -> float:
        """Return the load of the controller's own bus."""
        return self._buses[0].load(now_ns)


def with_more(first: Bus, more: int, bit_rate: int) -> Bus:
    """The bus itself, or with more beside it."""
    return SeveralBuses(first, more, bit_rate) if more else first
