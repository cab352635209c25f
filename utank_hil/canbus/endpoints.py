"""Transmitter and receiver of one message: sequence counter and acceptance of frames."""

from enum import Enum
from typing import Any, ClassVar, Final, Generic, TypeVar

from utank_hil.canbus.codec import FRAME_BYTES, Codec
from utank_hil.canbus.frame import Frame

T = TypeVar("T", bound=tuple[Any, ...])
#: Frames that may be missing between two accepted ones; after more, `RESYNC_FRAMES` applies.
MAX_LOST: Final = 3
RESYNC_FRAMES: Final = 3  #: Consecutive frames after which a new counter value is accepted.
BUCKET_LIMIT: Final = 5  #: Level of the leaky bucket at which a stream becomes invalid.
_COUNTER_MASK: Final = 15
# a NamedTuple's own constructor takes twice the time
_new: Final = tuple.__new__
_NO_COUNTER: Final = -1


class Rejection(Enum):
    """Why a frame was not accepted."""

    LENGTH = "wrong length"
    CRC = "wrong CRC or data ID"
    REPEATED = "counter repeated"
    SEQUENCE = "counter out of sequence"


class Transmitter(Generic[T]):
    """Encodes messages of one type and sender into protected frames."""

    __slots__ = ("_encode", "can_id", "counter", "cycle_ns")

    def __init__(self, codec: Codec[T]) -> None:
        self.can_id = codec.can_id
        self.cycle_ns = codec.cycle_ns
        self.counter = 0  #: Sequence counter of the last frame.
        self._encode = codec.encode

    def frame(self, message: T) -> Frame:
        """Return the next frame; values out of range saturate, NaN and None mean not available."""
        self.counter = counter = (self.counter + 1) & _COUNTER_MASK
        return _new(Frame, (self.can_id, self._encode(message, counter)))


class Receiver(Generic[T]):
    """Accepts or rejects the frames of one message; a rejected frame does not change the counter.

    The first valid frame is accepted. After that the counter may skip up to `MAX_LOST` frames,
    counted in `lost`. Any other step is rejected. After `RESYNC_FRAMES` consecutive frames without
    an accepted one between them, the last is accepted: the sender has restarted or the gap was
    long. So a single repeated, delayed or inserted frame never changes the expected counter if it
    is less than ``16 - MAX_LOST - 1`` frames old; with four bits, an older one looks like the next
    one. The age of frames is judged elsewhere, since there is no clock here.

    `heard` counts frames, accepted or not, `rejected` those that were not, by `Rejection`. `valid`
    is the state of the stream by a leaky bucket, +1 for a rejected and -1 for an accepted frame:
    False before the first accepted frame, and from `BUCKET_LIMIT` until the bucket is empty again.
    `changes` are frames with a new content, which who hears a message that is also sent on a change
    counts; else 0.
    """

    counts: ClassVar[bool] = True  #: Whether a counter tells a new frame.
    proved: ClassVar[bool] = True  #: Nothing has to be proved before an order counts.
    __slots__ = (
        "_bucket", "_candidate", "_decode", "_expected", "_protected", "_run",
        "can_id", "changes", "cycle_ns", "heard", "lost", "rejected", "valid",
    )  # fmt: skip

    def __init__(self, codec: Codec[T]) -> None:
        self.can_id = codec.can_id
        self.cycle_ns = codec.cycle_ns
        self.valid = False
        self.heard = self.lost = self.changes = 0
        self.rejected = dict.fromkeys(Rejection, 0)
        self._decode = codec.decode
        self._protected = codec.protected
        self._bucket = 0
        self._expected = _NO_COUNTER
        self._candidate = _NO_COUNTER
        self._run = 0

    @property
    def counter(self) -> int | None:
        """Counter of the last accepted frame, None before the first."""
        return None if self._expected == _NO_COUNTER else (self._expected - 1) & _COUNTER_MASK

    def accept(self, frame: Frame) -> T | None:
        """Return the message of a frame with this `can_id`, or None if it is rejected."""
        self.heard += 1
        data = frame.data
        if len(data) != FRAME_BYTES:
            self._reject(Rejection.LENGTH)
            return None
        message = self._decode(data)
        if message is None:
            self._reject(Rejection.CRC)
            return None
        counter = data[1] & _COUNTER_MASK
        if counter == self._expected:
            self._expected = (counter + 1) & _COUNTER_MASK
            if self._bucket:
                self._drain()
            return message
        return self._accept_out_of_step(message, counter)

    def intact(self, frame: Frame) -> T | None:
        """Return the message of a whole frame, also out of sequence, as a stop; nothing changes."""
        return self._decode(frame.data) if len(frame.data) == FRAME_BYTES else None

    def changed(self, new: bool) -> None:
        """Count a frame that came because its content is new."""
        self.changes += new

    def _accept_out_of_step(self, message: T, counter: int) -> T | None:
        following = (counter + 1) & _COUNTER_MASK
        if not self._protected:
            self._drain()
            return message
        if self._expected != _NO_COUNTER:
            missing = (counter - self._expected) & _COUNTER_MASK
            if missing <= MAX_LOST:
                self.lost += missing
            else:
                self._run = self._run + 1 if counter == self._candidate else 1
                self._candidate = following
                if self._run < RESYNC_FRAMES:
                    repeated = missing == _COUNTER_MASK
                    self._reject(Rejection.REPEATED if repeated else Rejection.SEQUENCE)
                    return None
        self._expected = following
        self._drain()
        return message

    def _drain(self) -> None:
        self._run = 0
        self._bucket = max(self._bucket - 1, 0)
        if not self._bucket:
            self.valid = True

    def _reject(self, reason: Rejection) -> None:
        self.rejected[reason] += 1
        self._bucket = min(self._bucket + 1, BUCKET_LIMIT)
        if self._bucket == BUCKET_LIMIT:
            self.valid = False
