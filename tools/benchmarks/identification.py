"""Identification on its own: speed beside `numpy.linalg.lstsq`, memory and growth.

Times are the least of several interleaved runs. tools/peers/compare_identification.py has the
accuracy, beside published packages.

Example: OPENBLAS_NUM_THREADS=1 .venv/bin/python -m tools.benchmarks.identification --quick
"""

import time
import tracemalloc
from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np
from scipy.linalg import cho_factor, cho_solve

from tools.peers.identification_records import (
    SAMPLE_TIME_S,
    SLOW,
    record,
)
from tools.printing import command_line, show
from utank_hil.base.arrays import FloatArray
from utank_hil.identification import okid
from utank_hil.identification.lag_regression import LagRegression
from utank_hil.identification.least_squares import fit


def best_of(repeats: int, *tasks: Callable[[], object]) -> list[float]:
    """Least time of each task in milliseconds, run in turns."""
    times = np.full(len(tasks), np.inf)
    for _ in range(repeats):
        for i, task in enumerate(tasks):
            start = time.perf_counter()
            task()
            times[i] = min(times[i], time.perf_counter() - start)
    return [float(t * 1e3) for t in times]


def peak_mb(task: Callable[[], object]) -> float:
    """Most memory allocated at a time, in MB."""
    tracemalloc.start()
    task()
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    return peak / 1e6


def regression_of(u: FloatArray, y: FloatArray, order: int) -> LagRegression:
    """The regression that `okid` solves, scaled as there."""
    z = np.column_stack([y, u])
    z = z / np.sqrt(np.mean(z**2, axis=0))
    return LagRegression(z, y.shape[1], order, np.empty((0, len(z))))


def reference(matrix: FloatArray, targets: FloatArray) -> FloatArray:
    """Least-squares solution, refined with residuals in extended precision."""
    triangle = np.linalg.qr(matrix)[1]
    wide, wanted = matrix.astype(np.longdouble), targets.astype(np.longdouble)
    solution = np.zeros((matrix.shape[1], targets.shape[1]), dtype=np.longdouble)
    for _ in range(4):
        gradient = (wide.T @ (wanted - wide @ solution)).astype(np.float64)
        solution += np.linalg.solve(triangle, np.linalg.solve(triangle.T, gradient))
    return solution.astype(np.float64)


def normal_equations(matrix: FloatArray, targets: FloatArray) -> FloatArray:
    """Plain normal equations by Cholesky."""
    return np.asarray(cho_solve(cho_factor(matrix.T @ matrix), matrix.T @ targets))


def speed(quick: bool) -> dict[str, Any]:
    """Order 200, 2,500 samples, two outputs, against the same regression written out."""
    repeats = 5 if quick else 25
    u, y = record()
    slow_u, slow_y = record(limits=SLOW)
    regression = regression_of(u, y, 200)
    matrix, targets = regression.matrix()
    names = ("okid", "okid, slow pump", "build matrix", "lstsq", "normal equations")
    times = dict(
        zip(
            names,
            best_of(
                repeats,
                lambda: okid(u, y, 200, sample_time_s=SAMPLE_TIME_S),
                lambda: okid(slow_u, slow_y, 200, sample_time_s=SAMPLE_TIME_S),
                regression.matrix,
                lambda: np.linalg.lstsq(matrix, targets, rcond=None),
                lambda: normal_equations(matrix, targets),
            ),
            strict=True,
        )
    )
    right = reference(matrix, targets)
    size = np.linalg.norm(right)
    errors = {
        "okid": fit(regression).coefficients,
        "lstsq": np.linalg.lstsq(matrix, targets, rcond=None)[0],
        "normal equations": normal_equations(matrix, targets),
    }
    return {
        "time_ms": times,
        "lstsq_over_okid": times["lstsq"] / times["okid"],
        "lstsq_over_okid_slow_pump": times["lstsq"] / times["okid, slow pump"],
        "relative_error": {k: float(np.linalg.norm(v - right) / size) for k, v in errors.items()},
        "memory_mb": {
            "okid": peak_mb(lambda: okid(u, y, 200, sample_time_s=SAMPLE_TIME_S)),
            "lstsq": peak_mb(lambda: np.linalg.lstsq(*regression.matrix(), rcond=None)),
        },
    }


def growth(quick: bool) -> list[dict[str, Any]]:
    """Time and memory with order and length; lstsq where its matrix stays below 200 MB."""
    cases = [(30, 2500), (60, 2500), (120, 2500), (200, 2500), (300, 2500), (120, 10_000)]
    if not quick:
        cases += [(200, 10_000), (120, 100_000), (200, 100_000)]
    rows = []
    for order, samples in cases:
        u, y = record(samples)
        task = partial(okid, u, y, order, sample_time_s=SAMPLE_TIME_S)
        row = {
            "order": order,
            "samples": samples,
            "okid_ms": best_of(3, task)[0],
            "okid_mb": peak_mb(task),
        }
        regression = regression_of(u, y, order)
        row["matrix_mb"] = regression.rows * regression.columns * 8 / 1e6
        if row["matrix_mb"] < 200:
            solve = partial(np.linalg.lstsq, *regression.matrix(), rcond=None)
            row["lstsq_ms"] = best_of(2, solve)[0]
        rows.append(row)
    return rows


def main() -> None:
    """Measure and print."""
    parser = command_line(__doc__)
    parser.add_argument("--quick", action="store_true", help="fewer and shorter measurements")
    arguments = parser.parse_args()
    quick = arguments.quick
    found = {"speed": speed(quick), "growth": growth(quick)}
    show(found, arguments)


if __name__ == "__main__":
    main()
