"""What a report says of a bench: read from the files that it left."""

import json
import math
from pathlib import Path
from typing import Any, Final

import numpy as np

from utank_hil.commands.check_report import ship_line
from utank_hil.commands.report_parts import about_section, roll_figure
from utank_hil.configuration import Vessel
from utank_hil.pictures.report_page import (
    ReportPicture,
    ReportSection,
    ReportTable,
    Verdict,
)

FIGURES: Final = "bench.json"


def bench_sections(folder: Path, scratch: Path) -> tuple[str, str, Verdict, list[ReportSection]]:
    """Title, line below it, verdict and sections of a bench's report.

    Parameters
    ----------
    folder : Path
        What ``utank-hil bench --out`` wrote.
    scratch : Path
        Folder for pictures that are made for the report.

    Raises
    ------
    OSError, ValueError
        If a file of the bench is missing or is none.
    """
    from utank_hil.telemetry.recording import read_recording

    told = json.loads((folder / FIGURES).read_text(encoding="utf-8"))
    recorded = read_recording(folder / "bench.rrd")
    rolls = {name: rows["true_roll_rad"] for name, rows in recorded.items()}
    times = next(iter(recorded.values()))["time_s"]
    window = (times >= told["settle_s"]) & (times <= told["end_s"])
    step_s = float(np.median(np.diff(times)))
    vessel = Vessel.model_validate(told["configuration"]["vessel"])
    sections = [
        ReportSection("What was run", _what_was_run(told, vessel)),
        ReportSection(
            "Roll and cost",
            pictures=[_picture(folder)],
            tables=[_roll_table(told), _cost_table(told), _comfort_table(told)],
        ),
        roll_figure(
            {name: roll[window[: len(roll)]] for name, roll in rolls.items()}, step_s, scratch
        ),
        *_retuning(told),
        *_deadlines(told),
        about_section(told, told["configuration"]),
    ]
    title = f"{told['scenario']}: bench"
    below = (
        f"{told['mode']}, seed {told['seed']}, {told['settle_s']:g} s to {told['end_s']:g} s of "
        f"the same waves for each run. {told['date']}."
    )
    return title, below, _verdict(told), sections


def _picture(folder: Path) -> ReportPicture:
    return ReportPicture((folder / "bench.png").read_bytes(), "Roll and power of each run, and "
                         "roll, level and pressure over time")  # fmt: skip


def _verdict(told: dict[str, Any]) -> Verdict:
    ranked = [run for run in told["runs"] if run["ranked"] and run["name"] != "passive"]
    lines = []
    if ranked:
        best = min(ranked, key=lambda run: run["roll"]["rms_rad"])
        below, bare = best["roll_below_passive"], best["roll_below_no_tank"]
        line = f"{best['name']} rolls {math.degrees(best['roll']['rms_rad']):.2f}° RMS"
        if below is not None:
            line += f", {_less(below)} than the passive tank"
        if bare is not None:
            line += f" and {_less(bare)} than no tank"
        power = best["pump"]["power_mean_w"]
        lines.append(f"{line}, for {power / 1e3:.3g} kW of shaft power on average.")
    wrong = [*told["endings"], *told["limits_passed"]]
    lines += wrong or ["No run failed, and no limit of the model was passed."]
    return Verdict(lines, good=not wrong)


def _less(share: float) -> str:
    return f"{abs(share):.0%} {'less' if share >= 0 else 'more'}"


def _what_was_run(told: dict[str, Any], vessel: Vessel) -> list[str]:
    sea = {key: value for key, value in told["configuration"]["sea"].items() if value is not None}
    names = [run["name"] for run in told["runs"] if run["name"] != "passive"]
    told_sea = ", ".join(
        f"{key} {sea[key]}" for key in ("kind", "hs_m", "tp_s", "time", "heading_deg") if key in sea
    )
    return [
        f"Ship: {vessel.name}. {ship_line(vessel)}",
        f"Sea: {told_sea}.",
        f"Runs: without a tank, with the passive tank, and with {', '.join(names)}."
        if names
        else "Runs: without a tank and with the passive tank.",
    ]


def _roll_table(told: dict[str, Any]) -> ReportTable:
    headings = ["", "RMS °", "significant °", "maximum °", "below no tank", "below passive",
                "in charge", "water strikes"]  # fmt: skip
    bare = told["no_tank"]
    rows = [["no tank", *_degrees(bare), "capsized" if bare["capsized_s"] else "", "", "", ""]]
    for run in told["runs"]:
        if not run["compared"]:
            rows.append([run["name"], "", "", "", run["mark"]["word"], "", "", ""])
            continue
        passive = run["name"] == "passive"
        rows.append(
            [
                run["name"],
                *_degrees(run["roll"]),
                _percent(run["roll_below_no_tank"]) or (run["mark"] or {}).get("word", ""),
                "" if passive else _percent(run["roll_below_passive"]),
                "" if passive else f"{run['active_share']:.0%}",
                str(run["strikes"]),
            ]
        )
    return ReportTable(headings, rows, "Roll; strikes of the water on roof or bottom")


def _cost_table(told: dict[str, Any]) -> ReportTable:
    headings = ["", "pressure RMS kPa", "pressure peak kPa", "power mean kW", "power peak kW",
                "level peak m", "bus load"]  # fmt: skip
    rows = [
        [
            run["name"],
            *(f"{run['pump'][key] / 1e3:.1f}" for key in
              ("pressure_rms_pa", "pressure_peak_pa", "power_mean_w", "power_peak_w")),
            f"{run['pump']['level_peak_m']:.2f}",
            f"{run['bus_load']:.1%}",
        ]
        for run in told["runs"]
        if run["compared"]
    ]  # fmt: skip
    return ReportTable(headings, rows, "Pump, tank and bus; power that the shaft draws")


def _comfort_table(told: dict[str, Any]) -> ReportTable:
    levels = [math.degrees(level) for level in told["on_board"]["levels_rad"]]
    shown = [index for index, level in enumerate(levels) if level <= 10.0]
    place = told["on_board"]["place"]
    rows = []
    for name, run in told["on_board"]["runs"].items():
        comfort, above = run["comfort"], run["exceedance"]
        rows.append(
            [
                name,
                *("" if above is None else f"{above[index]:.1%}" for index in shown),
                f"{comfort['lateral_rms_m_s2'] / 9.80665:.3f}",
                f"{comfort['interruptions_per_min']:.2f}",
                f"{comfort['sickness_percent']:.1f}%",
            ]
        )
    headings = ["", *(f"above {levels[index]:g}°" for index in shown), "lateral g",
                "interruptions/min", "sickness"]  # fmt: skip
    return ReportTable(
        headings,
        rows,
        f"Shares of the roll's amplitudes; on board at {place['height_m']:.1f} m above and "
        f"{place['starboard_m']:.1f} m to starboard of the centre of gravity, by roll alone",
    )


def _retuning(told: dict[str, Any]) -> list[ReportSection]:
    rows = [
        [run["name"], key.replace("_", " "), json.dumps(value)]
        for run in told["runs"]
        for key, value in (run["retuning"] or {}).items()
        if not isinstance(value, list | dict)
    ]
    if not rows:
        return []
    return [ReportSection("Retuning", tables=[ReportTable(["run", "", ""], rows, text=True)])]


def _deadlines(told: dict[str, Any]) -> list[ReportSection]:
    loops = {run["name"]: run["loop"] for run in told["runs"] if run["loop"]}
    if not loops:
        return [ReportSection("Deadlines", ["Simulated time: there are none."])]
    keys = [key for key, value in next(iter(loops.values())).items() if not isinstance(value, dict)]
    rows = [
        [name, *(f"{loop[key]:.4g}" if loop[key] is not None else "" for key in keys)]
        for name, loop in loops.items()
    ]
    return [
        ReportSection(
            "Deadlines", tables=[ReportTable(["", *(key.replace("_", " ") for key in keys)], rows)]
        )
    ]


def _degrees(roll: dict[str, Any]) -> list[str]:
    keys = ("rms_rad", "significant_rad", "maximum_rad")
    return ["" if roll[key] is None else f"{math.degrees(roll[key]):.2f}" for key in keys]


def _percent(share: float | None) -> str:
    return "" if share is None else f"{share:.1%}"
