#!/usr/bin/env python3
"""Cost of a frame at both ends, protection included, against cantools in the same run.

cantools gets its faster form (raw integers, no range check) as well as its plain one, and pays for
the CRC with the byte-wise computation. Ratios are what to look at; times are of this machine.

CPU time is measured, not wall time, and the two are measured in turn: on a busy machine the longer
rounds of the slower one would be preempted more often, which would flatter the faster.
"""

import math
from collections.abc import Callable
from time import thread_time_ns
from typing import Any

from cantools.database.can import Database, Message

from tools.printing import command_line, show
from utank_hil.canbus import (
    ControlWord,
    DriveState,
    DriveStatus1,
    PumpCommand,
    Quality,
    SensorMotion,
    SensorTank,
    Switch,
    load_catalogue,
)
from utank_hil.canbus.catalogue import DBC_PATH, read_data_ids
from utank_hil.canbus.e2e import profile2_crc

FRAMES = 1_024
ROUNDS = 40

EXAMPLES: tuple[tuple[str, Any], ...] = (
    ("PUMP_CMD", PumpCommand(1234.0, ControlWord.ENABLE_OPERATION, 0.1)),
    (
        "DRIVE_STATUS_1",
        DriveStatus1(1230.0, 42.0, DriveState.OPERATION_ENABLED, 3, False, False, True, False),
    ),
    ("SENSOR_MOTION", SensorMotion(0.0512, -0.0231, Quality.GOOD)),
    ("SENSOR_TANK", SensorTank(-1.204, 1.198, Switch.OFF, Switch.OFF, Quality.GOOD)),
)


def best_us(works: dict[str, Callable[[], None]]) -> dict[str, float]:
    """Shortest of several rounds of each, in microseconds a frame."""
    shortest = dict.fromkeys(works, math.inf)
    for _ in range(ROUNDS):
        for name, work in works.items():
            start = thread_time_ns()
            work()
            shortest[name] = min(shortest[name], thread_time_ns() - start)
    return {name: nanoseconds / FRAMES / 1000 for name, nanoseconds in shortest.items()}


def protected(data: bytes, data_ids: bytes) -> bytes:
    """Set the CRC byte."""
    return bytes((profile2_crc(data, data_ids),)) + data[1:]


def measure(dbc: Message, message: Any) -> dict[str, float]:
    """Time both ends of one message, ours and through cantools."""
    catalogue = load_catalogue()
    tx, rx = catalogue.transmitter(type(message)), catalogue.receiver(type(message))
    frames = [tx.frame(message) for _ in range(FRAMES)]  # whole turns of the counter
    values = {name: float(value) for name, value in message._asdict().items()}
    values |= {"crc": 0, "counter": 1}
    raw = dbc.decode(frames[0].data, scaling=False, decode_choices=False)
    data_ids = read_data_ids(dbc) or b""

    def encode() -> None:
        for _ in range(FRAMES):
            tx.frame(message)

    def decode() -> None:
        for frame in frames:
            rx.accept(frame)

    def cantools_encode() -> None:
        for _ in range(FRAMES):
            protected(dbc.encode(values), data_ids)

    def cantools_encode_raw() -> None:
        for _ in range(FRAMES):
            protected(dbc.encode(raw, scaling=False, strict=False), data_ids)

    def cantools_decode() -> None:
        for frame in frames:
            if profile2_crc(frame.data, data_ids) == frame.data[0]:
                dbc.decode(frame.data, decode_choices=False)

    result = best_us(
        {
            "encode_us": encode,
            "decode_us": decode,
            "cantools_encode_us": cantools_encode,
            "cantools_encode_raw_us": cantools_encode_raw,
            "cantools_decode_us": cantools_decode,
        }
    )
    if any(rx.rejected.values()):
        raise SystemExit(f"{dbc.name}: frames were rejected: {rx.rejected}")
    result["encode_ratio"] = result["cantools_encode_us"] / result["encode_us"]
    result["encode_raw_ratio"] = result["cantools_encode_raw_us"] / result["encode_us"]
    result["decode_ratio"] = result["cantools_decode_us"] / result["decode_us"]
    return result


def main() -> None:
    """Measure and print."""
    arguments = command_line(__doc__).parse_args()
    database = Database()
    database.add_dbc_file(DBC_PATH)
    results = {
        name: measure(database.get_message_by_name(name), message) for name, message in EXAMPLES
    }
    show(results, arguments)


if __name__ == "__main__":
    main()
