"""One signal in a frame of any maker, with its bits worked out beforehand, and what it is for."""

import math
import struct
from typing import Final

_REAL: Final = {16: ("<e", 65504.0), 32: ("<f", (2 - 2**-23) * 2.0**127), 64: ("<d", math.inf)}
"""Real numbers by their bits: how they are packed, and the greatest."""


class Field:
    """A signal as a DBC lays it out: physical = raw * scale + offset.

    `start` is the first bit as in a DBC: of a signal with the least byte first the least bit, of
    one with the most byte first (`big_endian`) the most; `length` is that of the frame in bytes.
    `signed` is two's complement, `real` IEEE 754. Counts outside `least_raw` and `most_raw` are not
    available, or an error. ValueError is raised if the signal does not fit its frame, or a real
    number has not 16, 32 or 64 bits.
    """

    __slots__ = (
        "_end", "_first", "_greatest", "_half", "_ieee", "_mask", "_spare", "big_endian", "bits",
        "least_raw", "most_raw", "offset", "scale", "shift",
    )  # fmt: skip

    def __init__(
        self,
        start: int,
        bits: int,
        length: int,
        *,
        big_endian: bool = False,
        signed: bool = False,
        real: bool = False,
        scale: float = 1.0,
        offset: float = 0.0,
        least_raw: int | None = None,
        most_raw: int | None = None,
    ) -> None:
        shift = start
        if big_endian:  # the most bit is so far from the left
            shift = 8 * length - (8 * (start // 8) + 7 - start % 8) - bits
        if bits < 1 or shift < 0 or shift + bits > 8 * length:
            raise ValueError(f"bits {start} and on, {bits} of them, are not in {length} bytes")
        if real and bits not in _REAL:
            raise ValueError(f"a real number has 16, 32 or 64 bits, not {bits}")
        self.big_endian = big_endian
        self.shift = shift
        # its bytes, from the most of them to the least, and the bits that the least one has besides
        least = shift // 8
        count = (shift + bits - 1) // 8 - least + 1
        self._first = length - least - count if big_endian else least + count - 1
        self._end = self._first + (count if big_endian else -count)
        self._spare = shift % 8
        self._mask = (1 << bits) - 1
        self._half = 1 << (bits - 1) if signed and not real else 1 << bits
        self._ieee, self._greatest = _REAL[bits] if real else ("", 0.0)
        self.least_raw = -(1 << bits) if least_raw is None else least_raw
        self.most_raw = 1 << bits if most_raw is None else most_raw
        self.bits, self.scale, self.offset = bits, scale, offset

    @property
    def signed(self) -> bool:
        """Whether the counts are two's complement."""
        return self._half <= self._mask

    @property
    def real(self) -> bool:
        """Whether it is a real number."""
        return self._ieee != ""

    def raw(self, data: bytes) -> int:
        """Counts of the signal, with their sign."""
        place, end = self._first, self._end
        word, step = data[place], -1 if end < place else 1
        place += step
        while place != end:
            word = word << 8 | data[place]
            place += step
        raw = word >> self._spare & self._mask
        return raw - self._mask - 1 if raw >= self._half else raw

    def value(self, data: bytes) -> float:
        """Physical value; NaN if the counts say that there is none."""
        raw = self.raw(data)
        if not self.least_raw <= raw <= self.most_raw:
            return math.nan
        if self._ieee:
            packed = raw.to_bytes(self.bits // 8, "little")
            return float(struct.unpack(self._ieee, packed)[0]) * self.scale + self.offset
        return raw * self.scale + self.offset

    def put(self, word: int, value: float, length: int) -> int:
        """The frame's content as a number, least byte first, with this value in it.

        The value is cut to what the bits, and the counts that are values, can hold. NaN is the
        first count beyond these; zero where every count is a value.
        """
        raw = (value - self.offset) / self.scale
        if self._ieee:
            raw = min(max(raw, -self._greatest), self._greatest) if raw == raw else raw
            counts = int.from_bytes(struct.pack(self._ieee, raw), "little")
            return self.put_counts(word, counts, length)
        least, most = self.least_raw, self.most_raw
        low, high = -self._half if self._half <= self._mask else 0, min(self._half - 1, self._mask)
        if math.isnan(value):
            counts = most + 1 if most < high else least - 1 if least > low else 0
        else:
            counts = round(min(max(raw, low, least), high, most))
        return self.put_counts(word, counts, length)

    def put_counts(self, word: int, counts: int, length: int, mask: int = -1) -> int:
        """Likewise with these counts, or the bits of a `mask` of them."""
        mask = (mask & self._mask) << self.shift
        if self.big_endian:
            word = int.from_bytes(word.to_bytes(length, "little"), "big")
        word = word & ~mask | counts << self.shift & mask
        if self.big_endian:
            word = int.from_bytes(word.to_bytes(length, "big"), "little")
        return word


class SignalPlan:
    """One measured value: value = sign * (physical * factor + offset).

    `place` is that of the value in the measurement. Outside of `least` to `most`, in the maker's
    unit, there is no value.
    """

    __slots__ = ("factor", "field", "least", "most", "offset", "place", "sign")

    def __init__(
        self,
        place: int,
        field: Field,
        factor: float,
        offset: float,
        sign: float,
        least: float,
        most: float,
    ) -> None:
        self.place, self.field, self.factor, self.offset = place, field, factor, offset
        self.sign, self.least, self.most = sign, least, most

    def value(self, data: bytes) -> float:
        """The value in its own unit; NaN where there is none."""
        physical = self.field.value(data)
        if self.least <= physical <= self.most:
            return self.sign * (physical * self.factor + self.offset)
        return math.nan


class ConditionPlan:
    """What a status must say: its counts under a mask are among those allowed."""

    __slots__ = ("_least", "allowed", "field", "mask")

    def __init__(self, field: Field, mask: int, allowed: frozenset[int]) -> None:
        self.field, self.mask, self.allowed = field, mask & (1 << field.bits) - 1, allowed
        self._least = min(allowed)  # of most devices the only one

    def holds(self, data: bytes) -> bool:
        """Whether a frame says so."""
        counts = self.field.raw(data) & self.mask
        return counts == self._least or counts in self.allowed
