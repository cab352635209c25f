"""What one step of each controller costs, beside the interpreter's floor and a hand-built OSQP.

Every controller of ``configs/controllers`` is stepped with the motion of the passive ship in the
storm. The floor is the passive controller, which does nothing. The programmes of the constrained
controller are solved again by OSQP, set up by hand with the same matrices and warm-started, if that
is installed (it is no dependency of this project: ``pip install osqp`` in an environment of yours).

Example: .venv/bin/python tools/benchmark_controllers.py --steps 2000
"""

import argparse
import gc
import importlib.util
import json
import sys
import time
import tracemalloc
from pathlib import Path
from typing import Any
from unittest.mock import patch

import numpy as np
from rich.console import Console
from rich.table import Table

from utank_hil.analysis.loop_simulation import passive_motion
from utank_hil.arrays import FloatArray
from utank_hil.config import ControllerConfig
from utank_hil.config_files import load_config
from utank_hil.config_laws import build_law
from utank_hil.control import Controller, PassiveController, plan_programme
from utank_hil.control.qp import ActiveSetSolver
from utank_hil.dynamics.linear import STATES
from utank_hil.sea import EffectiveSlope, Sea, jonswap

CONTROLLERS = Path(__file__).resolve().parents[1] / "configs" / "controllers"
WARM_UP = 200

# gradient, lower and upper bounds of every programme that was solved
Programmes = list[tuple[FloatArray, FloatArray, FloatArray]]


class Recording(ActiveSetSolver):
    """Solves as its parent does, and keeps what it was asked and how long it took."""

    hessian: FloatArray
    rows: FloatArray
    programmes: Programmes
    took_us: list[float]

    def __init__(self, hessian: FloatArray, rows: FloatArray, iteration_limit: int) -> None:
        super().__init__(hessian, rows, iteration_limit)
        Recording.hessian, Recording.rows = hessian.copy(), rows.copy()
        Recording.programmes, Recording.took_us = [], []

    def solve(
        self, gradient: FloatArray, lower: FloatArray, upper: FloatArray
    ) -> FloatArray | None:
        """Solve and note."""
        Recording.programmes.append((gradient.copy(), lower.copy(), upper.copy()))
        begin = time.perf_counter_ns()
        solution = super().solve(gradient, lower, upper)
        Recording.took_us.append((time.perf_counter_ns() - begin) / 1e3)
        return solution


def percentiles(costs_us: list[float]) -> dict[str, float]:
    """Median, 99th percentile and maximum."""
    ordered = np.sort(costs_us)
    return {
        "p50_us": float(np.percentile(ordered, 50)),
        "p99_us": float(np.percentile(ordered, 99)),
        "max_us": float(ordered[-1]),
    }


def step_costs(controller: Controller, measured: FloatArray) -> dict[str, float]:
    """Cost of each step, and the bytes that a step leaves behind."""
    for y in measured[:WARM_UP]:
        controller.step(y)
    gc.collect()
    gc.disable()
    costs = []
    for y in measured[WARM_UP:]:
        begin = time.perf_counter_ns()
        controller.step(y)
        costs.append((time.perf_counter_ns() - begin) / 1e3)
    tracemalloc.start()
    before = tracemalloc.get_traced_memory()[0]
    for y in measured[WARM_UP : 2 * WARM_UP]:
        controller.step(y)
    kept = (tracemalloc.get_traced_memory()[0] - before) / WARM_UP
    tracemalloc.stop()
    gc.enable()
    return {**percentiles(costs), "kept_bytes_per_step": kept}


def osqp_costs() -> dict[str, float] | None:
    """Costs of the recorded programmes in OSQP; None if it is not installed."""
    if importlib.util.find_spec("osqp") is None:
        return None
    osqp: Any = importlib.import_module("osqp")
    sparse: Any = importlib.import_module("scipy.sparse")
    n = len(Recording.hessian)
    gradient, lower, upper = Recording.programmes[0]
    solver = osqp.OSQP()
    solver.setup(
        sparse.csc_matrix(np.triu(Recording.hessian)),
        gradient,
        sparse.csc_matrix(np.vstack([np.eye(n), Recording.rows])),
        lower,
        upper,
        verbose=False,
        eps_abs=1e-4,
        eps_rel=1e-4,
    )
    costs = []
    for gradient, lower, upper in Recording.programmes[1:]:
        begin = time.perf_counter_ns()
        solver.update(q=gradient, l=lower, u=upper)
        solver.solve()
        costs.append((time.perf_counter_ns() - begin) / 1e3)
    return percentiles(costs)


def measure(steps: int) -> dict[str, dict[str, float]]:
    """Costs by controller, the floor first."""
    results: dict[str, dict[str, float]] = {}
    moments: dict[str, FloatArray] = {}
    for path in sorted(CONTROLLERS.glob("*.yaml")):
        config = load_config(path, ControllerConfig)
        with patch.object(plan_programme, "ActiveSetSolver", Recording):
            built = build_law(config.law, config.vessel, config.delay_s, config.limits)
        ship, tank = config.vessel.ship, config.vessel.tank
        step_s = built.controller.sample_time_s
        key = f"{config.vessel.name} {step_s}"
        if key not in moments:
            sea = Sea.irregular(jonswap(4.7, 10.0), seed=1, components=128)
            moment = sea.roll_moment(ship.stiffness_nm_rad, EffectiveSlope(0.5))
            moments[key] = passive_motion(ship, tank, moment, step_s, steps + WARM_UP)
        motion = moments[key]
        if not results:
            results["floor"] = step_costs(PassiveController(), motion[:, :1])
        rows = [STATES.index(name) for name in built.measured]
        results[path.stem] = step_costs(built.controller, np.ascontiguousarray(motion[:, rows]))
    results["constrained: DAQP"] = percentiles(Recording.took_us[1:])
    by_osqp = osqp_costs()
    if by_osqp is not None:
        results["constrained: OSQP"] = by_osqp
    return results


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawTextHelpFormatter
    )
    parser.add_argument("--steps", type=int, default=2000)
    parser.add_argument("--json", action="store_true")
    arguments = parser.parse_args()
    results = measure(arguments.steps)
    if arguments.json:
        sys.stdout.write(json.dumps(results) + "\n")
        return
    table = Table(title="One step of each controller, µs")
    for heading in ("", "p50", "p99", "max", "p50\nover floor", "bytes kept\na step"):
        table.add_column(heading, justify="right" if heading else "left", no_wrap=True)
    floor = results["floor"]["p50_us"]
    for name, cost in results.items():
        kept = cost.get("kept_bytes_per_step")
        table.add_row(
            name,
            *(f"{cost[key]:.1f}" for key in ("p50_us", "p99_us", "max_us")),
            f"{cost['p50_us'] - floor:.1f}",
            "" if kept is None else f"{kept:.0f}",
        )
    Console().print(table)


if __name__ == "__main__":
    main()
