"""Parts of the section ``devices`` of a ship's file: messages, signals, validity, protection."""

import math
from typing import Annotated, Any, Final, Literal

from pydantic import BeforeValidator, ConfigDict, Field

from utank_hil.base.parameters import Finite, Range
from utank_hil.canbus.frame import LONGEST_ID, LONGEST_STANDARD_ID
from utank_hil.canbus.profiles.field import Field as BusField
from utank_hil.configuration.files import Section


def _whole(value: Any) -> Any:
    if isinstance(value, str):
        try:
            return int(value, 0)
        except ValueError:
            raise ValueError(f"must be a whole number such as 18 or 0x12, got {value!r}") from None
    return value


_WHOLE: Final = BeforeValidator(_whole)
Whole = Annotated[int, Range(least=-(1 << 63), most=(1 << 64) - 1), _WHOLE]
Id29 = Annotated[int, Range(least=0, most=LONGEST_ID), _WHOLE]
Id11 = Annotated[int, Range(least=0, most=LONGEST_STANDARD_ID), _WHOLE]
Pgn = Annotated[int, Range(least=0, most=0x3FFFF), _WHOLE]
SourceAddress = Annotated[int, Range(least=0, most=0xFD), _WHOLE]
NodeNumber = Annotated[int, Range(least=1, most=127), _WHOLE]
Cycle = Annotated[float, Range(above=0, most=10_000)]

_DEGREE: Final = math.pi / 180
UNITS: Final[dict[str, tuple[str, float]]] = {
    "rad": ("rad", 1.0), "mrad": ("rad", 1e-3), "deg": ("rad", _DEGREE), "°": ("rad", _DEGREE),
    "rad/s": ("rad_s", 1.0), "rad.s-1": ("rad_s", 1.0), "mrad/s": ("rad_s", 1e-3),
    "deg/s": ("rad_s", _DEGREE), "°/s": ("rad_s", _DEGREE),
    "m": ("m", 1.0), "cm": ("m", 1e-2), "mm": ("m", 1e-3),
    "Pa": ("pa", 1.0), "kPa": ("pa", 1e3), "mbar": ("pa", 1e2), "bar": ("pa", 1e5),
    "m3/s": ("m3_s", 1.0), "l/s": ("m3_s", 1e-3), "m3/h": ("m3_s", 1 / 3600),
}  # fmt: skip
"""Units that makers write: end of the name of what is measured, and factor."""


class _Part(Section):
    model_config = ConfigDict(populate_by_name=True)


class FieldSection(_Part):
    """Layout of a signal as in a DBC."""

    start: Annotated[int, Range(least=0, most=63), _WHOLE]
    """First bit: the least of a signal with the least byte first, else the most."""
    bits: Annotated[int, Range(least=1, most=64), _WHOLE]  #: Number of bits.
    big_endian: bool = False  #: Most byte first.
    signed: bool = False  #: Two's complement.
    real: bool = False  #: IEEE 754.
    scale: Finite = 1.0  #: Physical value of one count.
    offset: Finite = 0.0  #: Physical value of no counts.
    unit: str = ""  #: Unit of the physical value.
    least_raw: Whole | None = None  #: Least count that is a value.
    most_raw: Whole | None = None  #: Counts outside of these two are not available, or an error.

    def field(self, length: int) -> BusField:
        """The signal in a frame of so many bytes."""
        return BusField(length=length, **self.model_dump(exclude={"unit"}))


class MessageSection(_Part):
    """Layout and identifier of a message: by `id`, by `pgn` and source, or by `cob` and node."""

    id: Id29 | None = None  #: Identifier.
    format: Literal["11bit", "29bit"] = "11bit"  #: Length of the identifier.
    pgn: Pgn | None = None  #: Group by SAE J1939-21; any priority is accepted.
    cob: Id11 | None = None  #: Identifier to which the node's number is added.
    bytes: Annotated[int, Range(least=1, most=8), _WHOLE] = 8
    """Length; a frame of another one is refused."""
    cycle_ms: Cycle | None = None  #: Of a message that has another cycle than the device's.
    signals: Annotated[dict[str, FieldSection], Field(default_factory=dict)]
    """Layouts of its signals."""


class SignalSection(_Part):
    """What one measured value is made of."""

    from_: Annotated[str, Field(alias="from")] = ""  #: Signal, as MESSAGE.SIGNAL.
    source: Literal["measured", "derived"] = "measured"
    """Measured, or derived as the slope of the roll."""
    sign: Literal[1, -1] = 1  #: -1 turns the value round.
    scale: Annotated[float, Range(least=-1e9, most=1e9)] | None = None
    """In place of the factor of its unit."""
    offset: Annotated[float, Range(least=-1e9, most=1e9)] = 0.0
    """In the unit of the value, before the sign is applied."""
    least: Finite = -1e300  #: Least physical value, in the maker's unit, that is one.
    most: Finite = 1e300
    """Range in the maker's unit, outside of which there is no value, as a broken 4-20 mA wire."""


class ConditionSection(_Part):
    """What a status must say for the values to be valid."""

    from_: Annotated[str, Field(alias="from")]  #: Status word, as MESSAGE.SIGNAL.
    mask: Whole = (1 << 64) - 1  #: Bits that count.
    in_: Annotated[tuple[Whole, ...], Field(alias="in", min_length=1)]
    """Values of these bits that are allowed."""


class StampSection(_Part):
    """The device's own time in a message."""

    from_: Annotated[str, Field(alias="from")]  #: Signal, as MESSAGE.SIGNAL.
    us: Annotated[float, Range(above=0, most=1e6)]  #: Microseconds of one count.


class CrcSection(_Part):
    """A checksum of eight bits over all other bytes of a message."""

    message: str  #: Message that carries it.
    byte: Annotated[int, Range(least=0, most=7), _WHOLE]  #: Its place in the frame.
    polynomial: Annotated[int, Range(least=0, most=255), _WHOLE] = 0x1D
    """Polynomial without its highest bit."""
    start: Annotated[int, Range(least=0, most=255), _WHOLE] = 0xFF
    """Value that the register begins with."""
    final: Annotated[int, Range(least=0, most=255), _WHOLE] = 0xFF
    """Value that is applied to the result by exclusive or."""


class ProtectionSection(_Part):
    """What tells frames that are wrong, old or not the device's."""

    counters: tuple[str, ...] = ()  #: Signals that count the frames of their message.
    crcs: tuple[CrcSection, ...] = ()  #: Checksums.
    stamps: tuple[StampSection, ...] = ()  #: The device's own times.
    unchanged_ms: Cycle | None = None  #: Content that has been the same for longer is not used.
    n2k_name: Whole | None = None
    """NAME that the device claims its source address with, SAE J1939-81."""


def unit_of(value: str) -> str:
    """The unit at the end of a value's name, as in `UNITS`; empty for a switch."""
    for unit in ("rad_s", "m3_s", "rad", "pa", "m"):
        if value.endswith(f"_{unit}"):
            return unit
    return ""
