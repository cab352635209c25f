"""Faults of frames: lost, damaged, repeated, out of sequence."""

import random
from abc import abstractmethod
from collections import deque
from collections.abc import Iterable
from itertools import cycle
from typing import Annotated, Final, Literal

from pydantic import Field

from firmware_sim.fault_injection.bench_parts import Spoil
from firmware_sim.fault_injection.fault import MessageFault, one_in
from utank_hil.base.parameters import Range
from utank_hil.canbus import Frame, load_catalogue
from utank_hil.canbus.codec import FRAME_BYTES
from utank_hil.canbus.e2e import data_ids, profile2_crc

_FOREIGN_DATA_IDS: Final = data_ids(127)  # Data IDs that no message of the catalogue has.


class Lost(MessageFault):
    """Frames are lost: all of them, or a share by chance."""

    of_frames = True
    kind: Literal["lost"]
    share: Annotated[float, Field(gt=0, le=1)] = 1.0  #: Share of the frames lost at random.

    def _spoil(self, seed: int) -> Spoil:
        draw = random.Random(seed).random
        return lambda frame, _: () if draw() < self.share else (frame,)


class Frozen(MessageFault):
    """The same frame is sent again and again."""

    of_frames = True
    kind: Literal["frozen"]

    def _spoil(self, seed: int) -> Spoil:  # noqa: ARG002
        return _repeats(1)


class Replayed(MessageFault):
    """The first frames of the fault are repeated in place of the new ones."""

    of_frames = True
    kind: Literal["replayed"]
    frames: Annotated[int, Field(ge=2)]  #: Number of frames that are repeated.

    def _spoil(self, seed: int) -> Spoil:  # noqa: ARG002
        return _repeats(self.frames)


def _repeats(count: int) -> Spoil:
    kept: list[Frame] = []
    again = cycle(kept)  # begins when all are kept

    def repeat(frame: Frame, _: float) -> Iterable[Frame]:
        if len(kept) == count:
            return (next(again),)
        kept.append(frame)
        return (frame,)

    return repeat


class Doubled(MessageFault):
    """Every frame is sent several times."""

    of_frames = True
    kind: Literal["doubled"]
    times: Annotated[int, Range(least=2, most=100)] = 2  #: Number of times that each frame is sent.

    def _spoil(self, seed: int) -> Spoil:  # noqa: ARG002
        return lambda frame, _: (frame,) * self.times


class Inserted(MessageFault):
    """An old frame is sent beside each new one."""

    of_frames = True
    kind: Literal["inserted"]
    back: Annotated[int, Range(least=1, most=10_000)]  #: Age of the old frame in cycles.

    def _spoil(self, seed: int) -> Spoil:  # noqa: ARG002
        old: deque[Frame] = deque(maxlen=self.back + 1)

        def insert(frame: Frame, _: float) -> Iterable[Frame]:
            old.append(frame)
            return (frame, old[0]) if len(old) > self.back else (frame,)

        return insert


class Counter(MessageFault):
    """The counter has a wrong step, with a correct CRC; with step zero it stands still."""

    of_catalogue = True
    kind: Literal["counter"]
    step: Annotated[int, Field(ge=0, le=15)]
    """Step of the counter from frame to frame; the correct step is 1."""
    one_of: Annotated[int, Field(ge=1)] = 1
    """Only one frame in this number is sent, as by a node that is slower than its cycle."""

    def _spoil(self, seed: int) -> Spoil:  # noqa: ARG002
        codec = self.named.codec
        counter: list[int] = []
        sends = one_in(self.one_of)

        def count(frame: Frame, _: float) -> Iterable[Frame]:
            if not sends():
                return ()
            message = load_catalogue().decoded(frame)
            if message is None:  # another fault has damaged it
                return (frame,)
            counter.append(frame.data[1] & 15 if not counter else counter.pop() + self.step)
            return (Frame(codec.can_id, codec.encode(message, counter[0] & 15)),)

        return count


class Damaged(MessageFault):
    """Base of faults that damage one frame in `every`."""

    of_catalogue = True
    every: Annotated[int, Field(ge=1)] = 1

    @abstractmethod
    def _damage(self, data: bytes) -> bytes:
        """Return the damaged bytes of a frame, which another fault may have shortened."""

    def _spoil(self, seed: int) -> Spoil:  # noqa: ARG002
        harms = one_in(self.every)
        return lambda frame, _: (
            Frame(frame.can_id, self._damage(frame.data)) if harms() else frame,
        )


class Corrupted(Damaged):
    """Two bits of a byte are wrong, undetected by the CAN controllers."""

    kind: Literal["corrupted"]
    byte: Annotated[int, Field(ge=0, lt=FRAME_BYTES)] = 3  #: Index of the damaged byte.

    def _damage(self, data: bytes) -> bytes:
        wrong = bytearray(data)
        if self.byte < len(wrong):
            wrong[self.byte] ^= 0x24
        return bytes(wrong)


class WrongDataId(Damaged):
    """The CRC is computed with the data ID of another message."""

    kind: Literal["data_id"]

    def _damage(self, data: bytes) -> bytes:
        if len(data) < FRAME_BYTES:
            return data
        return bytes([profile2_crc(data, _FOREIGN_DATA_IDS)]) + data[1:]


class WrongLength(Damaged):
    """The frame is too short."""

    kind: Literal["length"]
    length: Annotated[int, Field(ge=0, lt=FRAME_BYTES)]  #: Number of bytes left.

    def _damage(self, data: bytes) -> bytes:
        return data[: self.length]
