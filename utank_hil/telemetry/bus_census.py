"""Who is on a bus: messages, rates, versions, identities, errors, load; against a ship's file."""

from collections import Counter
from dataclasses import dataclass, field
from typing import Any, Final

from utank_hil.canbus import Address, Frame, HardwiredInputs, Heartbeat, Rejection, load_catalogue
from utank_hil.canbus.frame import BUS_SHIFT, OTHER_BUS, STANDARD
from utank_hil.canbus.line_names import LINES
from utank_hil.canbus.profiles.device import MessageHeard
from utank_hil.canbus.sentences import SENTENCES
from utank_hil.configuration import Vessel
from utank_hil.nodes.inbox import Inbox
from utank_hil.runners.bus_model import frame_bits
from utank_hil.safety.monitors.senders import LEAST_PER_CYCLE, MOST_PER_CYCLE
from utank_hil.telemetry.bus_files.frame import BusFrame, FrameKind

LEAST_CYCLES: Final = 3.0  #: A message that was listened to for fewer cycles has no rate yet.
_CLAIM_GROUP: Final = 0xEE00
_HEARTBEATS: Final = range(0x701, 0x780)
_STATES: Final = {0: "boot-up", 4: "stopped", 5: "operational", 127: "pre-operational"}
"""NMT states in a heartbeat, CiA 301."""


@dataclass
class Seen:
    """The frames of one identifier."""

    count: int = 0
    first_s: float = 0.0
    last_s: float = 0.0
    gap_s: float = 0.0
    lengths: set[int] = field(default_factory=set)

    def take(self, time_s: float, length: int) -> None:
        """Count a frame."""
        if self.count:
            self.gap_s = max(self.gap_s, time_s - self.last_s)
        else:
            self.first_s = time_s
        self.count, self.last_s = self.count + 1, time_s
        self.lengths.add(length)

    @property
    def rate_hz(self) -> float:
        """Frames a second between the first and the last; zero of a single one."""
        span_s = self.last_s - self.first_s
        return (self.count - 1) / span_s if span_s > 0 else 0.0


class BusCensus:
    """Listens to one interface, live or from a log, and compares it with the file of `vessel`.

    `interface` is named as in that file; any other name is the controller's own.
    """

    def __init__(self, bit_rate: int, vessel: Vessel | None = None, interface: str = "") -> None:
        self._bit_rate, self._vessel = bit_rate, vessel
        self._catalogue = load_catalogue()
        self._beats = {self._catalogue.codec(Heartbeat, each).can_id: each.name for each in Address}
        self._seen: dict[int, Seen] = {}
        self._line = interface.startswith(LINES)
        self._bits = 0
        self._begin_s: float | None = None
        self._end_s = 0.0
        self.errors: Counter[str] = Counter()
        self.versions: dict[str, tuple[int | None, int | None]] = {}
        self.identities: dict[int, set[int]] = {}
        self.states: dict[int, str] = {}
        self._tag = 0
        self._devices: dict[int, tuple[str, str, bool]] = {}
        self._inbox: Inbox | None = None
        if vessel is not None:
            foreign = vessel.foreign
            if interface in foreign.buses[1:]:
                self._tag = foreign.buses.index(interface) << BUS_SHIFT
            self._devices = {
                can_id & (OTHER_BUS - 1): said
                for can_id, said in foreign.said().items()
                if can_id & -OTHER_BUS == self._tag
            }
            self._inbox = Inbox(
                self._catalogue,
                vessel.version,
                pump=vessel.pump is not None,
                valve=vessel.valve is not None,
                redundancy=vessel.redundancy,
                foreign=foreign,
            )

    def take(self, heard: BusFrame) -> None:
        """Take one frame of an interface or of a log."""
        time_s, data = heard.time_ns * 1e-9, heard.data
        self._begin_s = time_s if self._begin_s is None else self._begin_s
        self._end_s = max(self._end_s, time_s)
        if heard.kind is FrameKind.ERROR:
            self.errors[f"error frame of class {heard.number:#x}"] += 1
            return
        if heard.kind is not FrameKind.DATA:
            remote = heard.kind is FrameKind.REMOTE
            self.errors["remote frame" if remote else "CAN FD frame"] += 1
            return
        can_id = heard.number | (0 if heard.extended else STANDARD)
        self._seen.setdefault(can_id, Seen()).take(time_s, len(data))
        frame = Frame(can_id, data)
        self._bits += frame_bits(frame)
        self._identify(frame)
        if self._inbox is not None:
            self._inbox.receive(Frame(self._tag | can_id, data), heard.time_ns)

    def _identify(self, frame: Frame) -> None:
        can_id, data = frame
        if can_id & STANDARD:
            number = can_id & ~STANDARD
            if number in _HEARTBEATS and len(data) == 1:
                state = _STATES.get(data[0] & 0x7F, f"state {data[0]:#x}")
                self.states[number - 0x700] = state
            return
        beat = self._catalogue.decoded(frame) if can_id in self._beats else None
        if beat is not None:
            versions = beat.catalogue_version, beat.configuration_version
            self.versions[self._beats[can_id]] = versions
        if can_id >> 8 & 0x3FF00 == _CLAIM_GROUP and len(data) == 8:
            name = int.from_bytes(data, "little")
            self.identities.setdefault(can_id & 0xFF, set()).add(name)

    @property
    def duration_s(self) -> float:
        """From the first frame to the last."""
        return 0.0 if self._begin_s is None else self._end_s - self._begin_s

    @property
    def load(self) -> float:
        """Share of the bus that the frames took."""
        return self._bits / (self._bit_rate * self.duration_s) if self.duration_s > 0 else 0.0

    def rows(self) -> list[dict[str, Any]]:
        """Each identifier: who, which, frames a second, longest gap, lengths."""
        return [
            {
                "id": written(can_id),
                "message": self._who(can_id)[1],
                "node": self._who(can_id)[0],
                "frames": seen.count,
                "rate_hz": round(seen.rate_hz, 3),
                "longest_gap_ms": round(1e3 * seen.gap_s, 1),
                "bytes": sorted(seen.lengths),
            }
            for can_id, seen in sorted(self._seen.items())
        ]

    def _who(self, can_id: int, content: str = "") -> tuple[str, str]:
        """Who sends an identifier, and which message it is, or has this content."""
        device, name, _ = self._devices.get(can_id, ("", "", False))
        name = content or name
        if can_id in self._catalogue.by_id:
            known = self._catalogue.by_id[can_id]
            return device or known.source.name, str(known.codec.name)
        if self._line:
            return device or "line", SENTENCES.get(can_id, name)
        if can_id & STANDARD:
            beats = (can_id & ~STANDARD) - 0x700 in self.states
            return device or f"node {can_id & 0x7F}", name or "CANopen heartbeat" * beats
        group = can_id >> 8 & 0x3FFFF
        name = f"{name} PGN {group if group & 0xFF00 >= 0xF000 else group & 0x3FF00}".lstrip()
        return device or f"source {can_id & 0xFF:#04x}", name

    def problems(self) -> list[tuple[str, str]]:
        """What is missing, wrong or double, in words; of the ship's file only with a ship."""
        found = [
            ("double", f"source {source:#04x} is claimed by {len(names)} devices")
            for source, names in self.identities.items()
            if len(names) > 1
        ]
        if self._inbox is None or self._vessel is None:
            return found
        wanted = (self._catalogue.version, self._vessel.version)
        for node, versions in self.versions.items():
            if versions != wanted:
                told = "/".join("none" if each is None else str(each) for each in versions)
                reason = f"{node} runs catalogue/ship {told}, wanted {wanted[0]}/{wanted[1]}"
                found.append(("wrong", reason))
        inputs = self._catalogue.codec(HardwiredInputs).can_id
        declared = self._vessel.redundancy.hardwired_inputs
        for heard in self._inbox.watched:
            if heard.can_id & -OTHER_BUS != self._tag:
                continue
            if heard.can_id & STANDARD == 0 and heard.can_id & 0xFF == Address.OPERATOR_2:
                continue  # a second station need not be there
            if heard.can_id == inputs and not (heard.heard or declared):
                continue  # obeyed wherever they are, but missed only by a ship that has them
            found += self._message_problems(heard)
        return found

    def _message_problems(self, heard: Any) -> list[tuple[str, str]]:
        bare = heard.can_id & (OTHER_BUS - 1)
        device, _, silent = self._devices.get(bare, ("", "", False))
        # several contents may share an identifier
        content = heard.name if isinstance(heard, MessageHeard) else ""
        what = " ".join(filter(None, (device, self._who(bare, content)[1], written(bare))))
        if not heard.heard:
            why = f"; controller or utank-hil conform {device} must configure it before it sends"
            return [("missing", f"{what} was not heard" + (why if silent else ""))]
        found = [("wrong", f"{what}: {heard.unwell}")] if content and heard.unwell else []
        for reason in Rejection:
            if heard.rejected[reason]:
                kind = "double" if reason is Rejection.REPEATED else "wrong"
                found.append((kind, f"{what}: {heard.rejected[reason]} frames, {reason.value}"))
        cycles = self.duration_s * 1e9 / heard.cycle_ns if heard.cycle_ns else 0.0
        share = heard.heard / cycles if cycles >= LEAST_CYCLES else 1.0
        rate = f"{what}: {heard.heard / max(self.duration_s, 1e-9):.3g} frames a second, "
        rate += f"{1e9 / max(heard.cycle_ns, 1):.3g} are right"
        if share < LEAST_PER_CYCLE:
            found.append(("wrong", rate))
        elif share > MOST_PER_CYCLE and heard.heard > cycles + LEAST_CYCLES:
            found.append(("double", rate))
        return found


def written(can_id: int) -> str:
    """An identifier as logs write it: three hexadecimal digits, or eight."""
    if can_id & STANDARD:
        return f"{can_id & ~STANDARD:03X}"
    return f"{can_id:08X}"
