"""The programme of the clairvoyant bound, a whole record at once, in three sparse solvers.

The same matrices for each, as the project hands them to its own: the first ship in the measured
storm hour, 50 kPa, 100 kPa/s, 4 m of level. Time holds setting up; roll is what the solution
leaves, beyond is by how much it misses limits and motion equations at most.

Example: make peers && .cache/peers/bin/python -m tools.peers.compare_bound_solvers --seconds 3600
"""

import time
from typing import Any

from rich.console import Console

from tools.peers.bound_programme import bound_programme
from tools.peers.bound_solvers import SOLVERS
from tools.peers.plan_programmes import CONTROLLER
from tools.printing import command_line, show
from utank_hil.configuration import ControllerConfig, load_config


def main() -> None:
    """Measure and print."""
    parser = command_line(__doc__)
    parser.add_argument("--seconds", type=float, default=600.0, help="of the storm")
    parser.add_argument("--limit-s", type=float, default=30.0, help="time that OSQP is given")
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
    show({**size, "seconds": arguments.seconds, "rows": rows}, arguments)


if __name__ == "__main__":
    main()
