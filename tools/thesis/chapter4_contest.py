"""Who capsizes, and in what wave: thesis 4.5 with every nonlinear law and several pumps.

    python -m tools.thesis.chapter4_contest                        # --pump-pa 20e3, --json

Patti-B in wave moments M cos(0.6 t) of the four amplitudes that are printed, and the largest that
she survives by bisection. In each cell stands the greatest roll, or the time of capsizing; greatest
pressure and strikes of the water at the reservoirs' ends are those of the runs survived. What the
source leaves open, and the laws' numbers, are in `utank_hil.analysis.capsize.contest`. Takes a
minute on two cores.
"""

import argparse
import json
import math
import multiprocessing
import sys
from concurrent.futures import ProcessPoolExecutor

from rich.console import Console
from rich.progress import track
from rich.table import Table

from utank_hil.analysis.capsize.contest import LAWS, PRINTED_NM, Contest, contest
from utank_hil.analysis.capsize.survival import Survival

PUMPS_PA = (math.inf, 100e3, 20e3)
UNPUMPED = ("no tank",)  # the same with any pump


def cell(run: Survival) -> str:
    """Greatest roll, or when she capsized."""
    if math.isfinite(run.capsized_s):
        return f"{run.capsized_s:.0f} s"
    return f"{math.degrees(run.max_roll_rad):.1f}°"


def survived(runs: tuple[Survival, ...]) -> list[Survival]:
    """The runs that did not end in capsizing."""
    return [run for run in runs if math.isinf(run.capsized_s)]


def pump_name(pump_pa: float) -> str:
    """How the pump is called."""
    return f"pump of {pump_pa / 1e3:g} kPa" if math.isfinite(pump_pa) else "no limit of the pump"


def as_json(found: Contest) -> dict[str, object]:
    """One law with one pump."""
    return {
        "survivable_nm": found.survivable_nm if math.isfinite(found.survivable_nm) else None,
        "runs": [
            {
                "amplitude_nm": amplitude,
                "capsized_s": run.capsized_s if math.isfinite(run.capsized_s) else None,
                "max_roll_rad": run.max_roll_rad,
                "max_level_m": run.max_level_m,
                "max_pressure_pa": run.max_command,
                "strikes": run.strikes,
            }
            for amplitude, run in zip(PRINTED_NM, found.runs, strict=True)
        ],
    }


def main() -> None:
    """Let every law meet the waves and print the tables."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument(
        "--pump-pa",
        type=float,
        action="append",
        help="greatest pressure, inf for none; may be given again (inf, 100e3 and 20e3)",
    )
    parser.add_argument("--json", action="store_true", help="one JSON object instead of tables")
    arguments = parser.parse_args()
    pumps = arguments.pump_pa or list(PUMPS_PA)
    if not min(pumps) > 0:
        parser.error("--pump-pa must be positive")
    entries = [
        (law, pump) for pump in pumps for law in LAWS if pump == pumps[0] or law not in UNPUMPED
    ]
    with ProcessPoolExecutor(mp_context=multiprocessing.get_context("spawn")) as pool:
        futures = {entry: pool.submit(contest, *entry) for entry in entries}
        found = {
            entry: future.result()
            for entry, future in track(futures.items(), "contests", console=Console(stderr=True))
        }
    if arguments.json:
        listed = [
            {"law": law, "pump_pa": pump if math.isfinite(pump) else None, **as_json(result)}
            for (law, pump), result in found.items()
        ]
        sys.stdout.write(json.dumps({"contests": listed}) + "\n")
        return
    for pump in pumps:
        table = Table(title=pump_name(pump))
        table.add_column("law", no_wrap=True)
        for amplitude in PRINTED_NM:
            table.add_column(f"{amplitude / 1e3:.1f}\nkN m", justify="right", no_wrap=True)
        table.add_column("largest\nkN m", justify="right", no_wrap=True)
        table.add_column("greatest\nkPa", justify="right", no_wrap=True)
        table.add_column("strikes", justify="right", no_wrap=True)
        for (law, of_pump), result in found.items():
            if of_pump == pump:
                alive = survived(result.runs)
                pressure_pa = max((run.max_command for run in alive), default=0.0)
                table.add_row(
                    law,
                    *(cell(run) for run in result.runs),
                    f"{result.survivable_nm / 1e3:.1f}",
                    f"{pressure_pa / 1e3:.0f}" if pressure_pa else "",
                    "yes" if any(run.strikes for run in alive) else "",
                )
        Console(width=110).print(table)


if __name__ == "__main__":
    main()
