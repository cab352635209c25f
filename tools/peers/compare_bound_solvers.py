"""The programme of the clairvoyant bound, a whole record at once, in three sparse solvers.

The same matrices for each, as the project hands them to its own: the first ship in the measured
storm hour, 50 kPa, 100 kPa/s, 4 m of level. Time holds setting up; roll is what the solution
leaves, beyond is by how much it misses limits and motion equations at most.

Example: make peers && .cache/peers/bin/python -m tools.peers.compare_bound_solvers --seconds 3600
"""

import argparse
import json
import sys
import time
from typing import Any

from rich.console import Console
from rich.table import Table

from tools.peers.bound_programme import bound_programme
from tools.peers.bound_solvers import SOLVERS
from tools.peers.plan_programmes import CONTROLLER
from utank_hil.configuration import ControllerConfig, load_config


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--seconds", type=float, default=600.0, help="of the storm")
    parser.add_argument("--limit-s", type=float, default=30.0, help="time that OSQP is given")
    parser.add_argument("--json", action="store_true", help="print one JSON object")
    arguments = parser.parse_args()
    if not min(arguments.seconds, arguments.limit_s) > 0:
        parser.error("--seconds and --limit-s must be positive")
    vessel = load_config(CONTROLLER, ControllerConfig).vessel
    programme = bound_programme(vessel, arguments.seconds)
    rows: dict[str, dict[str, Any]] = {}
    with Console(stderr=True).status("") as status:
        for name, solve in SOLVERS.items():
            status.update(name)
            begin = time.perf_counter()
            x, said, iterations = solve(programme, arguments.limit_s)
            rows[name] = {
                "time_s": time.perf_counter() - begin,
                "status": said,
                "iterations": iterations,
                "roll_rms_deg": programme.roll_rms_deg(x),
                "beyond": programme.violation(x),
            }
    size = {"unknowns": programme.rows.shape[1], "rows": programme.rows.shape[0]}
    if arguments.json:
        sys.stdout.write(json.dumps({**size, "seconds": arguments.seconds, "rows": rows}) + "\n")
        return
    title = f"{arguments.seconds:.0f} s: {size['unknowns']:,} unknowns, {size['rows']:,} rows"
    table = Table("", title=title)
    for heading in ("time, s", "iterations", "roll RMS, °", "beyond", "status"):
        table.add_column(heading, justify="right", no_wrap=True)
    for name, row in rows.items():
        table.add_row(
            name,
            f"{row['time_s']:.1f}",
            f"{row['iterations']:,}",
            f"{row['roll_rms_deg']:.5f}",
            f"{row['beyond']:.0e}",
            row["status"],
        )
    Console(width=100).print(table)


if __name__ == "__main__":
    main()
