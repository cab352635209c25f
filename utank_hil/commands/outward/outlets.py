"""Where alarms and state go: addresses as given on the command line, and what serves them."""

import socket
import time
from collections.abc import Callable, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from datetime import UTC, datetime
from ipaddress import IPv4Address
from typing import Final
from urllib.parse import parse_qs, urlsplit

from utank_hil.base.closing import Closing
from utank_hil.canbus import AlarmState, Fault
from utank_hil.canbus.events import AlarmEvent
from utank_hil.commands.outward.alerts import Alerts, Framing
from utank_hil.commands.outward.registers import ModbusServer, State
from utank_hil.telemetry.ring import RingKind, RingReader, RowReader, ring_names

KINDS: Final = ("udp", "iec450", "modbus")
CYCLE_S: Final = 30.0  #: Longest time between two lists of alerts (IEC 62923-1).
STALE_S: Final = 2.0  #: Age of the last telemetry row, at 20 Hz, after which nothing is known.
_MOST_BYTES: Final = 1500  #: Of a datagram on Ethernet.
_MOST_COMMANDS: Final = 64  #: Datagrams of one look: a flood must not hold up the alarms.
_FORM: Final = "write udp://ADDRESS:PORT, iec450://ADDRESS:PORT or modbus://ADDRESS:PORT"

Address = tuple[str, int]


@dataclass(frozen=True, slots=True)
class Outlet:
    """One address: sentences by UDP, with the header of IEC 61162-450 or without, or Modbus TCP."""

    kind: str
    address: Address
    hear: Address | None = None  #: Where commands (ACN) arrive; None: at the sender's own port.


def read_outlet(text: str) -> Outlet:
    """Read an address; ValueError says what is wrong with it and what to write."""
    parts = urlsplit(text)
    if parts.scheme not in KINDS:
        raise ValueError(f"{text!r}: {_FORM}")
    address = _address(text, parts.netloc)
    options = parse_qs(parts.query, keep_blank_values=True)
    allowed = set() if parts.scheme == "modbus" else {"hear"}
    if parts.path or parts.fragment or set(options) - allowed:
        raise ValueError(f"{text!r}: only ?hear=ADDRESS:PORT may follow, and of sentences only")
    hear = [_address(text, each) for each in options.get("hear", [])]
    return Outlet(parts.scheme, address, hear[-1] if hear else None)


def _address(text: str, written: str) -> Address:
    host, _, port = written.rpartition(":")
    try:
        address = (str(IPv4Address(host)), int(port))
    except ValueError as error:
        raise ValueError(f"{text!r}: {error}; {_FORM}, such as 127.0.0.1:10110") from error
    if not 0 < address[1] < 65536:
        raise ValueError(f"{text!r}: a port is a number from 1 to 65535")
    return address


class _Udp:
    """Sends messages to one address and takes commands."""

    def __init__(self, outlet: Outlet) -> None:
        self._to, self._framing = outlet.address, Framing(outlet.kind == "iec450")
        self.failed = ""  #: Why the last message was not sent.
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.setblocking(False)
        if outlet.hear is None:
            return
        host, _ = outlet.hear
        try:
            self._socket.bind(outlet.hear)
            if IPv4Address(host).is_multicast:
                group = IPv4Address(host).packed + bytes(4)
                self._socket.setsockopt(socket.IPPROTO_IP, socket.IP_ADD_MEMBERSHIP, group)
        except OSError as error:
            self._socket.close()
            raise OSError(f"hear={host}:{outlet.hear[1]}: {error.strerror}") from error

    def send(self, message: list[str]) -> None:
        try:
            self._socket.sendto(self._framing.datagram(message), self._to)
            self.failed = ""
        except OSError as error:
            self.failed = f"udp to {self._to[0]}:{self._to[1]}: {error.strerror}"

    def commands(self) -> list[str]:
        found: list[str] = []
        for _ in range(_MOST_COMMANDS):
            try:
                found += self._framing.lines(self._socket.recv(_MOST_BYTES))
            except BlockingIOError:
                break
            except OSError:  # A former message found no listener at its address.
                continue
        return found

    def close(self) -> None:
        self._socket.close()


class Outward(Closing):
    """Everything that a run shows outward; an outlet that fails is said, and the rest goes on."""

    def __init__(self, outlets: Sequence[Outlet], pid: int, say: Callable[[str], None]) -> None:
        self._pid, self._say = pid, say
        self._alerts, self._alarms = Alerts(), dict[Fault, AlarmState]()
        self._rows: RowReader | None = None
        self._state = State({}, self._alarms, 0, complete=True)
        self._fresh_s = self._listed_s = -CYCLE_S
        self._udp: list[_Udp] = []
        self._modbus: list[ModbusServer] = []
        self._said: set[str] = set()
        self._stack = ExitStack()
        for outlet in outlets:
            try:
                if outlet.kind == "modbus":
                    server = ModbusServer(outlet.address, self._state)
                    self._modbus.append(server)
                    self._stack.callback(server.close)
                else:
                    self._udp.append(udp := _Udp(outlet))
                    self._stack.callback(udp.close)
            except OSError as error:
                say(f"not shown outward: {error}")

    def take(self, event: AlarmEvent, utc: datetime) -> None:
        """Show the change of an alarm."""
        if event.state is AlarmState.NORMAL:
            self._alarms.pop(event.code, None)
        elif event.state is not None:
            self._alarms[event.code] = event.state
        self._send(self._alerts.take(event, utc))

    def look(self, lost: int) -> None:
        """Do what is due: answers, the cyclic list, and the latest state."""
        for udp in self._udp:
            for line in udp.commands():
                self._send(self._alerts.answer(line, datetime.now(UTC)))
        now_s = time.monotonic()
        if now_s - self._listed_s >= CYCLE_S:
            self._listed_s = now_s
            self._send([self._alerts.cyclic()])
        if self._modbus:
            self._state.complete = lost == 0
            self._renew(now_s)
            for server in self._modbus:
                server.show(self._state)

    def _send(self, messages: list[list[str]]) -> None:
        for udp in self._udp:
            for message in messages:
                udp.send(message)
            if udp.failed and udp.failed not in self._said:
                self._said.add(udp.failed)
                self._say(f"not shown outward: {udp.failed}")

    def _renew(self, now_s: float) -> None:
        if self._rows is None:
            self._rows = _rows_of(self._pid)
        rows = None if self._rows is None else self._rows.read_rows()
        if self._rows is not None and rows is not None and len(rows):
            self._state.row = dict(zip(self._rows.columns, map(float, rows[-1]), strict=True))
            self._state.life = (self._state.life + 1) % 65536
            self._fresh_s = now_s
        elif now_s - self._fresh_s > STALE_S:
            self._state.row = {}

    def close(self) -> None:
        """End all; idempotent."""
        self._stack.close()
        if self._rows is not None:
            self._rows.close()
            self._rows = None


def _rows_of(pid: int) -> RowReader | None:
    for name in ring_names():
        try:
            with RingReader(name) as ring:
                if ring.writer_pid != pid or ring.kind is not RingKind.ROWS:
                    continue
            return RowReader(name)
        except OSError:  # It has ended, or belongs to another user.
            continue
    return None
