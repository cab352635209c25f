"""The report of a recording of ``utank-hil run``: ship, passive twin, alarms, deadlines."""

import math
import tempfile
from pathlib import Path
from typing import Any, Final

import msgspec
import numpy as np
import numpy.typing as npt

from utank_hil.analysis.motion.statistics import roll_statistics
from utank_hil.base.arrays import FloatArray
from utank_hil.base.text_files import lines_of, open_text
from utank_hil.canbus.enumerations import Fault, Mode
from utank_hil.pictures import BenchCurve, draw_bench
from utank_hil.pictures.report_page import ReportPicture, ReportSection, ReportTable, Verdict
from utank_hil.reports.page import Report, about_section
from utank_hil.safety.faults import fault_text
from utank_hil.telemetry.recording_reader import in_service, read_about, read_recording
from utank_hil.telemetry.rotation import whole_of


class _Event(msgspec.Struct):
    """A line of a run's log; those of retuning have other keys."""

    event: str
    time_s: float
    fault: str = ""
    state: str | None = None
    happened: str = ""
    remedy: str = ""


STEP_S: Final = 0.05  #: Step between the samples that are drawn: ample for a ship.
LEAST_ROWS: Final = 3  #: Rows that statistics and a spectrum need.
RUN, LOG = "run-", "log-"  #: Beginnings of the names of a run's recording and of its log of alarms.


def recording_report(file: Path) -> Report:
    """The report of a recording of ``utank-hil run --out``, with its log of alarms beside it.

    Raises `OSError, ValueError` if the file is no recording, one of several runs, one of hardly
    any rows, or of another version.
    """
    runs = read_recording(file)
    if len(runs) > 1:
        names = ", ".join(runs)
        raise ValueError(f"{file}: holds the runs {names} of a bench, whose page is beside it")
    ((name, rows),) = runs.items()
    if len(rows["time_s"]) < LEAST_ROWS:
        raise ValueError(f"{file}: {len(rows['time_s'])} rows are too few for a report")
    try:
        about: dict[str, Any] | None = read_about(file)
    except ValueError:
        about = None
    duration_s = float(rows["time_s"][-1] - rows["time_s"][0])
    alarms, unread = _alarms(file)
    sections = [
        ReportSection("Roll, level and pressure", pictures=[_histories(rows, file.stem)]),
        ReportSection("Modes", tables=[_modes(rows)]),
        _alarm_section(alarms, unread, file),
        _deadlines(rows),
    ]
    if about is not None:
        try:
            sections.append(about_section(about, about["configuration"]))
        except KeyError as error:
            raise ValueError(f"{file}: has no {error}: it is of another version") from error
    title = (about or {}).get("configuration", {}).get("name", name)
    below = f"Recording {file.name}, {duration_s:.0f} s" + (f", {about['date']}." if about else ".")
    return Report(f"{title}: run", below, [_verdict(rows, alarms)], sections)


def _verdict(rows: dict[str, FloatArray], alarms: list[_Event]) -> Verdict:
    lines = []
    active = rows["mode"] == Mode.ACTIVE
    if active.any():
        lines.append(f"In charge for {active.mean():.0%} of the time: {_rolled(rows, active)}.")
    else:
        lines.append("The controller was never in charge.")
    codes = np.unique(rows["fault"][in_service(rows)])
    faults = [Fault(int(code)) for code in codes if code != Fault.NONE]
    lines += [fault_text(fault) for fault in faults]
    raised = {alarm.fault for alarm in alarms if alarm.state}
    lines += [f"Alarm: {name}." for name in sorted(raised - {fault.name for fault in faults})]
    return Verdict(lines, good=not (faults or raised))


def _rolled(rows: dict[str, FloatArray], active: npt.NDArray[np.bool_]) -> str:
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


def _degrees(angle_rad: float) -> str:
    return f"{math.degrees(angle_rad):.2f}°"


def _histories(rows: dict[str, FloatArray], title: str) -> ReportPicture:
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


def _modes(rows: dict[str, FloatArray]) -> ReportTable:
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


def _alarms(file: Path) -> tuple[list[_Event], int]:
    log, found, unread = _log_of(file), [], 0
    if log.exists():
        with open_text(log, errors="replace") as text:
            for _, line in lines_of(log, text):
                try:
                    found.append(msgspec.json.decode(line, type=_Event))
                except ValueError:
                    unread += 1
    return [event for event in found if event.event != "retuning"], unread


def _log_of(file: Path) -> Path:
    whole, _ = whole_of(file)
    return whole.with_name(whole.name.replace(RUN, LOG, 1)).with_suffix(".jsonl")


def _alarm_section(alarms: list[_Event], unread: int, file: Path) -> ReportSection:
    log = _log_of(file)
    said = [f"{unread} lines of {log.name} are not understood and left out."] if unread else []
    if not alarms:
        absent = f"Not known: there is no {log.name} beside it."
        return ReportSection("Alarms", [f"None in {log.name}." if log.exists() else absent, *said])
    rows = []
    for alarm in alarms:
        at, words = f"{alarm.time_s:.1f} s", f"{alarm.happened} {alarm.remedy}"
        rows.append([at, alarm.fault, alarm.state or alarm.event, words])
    return ReportSection("Alarms", said, tables=[ReportTable(["at", "", "", ""], rows, text=True)])


def _deadlines(rows: dict[str, FloatArray]) -> ReportSection:
    late_us = 1e6 * rows["wakeup_lateness_s"]
    figures = [
        ["late by, median", f"{np.median(late_us):.0f} µs"],
        ["late by, 99.9 %", f"{np.percentile(late_us, 99.9):.0f} µs"],
        ["late by, at most", f"{late_us.max():.0f} µs"],
        ["tick took, 99.9 %", f"{1e6 * np.percentile(rows['tick_duration_s'], 99.9):.0f} µs"],
        ["deadlines missed", f"{rows['overruns'].max():.0f}"],
    ]
    return ReportSection("Deadlines", tables=[ReportTable(["", ""], figures)])
