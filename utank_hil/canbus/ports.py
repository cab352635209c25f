"""CAN interfaces: their bit rate, and several as one port; no frame goes from one to another."""

import json
import subprocess
from collections.abc import Sequence

from utank_hil.canbus.frame import BUS_SHIFT, OTHER_BUS, Frame, Port, PortError
from utank_hil.canbus.line_names import LINES, SLCAN, tty_and_bit_rate
from utank_hil.canbus.profiles.device_plan import ForeignDevices


def why_other_bit_rate(channel: str, bit_rate: int) -> str:
    """Return why an interface does not run at a bit rate; empty if it does.

    Also empty where `ip` (iproute2) tells none: it is missing, or the interface is virtual.
    """
    words = ["ip", "-details", "-json", "link", "show", channel]
    remedy = f"ip link set {channel} type can bitrate {bit_rate}"
    try:
        if channel.startswith(SLCAN):
            tty, found = tty_and_bit_rate(channel)
            remedy = f"{SLCAN}{tty}:{bit_rate}"
        else:
            said = subprocess.run(words, capture_output=True, check=True, timeout=5).stdout
            found = int(json.loads(said)[0]["linkinfo"]["info_data"]["bittiming"]["bitrate"])
    except (OSError, subprocess.SubprocessError, ValueError, LookupError, TypeError):
        return ""
    if found == bit_rate:
        return ""
    return (
        f"is {bit_rate}, but {channel} runs at {found}: load and delay would be judged by the "
        f"wrong one; give both the same ({remedy})"
    )


class BusPorts:
    """The controller's own interface, the first, and others, whose frames carry their numbers.

    An error of another one is kept in `errors`, by its number, until it is taken; the devices on it
    fall silent.
    """

    def __init__(self, ports: Sequence[Port]) -> None:
        self._ports = tuple(ports)
        self.errors: dict[int, PortError] = {}
        self._told: dict[int, str] = {}
        self._pending: PortError | None = None

    @property
    def others(self) -> int:
        """Frames of other kinds on the controller's own interface."""
        return self._ports[0].others

    def send(self, frame: Frame) -> None:
        """Queue one frame on its interface."""
        number = frame.can_id >> BUS_SHIFT
        self._ports[number].send(Frame(frame.can_id & (OTHER_BUS - 1), frame.data))

    def receive(self) -> Sequence[Frame]:
        """Frames of all interfaces; an error beside frames is raised by the next call."""
        frames: list[Frame] = []
        if self._pending is None:
            for number, port in enumerate(self._ports):
                try:
                    heard = port.receive()
                except PortError as error:
                    if number:
                        self.errors[number] = error
                    else:
                        self._pending = error
                    continue
                if number:
                    tag = number << BUS_SHIFT
                    frames += [Frame(tag | each.can_id, each.data) for each in heard]
                else:
                    frames += heard
        if self._pending is not None and not frames:
            try:
                raise self._pending  # held by a variable here it would never be freed
            finally:
                self._pending = None
        return frames

    def take_errors(self) -> list[PortError]:
        """New errors of interfaces but the controller's own; one that lasts is told once."""
        new = [each for number, each in self.errors.items() if str(each) != self._told.get(number)]
        self._told = {number: str(each) for number, each in self.errors.items()}
        self.errors.clear()
        return new

    def close(self) -> None:
        """Release all interfaces; idempotent."""
        for port in self._ports:
            port.close()


def open_port(own: str, foreign: ForeignDevices) -> Port:
    """Open the controller's own interface and those of devices on others (`open_buses`)."""
    from utank_hil.canbus.socketcan import SocketCanPort

    if own.startswith(LINES):
        raise PortError(f"{own} only brings sentences: name a CAN interface")
    return open_buses(own, foreign) if foreign.any else SocketCanPort(own)


def open_buses(own: str, foreign: ForeignDevices, *, sends: bool = False) -> BusPorts:
    """Open the controller's own interface and those of the ship's devices.

    With `sends` it is the devices' side, which sends where the controller is not to. PortError is
    raised if an interface is missing, or the controller's own stands in the ship's file, too.
    """
    from utank_hil.canbus.socketcan import SocketCanPort

    if own in foreign.buses:
        raise PortError(f"CAN interface {own}: is the controller's own: leave out bus: {own}")
    ports: list[SocketCanPort] = []
    try:
        for name in (own, *foreign.buses[1:]):
            silent = name in foreign.receive_only and not sends
            port = SocketCanPort(name, standard=True, receive_only=silent, emulates=sends)
            ports.append(port)
    except PortError:
        for port in ports:
            port.close()
        raise
    return BusPorts(ports)
