"""Signals of the bus as columns: one row per tick with the last value of each signal."""

import math
from array import array
from collections.abc import Iterable
from typing import Any, Final

import numpy as np

from utank_hil.base.arrays import FloatArray
from utank_hil.canbus import AddressClaim, DriveStatus2, load_catalogue
from utank_hil.canbus.codec import FRAME_BYTES, Codec
from utank_hil.telemetry.bus_records import Kind
from utank_hil.telemetry.replay import Entry

_NAMES: Final = {
    ("SENSOR_MOTION", "roll_rad"): "roll_rad",
    ("SENSOR_MOTION", "roll_rate_rad_s"): "roll_rate_rad_s",
    ("SENSOR_TANK", "port_level_m"): "port_level_m",
    ("SENSOR_TANK", "starboard_level_m"): "starboard_level_m",
    ("PUMP_CMD", "pressure_pa"): "pressure_command_pa",
    ("SENSOR_PUMP", "pressure_pa"): "pressure_actual_pa",
    ("VALVE_STATUS", "opening"): "valve_opening",
    ("CTRL_STATUS", "mode"): "mode",
    ("CTRL_STATUS", "fault"): "fault",
    ("CTRL_STATUS", "bus_load"): "bus_load",
    ("CTRL_STATUS", "retuning"): "retuning",
    ("PASSIVE_TWIN", "twin_roll_rad"): "twin_roll_rad",
    ("PASSIVE_TWIN", "twin_rms_rad"): "twin_roll_rms_rad",
    ("PASSIVE_TWIN", "roll_rms_rad"): "roll_rms_rad",
}  # Signals with the name of a telemetry column; others are named after their message.


class _Heard:
    """Frames of one message, by tick."""

    def __init__(self, codec: Codec[Any]) -> None:
        self.decode = codec.decode
        self.ticks = array("q")
        self.values = array("d")

    def add(self, tick: int, data: bytes) -> None:
        """Take a frame that is visible from a tick on; a damaged one is ignored."""
        message = self.decode(data) if len(data) == FRAME_BYTES else None
        if message is not None:
            self.ticks.append(tick)
            self.values.extend(math.nan if value is None else float(value) for value in message)

    def held(self, ticks: int, fields: int) -> FloatArray:
        """Return the last values in each tick, (ticks, fields); NaN before the first frame."""
        if not self.ticks:
            return np.full((ticks, fields), np.nan)
        values = np.asarray(self.values).reshape(-1, fields)
        last = np.searchsorted(np.asarray(self.ticks), np.arange(ticks), side="right") - 1
        return np.where((last < 0)[:, None], np.nan, values[last])


def signal_table(entries: Iterable[Entry]) -> dict[str, FloatArray]:
    """Decode the frames of a recording, whatever the controller's checks said of them.

    A received frame counts from the next tick on, a sent one from its own. Returned are arrays
    (n,), one value per tick: ``time_s`` since the first tick, the telemetry's columns, and every
    other signal as ``<message>_<signal>``, in SI units, states and flags as numbers. NaN before the
    first frame and where unavailable; all-NaN signals are left out.
    """
    messages = load_catalogue().messages
    heard = {codec.can_id: _Heard(codec) for _, _, codec in messages}
    times_ns = array("q")
    for number, data, kind, time_ns in entries:
        if kind == Kind.TICK:
            times_ns.append(time_ns)
        elif kind in (Kind.RECEIVED, Kind.SENT) and number in heard:
            heard[number].add(len(times_ns) - (kind == Kind.SENT), data)
    ticks_ns = np.asarray(times_ns, dtype=np.int64)
    columns: dict[str, FloatArray] = {}
    for message, _, codec in messages:
        if message is AddressClaim:
            continue
        fields: tuple[str, ...] = message._fields
        held = heard[codec.can_id].held(len(ticks_ns), len(fields))
        for name, column in zip(fields, held.T, strict=True):
            columns[_NAMES.get((codec.name, name), f"{codec.name.lower()}_{name}")] = column
        if message is DriveStatus2:
            volts, amperes = (fields.index(name) for name in ("bus_voltage_v", "current_a"))
            columns["pump_power_w"] = held[:, volts] * held[:, amperes]
    first = (*_NAMES.values(), "pump_power_w")
    order = (*first, *(name for name in columns if name not in first))
    return {
        "time_s": (ticks_ns - ticks_ns[:1]).astype(np.float64) * 1e-9,
        **{name: columns[name] for name in order if not np.isnan(columns[name]).all()},
    }
