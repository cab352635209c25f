"""Length of a CAN frame on the wire in bits, with the exact number of stuff bits.

ISO 11898-1: after five equal bits the transmitter inserts one of the opposite value, from start of
frame to the end of the CRC sequence, and an inserted bit counts towards the next five. So the
length depends on every bit of the frame, including the CRC:

    start of frame 1, identifier 11, SRR 1, IDE 1, identifier 18, RTR 1, r1 r0 2, DLC 4,
    data 8n, CRC 15                                                        (stuffed, 54 + 8n bits)
    CRC delimiter 1, acknowledge slot 1 and delimiter 1, end of frame 7    (10 bits)
    intermission 3                                  (belongs to the frame: the bus is not free yet)

An identifier of 11 bits has neither SRR nor the other 18 bits nor r1: 20 bits less.

Eight data bytes make 131 bits without and at most 160 bits with stuffing. This is the largest
single cost of a simulated frame. So the header of an identifier is processed bit by bit once and
cached, and data and CRC go bytewise through tables small enough for the processor's cache.
(Tables for sixteen bits take twice the time, because they miss the cache.)
"""

from functools import lru_cache
from typing import Final

from utank_hil.canbus.frame import LONGEST_STANDARD_ID, STANDARD, Frame

LONGEST_FRAME_BITS: Final = 160  #: Of a frame with eight data bytes.
INTERMISSION_BITS: Final = 3
_AFTER_CRC_BITS: Final = 10 + INTERMISSION_BITS
_CRC_BITS: Final = 15
_CRC_POLYNOMIAL: Final = 0x4599
_HEADER_BITS: Final = 39
_SHORT_HEADER_BITS: Final = 19
Row = list[tuple["Row", int]]
"""Of one state of the stuffing rule, by byte: the row of the next state, and the stuff bits."""
# State of the stuffing rule: 5 * (last bit) + (number of equal bits so far, 0 to 4).
_STATES: Final = 10


def _after_bits(state: int, bits: int, length: int) -> tuple[int, int]:
    """Return the state after the last `length` bits of `bits`, and the stuff bits in them."""
    stuffed = 0
    for position in range(length - 1, -1, -1):
        bit = bits >> position & 1
        last, run = divmod(state, 5)
        run = run + 1 if bit == last else 1
        if run == 5:
            stuffed += 1
            bit, run = 1 - bit, 1
        state = bit * 5 + run
    return state, stuffed


def _stuffing_rows() -> list[Row]:
    rows: list[Row] = [[] for _ in range(_STATES)]
    # rows share the same few pairs, so that they stay in the cache
    pairs = [[(row, stuffed) for stuffed in range(3)] for row in rows]
    for state, row in enumerate(rows):
        for byte in range(256):
            following, stuffed = _after_bits(state, byte, 8)
            row.append(pairs[following][stuffed])
    return rows


def _crc(register: int, bits: int, length: int) -> int:
    for position in range(length - 1, -1, -1):
        feedback = (bits >> position ^ register >> (_CRC_BITS - 1)) & 1
        register = (register << 1 & 0x7FFF) ^ (_CRC_POLYNOMIAL * feedback)
    return register


_ROWS: Final = _stuffing_rows()
# The CRC is held left-aligned in 16 bits, as two bytes; these tables advance them by one byte.
_CRC_HIGH: Final = [_crc(0, byte, 8) >> 7 for byte in range(256)]
_CRC_LOW: Final = [_crc(0, byte, 8) << 1 & 0xFF for byte in range(256)]


@lru_cache(maxsize=4096)
def _after_header(can_id: int, length: int) -> tuple[int, int, Row, int]:
    """Return CRC and row after the DLC, and the frame's bits except later stuff bits."""
    if not 0 <= can_id < 1 << 29 and not STANDARD <= can_id <= STANDARD | LONGEST_STANDARD_ID:
        raise ValueError(f"can_id {can_id:#x}: not a 29-bit identifier")
    if length > 8:
        raise ValueError(f"frame {can_id:#x}: {length} data bytes, a CAN frame holds 8")
    if can_id & STANDARD:  # RTR, IDE and r0 follow the identifier, all dominant
        return _after_bits_of(
            (can_id & LONGEST_STANDARD_ID) << 7 | length, _SHORT_HEADER_BITS, length
        )
    # SRR and IDE are recessive; start of frame, RTR, r1 and r0 are not
    header = can_id >> 18 << 27 | 0b11 << 25 | (can_id & 0x3FFFF) << 7 | length
    return _after_bits_of(header, _HEADER_BITS, length)


def _after_bits_of(header: int, bits: int, length: int) -> tuple[int, int, Row, int]:
    state, stuffed = _after_bits(0, header, bits)
    plain = bits + 8 * length + _CRC_BITS + _AFTER_CRC_BITS
    crc = _crc(0, header, bits)
    return crc >> 7, crc << 1 & 0xFF, _ROWS[state], plain + stuffed


def frame_bits(frame: Frame) -> int:
    """Return the number of bits of a frame, with stuff bits and intermission.

    They are 67 + 8 n bits without stuffing, and at most 160 for eight data bytes. ValueError is
    raised if the identifier has more than 29 bits or there are more than 8 bytes.
    """
    can_id, data = frame
    crc_high, crc_low, row, bits = _after_header(can_id, len(data))
    for byte in data:
        index = crc_high ^ byte
        crc_high = _CRC_HIGH[index] ^ crc_low
        crc_low = _CRC_LOW[index]
        row, stuffed = row[byte]
        bits += stuffed
    row, stuffed = row[crc_high]
    bits += stuffed
    # seven bits are left; padding with the complement of the last one adds no stuff bit
    _, stuffed = row[crc_low | ~crc_low >> 1 & 1]
    return bits + stuffed
