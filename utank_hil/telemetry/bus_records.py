"""Inputs and answers of a controller node, as records of one fixed layout.

A node without I/O is a function of its inputs: these records, in order, and its configuration
determine its behaviour.
"""

import struct
from enum import IntEnum
from typing import Final

import numpy as np
import numpy.typing as npt

from utank_hil.telemetry.ring import RingKind, RingWriter

PAYLOAD_BYTES: Final = 8
RECORD: Final = np.dtype(
    [
        ("number", "<u4"), ("length", "u1"), ("data", "u1", (PAYLOAD_BYTES,)), ("kind", "u1"),
        ("spare", "<u2"), ("time_ns", "<i8"),
    ]
)  # fmt: skip
"""Type of a record: `number` is a frame's identifier or a count, `time_ns` the node's time."""
LAYOUT: Final = struct.Struct("<I9pB2xq")  #: Packed record: number, length, data, kind and time.
Records = npt.NDArray[np.void]  #: Records, shape (n,), of type `RECORD`.
IN_A_SLOT: Final = 32  #: Number of records in one slot of a ring; five ticks have some 25.


class Kind(IntEnum):
    """Kind of a record; inputs come before their TICK and answers after it."""

    RECEIVED = 1  #: A frame was received.
    SENT = 2  #: A frame was returned by the tick, or the stop, before.
    TICK = 3
    OTHERS = 4  #: `number` frames of other kinds were on the bus.
    LINK_ERROR = 5
    STOP = 6
    STARTED = 7  #: First record: the first byte says whether the loop has a real-time policy.
    ALIVE = 8  #: The controller asked whether the retuner lives; the first byte is the answer.
    ANSWER = 9  #: The controller took this piece of the retuner's answer of `number` bytes.
    LOST = 10  #: `number` rows were lost before they could be written.
    ESTIMATOR_ALIVE = 11
    ESTIMATE = 12  #: The estimator of sea and ship answered; ALIVE and ANSWER are the retuner's.


def frame_ring(slots: int) -> RingWriter:
    """Create a ring for packed records; raises RingError without room in shared memory."""
    return RingWriter(RingKind.FRAMES, LAYOUT.size, IN_A_SLOT, slots)


def pack(records: Records) -> bytes:
    """Arrange records so that they compress well: column by column, payloads by identifier."""
    head = np.zeros((len(records), 7), dtype=np.uint8)
    head[:, 0], head[:, 1] = records["kind"], records["length"]
    head[:, 3:] = records["number"].astype("<u4").view(np.uint8).reshape(-1, 4)
    steps_ns = np.diff(records["time_ns"], prepend=np.int64(0)).astype("<i8")
    times = steps_ns.view(np.uint8).reshape(-1, 8)
    payloads = records["data"][_by_sender(head)]
    planes = [np.ascontiguousarray(part.T).tobytes() for part in (head, times, payloads)]
    return struct.pack("<I", len(records)) + b"".join(planes)


def unpack(packed: bytes) -> Records:
    """Invert `pack`; raises ValueError for other data."""
    count = int.from_bytes(packed[:4], "little")
    planes = np.frombuffer(packed, dtype=np.uint8, offset=4)
    if planes.size != count * (7 + 8 + PAYLOAD_BYTES):
        raise ValueError(f"{planes.size} bytes are not {count} records")
    head, times, payloads = (
        np.ascontiguousarray(part.T)
        for part in np.split(planes.reshape(-1, count) if count else planes.reshape(23, 0), [7, 15])
    )
    records = np.zeros(count, dtype=RECORD)
    records["kind"], records["length"] = head[:, 0], head[:, 1]
    records["number"] = np.ascontiguousarray(head[:, 3:]).view("<u4").ravel()
    records["time_ns"] = np.cumsum(times.view("<i8").ravel())
    records["data"][_by_sender(head)] = payloads
    return records


def _by_sender(head: npt.NDArray[np.uint8]) -> npt.NDArray[np.intp]:
    """Return the order that groups records by kind and identifier; groups keep their order."""
    keys = head.astype(np.int64) @ (1 << np.arange(0, 56, 8))
    return np.argsort(keys, kind="stable")
