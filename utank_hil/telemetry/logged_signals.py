"""Signals of a log, decoded from the frames of a recording or of the bus: a table by parts.

A log may be of days, so the whole of its table is held only as far as a limit goes.
"""

import math
from array import array
from collections.abc import Container, Iterable, Iterator
from typing import Any, Final

import numpy as np

from utank_hil.base.arrays import FloatArray
from utank_hil.base.between import ALWAYS, Between
from utank_hil.base.text_files import VALUES_LIMIT, TextFileError, more_values
from utank_hil.base.tick import TICK_NS
from utank_hil.canbus import AddressClaim, DriveStatus2, load_catalogue
from utank_hil.canbus.codec import FRAME_BYTES, Codec
from utank_hil.telemetry.frame_log import Kind
from utank_hil.telemetry.replay import Entry

Columns = dict[str, FloatArray]

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
_PART: Final = 1 << 14  #: Number of ticks that are decoded at once.
_HELD_TICKS: Final = 2_000_000_000 // TICK_NS
"""Ticks for which a value is held: two of the longest cycles, then its sender has fallen silent."""


class _Heard:
    """Frames of one message, by tick of a part."""

    def __init__(self, codec: Codec[Any], fields: tuple[str, ...]) -> None:
        self.decode, self.fields = codec.decode, fields
        self.names = [_NAMES.get((codec.name, n), f"{codec.name.lower()}_{n}") for n in fields]
        self.ticks = array("q")
        self.values = array("d")

    def add(self, tick: int, data: bytes) -> None:
        """Take a frame that is visible from a tick on; a damaged one is ignored."""
        message = self.decode(data) if len(data) == FRAME_BYTES else None
        if message is None:
            return
        if self.ticks and self.ticks[-1] == tick:  # The last of a tick counts.
            del self.values[-len(self.fields) :]
        else:
            self.ticks.append(tick)
        self.values.extend(math.nan if value is None else float(value) for value in message)

    def held(self, ticks: int) -> FloatArray:
        """Return the last values in each tick, (fields, ticks), and begin the next part.

        They are NaN before the first frame, and where the last one is too old.
        """
        if not self.ticks:
            return np.full((len(self.fields), ticks), np.nan)
        values, at = np.asarray(self.values).reshape(-1, len(self.fields)), np.asarray(self.ticks)
        last = np.searchsorted(at, np.arange(ticks), side="right") - 1
        unknown = (last < 0) | (np.arange(ticks) - at[last] > _HELD_TICKS)
        self.ticks, self.values = array("q", [at[-1] - ticks]), array("d", values[-1])
        return np.where(unknown, np.nan, values[last].T)


def signal_parts(entries: Iterable[Entry]) -> Iterator[Columns]:
    """Decode the frames of a recording, whatever the controller's checks said of them, by parts.

    A received frame counts from the next tick on, a sent one from its own. Each part has arrays
    (n,), one value per tick: ``time_s`` since the first tick, the telemetry's columns, and every
    other signal of the catalogue as ``<message>_<signal>``, in SI units, states and flags as
    numbers. NaN before the first frame, where unavailable, and 2 s after the last frame.
    """
    heard = {
        codec.can_id: _Heard(codec, message._fields)
        for message, _, codec in load_catalogue().messages
        if message is not AddressClaim
    }
    drive = heard[load_catalogue().codec(DriveStatus2).can_id]
    volts, amperes = (drive.fields.index(name) for name in ("bus_voltage_v", "current_a"))
    first = (*_NAMES.values(), "pump_power_w")
    times_ns, begin_ns = array("q"), 0

    def part() -> Columns:
        columns: Columns = {}
        for each in heard.values():
            held = each.held(len(times_ns))
            columns.update(zip(each.names, held, strict=True))
            if each is drive:
                columns["pump_power_w"] = held[volts] * held[amperes]
        columns = {name: columns.pop(name) for name in first} | columns
        since_ns = np.array(times_ns, dtype=np.int64) - begin_ns
        return {"time_s": since_ns.astype(np.float64) * 1e-9} | columns

    whole = 0
    for number, data, kind, time_ns in entries:
        if kind == Kind.TICK:
            if len(times_ns) == _PART:
                yield part()
                times_ns, whole = array("q"), whole + 1
            if not (times_ns or whole):
                begin_ns = time_ns
            times_ns.append(time_ns)
        elif kind in (Kind.RECEIVED, Kind.SENT) and number in heard:
            heard[number].add(len(times_ns) - (kind == Kind.SENT), data)
    yield part()


def signal_table(
    parts: Iterable[Columns],
    names: Container[str] | None = None,
    between_s: Between = ALWAYS,
    of: object = "the log",
) -> Columns:
    """Join the parts of a table; signals that are NaN throughout are left out.

    Kept are the signals of these `names`, or all, and the rows `between_s`. TextFileError, with
    the name of what the table is `of`, is raised where that is none, or too much to be held.
    """
    joined: dict[str, list[FloatArray]] = {"time_s": []}
    rows, part = 0, {}
    for part in parts:
        time_s = part["time_s"]
        kept = (time_s >= between_s[0]) & (time_s <= between_s[1])
        for name, column in part.items():
            other = name not in joined and names is not None and name not in names
            if not other and (name in joined or not np.isnan(column[kept]).all()):
                joined.setdefault(name, [np.full(rows, np.nan)]).append(column[kept])
        rows += int(kept.sum())
        if rows * len(joined) > VALUES_LIMIT:
            raise more_values(of)
        if len(time_s) and time_s[-1] > between_s[1]:
            break
    if not rows:
        low_s, high_s = between_s
        raise TextFileError(f"{of}: holds no tick between {low_s:g} and {high_s:g} s")
    return {name: np.concatenate(joined.pop(name)) for name in part if name in joined}
