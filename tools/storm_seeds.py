"""Roll in a scenario over many seeds: mean and 95 % confidence interval for each controller.

One seed is one realisation of the sea; a single hour differs by several per cent from the next.

Example: .venv/bin/python tools/storm_seeds.py --seeds 8 --duration 3600
"""

import argparse
import json
import math
import sys
from pathlib import Path

import numpy as np
from rich.console import Console
from rich.progress import track
from rich.table import Table
from scipy.stats import t as student

from firmware_sim.bench import BenchOptions, run_bench
from firmware_sim.report import figures
from firmware_sim.scenario import Scenario
from utank_hil.arrays import FloatArray
from utank_hil.config_files import load_config

STORM = Path(__file__).resolve().parents[1] / "configs" / "scenarios" / "storm.yaml"


def half_width(values: FloatArray) -> float:
    """Half the 95 % confidence interval of the mean of `values`, shape (n,)."""
    n = len(values)
    return float(student.ppf(0.975, n - 1) * values.std(ddof=1) / math.sqrt(n))


def main() -> None:
    """Run the benches and print the table."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawTextHelpFormatter
    )
    parser.add_argument("scenario", nargs="?", type=Path, default=STORM)
    parser.add_argument("--seeds", type=int, default=8, help="how many, 2 or more")
    parser.add_argument("--first", type=int, default=101, help="the first of them")
    parser.add_argument("--duration", type=float, help="seconds of each run")
    parser.add_argument("--json", action="store_true")
    arguments = parser.parse_args()
    if arguments.seeds < 2:
        parser.error("--seeds must be 2 or more: one value has no confidence interval")
    scenario = load_config(arguments.scenario, Scenario)
    rms: dict[str, list[float]] = {}
    below: dict[str, list[float]] = {}
    level: dict[str, list[float]] = {}
    seeds = range(arguments.first, arguments.first + arguments.seeds)
    for seed in track(seeds, console=Console(stderr=True), description="seeds"):
        options = BenchOptions(seed=seed, duration_s=arguments.duration)
        bare, runs = figures(run_bench(scenario, options, lambda _name, _done: None))
        rms.setdefault("no tank", []).append(math.degrees(bare.rms_rad))
        for run in runs:
            rms.setdefault(run.name, []).append(math.degrees(run.roll.rms_rad))
            if run.roll_below_passive is not None:
                below.setdefault(run.name, []).append(run.roll_below_passive)
            level.setdefault(run.name, []).append(run.pump.level_peak_m)
    table = Table(title=f"{scenario.name}, {arguments.seeds} seeds, mean ± 95 % of the mean")
    for heading in ("", "roll RMS °", "below passive", "least", "level peak m"):
        table.add_column(heading, justify="right" if heading else "left")
    summary = {}
    for name, values in rms.items():
        angles = np.array(values)
        cells = [f"{angles.mean():.2f} ± {half_width(angles):.2f}"]
        summary[name] = {"roll_rms_deg": values, "below_passive": below.get(name)}
        if name in below:
            shares = np.array(below[name])
            cells += [
                f"{shares.mean():.1%} ± {half_width(shares):.1%}",
                f"{shares.min():.1%}",
                f"{max(level[name]):.2f}",
            ]
        table.add_row(name, *cells)
    if arguments.json:
        sys.stdout.write(json.dumps(summary) + "\n")
    else:
        Console().print(table)


if __name__ == "__main__":
    main()
