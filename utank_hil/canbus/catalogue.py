"""The catalogue of messages: the DBC, compiled for the message types."""

import hashlib
from collections.abc import Sequence
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

T = TypeVar("T", bound=tuple[Any, ...])
DBC_PATH: Final = Path(__file__).with_name("utank.dbc")
#: Number of catalogue hashes: 12 bits without all ones, which means "not available".
_VERSIONS: Final = (1 << 12) - 1


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
        if len(found) != 1:
            senders = ", ".join(address.name for address in found) or "no such node"
            raise ValueError(f"{message_type.__name__} is sent by {senders}: say whose is meant")
        return next(iter(found.values()))

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
    """Read and compile a DBC that fits the message types; tests say whether one does."""
    import utank_hil.canbus.python_can  # noqa: F401, before cantools

    # isort: split
    from cantools.database.can import Database  # slow to import, and needed only here

    database = Database()  # strict: refuses overlapping signals and those outside their frame
    database.add_dbc_string(path.read_text("utf-8"))
    types = {name: kind for kind, name in DBC_NAMES.items()}
    found = []
    for message in database.messages:
        (sender,) = message.senders
        kind = types.get(message.name) or types[common_name(message.name, sender)]
        found.append(NamedMessage(kind, Address[sender], _compile(message, kind)))
    return Catalogue(found, _version(database.version or "", path.read_text("utf-8")))


def _version(said: str, text: str) -> int:
    """Return the version that a DBC says it has, if the hash behind it is that of its other lines.

    So an addition that no node needs to know keeps the version, and a DBC that was changed by
    somebody else has another one: its hash.
    """
    rest = text.partition("\n")[2].encode()
    found = int.from_bytes(hashlib.sha256(rest).digest(), "big") % _VERSIONS
    version, _, of = said.partition(" ")
    return int(version) if of == str(found) else found


def common_name(message: str, sender: str) -> str:
    """Return the name of a message without its sender's name, or number, at the end."""
    stem, _, number = sender.rpartition("_")
    return message.removesuffix(f"_{sender}").removesuffix(f"_{number}" if stem else "")


def read_data_ids(message: "DbcMessage") -> bytes | None:
    """Return the data IDs of a message, None if unprotected."""
    attribute = message.dbc.attributes.get("DataIDs") if message.dbc else None
    return None if attribute is None else bytes.fromhex(str(attribute.value))


def _compile(message: "DbcMessage", kind: type[T]) -> Codec[T]:
    signals = []
    for name, hint in get_type_hints(kind).items():
        dbc, what = message.get_signal_by_name(name), field_kind(hint)
        number = float if what is float else int
        limits = number(dbc.minimum or 0), number(dbc.maximum or 0)
        scaling = float(dbc.scale), float(dbc.offset)
        signals.append(Signal(name, what, dbc.start, dbc.length, *scaling, *limits))
    return compile_codec(
        kind,
        signals,
        name=message.name,
        can_id=message.frame_id,
        cycle_ns=(message.cycle_time or 0) * 1_000_000,
        data_ids=read_data_ids(message),
    )
