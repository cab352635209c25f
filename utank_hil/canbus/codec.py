"""Encodes and decodes frames with functions generated from the DBC.

The messages are compiled at start: one Python function to encode and one to decode, over the
frame's CRC byte, counter byte and three 16-bit words. They take a tenth of cantools' time, which
control loop and lockstep runs need. Tests compare both with cantools. `make compiled` has mypyc
compile the same text (`utank_hil.base.compiled`).
"""

import math
import struct
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from enum import IntEnum
from types import NoneType, UnionType
from typing import Any, Final, Generic, TypeVar, get_args, get_origin

from utank_hil.base.compiled import compiled_codecs
from utank_hil.canbus.e2e import WORD_TABLES, first_byte_table

T = TypeVar("T", bound=tuple[Any, ...])
FRAME_BYTES: Final = 8  #: Of a classic frame.
#: Parts of a frame: name, first bit, number of bits.
_PARTS: Final = (("crc", 0, 8), ("b1", 8, 8), ("w1", 16, 16), ("w2", 32, 16), ("w3", 48, 16))
_STRUCT: Final = struct.Struct("<BBHHH")


@dataclass(frozen=True, slots=True)
class Signal:
    """One signal of the DBC: unsigned, little endian, physical = raw * scale + offset."""

    name: str  #: Also the name of the message's field.
    kind: type  #: `float`, `bool`, `int` or the IntEnum of its value table.
    start: int  #: First bit.
    length: int  #: Number of bits.
    #: scale, offset: used only if `kind` is float.
    scale: float
    offset: float
    #: minimum, maximum: range of the physical value; integers unless `kind` is float.
    minimum: float
    maximum: float

    @property
    def not_available(self) -> int:
        """Raw value that means "not available": all ones."""
        return (1 << self.length) - 1

    @property
    def raw_range(self) -> tuple[int, int]:
        """Smallest and largest raw value within the range."""
        if self.kind is float:
            scale, offset = self.scale, self.offset
            return round((self.minimum - offset) / scale), round((self.maximum - offset) / scale)
        return int(self.minimum), int(self.maximum)


@dataclass(frozen=True, slots=True)
class Codec(Generic[T]):
    """Encoding of one message of the catalogue."""

    name: str  #: Name in the DBC.
    can_id: int  #: Identifier of 29 bits.
    cycle_ns: int  #: Cycle time; 0 for a message without one.
    data_ids: bytes | None  #: Sixteen of its protection; None for an unprotected message.
    encode: Callable[[T, int], bytes]  #: ``encode(message, counter)`` gives 8 bytes.
    decode: Callable[[bytes], T | None]  #: Takes 8 bytes; None if the CRC is wrong.
    source: str  #: Text of both functions.
    not_available: Mapping[str, int]  #: Raw value of each signal that says so: all ones.

    @property
    def protected(self) -> bool:
        """Whether byte 0 is a CRC and the low nibble of byte 1 a counter."""
        return self.data_ids is not None


def compile_codec(
    message_type: type[T],
    signals: Iterable[Signal],
    *,
    name: str,
    can_id: int,
    cycle_ns: int,
    data_ids: bytes | None,
) -> Codec[T]:
    """Generate the functions that encode and decode one message, a NamedTuple.

    `signals` are all but CRC and counter, in the order of its fields. There are sixteen `data_ids`,
    or None for an unprotected message.
    """
    signals = tuple(signals)
    kinds = [signal.kind for signal in signals if issubclass(signal.kind, IntEnum)]
    tables = _tables(name, message_type, signals, data_ids)
    encoder = _encoder(name, signals, data_ids is not None)
    decoder = _decoder(name, signals, data_ids is not None)
    source = "\n".join([*tables, *encoder, *decoder])
    scope = {**COMMON, **{kind.__name__: kind for kind in (message_type, *kinds)}}
    functions = compiled_codecs().get(source)
    if functions is None:
        exec(compile(source, f"<codec of {name}>", "exec"), scope)
        functions = scope[f"encode_{name}"], scope[f"decode_{name}"]
    largest = {signal.name: signal.not_available for signal in signals}
    return Codec(name, can_id, cycle_ns, data_ids, *functions, source, largest)


def field_kind(annotation: Any) -> type:
    """Return the kind of a field from its annotation: E for `E | None`, int for `int | None`.

    ValueError is raised if it is none of those in `utank_hil.canbus.messages`.
    """
    if annotation in (float, bool):
        return annotation  # type: ignore[no-any-return]  # narrowed by the line above
    if get_origin(annotation) is UnionType:
        kinds = [kind for kind in get_args(annotation) if kind is not NoneType]
        if len(kinds) == 1 and (kinds[0] is int or issubclass(kinds[0], IntEnum)):
            return kinds[0]  # type: ignore[no-any-return]  # a type, by the check before
    raise ValueError(f"a field is float, bool, int | None or an IntEnum | None, not {annotation}")


def _members(kind: type[IntEnum], length: int) -> tuple[IntEnum | None, ...]:
    members = {member.value: member for member in kind}
    return tuple(members.get(raw) for raw in range(1 << length))


def _clamp(value: float, signal: tuple[float, int, int, int]) -> int:
    """Raw value of a physical value that is out of range or NaN."""
    minimum, raw_minimum, raw_maximum, not_available = signal
    if value != value:
        return not_available
    return raw_minimum if value < minimum else raw_maximum


COMMON: Final[dict[str, Any]] = {
    "Any": Any,
    "Final": Final,
    "pack": _STRUCT.pack,
    "unpack": _STRUCT.unpack,
    "new": tuple.__new__,
    "nan": math.nan,
    "clamp": _clamp,
    "members": _members,
    **dict(zip("ABC", WORD_TABLES, strict=True)),
}  #: What the text of every message names.


def _overlaps(signal: Signal) -> list[tuple[str, int, int]]:
    """Return the parts that contain a signal: name, shift of the signal, number of bits."""
    return [
        (part, signal.start - start, bits)
        for part, start, bits in _PARTS
        if signal.start < start + bits and start < signal.start + signal.length
    ]


def _tables(
    name: str, message_type: type, signals: Sequence[Signal], data_ids: bytes | None
) -> list[str]:
    lines = [f"M_{name}: Final[Any] = {message_type.__name__}"]
    if data_ids is not None:
        lines.append(f"F_{name}: Final[bytes] = {first_byte_table(data_ids)!r}")
    for signal in signals:
        if issubclass(signal.kind, IntEnum):
            members = f"members({signal.kind.__name__}, {signal.length})"
            lines.append(f"T_{name}_{signal.name}: Final[tuple[Any, ...]] = {members}")
    return lines


def _encoder(name: str, signals: Sequence[Signal], protected: bool) -> list[str]:
    fields = "".join(f"{signal.name}, " for signal in signals)
    kinds = [(signal.name, "float" if signal.kind is float else "Any") for signal in signals]
    lines = [
        f"def encode_{name}(message: tuple[Any, ...], counter: int) -> bytes:",
        *[f"    {field}: {kind}; raw_{field}: int" for field, kind in kinds],
        f"    {fields}= message",
    ]
    terms: dict[str, list[str]] = {part: [] for part, _, _ in _PARTS}
    if protected:
        terms["b1"].append("counter")
    for signal in signals:
        value, raw, ones = signal.name, f"raw_{signal.name}", signal.not_available
        low, high = signal.raw_range
        if signal.kind is float:
            limits = (signal.minimum, low, high, ones)
            lines.append(
                f"    {raw} = round(({value} - {signal.offset!r}) / {signal.scale!r}) "
                f"if {signal.minimum!r} <= {value} <= {signal.maximum!r} "
                f"else clamp({value}, {limits!r})"
            )
        elif signal.kind is bool:
            lines.append(f"    {raw} = 1 if {value} else 0")
        elif signal.kind is int:
            lines.append(f"    {raw} = {ones} if {value} is None else int({value})")
            lines.append(f"    if {value} is not None and not {low} <= {raw} <= {high}:")
            lines.append(f"        {raw} = {low} if {raw} < {low} else {high}")
        else:
            lines.append(f"    {raw} = {ones} if {value} is None else {value}")
        for part, shift, bits in _overlaps(signal):
            term = f"{raw} << {shift}" if shift > 0 else f"{raw} >> {-shift}" if shift else raw
            too_long = shift + signal.length > bits
            terms[part].append(f"({term} & {(1 << bits) - 1})" if too_long else f"({term})")
    lines += [f"    {part} = {' | '.join(terms[part]) or 0}" for part, _, _ in _PARTS]
    if protected:
        lines.append(f"    crc = F_{name}[b1] ^ A[w1] ^ B[w2] ^ C[w3]")
    lines.append("    return pack(crc, b1, w1, w2, w3)")
    return lines


def _decoder(name: str, signals: Sequence[Signal], protected: bool) -> list[str]:
    lines = [
        f"def decode_{name}(data: bytes) -> Any:",
        "    crc: int; b1: int; w1: int; w2: int; w3: int",
        "    crc, b1, w1, w2, w3 = unpack(data)",
    ]
    if protected:
        lines.append(f"    if crc != F_{name}[b1] ^ A[w1] ^ B[w2] ^ C[w3]: return None")
    values = []
    for signal in signals:
        value, ones = signal.name, signal.not_available
        low, high = signal.raw_range
        parts = _overlaps(signal)
        raw = " | ".join(
            f"({part} >> {shift})" if shift > 0 else f"({part} << {-shift})" if shift else part
            for part, shift, _ in parts
        )
        _, last_shift, last_bits = parts[-1]
        if last_shift + signal.length < last_bits:
            raw = f"({raw}) & {ones}"
        if signal.kind is bool:
            values.append(f"({raw}) != 0")
        elif signal.kind is int or signal.kind is float:
            lines.append(f"    {value} = {raw}")
            within = f"{low} <= {value} <= {high}" if low else f"{value} <= {high}"
            scaled = f"{value} * {signal.scale!r} + {signal.offset!r}"
            there, other = (value, "None") if signal.kind is int else (scaled, "nan")
            values.append(f"({there} if {within} else {other})")
        else:
            values.append(f"T_{name}_{value}[{raw}]")
    lines.append(f"    return new(M_{name}, ({', '.join(values)},))")
    return lines
