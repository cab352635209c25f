"""One step of the constrained controller beside OSQP set up by hand, do-mpc and other solvers.

All solve the same programmes in the same run: those of the shipped controller
(configs/controllers/constrained_gpc.yaml) in the measured storm hour, in the steps in which a limit
bends its plan. Twice: with the plan held at the shipped knots, and free at every sample. Times are
the least of a few rounds, programme by programme; the error is the largest of the first command, of
50 kPa, beside quadprog's solution, whose conditions of optimality are checked.

Example: make peers && .cache/peers/bin/python -m tools.peers.compare_plan_solvers --seconds 60
"""

import warnings
from collections.abc import Callable

import numpy as np
from rich.console import Console
from rich.progress import Progress

from tools.peers.do_mpc_plan import DoMpc
from tools.peers.plan_programmes import (
    Programme,
    ProgrammeFamily,
    Step,
    constrained_design,
    constrained_law,
    sail,
)
from tools.peers.plan_solvers import SOLVERS, Quadprog
from tools.peers.turns import Costs, in_turns, percentiles_us
from tools.printing import command_line, show
from utank_hil.base.arrays import FloatArray
from utank_hil.control.constrained.law import ConstrainedLaw

PROJECT, STEP = "DAQP, kept and warm (ours)", "our whole step"
OPTIMAL = 1e-9  # that the reference misses its conditions of optimality by, at most


def reference(family: ProgrammeFamily, programmes: list[Programme]) -> FloatArray:
    """First commands, from solutions that are shown to be optimal."""
    solver = Quadprog(family)
    found = [solver.certified(programme) for programme in programmes]
    worst = max(missed for _, missed in found)
    if worst > OPTIMAL:
        raise SystemExit(f"the reference misses its conditions of optimality by {worst:.1e}")
    return np.array([x[0] for x, _ in found])


def whole_steps(law: ConstrainedLaw, steps: list[Step], rounds: int, progress: Progress) -> Costs:
    """Costs of the controller's own steps, its estimator included; answers in Pa."""
    controller = law.controller()

    def run(step: Step) -> float:
        if step.applied_pa is None:
            controller.reset()
        else:
            controller.applied(np.array([step.applied_pa]))
        return float(controller.step(step.measured)[0])

    return in_turns({STEP: run}, steps, rounds, progress)[STEP]


def compare(
    every_sample: bool, seconds: float, rounds: int, progress: Progress
) -> dict[str, dict[str, float]]:
    """Cost and error by solver."""
    design, config = constrained_design(every_sample)
    law = constrained_law(design, config)
    steps = sail(law, config, design.measured, seconds)
    limited = np.array([step.limited for step in steps])
    family, unit_pa = ProgrammeFamily(law), law.limits.pressure_pa
    programmes = [family.programme(step) for step in steps if step.limited]
    if len(programmes) < 2:
        raise SystemExit(f"no limit bent a plan in {seconds} s: take a longer --seconds")
    right_pa = unit_pa * reference(family, programmes)
    solvers: dict[str, Callable[[Programme], float]] = {
        name: make(family).solve for name, make in SOLVERS.items()
    }
    solvers["do-mpc (IPOPT), warm"] = DoMpc(family, design, law).solve
    own = whole_steps(law, steps, rounds, progress)
    found = {STEP: (own.time_s[limited], own.answers[limited])}
    for name, costs in in_turns(solvers, programmes, rounds, progress).items():
        found[name] = (costs.time_s, unit_pa * costs.answers)
    return {
        name: {
            **percentiles_us(time_s),
            "largest_error_pa": float(np.nanmax(np.abs(answers_pa - right_pa))),
            "unsolved": int(np.isnan(answers_pa).sum()),
            "programmes": len(programmes),
            "unknowns": len(family.hessian),
        }
        for name, (time_s, answers_pa) in found.items()
    }


def main() -> None:
    """Measure and print."""
    parser = command_line(__doc__)
    parser.add_argument("--seconds", type=float, default=120.0, help="of the storm")
    parser.add_argument("--rounds", type=int, default=3)
    arguments = parser.parse_args()
    if arguments.rounds < 1 or not arguments.seconds > 0:
        parser.error("--rounds must be 1 or more and --seconds positive")
    warnings.simplefilter("ignore", FutureWarning)  # casadi's, about do-mpc's calls
    errors = Console(stderr=True)
    with Progress(console=errors, transient=True) as progress:
        results = {
            name: compare(every_sample, arguments.seconds, arguments.rounds, progress)
            for name, every_sample in (("shipped knots", False), ("every sample", True))
        }
    show(results, arguments)


if __name__ == "__main__":
    main()
