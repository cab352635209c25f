"""Every shipped scenario on the bench: roll, strikes, power, and what the nonlinear plant changes.

    python -m tools.studies.shipped_scenarios              # or the names of some, e.g. storm_day

The scenario's own seed, everything as in `utank-hil bench`. Those of an hour at most are run a
second time with ``plant: linear`` (no valve), those of more than two hours only if they are named.
"""

import argparse
import json
import math
import sys
from collections.abc import Mapping
from pathlib import Path

from rich.console import Console
from rich.progress import track
from rich.table import Table

from firmware_sim.bench import BenchOptions, run_bench
from firmware_sim.figures import figures
from firmware_sim.report_tables import NO_TANK
from firmware_sim.scenario import Scenario
from tools.studies.trial_setup import designed
from utank_hil.configuration import load_config
from utank_hil.control import BuiltLaw

FOLDER = Path(__file__).resolve().parents[2] / "configs" / "scenarios"
LONGEST_LINEAR_S = 3600.0
LONGEST_S = 7200.0

Row = dict[str, float | None]


def rows_of(scenario: Scenario, laws: Mapping[str, BuiltLaw]) -> dict[str, Row]:
    """A row for the bare ship and each run."""
    result = run_bench(scenario, BenchOptions(), lambda _name, _done: None, laws)
    bare, runs = figures(result)
    rows: dict[str, Row] = {NO_TANK: {"roll_rms_deg": math.degrees(bare.rms_rad)}}
    for run in runs:
        rows[run.name] = {
            "roll_rms_deg": math.degrees(run.roll.rms_rad),
            "below_no_tank": run.roll_below_no_tank,
            "below_passive": run.roll_below_passive,
            "strikes": run.strikes,
            "power_mean_w": run.pump.power_mean_w,
            "active_share": run.active_share,
        }
    return rows


def usual() -> list[str]:
    """Names of the scenarios that do not take too long."""
    scenarios = {path.stem: load_config(path, Scenario) for path in sorted(FOLDER.glob("*.yaml"))}
    return [name for name, each in scenarios.items() if each.duration_s <= LONGEST_S]


def study(names: list[str]) -> dict[str, dict[str, Row]]:
    """Rows of the named scenarios; `linear_roll_rms_deg` is the roll of the linear plant."""
    found = {}
    for name in track(names, "scenarios", console=Console(stderr=True)):
        scenario, laws = designed(FOLDER / f"{name}.yaml")
        found[name] = rows_of(scenario, laws)
        # the linear plant has no valve
        if scenario.duration_s <= LONGEST_LINEAR_S and scenario.vessel.valve is None:
            linear = rows_of(scenario.model_copy(update={"plant": "linear"}), laws)
            for run, row in found[name].items():
                row["linear_roll_rms_deg"] = linear[run]["roll_rms_deg"]
    return found


def cells(name: str, run: str, row: Row) -> list[str]:
    """A row for people."""

    def written(key: str, form: str) -> str:
        value = row.get(key)
        return "" if value is None else format(value, form)

    linear, roll = row.get("linear_roll_rms_deg"), row["roll_rms_deg"]
    change = "" if not linear or roll is None else f"{roll / linear - 1:+.1%}"
    power = row.get("power_mean_w")
    return [
        name,
        run,
        written("roll_rms_deg", ".2f"),
        written("below_no_tank", ".1%"),
        written("below_passive", ".1%") if run != "passive" else "",
        written("strikes", ".0f"),
        "" if power is None else f"{power / 1e3:.3g}",
        change,
    ]


HEADINGS = (
    "scenario",
    "run",
    "roll RMS, °",
    "below no tank",
    "below passive",
    "strikes",
    "shaft power, kW",
    "roll against linear plant",
)


def main() -> None:
    """Run the scenarios and print what came out."""
    shipped = sorted(path.stem for path in FOLDER.glob("*.yaml"))
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("names", nargs="*", choices=[*shipped, []], help="the usual ones if none")
    parser.add_argument("--json", action="store_true", help="print one JSON object")
    arguments = parser.parse_args()
    result = study(arguments.names or usual())
    if arguments.json:
        json.dump(result, sys.stdout)
        return
    table = Table(*HEADINGS)
    for name, rows in result.items():
        for run, row in rows.items():
            table.add_row(*cells(name, run, row))
    Console().print(table)


if __name__ == "__main__":
    main()
