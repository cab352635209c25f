"""Roll in a scenario over many seeds: mean and 95 % confidence interval for each controller.

    python -m tools.studies.storm_seeds configs/scenarios/storm_all.yaml --seeds 16

One seed is one realisation of the sea; a single hour differs by several per cent from the next.
Everything is as in `utank-hil bench`: bus, nodes, sensors, propeller pump. Sixteen hours of a
scenario with five controllers take half an hour on two cores.
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
from utank_hil.analysis.motion.confidence import mean_interval
from utank_hil.configuration import ConfigError
from utank_hil.control import BuiltLaw

STORM = Path(__file__).resolve().parents[2] / "configs" / "scenarios" / "storm.yaml"


def figures_of_seed(
    scenario: Scenario, options: BenchOptions, laws: Mapping[str, BuiltLaw]
) -> dict[str, dict[str, float]]:
    """What is kept of each run of a bench, the bare ship with them."""
    bare, runs = figures(run_bench(scenario, options, lambda _name, _done: None, laws))
    kept = {NO_TANK: {"roll_rms_deg": math.degrees(bare.rms_rad)}}
    for run in runs:
        kept[run.name] = {
            "roll_rms_deg": math.degrees(run.roll.rms_rad),
            "level_peak_m": run.pump.level_peak_m,
            "pressure_rms_pa": run.pump.pressure_rms_pa,
            "power_mean_w": run.pump.power_mean_w,
        }
        if run.roll_below_passive is not None and run is not runs[0]:
            kept[run.name]["below_passive"] = run.roll_below_passive
    return kept


def table_of(summary: dict[str, dict[str, list[float]]], title: str) -> Table:
    """The figures for a terminal."""
    table = Table(title=title)
    for heading in (
        "",
        "roll RMS °",
        "below\npassive %",
        "least of\nall %",
        "level\npeak m",
        "pressure\nRMS kPa",
        "power\nmean MW",
    ):
        table.add_column(heading, justify="right" if heading else "left", no_wrap=True)
    for name, values in summary.items():
        roll = mean_interval(values["roll_rms_deg"])
        cells = [f"{roll.mean:.3f} ± {roll.half_width:.3f}"]
        below = values.get("below_passive")
        if below is None:
            cells += ["", ""]
        else:
            share = mean_interval(below)
            cells += [f"{100 * share.mean:.1f} ± {100 * share.half_width:.1f}"]
            cells += [f"{100 * min(below):.1f}"]
        if "level_peak_m" in values:
            pressure, power = (
                mean_interval(values[key]).mean for key in ("pressure_rms_pa", "power_mean_w")
            )
            cells += [f"{max(values['level_peak_m']):.2f}"]
            cells += [f"{pressure / 1e3:.1f}", f"{power / 1e6:.2f}"]
        table.add_row(name, *cells)
    return table


def main() -> None:
    """Run the benches and print the table."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("scenario", nargs="?", type=Path, default=STORM)
    parser.add_argument("--seeds", type=int, default=8, help="how many, 2 or more (%(default)s)")
    parser.add_argument("--first", type=int, default=101, help="the first of them (%(default)s)")
    parser.add_argument("--duration", type=float, help="seconds of each run")
    parser.add_argument("--json", action="store_true", help="one JSON object instead of a table")
    arguments = parser.parse_args()
    if arguments.seeds < 2:
        parser.error("--seeds must be 2 or more: one value has no confidence interval")
    try:
        scenario, laws = designed(arguments.scenario)
    except ConfigError as error:
        parser.error(str(error))
    summary: dict[str, dict[str, list[float]]] = {}
    seeds = range(arguments.first, arguments.first + arguments.seeds)
    for seed in track(seeds, console=Console(stderr=True), description="seeds"):
        options = BenchOptions(seed=seed, duration_s=arguments.duration)
        for name, kept in figures_of_seed(scenario, options, laws).items():
            for key, value in kept.items():
                summary.setdefault(name, {}).setdefault(key, []).append(value)
    if arguments.json:
        sys.stdout.write(json.dumps(summary) + "\n")
    else:
        title = f"{scenario.name}, {arguments.seeds} seeds, mean ± 95 % of the mean"
        Console(width=100).print(table_of(summary, title))


if __name__ == "__main__":
    main()
