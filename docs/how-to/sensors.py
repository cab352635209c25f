"""Sensor hardware in the place of the emulated sensors: python-can, cantools and the DBC alone.

A start for a node of your own: replace `measurements` by readings of your sensors.

Example: python docs/how-to/sensors.py --bus vcan0 --configuration 1234
"""

import argparse
import contextlib
import math
import time
from pathlib import Path

import can
import cantools
from cantools.database.can import Database, Message

DBC = Path(__file__).resolve().parents[2] / "utank_hil" / "canbus" / "utank.dbc"
TICK_S = 0.01
ADDRESS = 0x82
NO_COUNT = 15 * 16  # all ones: python-can tells no error counters


def measurements(time_s: float) -> dict[str, dict[str, float]]:
    """Signals of each message at a time: a ship that rolls by one degree in 12 s."""
    omega, roll_rad = 2 * math.pi / 12.0, math.radians(1.0)
    return {
        "SENSOR_MOTION": {
            "roll_rad": roll_rad * math.sin(omega * time_s),
            "roll_rate_rad_s": roll_rad * omega * math.cos(omega * time_s),
            "quality": 0,
        },
        "SENSOR_TANK": {
            "port_level_m": 0.0,
            "starboard_level_m": 0.0,
            "port_high": 0,
            "starboard_high": 0,
            "quality": 0,
        },
        "SENSOR_PUMP": {"pressure_pa": 0.0, "flow_m3_s": 0.0, "quality": 0},
    }


def protected(message: Message, signals: dict[str, float], counter: int) -> bytes:
    """The eight bytes of a frame: CRC-8, polynomial 0x2F, over bytes 1 to 7 and the data ID."""
    # a measurement out of its range is an error; error counts that are not available are so, too
    strict = not message.name.startswith("HEARTBEAT")
    data = message.encode({**signals, "crc": 0, "counter": counter}, strict=strict)
    assert message.dbc is not None
    data_ids = bytes.fromhex(str(message.dbc.attributes["DataIDs"].value))
    crc = 0xFF
    for byte in (*data[1:], data_ids[counter]):
        crc ^= byte
        for _ in range(8):
            crc = (crc << 1 ^ 0x2F) & 0xFF if crc & 0x80 else crc << 1
    return bytes([crc ^ 0xFF]) + data[1:]


def catalogue_version() -> int:
    """Version of the DBC, as heartbeats carry it."""
    return int(cantools.database.load_file(DBC).version.split()[0])


def main() -> None:
    """Send in the cycles of the DBC until Ctrl-C."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--bus", required=True, help="SocketCAN interface")
    parser.add_argument("--configuration", required=True, type=int, help="version of the ship")
    arguments = parser.parse_args()
    database = cantools.database.load_file(DBC)
    assert isinstance(database, Database)
    heartbeat = {
        "state": 2,
        "reset_cause": 0,
        "uptime_s": 0,
        "catalogue_version": catalogue_version(),
        "configuration_version": arguments.configuration,
        "transmit_error_count": NO_COUNT,
        "receive_error_count": NO_COUNT,
    }
    start = time.monotonic()
    ticks = 0
    due_ticks: dict[str, int] = {}
    counters: dict[str, int] = {}
    claim = database.get_message_by_name("ADDRESS_CLAIM_SENSORS")
    with can.Bus(arguments.bus, interface="socketcan") as bus:
        name = claim.encode({"name": ADDRESS})
        bus.send(can.Message(arbitration_id=claim.frame_id, data=name))
        while True:
            time_s = ticks * TICK_S
            heartbeat["uptime_s"] = min(time_s // 10 * 10, 40940)
            messages = {**measurements(time_s), "HEARTBEAT_SENSORS": heartbeat}
            for name, signals in messages.items():
                message = database.get_message_by_name(name)
                cycle_ticks = (message.cycle_time or 0) // 10
                if ticks >= due_ticks.get(name, 0):
                    due_ticks[name] = ticks - ticks % cycle_ticks + cycle_ticks
                    counters[name] = (counters.get(name, 0) + 1) % 16
                    data = protected(message, signals, counters[name])
                    bus.send(can.Message(arbitration_id=message.frame_id, data=data))
            # a late tick is left out, not made up for
            ticks = max(ticks + 1, int((time.monotonic() - start) / TICK_S))
            time.sleep(max(0.0, start + ticks * TICK_S - time.monotonic()))


if __name__ == "__main__":
    with contextlib.suppress(KeyboardInterrupt):
        main()
