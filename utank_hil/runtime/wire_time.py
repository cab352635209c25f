"""How many bits a CAN frame takes on the wire, stuff bits counted exactly.

ISO 11898-1: after five equal bits the transmitter inserts one of the opposite value, from start of
frame to the end of the CRC sequence, and an inserted bit counts towards the next five. So the
length depends on every bit of the frame, the computed CRC included:

    start of frame 1, identifier 11, SRR 1, IDE 1, identifier 18, RTR 1, r1 r0 2, DLC 4,
    data 8n, CRC 15                                                        (stuffed, 54 + 8n bits)
    CRC delimiter 1, acknowledge slot 1 and delimiter 1, end of frame 7    (10 bits)
    intermission 3                                  (belongs to the frame: the bus is not free yet)

Eight data bytes make 131 bits without and at most 160 bits with stuffing. The header of an
identifier is walked bit by bit once and remembered; data and CRC go through tables of sixteen bits
a step, because this is the largest single cost of a simulated frame.
"""

from collections.abc import Callable
from functools import lru_cache
from struct import Struct
from typing import Final

import numpy as np

from utank_hil.canbus.frame import Frame

INTERMISSION_BITS: Final = 3
_AFTER_CRC_BITS: Final = 10 + INTERMISSION_BITS
_CRC_BITS: Final = 15
_CRC_POLYNOMIAL: Final = 0x4599
_HEADER_BITS: Final = 39

# State of the stuffing rule: 5 * (last bit) + (number of equal bits so far, 0 to 4).
_STATES: Final = 10


def _after_bit(state: int, bit: int) -> tuple[int, int]:
    """Return the state after `bit`, and 1 if a stuff bit follows it."""
    last, run = divmod(state, 5)
    run = run + 1 if bit == last else 1
    return ((1 - bit) * 5 + 1, 1) if run == 5 else (bit * 5 + run, 0)


def _stuffing_table(width: int) -> bytes:
    """Return stuff bits << 4 | next state, at [state << width | word of `width` bits]."""
    states = range(_STATES)
    following = np.array([[_after_bit(s, bit) for bit in (0, 1)] for s in states], dtype=np.uint8)
    state = np.arange(_STATES, dtype=np.uint8)[:, None]
    stuffed = np.zeros_like(state)
    for _ in range(width):  # each word splits into itself followed by 0 and by 1
        stuffed = (stuffed[:, :, None] + following[state, :, 1]).reshape(_STATES, -1)
        state = following[state, :, 0].reshape(_STATES, -1)
    return (stuffed << 4 | state).tobytes()


def _crc_table() -> list[int]:
    """Return the CRC register after the sixteen bits of each word, from a register of zero."""
    register = np.arange(1 << 16)
    for _ in range(16):
        top = register & 0x8000
        register = (register << 1 & 0xFFFF) ^ np.where(top, _CRC_POLYNOMIAL << 1, 0)
    crc: list[int] = (register >> 1).tolist()
    return crc


_CRC: Final = _crc_table()
_STUFF_16: Final = _stuffing_table(16)
_STUFF_15: Final = _stuffing_table(_CRC_BITS)
_words: Final[Callable[[bytes], tuple[int, int, int, int]]] = Struct(">4H").unpack


def _walk(bits: int, length: int) -> tuple[int, int, int]:
    """Return CRC register, stuffing state and stuff bits after the first `length` bits."""
    crc, state, stuffed = 0, 0, 0
    for position in range(length - 1, -1, -1):
        bit = bits >> position & 1
        feedback = bit ^ crc >> (_CRC_BITS - 1)
        crc = (crc << 1 & 0x7FFF) ^ (_CRC_POLYNOMIAL * feedback)
        state, extra = _after_bit(state, bit)
        stuffed += extra
    return crc, state, stuffed


def _header(can_id: int, length: int) -> int:
    """Return the 39 bits from start of frame to DLC; SRR and IDE are recessive, RTR is not."""
    if not 0 <= can_id < 1 << 29:
        raise ValueError(f"can_id {can_id:#x}: not a 29-bit identifier")
    return can_id >> 18 << 27 | 0b11 << 25 | (can_id & 0x3FFFF) << 7 | length


@lru_cache(maxsize=4096)
def _eight_byte_header(can_id: int) -> tuple[int, int, int]:
    """Return CRC register, stuffing state and all bits but the stuff bits still to come."""
    crc, state, stuffed = _walk(_header(can_id, 8), _HEADER_BITS)
    return crc, state, _HEADER_BITS + 64 + _CRC_BITS + _AFTER_CRC_BITS + stuffed


def frame_bits(frame: Frame) -> int:
    """Return the bits that a frame occupies the bus for, stuff bits and intermission included.

    Parameters
    ----------
    frame : Frame
        29-bit identifier, 0 to 8 data bytes.

    Returns
    -------
    int
        67 + 8 n bits without stuffing, at most 160 for eight data bytes.

    Raises
    ------
    ValueError
        If the identifier has more than 29 bits or there are more than 8 bytes.
    """
    can_id, data = frame
    if len(data) != 8:
        return _short_frame_bits(can_id, data)
    crc, state, bits = _eight_byte_header(can_id)
    word_0, word_1, word_2, word_3 = _words(data)
    crc = _CRC[crc << 1 ^ word_0]
    step = _STUFF_16[state << 16 | word_0]
    bits += step >> 4
    crc = _CRC[crc << 1 ^ word_1]
    step = _STUFF_16[(step & 15) << 16 | word_1]
    bits += step >> 4
    crc = _CRC[crc << 1 ^ word_2]
    step = _STUFF_16[(step & 15) << 16 | word_2]
    bits += step >> 4
    crc = _CRC[crc << 1 ^ word_3]
    step = _STUFF_16[(step & 15) << 16 | word_3]
    return bits + (step >> 4) + (_STUFF_15[(step & 15) << _CRC_BITS | crc] >> 4)


def _short_frame_bits(can_id: int, data: bytes) -> int:
    """Return `frame_bits` of any length, bit by bit: the catalogue has no such frames."""
    if len(data) > 8:
        raise ValueError(f"frame {can_id:#x}: {len(data)} data bytes, a CAN frame holds 8")
    length = _HEADER_BITS + 8 * len(data)
    header = _header(can_id, len(data))
    crc, state, stuffed = _walk(header << 8 * len(data) | int.from_bytes(data, "big"), length)
    stuffed += _STUFF_15[state << _CRC_BITS | crc] >> 4
    return length + _CRC_BITS + stuffed + _AFTER_CRC_BITS
