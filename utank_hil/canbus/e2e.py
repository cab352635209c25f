"""End-to-end protection in the style of AUTOSAR E2E Profile 2.

Byte 0 of a frame is a CRC-8 (polynomial 0x2F, start value and final exclusive-or 0xFF) over bytes
1 to 7 and one more byte that is not sent: the data ID, selected from the message's list of sixteen
by the counter in the low nibble of byte 1. So a frame of another message fails the check even with
the right length and counter (masquerade). Source: AUTOSAR, Specification of SW-C End-to-End
Communication Protection Library (polynomial, start value and Profile 2).

The lists of the catalogue (attribute `DataIDs` of the DBC) are those of `data_ids`. Two messages
then differ at every counter value, even after one bit error. Any one, two or three bit errors of a
frame are detected. Other lists may miss some: a bit error in the counter changes the data ID as
well, and two bit errors may cancel. Tests check all of this.

The CRC is linear over GF(2): the CRC of a frame is the exclusive-or of one contribution per byte.
So eight bytes take four table look-ups: byte 1 with the data ID and all constants in a table of the
message, bytes 2 to 7 in pairs in the tables `WORD_TABLES`.
"""

from functools import cache, reduce
from operator import xor
from typing import Final

POLYNOMIAL: Final = 0x2F
DATA_ID_COUNT: Final = 16
_COUNTER_BITS: Final = (0x06, 0x03, 0x0A, 0x11)


@cache
def crc_table(polynomial: int) -> bytes:
    """Register of a CRC-8 after each byte, from a register of zero."""
    table = list(range(256))
    for _ in range(8):
        table = [((crc << 1) ^ polynomial) & 0xFF if crc & 0x80 else crc << 1 for crc in table]
    return bytes(table)


#: Contribution of the last byte to the CRC register.
_BYTE_TABLE: Final = crc_table(POLYNOMIAL)


def crc8(data: bytes) -> int:
    """CRC-8 with polynomial 0x2F, start value and final exclusive-or 0xFF, byte by byte."""
    crc = 0xFF
    for byte in data:
        crc = _BYTE_TABLE[crc ^ byte]
    return crc ^ 0xFF


def _place_table(following_bytes: int) -> bytes:
    """Contribution of a byte to the CRC, with this number of bytes after it."""
    table = _BYTE_TABLE
    for _ in range(following_bytes):
        table = table.translate(_BYTE_TABLE)
    return table


def _word_table(place: int) -> bytes:
    """Contribution of the 16-bit little-endian word at byte `place`; the data ID comes last."""
    low, high = _place_table(8 - place), _place_table(7 - place)
    rows = int.from_bytes(low, "little")
    return b"".join(
        (rows ^ int.from_bytes(bytes((part,)) * 256, "little")).to_bytes(256, "little")
        for part in high
    )


#: Contribution of bytes 2-3, 4-5 and 6-7, by their value as a little-endian word.
WORD_TABLES: Final = (_word_table(2), _word_table(4), _word_table(6))


def data_ids(number: int) -> bytes:
    """Data IDs by counter of the catalogue's protected message number 1 to 127.

    The number n as the eight bits ``2 n + parity(n)``, exclusive-or 0x06, 0x03, 0x0A, 0x11 for the
    counter's bits 0 to 3.
    """
    code = 2 * number + number.bit_count() % 2
    return bytes(
        reduce(
            xor, (change for bit, change in enumerate(_COUNTER_BITS) if counter >> bit & 1), code
        )
        for counter in range(DATA_ID_COUNT)
    )


def first_byte_table(data_ids: bytes) -> bytes:
    """Contribution of byte 1, of the data ID for its counter, and of the constants.

    The CRC of a frame with bytes b is ``table[b[1]] ^ A[b[2:4]] ^ B[b[4:6]] ^ C[b[6:8]]`` where
    A, B, C are `WORD_TABLES`; there are sixteen data IDs.
    """
    return bytes(crc8(bytes((byte, 0, 0, 0, 0, 0, 0, data_ids[byte & 15]))) for byte in range(256))


def profile2_crc(data: bytes, data_ids: bytes) -> int:
    """CRC of one frame computed byte by byte: the definition, for tools and tests."""
    return crc8(data[1:] + data_ids[data[1] & 15 : (data[1] & 15) + 1])
