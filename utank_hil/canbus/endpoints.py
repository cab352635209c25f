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
    PROOF = "a proof of another key"


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


class Acceptance:
    """Judges the frames of one message by their order; a rejected one does not change the counter.

    The first valid frame is accepted. After that the counter may skip up to `MAX_LOST` frames,
    counted in `lost`. Any other step is rejected. After `RESYNC_FRAMES` consecutive frames without
    an accepted one between them, the last is accepted: the sender has restarted or the gap was
    long. So a single repeated, delayed or inserted frame never changes the expected counter if it
    is less than ``counts - MAX_LOST - 1`` frames old; an older one looks like the next one. The age
    of frames is judged elsewhere, since there is no clock here.

    `counts` are the values of the counter, 0 without one. `heard` counts frames, accepted or not,
    `rejected` those that were not, by `Rejection`. `valid` is the state of the stream by a leaky
    bucket, +1 for a rejected and -1 for an accepted frame: False before the first accepted frame,
    and from `BUCKET_LIMIT` until the bucket is empty again. `changes` are frames with a new
    content, which who hears a message that is also sent on a change counts; else 0. `may_speak` is
    False while its sender is being configured, and silent by right.
    """

    __slots__ = (
        "_bucket", "_candidate", "_counts", "_expected", "_run",
        "can_id", "changes", "cycle_ns", "heard", "lost", "may_speak", "rejected", "valid",
    )  # fmt: skip

    def __init__(self, can_id: int, cycle_ns: int, counts: int) -> None:
        self.can_id = can_id
        self.cycle_ns = cycle_ns
        self.valid, self.may_speak = False, True
        self.heard = self.lost = self.changes = 0
        self.rejected = dict.fromkeys(Rejection, 0)
        self._counts = counts
        self._bucket = self._run = 0
        self._expected = self._candidate = _NO_COUNTER

    def _follows(self, counter: int) -> bool:
        """Whether a whole frame with this counter is accepted."""
        steps = self._steps(counter)
        if steps < 1:
            return self._reject(Rejection.SEQUENCE if steps else Rejection.REPEATED)
        self.lost += steps - 1
        return self._drain()

    def _steps(self, counter: int) -> int:
        """Take a counter: by how many it is on; 0 if it is repeated, -1 out of sequence."""
        counts, steps = self._counts, 1
        following = (counter + 1) % counts
        if self._expected != _NO_COUNTER:
            steps = (following - self._expected) % counts
            if not 0 < steps <= MAX_LOST + 1:
                self._run = self._run + 1 if counter == self._candidate else 1
                self._candidate = following
                if self._run < RESYNC_FRAMES:
                    return -1 if steps else 0
                steps = 1
        self._expected, self._run = following, 0
        return steps

    def _drain(self) -> bool:
        self._run = 0
        self._bucket = max(self._bucket - 1, 0)
        if not self._bucket:
            self.valid = True
        return True

    def _reject(self, reason: Rejection) -> bool:
        self.rejected[reason] += 1
        self._bucket = min(self._bucket + 1, BUCKET_LIMIT)
        if self._bucket == BUCKET_LIMIT:
            self.valid = False
        return False


class Receiver(Acceptance, Generic[T]):
    """Accepts or rejects the frames of one message of the catalogue."""

    counts: ClassVar[bool] = True  #: Whether a counter tells a new frame.
    proved: ClassVar[bool] = True  #: Nothing has to be proved before an order counts.
    __slots__ = ("_decode",)

    def __init__(self, codec: Codec[T]) -> None:
        super().__init__(codec.can_id, codec.cycle_ns, _COUNTER_MASK + 1 if codec.protected else 0)
        self._decode = codec.decode

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
        accepted = self._follows(counter) if self._counts else self._drain()
        return message if accepted else None

    def intact(self, frame: Frame) -> T | None:
        """Return the message of a whole frame, also out of sequence, as a stop; nothing changes."""
        return self._decode(frame.data) if len(frame.data) == FRAME_BYTES else None

    def changed(self, new: bool) -> None:
        """Count a frame that came because its content is new."""
        self.changes += new
