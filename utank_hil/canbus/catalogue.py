"""The catalogue of messages: the DBC, checked against the message types and compiled."""

import hashlib
from collections.abc import Sequence
from enum import IntEnum
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final, NamedTuple, TypeVar, get_type_hints

from utank_hil.canbus.codec import FRAME_BYTES, Codec, Signal, compile_codec, field_kind
from utank_hil.canbus.endpoints import Receiver, Transmitter
from utank_hil.canbus.enumerations import Address
from utank_hil.canbus.frame import Frame
from utank_hil.canbus.messages import DBC_NAMES

if TYPE_CHECKING:
    from cantools.database.can.message import Message as DbcMessage
    from cantools.database.can.signal import Signal as DbcSignal

T = TypeVar("T", bound=tuple[Any, ...])
DBC_PATH: Final = Path(__file__).with_name("utank.dbc")
#: Number of catalogue hashes: 12 bits without all ones, which means "not available".
_VERSIONS: Final = (1 << 12) - 1
_PROTECTION: Final = {"crc": (0, 8), "counter": (8, 4)}


class NamedMessage(NamedTuple):
    """A message of the catalogue: its type, who sends it, how it is encoded."""

    kind: type[Any]
    source: Address
    codec: Codec[Any]


class Catalogue:
    """The compiled messages of one DBC; creates transmitters and receivers."""

    def __init__(self, messages: Sequence[NamedMessage], version: int) -> None:
        #: Hash of the DBC, 0 to 4094, as HEARTBEAT and CTRL_STATUS carry it.
        self.version = version
        self.messages = tuple(messages)
        self.by_id = {each.codec.can_id: each for each in messages}
        self.can_ids = frozenset(self.by_id)

    def named(self, name: str) -> NamedMessage:
        """Return the message of a name in the DBC; KeyError is raised if there is none."""
        return {each.codec.name: each for each in self.messages}[name]

    def decoded(self, frame: Frame) -> Any:
        """Return the message of a frame; None if it is not of the catalogue, or damaged."""
        known = self.by_id.get(frame.can_id)
        return known.codec.decode(frame.data) if known and len(frame.data) == FRAME_BYTES else None

    def codec(self, message_type: type[T], source: Address | None = None) -> Codec[T]:
        """Return the codec of a message.

        `source` is needed for messages that every node sends, and for those of a second node of a
        kind; without it, the first node's is meant. ValueError is raised if there is no such one,
        or several.
        """
        found = {
            address: codec
            for kind, address, codec in self.messages
            if kind is message_type
            and (source is address or (source is None and not address.name.endswith("_2")))
        }
        if len(found) == 1:
            return next(iter(found.values()))
        if found:
            senders = ", ".join(address.name for address in found)
            raise ValueError(f"{message_type.__name__} is sent by {senders}: say whose is meant")
        sender = "" if source is None else f" sent by {source.name}"
        raise ValueError(f"the catalogue has no message {message_type.__name__}{sender}")

    def ids_sent_by(self, address: Address) -> frozenset[int]:
        """Identifiers of all messages that a node sends."""
        return frozenset(each.codec.can_id for each in self.messages if each.source is address)

    def transmitter(self, message_type: type[T], source: Address | None = None) -> Transmitter[T]:
        """Return a new transmitter; see `codec`."""
        return Transmitter(self.codec(message_type, source))

    def receiver(self, message_type: type[T], source: Address | None = None) -> Receiver[T]:
        """Return a new receiver; see `codec`."""
        return Receiver(self.codec(message_type, source))


@cache
def load_catalogue(path: Path = DBC_PATH) -> Catalogue:
    """Read and compile a DBC; ValueError lists every difference from the message types."""
    import utank_hil.canbus.python_can  # noqa: F401, before cantools

    # isort: split
    from cantools.database.can import Database  # slow to import, and needed only here

    content = path.read_bytes()
    database = Database()  # strict: refuses overlapping signals and those outside their frame
    database.add_dbc_string(content.decode())
    addresses = {
        node.name: node.dbc.attributes["NmStationAddress"].value for node in database.nodes
    }
    errors = [
        f"node {address.name}: NmStationAddress must be {address:#x}"
        for address in Address
        if addresses.get(address.name) != address
    ]
    types = {name: kind for kind, name in DBC_NAMES.items()}
    found: list[NamedMessage] = []
    for message in database.messages:
        sender = message.senders[0] if message.senders else ""
        kind = types.get(message.name) or types.get(common_name(message.name, sender))
        if kind is None or sender not in Address.__members__:
            errors.append(f"{message.name}: no message type, or its sender is unknown")
            continue
        address = Address[sender]
        problems = _problems(message, kind, address)
        errors += [f"{message.name}: {problem}" for problem in problems]
        if not problems:
            found.append(NamedMessage(kind, address, _compile(message, kind)))
    defined = {each.kind for each in found}
    if not errors:
        errors = [f"{name}: missing" for kind, name in DBC_NAMES.items() if kind not in defined]
    if errors:
        listed = "\n".join(errors)
        raise ValueError(f"{path.name} does not fit utank_hil/canbus/messages.py:\n{listed}")
    digest = hashlib.sha256(content.replace(b"\r\n", b"\n")).digest()
    return Catalogue(found, int.from_bytes(digest, "big") % _VERSIONS)


def common_name(message: str, sender: str) -> str:
    """Return the name of a message without its sender's name, or number, at the end."""
    stem, _, number = sender.rpartition("_")
    return message.removesuffix(f"_{sender}").removesuffix(f"_{number}" if stem else "")


def read_data_ids(message: "DbcMessage") -> bytes | None:
    """Return the data IDs of a message, None if unprotected; ValueError if not hexadecimal."""
    attribute = message.dbc.attributes.get("DataIDs") if message.dbc else None
    return None if attribute is None else bytes.fromhex(str(attribute.value))


def _compile(message: "DbcMessage", kind: type[T]) -> Codec[T]:
    by_name = {signal.name: signal for signal in message.signals}
    return compile_codec(
        kind,
        [_signal(by_name[name], hint) for name, hint in get_type_hints(kind).items()],
        name=message.name,
        can_id=message.frame_id,
        cycle_ns=(message.cycle_time or 0) * 1_000_000,
        data_ids=read_data_ids(message),
    )


def _signal(signal: "DbcSignal", hint: Any) -> Signal:
    kind = field_kind(hint)
    number = float if kind is float else int
    scale, offset = float(signal.scale), float(signal.offset)
    least, most = number(signal.minimum or 0), number(signal.maximum or 0)
    return Signal(signal.name, kind, signal.start, signal.length, scale, offset, least, most)


def _problems(message: "DbcMessage", kind: type, address: Address) -> list[str]:
    problems = []
    if message.length != FRAME_BYTES or not message.is_extended_frame:
        problems.append("must have 8 bytes and an extended identifier")
    if message.frame_id & 0xFF != address:
        problems.append(f"the identifier must end in the sender's address {address:#x}")
    signals = {signal.name: signal for signal in message.signals}
    try:
        data_ids = read_data_ids(message)
    except ValueError:
        data_ids = b""
    if data_ids is not None:
        if len(data_ids) != 16:
            problems.append("DataIDs must be 16 bytes in hexadecimal")
        for name, place in _PROTECTION.items():
            signal = signals.pop(name, None)
            if signal is None or (signal.start, signal.length) != place:
                problems.append(f"protected, needs {name} at bit {place[0]}, {place[1]} bits")
    hints = get_type_hints(kind)
    problems += [f"signal {name} has no field" for name in signals if name not in hints]
    for name, hint in hints.items():
        if name not in signals:
            problems.append(f"field {name} of {kind.__name__} has no signal")
        else:
            problems += [f"signal {name} {p}" for p in _signal_problems(signals[name], hint)]
    return problems


def _signal_problems(signal: "DbcSignal", hint: Any) -> list[str]:
    kind = field_kind(hint)
    if signal.is_signed or signal.is_float or signal.byte_order != "little_endian":
        return ["must be unsigned (an offset makes it signed) and little endian"]
    if kind is bool:
        return [] if signal.length == 1 else ["must have one bit, it is a flag"]
    if signal.minimum is None or signal.maximum is None:
        return ["needs a range"]
    problems = []
    compiled = _signal(signal, hint)
    low, high = compiled.raw_range
    if not 0 <= low < high < compiled.not_available:
        problems.append("must keep its range within the raw values, without all ones")
    if kind is not float and (signal.scale, signal.offset) != (1, 0):
        problems.append("must have scale 1 and offset 0, it is an integer")
    if issubclass(kind, IntEnum):
        table = {value: str(name) for value, name in (signal.choices or {}).items()}
        expected = {member.value: member.name for member in kind}
        expected[compiled.not_available] = "NOT_AVAILABLE"
        if table != expected:
            problems.append(f"must have the value table of {kind.__name__}: {expected}")
    return problems
