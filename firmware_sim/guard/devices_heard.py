"""What devices of other makers say, by the parts of the guard's table; as guard_device.c."""

from typing import Final

from utank_hil.canbus import Frame
from utank_hil.canbus.profiles.guarded import MOVES, PLACES, GuardPart, Stream

OLDEST: Final = 65535
MOST_VALUE: Final = 32000


class DevicesHeard:
    """Values by stream and place, and how old each part is."""

    def __init__(self, parts: tuple[GuardPart, ...], unchanged: tuple[int, ...]) -> None:
        self.values = [[0] * PLACES for _ in Stream]
        self._parts, self._unchanged = parts, unchanged
        self._age, self._raw = [OLDEST] * len(parts), [0] * len(parts)
        self._same = [0] * len(Stream)

    def heard(self, frame: Frame) -> list[Stream]:
        """Take a frame; return the streams that it has a value of."""
        streams, data = set(), frame.data
        for index, part in enumerate(self._parts):
            if frame.can_id & part.id_bits != part.can_id or len(data) != part.length:
                continue
            at = part.crc.byte
            if at < len(data) and data[at] != part.crc.of(data):
                continue
            self._take(index, part, data)
            if part.place < PLACES:
                streams.add(part.stream)
        return sorted(streams)

    def whole(self, stream: Stream) -> bool:
        """Whether all parts of a stream are good and of now."""
        most = self._unchanged[stream]
        return (not most or self._same[stream] <= most) and all(
            age <= part.old
            for part, age in zip(self._parts, self._age, strict=True)
            if part.stream == stream
        )

    def tick(self) -> None:
        """Grow older."""
        self._age = [min(age + 1, OLDEST) for age in self._age]
        self._same = [min(age + 1, OLDEST) for age in self._same]

    def _take(self, index: int, part: GuardPart, data: bytes) -> None:
        word = int.from_bytes(data, "big" if part.most_first else "little")
        raw = word >> part.shift & part.mask
        counts = raw - 2 * part.sign_bit if raw & part.sign_bit else raw
        moved, good = raw != self._raw[index], part.least <= counts <= part.most
        self._raw[index] = raw
        if part.place != MOVES:
            self._age[index] = 0 if good else OLDEST
        elif moved:
            self._age[index] = 0
        if part.place < PLACES:
            if moved:
                self._same[part.stream] = 0
            value = counts * part.times + part.plus
            value = abs(value) // part.by * (1 if value > 0 else -1)  # as C divides
            value = min(max(value, -MOST_VALUE), MOST_VALUE)
            self.values[part.stream][part.place] = value if good else part.otherwise
