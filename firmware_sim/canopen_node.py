"""An emulated CANopen node: object dictionary, network management, SDO server, PDOs, heartbeats."""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import Any

from utank_hil.canbus import Frame
from utank_hil.canbus.frame import BUS_SHIFT, LONGEST_ID, STANDARD
from utank_hil.canbus.profiles import drive_plan as cia
from utank_hil.canbus.profiles.device_plan import DevicePlan
from utank_hil.canbus.profiles.drive_plan import NetworkState, Place

MS_NS = 1_000_000
_STATES: dict[int, NetworkState] = {
    cia.NodeCommand.START: NetworkState.OPERATIONAL,
    cia.NodeCommand.STOP: NetworkState.STOPPED,
    cia.NodeCommand.PRE_OPERATIONAL: NetworkState.PRE_OPERATIONAL,
    0x81: NetworkState.BOOT_UP,  # reset of the application
    0x82: NetworkState.BOOT_UP,  # and of the communication
}


@dataclass(slots=True)
class Entry:
    """One entry: its value without sign, its bytes, and whether it may be written."""

    value: int
    size: int
    writable: bool = False

    @property
    def signed(self) -> int:
        """The value with its sign."""
        half = 1 << 8 * self.size - 1
        return (self.value ^ half) - half


class CanopenNode:
    """What every node does, by its object dictionary `entries`.

    `lost_controller` is set while the heartbeat that 1016h names has ended.
    """

    def __init__(
        self, node: int, bus: int, entries: dict[Place, Entry], pdos: dict[int, int]
    ) -> None:
        self.node, self.entries, self._pdos = node, entries, pdos
        self._tag = bus << BUS_SHIFT | STANDARD
        self.state = NetworkState.BOOT_UP
        self._out: list[Frame] = []
        self.lost_controller = False
        self._beat_ns: dict[int, int] = {}  # of other nodes, from their first heartbeat on
        self._next_beat_ns = 0
        self._sent = [index for index in pdos if index >= 0x1800]
        self._next_event_ns = dict.fromkeys(self._sent, 0)
        for kind, size in ((2, 1), (3, 2), (4, 4), (5, 1), (6, 2), (7, 4)):
            entries[Place(kind)] = Entry(0, size)  # types, which fill gaps of a PDO
        entries[Place(0x1000)] = Entry(0, 4)
        entries[Place(0x1001)] = Entry(0, 1)
        entries[Place(0x1016)] = Entry(1, 1)
        entries[Place(0x1016, 1)] = Entry(0, 4, writable=True)
        entries[Place(0x1017)] = Entry(0, 2, writable=True)
        for index, cob in pdos.items():
            entries[Place(index, 1)] = Entry(cob, 4, writable=True)
            entries[Place(index, 2)] = Entry(cia.ASYNCHRONOUS, 1, writable=True)
            entries[Place(index + 0x200)] = Entry(0, 1, writable=True)
            for subindex in range(1, 9):
                entries[Place(index + 0x200, subindex)] = Entry(0, 4, writable=True)
            if index >= 0x1800:  # as delivered they are held back
                entries[Place(index, 3)] = Entry(300, 2, writable=True)
                entries[Place(index, 5)] = Entry(0, 2, writable=True)

    @property
    def canopen(self) -> tuple["CanopenNode", ...]:
        """Itself."""
        return (self,)

    @property
    def hears(self) -> frozenset[int]:
        """Identifiers that the node takes; heartbeats are those of any node."""
        own = (cia.NMT, cia.SYNC, cia.RECEIVED_1 + self.node, cia.SDO_REQUEST + self.node)
        beats = (cia.HEARTBEAT + node for node in range(1, 128) if node != self.node)
        return frozenset(self._tag | cob for cob in (*own, *beats))

    def receive(self, frame: Frame, now_ns: int) -> None:
        """Take a frame."""
        cob, data = frame.can_id & 0x7FF, frame.data
        if frame.can_id != self._tag | cob:
            return
        if cob == cia.NMT and len(data) == 2 and data[1] in (0, self.node):
            self.state = _STATES.get(data[0], self.state)
        elif cob == cia.SYNC:
            self._send_pdos(range(1, 241), self._sent)
        elif cob == cia.SDO_REQUEST + self.node and len(data) == 8:
            if self.state in (NetworkState.OPERATIONAL, NetworkState.PRE_OPERATIONAL):
                self._say(cia.SDO_ANSWER + self.node, self._serve(data))
        elif cob > cia.HEARTBEAT:
            self._beat_ns[cob - cia.HEARTBEAT] = now_ns
        elif self.state is NetworkState.OPERATIONAL and (
            0x1400 in self._pdos and cob == self.entries[Place(0x1400, 1)].value
        ):  # a PDO that is disabled has another identifier
            self._take_pdo(data, now_ns)

    def tick(self, now_ns: int) -> list[Frame]:
        """What is due: heartbeat, PDOs by event timer, and all that was said since."""
        consumed = self.entries[Place(0x1016, 1)].value
        came_ns = self._beat_ns.get(consumed >> 16 & 0x7F)
        late_ns = (consumed & 0xFFFF) * MS_NS
        self.lost_controller = came_ns is not None and 0 < late_ns < now_ns - came_ns
        if self.state is NetworkState.BOOT_UP:
            self._say(cia.HEARTBEAT + self.node, bytes((NetworkState.BOOT_UP,)))
            self.state = NetworkState.PRE_OPERATIONAL
        cycle_ns = self.entries[Place(0x1017)].value * MS_NS
        if cycle_ns and now_ns >= self._next_beat_ns:
            self._next_beat_ns = now_ns + cycle_ns
            self._say(cia.HEARTBEAT + self.node, bytes((self.state,)))
        for index in self._sent:
            timer_ns = self.entries[Place(index, 5)].value * MS_NS
            if timer_ns and now_ns >= self._next_event_ns[index]:
                self._next_event_ns[index] = now_ns + timer_ns
                self._send_pdos(range(254, 256), (index,))
        frames, self._out = self._out, []
        return frames

    def swap(self) -> None:
        """Put another device of the same kind in its place: it starts, with another number."""
        serial = self.entries.setdefault(Place(0x1018, 4), Entry(0, 4))
        serial.value += 1
        self.state = NetworkState.BOOT_UP

    def emergency(self, code: int) -> None:
        """Send an emergency message; 0 says that errors are over."""
        self.entries[Place(0x1001)].value = int(code != 0)
        self._say(
            cia.EMERGENCY + self.node, code.to_bytes(2, "little") + bytes((code != 0, *[0] * 5))
        )

    def taken(self, now_ns: int) -> None:
        """A PDO was taken into the entries."""

    def _say(self, cob: int, data: bytes) -> None:
        self._out.append(Frame(self._tag | cob, data))

    def _serve(self, data: bytes) -> bytes:
        command, place, value, size = cia.parts(data)
        entry = self.entries.get(place)
        if entry is None:
            known = any(each.number == place.number for each in self.entries)
            return cia.sdo(
                cia.ABORT, place, cia.Abort.NO_SUBINDEX if known else cia.Abort.NO_OBJECT
            )
        if command == cia.READ:
            return cia.sdo(0x43 | (4 - entry.size) << 2, place, entry.value)
        if command & 0xE2 != 0x22:
            return cia.sdo(cia.ABORT, place, cia.Abort.COMMAND_UNKNOWN)
        abort = self._write(place, entry, value, size if command & 1 else entry.size)
        return cia.sdo(cia.ABORT if abort else cia.WRITTEN, place, abort or 0)

    def _write(self, place: Place, entry: Entry, value: int, size: int) -> cia.Abort | None:
        if not entry.writable:
            return cia.Abort.READ_ONLY
        if size != entry.size:
            return cia.Abort.WRONG_LENGTH
        if place.number - 0x200 in self._pdos:
            if not place.subindex:
                mapping = [self.entries.get(Place(place.number, n + 1)) for n in range(value)]
                if sum(64 if each is None else each.value & 0xFF for each in mapping) > 64:
                    return cia.Abort.TOO_LONG_A_PDO
            elif self.entries[Place(place.number)].value:
                return cia.Abort.NOT_IN_THIS_STATE
            else:
                what = self.entries.get(Place(value >> 16, value >> 8 & 0xFF))
                if what is None or 8 * what.size != value & 0xFF:
                    return cia.Abort.NOT_TO_BE_MAPPED
        cob = self._pdos.get(place.number, -1) if place.subindex == 1 else -1
        if cob >= 0 and value & ~cia.DISABLED != cob:
            return cia.Abort.VALUE_OUT_OF_RANGE
        entry.value = value
        return None

    def _mapped(self, index: int) -> Iterator[Entry]:
        for subindex in range(1, self.entries[Place(index)].value + 1):
            what = self.entries[Place(index, subindex)].value
            yield self.entries[Place(what >> 16, what >> 8 & 0xFF)]

    def _take_pdo(self, data: bytes, now_ns: int) -> None:
        entries = list(self._mapped(0x1600))
        if len(data) < sum(each.size for each in entries):
            return  # too short a PDO is not processed, CiA 301 7.2.2.1
        at = 0
        for entry in entries:
            entry.value = int.from_bytes(data[at : at + entry.size], "little")
            at += entry.size
        self.taken(now_ns)

    def _send_pdos(self, kinds: range, indices: Iterable[int]) -> None:
        if self.state is not NetworkState.OPERATIONAL:
            return
        for index in indices:
            cob = self.entries[Place(index, 1)].value
            if cob & cia.DISABLED or self.entries[Place(index, 2)].value not in kinds:
                continue
            entries = self._mapped(index + 0x200)
            content = b"".join(each.value.to_bytes(each.size, "little") for each in entries)
            if content:
                self._say(cob, content)


class CanopenSensor(CanopenNode):
    """What a CANopen sensor answers; the content of its PDOs is that of `ForeignFrames`."""

    def __init__(self, plan: DevicePlan[Any]) -> None:
        assert plan.node is not None
        sizes = {step.place: step.size for step in plan.steps if step.size}
        pdos = {
            step.place.number: step.value & LONGEST_ID
            for step in plan.steps
            if step.place.number in range(0x1800, 0x1A00) and step.place.subindex == 1
        }
        entries = {
            step.place: Entry(0 if step.writes else step.value, sizes.get(step.place, 4),
                              writable=step.writes)
            for step in plan.steps
        }  # fmt: skip
        super().__init__(plan.node, plan.bus, entries, pdos)
        entries[Place(0x1000)].value = plan.steps[0].value

    @property
    def measures(self) -> bool:
        """Whether it sends what it measures."""
        timed = all(self.entries[Place(index, 5)].value for index in self._sent)
        return self.state is NetworkState.OPERATIONAL and timed

    def _send_pdos(self, kinds: range, indices: Iterable[int]) -> None:
        """Nothing: the sensor's node sends what it measures."""
