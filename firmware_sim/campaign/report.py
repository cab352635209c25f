"""Picture of a campaign, and its report, made from the files in its folder."""

import json
import math
from pathlib import Path
from typing import Any, Final

from firmware_sim.campaign.store import PICTURE, SUMMARY, Results
from firmware_sim.campaign.summary import ROLL, groups_of
from firmware_sim.campaign.tables import interval, pairs_table, runs_table
from firmware_sim.scenario_content import PASSIVE
from utank_hil.pictures.campaign import CampaignRun, draw_campaign
from utank_hil.pictures.report_page import ReportPicture, ReportSection, ReportTable, Verdict
from utank_hil.reports.page import Report, about_section, printed

MOST_LINES: Final = 8  #: Most lines of the verdict. Chosen; no study.


def draw(results: Results, groups: list[dict[str, Any]], path: Path) -> Path:
    """Draw the groups of a campaign's `summary`."""
    names = dict.fromkeys(run for group in groups for run in group["runs"])
    found = groups_of(results)

    def values(run: str, key: str) -> list[float]:
        rolls = [group["runs"].get(run, {}).get(ROLL, {}).get(key) for group in groups]
        return [math.nan if roll is None else float(roll) for roll in rolls]

    runs = [
        CampaignRun(
            run,
            values(run, "mean"),
            values(run, "half_width"),
            [row[ROLL] for group in found for row in group.of_run(run)],
        )
        for run in names
    ]
    labels = [_label(group["parameters"]) for group in groups]
    study = results.about["configuration"]
    title = f"{study['name']}, simulation: {study['simulation']}"
    return draw_campaign(labels, ", ".join(results.keys), runs, path, title)


def _label(parameters: dict[str, Any]) -> str | float:
    """Label of a group: the number if one key is varied, else the values as text."""
    values = list(parameters.values())
    if len(values) == 1 and isinstance(values[0], float | int):
        return values[0]
    return ", ".join(f"{each:g}" if isinstance(each, float) else str(each) for each in values)


def campaign_report(folder: Path) -> Report:
    """Report of a campaign; `OSError, ValueError` for bad files, `KeyError` for other versions."""
    content = json.loads((folder / SUMMARY).read_text(encoding="utf-8"))
    groups, failed, study = content["groups"], content["failures"], content["configuration"]
    picture = ReportPicture((folder / PICTURE).read_bytes(), "Rolls of each run, with intervals")
    tables = [printed(runs_table(groups, "Runs")), printed(pairs_table(groups))]
    sections = [ReportSection("Results", pictures=[picture], tables=tables)]
    if left_out := content["leaves_out"]:
        sections.append(ReportSection("What it leaves out", [f"{each}." for each in left_out]))
    if failed:
        rows = [[reason, str(count)] for reason, count in failed.items()]
        table = ReportTable(["reason", "cases"], rows, text=True)
        sections.append(ReportSection("Cases without a result", tables=[table]))
    sections.append(about_section(content, study))
    below = f"{content['cases']} cases, simulation {study['simulation']}. {content['date']}."
    return Report(f"{study['name']}: campaign", below, [_verdict(content)], sections)


def _verdict(content: dict[str, Any]) -> Verdict:
    lines = []
    for group in content["groups"]:
        where = ", ".join(f"{key} {value}" for key, value in group["parameters"].items())
        lines += [
            f"{pair['run']}{f' ({where})' if where else ''}: "
            f"{interval(pair['share_below'], 100, 1)} % below the passive tank, mean of "
            f"{pair['share_below']['cases']} pairs."
            for pair in group["paired"]
            if pair["against"] == PASSIVE and pair["share_below"]["cases"]
        ]
    wrong = []
    if content["interrupted"]:
        wrong.append("The campaign was interrupted: --resume goes on from there.")
    if content["failures"]:
        wrong.append(f"{sum(content['failures'].values())} cases have no result.")
    return Verdict([*lines[:MOST_LINES], *wrong], good=not wrong)
