"""What protects the frames of one message of another maker's device."""

from typing import Final

from utank_hil.canbus.endpoints import BUCKET_LIMIT, MAX_LOST, RESYNC_FRAMES, Rejection
from utank_hil.canbus.profiles.device_plan import Crc8
from utank_hil.canbus.profiles.field import Field


class HeardMessage:
    """Length, checksum and counter of one message, and how its frames pass them.

    The counts `heard`, `lost`, `rejected` and `valid` are as of `Receiver`.
    """

    def __init__(
        self,
        can_id: int,
        cycle_ns: int,
        length: int,
        counter: Field | None = None,
        crc: Crc8 | None = None,
    ) -> None:
        self.can_id, self.cycle_ns, self.length = can_id, cycle_ns, length
        self.heard = self.lost = 0
        self.changes = 0  # No device of another maker sends a message on a change.
        self.rejected = dict.fromkeys(Rejection, 0)
        self.valid = False
        self._counter, self._crc = counter, crc
        self._counts: Final = 0 if counter is None else 1 << counter.bits
        self._last = self._candidate = -1
        self._run = self._bucket = 0

    def passes(self, data: bytes) -> bool:
        """Judge the next frame; a rejected one does not change the counter."""
        self.heard += 1
        if len(data) != self.length:
            return self._reject(Rejection.LENGTH)
        if self._crc is not None and self._crc.of(data) != data[self._crc.byte]:
            return self._reject(Rejection.CRC)
        if self._counter is not None:
            counter = self._counter.raw(data)
            if self._last >= 0:
                steps = (counter - self._last) % self._counts
                if not 0 < steps <= MAX_LOST + 1:
                    self._run = self._run + 1 if counter == self._candidate else 1
                    self._candidate = (counter + 1) % self._counts
                    if self._run < RESYNC_FRAMES:
                        return self._reject(Rejection.SEQUENCE if steps else Rejection.REPEATED)
                else:
                    self.lost += steps - 1
            self._last, self._run = counter, 0
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


DRIFT: Final = 0.02
"""Two clocks may run apart by so much: one part in a hundred was measured, of an inertial sensor;
twice that."""


class Stamp:
    """The device's own time in a message: whether it moves on, and how late its frame came.

    The least delay so far counts as none. It is forgotten at the rate of two clocks that run apart.
    A count is `unit_us` microseconds; a frame that is later than others by more than `late_ms` is
    not accepted.
    """

    def __init__(self, field: Field, unit_us: float, late_ms: float) -> None:
        self._field = field
        self._unit_ns = unit_us * 1e3
        self._late_ns = late_ms * 1e6
        self._counts = 1 << field.bits
        self._last = -1
        self._time_ns = self._least_ns = 0.0
        self._came_ns = 0
        self.late = 0

    def passes(self, data: bytes, now_ns: int) -> bool:
        """Take the next stamp; False where it stands, steps back, or comes late.

        A step back that is no wrap is a device that has restarted: its next stamp is taken.
        """
        stamp = self._field.raw(data)
        last, self._last = self._last, stamp
        steps = (stamp - last) % self._counts
        if last < 0 or steps > self._counts // 2:
            self._time_ns, self._least_ns, self._came_ns = 0.0, float(now_ns), now_ns
            return False
        if steps == 0:
            return False
        self._time_ns += steps * self._unit_ns
        delay_ns = now_ns - self._time_ns
        forgiven_ns = self._least_ns + DRIFT * (now_ns - self._came_ns)
        self._least_ns, self._came_ns = min(delay_ns, forgiven_ns), now_ns
        if delay_ns - self._least_ns > self._late_ns:
            self.late += 1
            return False
        return True
