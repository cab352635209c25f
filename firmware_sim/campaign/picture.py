"""Picture of a campaign."""

import math
from pathlib import Path
from typing import Any

from firmware_sim.campaign.store import Results
from firmware_sim.campaign.summary import groups_of
from utank_hil.pictures.campaign import CampaignRun, draw_campaign


def draw(results: Results, groups: list[dict[str, Any]], path: Path) -> Path:
    """Draw the groups of a campaign's `summary`."""
    names = list(dict.fromkeys(run for group in groups for run in group["runs"]))
    found = groups_of(results)

    def value(group: dict[str, Any], run: str, key: str) -> float:
        figure = group["runs"].get(run, {}).get("roll_rms_rad", {})
        known = figure.get(key)
        return math.nan if known is None else float(known)

    runs = [
        CampaignRun(
            run,
            [value(group, run, "mean") for group in groups],
            [value(group, run, "half_width") for group in groups],
            [row["roll_rms_rad"] for group in found for row in group.of_run(run)],
        )
        for run in names
    ]
    labels = [_label(group["parameters"]) for group in groups]
    axis = ", ".join(results.keys)
    study = results.about["configuration"]
    about = {key: results.about[key] for key in ("program", "version", "commit", "date", "code")}
    title = f"{study['name']}, simulation: {study['simulation']}"
    return draw_campaign(labels, axis, runs, path, title, about)


def _label(parameters: dict[str, Any]) -> str | float:
    """Label of a group: the number if one key is varied, else the values as text."""
    values = list(parameters.values())
    if len(values) == 1 and isinstance(values[0], float | int):
        return values[0]
    return ", ".join(f"{each:g}" if isinstance(each, float) else str(each) for each in values)
