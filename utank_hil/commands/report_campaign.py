"""What a report says of a campaign: read from the files that it left."""

import json
import math
from pathlib import Path
from typing import Any, Final

from utank_hil.commands.report_parts import about_section
from utank_hil.pictures.report_page import ReportPicture, ReportSection, ReportTable, Verdict

SUMMARY: Final = "summary.json"
PICTURE: Final = "campaign.png"
PASSIVE: Final = "passive"


def campaign_sections(folder: Path) -> tuple[str, str, Verdict, list[ReportSection]]:
    """Title, line below it, verdict and sections of a campaign's report.

    Parameters
    ----------
    folder : Path
        What ``utank-hil campaign --out`` wrote.

    Raises
    ------
    OSError, ValueError
        If a file of the campaign is missing or is none.
    """
    told = json.loads((folder / SUMMARY).read_text(encoding="utf-8"))
    groups, failed = told["groups"], told["failures"]
    study = told["configuration"]
    picture = ReportPicture((folder / PICTURE).read_bytes(), "Rolls of each run, with intervals")
    sections = [
        ReportSection("Results", pictures=[picture], tables=[_runs(groups)]),
        ReportSection("In the same waves, pair by pair", tables=[_pairs(groups)]),
        ReportSection("What it leaves out", [f"{each}." for each in told["leaves_out"]]),
    ]
    if failed:
        rows = [[reason, str(count)] for reason, count in failed.items()]
        table = ReportTable(["reason", "cases"], rows, text=True)
        sections.append(ReportSection("Cases without a result", tables=[table]))
    sections.append(about_section(told, study))
    below = f"{told['cases']} cases, simulation {study['simulation']}. {told['date']}."
    return f"{study.get('name') or folder.name}: campaign", below, _verdict(told), sections


def _verdict(told: dict[str, Any]) -> Verdict:
    lines = []
    for group in told["groups"]:
        where = ", ".join(f"{key} {value}" for key, value in group["parameters"].items())
        for pair in group["paired"]:
            if pair["against"] == PASSIVE:
                share = _interval(pair["share_below"], 100, 1)
                lines.append(
                    f"{pair['run']}{f' ({where})' if where else ''}: {share} % below the passive "
                    f"tank, mean of {pair['share_below']['cases']} pairs."
                )
    wrong = []
    if told["interrupted"]:
        wrong.append("The campaign was interrupted: --resume goes on from there.")
    if told["failures"]:
        wrong.append(f"{sum(told['failures'].values())} cases have no result.")
    return Verdict([*lines[:8], *wrong], good=not wrong)


def _runs(groups: list[dict[str, Any]]) -> ReportTable:
    keys = list(groups[0]["parameters"]) if groups else []
    rows = [
        [
            name,
            *(str(value) for value in group["parameters"].values()),
            str(run["roll_rms_rad"]["cases"]),
            _interval(run["roll_rms_rad"], 180 / math.pi, 3),
            f"{math.degrees(run['worst']['roll_max_rad']):.1f}",
            _interval(run["level_peak_m"], 1, 2),
            _interval(run["power_mean_w"], 1e-3, 1),
            ", ".join(f"{count} {mark}" for mark, count in run["marked"].items()),
        ]
        for group in groups
        for name, run in group["runs"].items()
    ]
    headings = ["run", *keys, "cases", "roll RMS °", "greatest roll °", "level peak m", "power kW",
                "not counted"]  # fmt: skip
    return ReportTable(headings, rows, "Mean ± half width of its 95 % interval")


def _pairs(groups: list[dict[str, Any]]) -> ReportTable:
    keys = list(groups[0]["parameters"]) if groups else []
    rows = [
        [
            f"{pair['run']} against {pair['against']}",
            *(str(value) for value in group["parameters"].values()),
            str(pair["share_below"]["cases"]),
            _interval(pair["share_below"], 100, 1),
            _interval(pair["roll_rms_difference_rad"], 180 / math.pi, 3),
        ]
        for group in groups
        for pair in group["paired"]
    ]
    return ReportTable(["", *keys, "pairs", "below it %", "difference °"], rows)


def _interval(figure: dict[str, Any], scale: float, digits: int) -> str:
    if figure["mean"] is None:
        return ""
    mean = f"{scale * figure['mean']:.{digits}f}"
    width = figure["half_width"]
    return mean if width is None else f"{mean} ± {scale * width:.{digits}f}"
