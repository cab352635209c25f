"""Sentences of motion sensors, as frames that a profile reads: PSXN, TSS1, EM Attitude 3000.

The device's documents stand in the profiles. Roll is positive with the port side up in all three.
A frame has no more than the profiles take of a sentence.
"""

import re
import struct
from collections.abc import Callable, Iterator
from functools import reduce
from operator import xor
from typing import Final

from utank_hil.canbus.frame import STANDARD, Frame

PSXN_QUALITY: Final = STANDARD | 0x020
PSXN_ATTITUDE: Final = STANDARD | 0x023
PSXN_RATES: Final = STANDARD | 0x024
TSS1: Final = STANDARD | 0x751
EM3000: Final = STANDARD | 0x300
GARBAGE: Final = STANDARD
"""Of bytes that are no sentence, and came before one that told which are sent there."""
LONGEST: Final = 120  #: Of a sentence, of which NMEA 0183 allows 82 characters.
NOT_AVAILABLE: Final = 0x7FFF_FFFF  #: Count of an empty field.

SENTENCES: Final = {
    PSXN_QUALITY: "$PSXN,20", PSXN_ATTITUDE: "$PSXN,23", PSXN_RATES: "$PSXN,24", TSS1: "TSS1",
    EM3000: "EM Attitude 3000",
}  # fmt: skip

_TEXT: Final = rb"(?:[$:][ -#%-9;-~]{1,117}|![ -#%-~]{1,117})\r?\n"  # ! of AIS has colons, too
_HEAD: Final = rb"[\x00\x90-\xaf]\x90"
_BINARY: Final = _HEAD + rb"[\x00-\xff]{8}"
_NEXT: Final = re.compile(_TEXT + b"|" + _BINARY)
# after a gap ten bytes may look like a record by chance: the one behind it has to begin, too
_ANY: Final = re.compile(_TEXT + b"|" + _BINARY + b"(?=" + _HEAD + b")")
_PSXN: Final = re.compile(rb"\$(PSXN,(20|23|24),([^*]*))\*([0-9A-Fa-f]{2})\r?\n")
_NUMBER: Final = re.compile(rb"-?\d{1,3}(\.\d{1,6})?")
_TSS1: Final = re.compile(
    rb":[0-9A-Fa-f]{6} ([ -])(\d{4})([A-Za-z?])([ -])(\d{4}) ([ -])(\d{4})\r?\n"
)
_EM3000: Final = struct.Struct("<BBhhhH")
_PARTS: Final = struct.Struct("<Bhhh")  #: Status, roll, pitch, heave of the latter two.
_ANGLES: Final = struct.Struct("<ii")


def checksum(body: bytes) -> str:
    """NMEA 0183: exclusive or of all bytes between ``$`` and ``*``, two hexadecimal digits."""
    return f"{reduce(xor, body, 0):02X}"


def _psxn(sentence: bytes) -> Frame | None:
    """The frame of a sentence of Seatex; without data if it is spoilt, None if it is none."""
    if sentence[:8] not in (b"$PSXN,20", b"$PSXN,23", b"$PSXN,24"):
        return None
    spoilt = Frame(STANDARD | int(sentence[6:8], 16), b"")
    found = _PSXN.fullmatch(sentence)
    if found is None or checksum(found[1]) != found[4].decode().upper():
        return spoilt
    fields = found[3].split(b",")
    if len(fields) != 4 or not all(not each or _NUMBER.fullmatch(each) for each in fields):
        return spoilt
    if found[2] == b"20":
        return Frame(PSXN_QUALITY, bytes([min(int(float(each or 9)), 9) & 0xF for each in fields]))
    counts = [round(1e3 * float(each)) if each else NOT_AVAILABLE for each in fields[:2]]
    return Frame(spoilt.can_id, _ANGLES.pack(*counts))


def _tss1(sentence: bytes) -> Frame:
    found = _TSS1.fullmatch(sentence)
    if found is None:
        return Frame(TSS1, b"")
    heave, roll, pitch = [int(found[at] + found[at + 1]) for at in (1, 4, 6)]
    return Frame(TSS1, _PARTS.pack(found[3][0], roll, pitch, heave))


def _em3000(record: bytes) -> Frame:
    status, _, roll, pitch, heave, heading = _EM3000.unpack(record)
    if max(abs(roll), abs(pitch)) > 17_999 or abs(heave) > 999 or heading > 35_999:
        return Frame(EM3000, b"")
    return Frame(EM3000, _PARTS.pack(status, roll, pitch, heave))


_READ: Final[dict[bytes, Callable[[bytes], Frame | None]]] = {b"$": _psxn, b"!": _psxn, b":": _tss1}


class SentenceReader:
    """Finds sentences in what comes in, in pieces of any length; others of NMEA 0183 are passed by.

    What is spoilt, cut or no sentence gives a frame without data, which the device's message
    rejects by its length.
    """

    def __init__(self) -> None:
        self._rest = b""
        self._in_step = False
        self._kind = GARBAGE  #: The last that had an attitude.

    def take(self, data: bytes) -> Iterator[Frame]:
        """Yield the frames of what has come, oldest first."""
        data = self._rest + data
        at = 0
        while True:
            found = (_NEXT.match(data, at) if self._in_step else None) or _ANY.search(data, at)
            if found is None:
                break
            if found.start() > at:
                yield Frame(self._kind, b"")
            at, self._in_step = found.end(), True
            frame = self._frame(found[0])
            if frame is not None:
                yield frame
        self._rest = data[at:]
        if len(self._rest) > LONGEST:
            self._rest, self._in_step = self._rest[-LONGEST:], False
            yield Frame(self._kind, b"")

    def _frame(self, found: bytes) -> Frame | None:
        frame = _READ.get(found[:1], _em3000)(found)
        if frame is not None and frame.data and frame.can_id in (PSXN_ATTITUDE, TSS1, EM3000):
            self._kind = frame.can_id
        return frame


def _said_psxn(data: bytes) -> str:
    counts = [f"{each / 1e3:.2f}" if abs(each) <= 180_000 else "" for each in _ANGLES.unpack(data)]
    return ",".join((*counts, "0.00", "0.00"))


def sentence(frame: Frame) -> bytes:
    """What a sensor says that stands for a frame, in hundredths; ValueError if none does."""
    can_id, data = frame
    if can_id in (PSXN_ATTITUDE, PSXN_RATES, PSXN_QUALITY):
        quality = can_id == PSXN_QUALITY
        body = ",".join(str(min(each, 2)) for each in data) if quality else _said_psxn(data)
        said = f"PSXN,{can_id & 0xFF:02x},{body}".encode()
        return b"$%b*%b\r\n" % (said, checksum(said).encode())
    if can_id not in (TSS1, EM3000):
        raise ValueError(f"{can_id & ~STANDARD:#x} stands for no sentence")
    status, roll, pitch, heave = _PARTS.unpack(data)
    if can_id == EM3000:
        status = status if status in (0, *range(0x90, 0xB0)) else 0x9A
        return _EM3000.pack(status, 0x90, roll, pitch, heave, 0)
    letter = chr(status) if chr(status).isascii() and chr(status).isalpha() else "?"
    parts = [f"{'-' if each < 0 else ' '}{min(abs(each), 9999):04d}" for each in
             (heave, roll, pitch)]  # fmt: skip
    return f":000000 {parts[0]}{letter}{parts[1]} {parts[2]}\r\n".encode()
