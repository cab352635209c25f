"""The report of a recording of ``utank-hil run``: ship, passive twin, alarms, deadlines."""

import math
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Final

import numpy as np
import numpy.typing as npt

from utank_hil.analysis.motion.statistics import roll_statistics
from utank_hil.base.arrays import FloatArray
from utank_hil.canbus.enumerations import Fault, Mode
from utank_hil.canbus.events import AlarmEvent
from utank_hil.pictures import BenchCurve, draw_bench
from utank_hil.pictures.report_page import ReportPicture, ReportSection, ReportTable, Verdict
from utank_hil.reports.page import Report, about_section, roll_section
from utank_hil.safety.faults import fault_text
from utank_hil.telemetry.highlight import Columns, in_service
from utank_hil.telemetry.run_log import read_run_log

STEP_S: Final = 0.05  #: Step between the samples that are drawn: ample for a ship.
LEAST_ROWS: Final = 3  #: Rows that statistics and a spectrum need.


def recording_report(file: Path, note: Callable[[str], None] | None = None) -> Report:
    """The report of a part of the log of ``utank-hil run --out``; `note` as of `read_run_log`.

    Raises `OSError, ValueError` if the file is no such log, one of hardly any rows, or of another
    version.
    """
    log = read_run_log(file, note)
    rows, about = log.signals, log.about
    if len(log.rows) < LEAST_ROWS:
        raise ValueError(f"{file}: {len(log.rows)} rows are too few for a report")
    duration_s = float(rows["time_s"][-1] - rows["time_s"][0])
    alarms = [event for event in log.events if isinstance(event, AlarmEvent)]
    rolls = {"passive twin": rows["twin_roll_rad"], "ship": rows["roll_rad"]}
    stretches = {name: _longest_known(roll) for name, roll in rolls.items()}
    known = {name: roll for name, roll in stretches.items() if len(roll) >= LEAST_ROWS}
    step_s = float(np.median(np.diff(rows["time_s"])))
    try:
        sections = [
            ReportSection("Roll, level and pressure", pictures=[_histories(rows, file.stem)]),
            ReportSection("Modes", tables=[_modes(rows)]),
            _alarm_section(alarms),
            *([roll_section(known, step_s)] if known else []),
            _deadlines(rows),
            about_section(about, about["configuration"]),
        ]
        title, date = about["configuration"]["name"], about["date"]
    except KeyError as error:
        raise ValueError(f"{file}: has no {error}: it is of another version") from error
    below = f"Recording {file.name}, {duration_s:.0f} s, {date}."
    return Report(f"{title}: run", below, [_verdict(rows, alarms)], sections)


def _verdict(rows: Columns, alarms: list[AlarmEvent]) -> Verdict:
    lines = []
    active = rows["mode"] == Mode.ACTIVE
    if active.any():
        lines.append(f"In charge for {active.mean():.0%} of the time: {_rolled(rows, active)}.")
    else:
        lines.append("The controller was never in charge.")
    codes = np.unique(rows["fault"][in_service(rows)])
    faults = [Fault(int(code)) for code in codes if code != Fault.NONE]
    lines += [fault_text(fault) for fault in faults]
    raised = {alarm.code.name for alarm in alarms if alarm.state is not None}
    lines += [f"Alarm: {name}." for name in sorted(raised - {fault.name for fault in faults})]
    return Verdict(lines, good=not (faults or raised))


def _rolled(rows: Columns, active: npt.NDArray[np.bool_]) -> str:
    known = active & np.isfinite(rows["roll_rad"])
    if not known.any():
        return "the roll is not known"
    roll = roll_statistics(rows["roll_rad"][known])
    words = f"{_degrees(roll.rms_rad)} RMS"
    both = known & np.isfinite(rows["twin_roll_rad"])
    twin = roll_statistics(rows["twin_roll_rad"][both]).rms_rad if both.any() else 0.0
    if twin > 0:
        share = 1 - roll_statistics(rows["roll_rad"][both]).rms_rad / twin
        words += (
            f", {abs(share):.0%} {'less' if share >= 0 else 'more'} than the "
            f"{_degrees(twin)} of its passive twin"
        )
    words += f"; {_degrees(roll.maximum_rad)} at most"
    share_known = known.sum() / active.sum()
    return words if share_known == 1 else f"{words}; the roll is known for {share_known:.1%} of it"


def _longest_known(roll_rad: FloatArray) -> FloatArray:
    """The longest stretch without a gap, which a spectrum needs."""
    ends = np.flatnonzero(~np.isfinite(np.concatenate([[np.nan], roll_rad, [np.nan]])))
    longest = int(np.diff(ends).argmax())
    return roll_rad[ends[longest] : ends[longest + 1] - 1]


def _degrees(angle_rad: float) -> str:
    return f"{math.degrees(angle_rad):.2f}°"


def _histories(rows: Columns, title: str) -> ReportPicture:
    every = max(1, round(STEP_S / float(np.median(np.diff(rows["time_s"])))))
    thin = {name: values[::every] for name, values in rows.items()}
    level_m = (thin["starboard_level_m"] - thin["port_level_m"]) / 2
    nothing = np.full_like(level_m, np.nan)
    time_s, pressure_pa = thin["time_s"], thin["pressure_actual_pa"]
    twin = BenchCurve("passive twin", time_s, thin["twin_roll_rad"], nothing, nothing)
    ship = BenchCurve("ship", time_s, thin["roll_rad"], level_m, pressure_pa, mode=thin["mode"])
    says = "Roll of the ship and of its passive twin, level and pressure"
    with tempfile.TemporaryDirectory() as scratch:
        file = draw_bench([twin, ship], Path(scratch) / "histories.png", title)
        return ReportPicture(file.read_bytes(), says)


def _modes(rows: Columns) -> ReportTable:
    state = np.column_stack([rows["mode"], rows["fault"]])
    begins = np.flatnonzero(np.any(np.diff(state, axis=0, prepend=np.nan) != 0, axis=1))
    table = [
        [
            f"{rows['time_s'][row]:.1f} s",
            Mode(int(rows["mode"][row])).name,
            "" if rows["fault"][row] == Fault.NONE else fault_text(Fault(int(rows["fault"][row]))),
        ]
        for row in begins
    ]
    return ReportTable(["from", "mode", "fault"], table, text=True)


def _alarm_section(alarms: list[AlarmEvent]) -> ReportSection:
    if not alarms:
        return ReportSection("Alarms", ["None."])
    rows = [
        [
            f"{alarm.time_ns * 1e-9:.1f} s",
            alarm.code.name,
            "reset refused" if alarm.state is None else alarm.state.name,
            fault_text(alarm.code).partition(": ")[2],
        ]
        for alarm in alarms
    ]
    return ReportSection("Alarms", tables=[ReportTable(["at", "", "", ""], rows, text=True)])


def _deadlines(rows: Columns) -> ReportSection:
    late_us = 1e6 * rows["wakeup_lateness_s"]
    figures = [
        ["late by, median", f"{np.median(late_us):.0f} µs"],
        ["late by, 99.9 %", f"{np.percentile(late_us, 99.9):.0f} µs"],
        ["late by, at most", f"{late_us.max():.0f} µs"],
        ["tick took, 99.9 %", f"{1e6 * np.percentile(rows['tick_duration_s'], 99.9):.0f} µs"],
        ["deadlines missed", f"{rows['overruns'].max():.0f}"],
    ]
    return ReportSection("Deadlines", tables=[ReportTable(["", ""], figures)])
