"""Identification side by side: speed, memory, growth, and accuracy under waves.

Run ``python tools/benchmark_identification.py``; ``--json`` prints one JSON object instead of the
tables, ``--quick`` measures less. The packages sippy_unipi, nfoursid and mdof are compared when
they are installed. Times are the least of several interleaved runs; set OMP_NUM_THREADS=1 on a busy
machine.
"""

import argparse
import contextlib
import io
import json
import time
import tracemalloc
import warnings
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import control
import numpy as np
from published_identification import published
from scipy.linalg import cho_factor, cho_solve

from utank_hil.arrays import FloatArray
from utank_hil.control.limits import PumpLimits
from utank_hil.dynamics import RollShip, Tank, coupled_model
from utank_hil.identification import (
    RecursiveArx,
    era,
    find_disturbance_frequencies,
    okid,
    random_pulses,
    refine,
)
from utank_hil.identification.lag_regression import LagRegression
from utank_hil.identification.least_squares import fit
from utank_hil.sea import Sea, load_ndbc

SAMPLE_TIME_S = 0.2
FAST = PumpLimits(pressure_pa=50e3, rate_pa_s=500e3)
SLOW = PumpLimits(pressure_pa=50e3, rate_pa_s=50e3)
SHIP = RollShip(1.9275e9, 1.9275e9 * 0.25, 4.87e7)
TANK = Tank(17.1, 4.88, 17.11, 6.22, lz_m=1.83, damping_ratio=0.1)
BAND_RAD_S = np.linspace(0.2, 1.2, 101)
WAVE_RAD_S = 0.6
SEAS = Path(__file__).parent.parent / "configs" / "seas"


def sampled_plant() -> control.StateSpace:
    """First ship and tank of the thesis: (pressure, wave moment) to (roll, level), sampled."""
    full = coupled_model(SHIP, TANK)
    chosen = control.ss(full.A, full.B, full.C[[0, 2]], np.zeros((2, 2)))
    return control.c2d(chosen, SAMPLE_TIME_S)


def respond(pressure_pa: FloatArray, moment_nm: FloatArray) -> FloatArray:
    """Roll and level from rest, shape (N, 2)."""
    plant = sampled_plant()
    inputs = np.vstack([pressure_pa, moment_nm])
    return np.asarray(control.forced_response(plant, inputs=inputs).outputs.T)


def record(
    samples: int = 2500,
    noise: float = 0.01,
    limits: PumpLimits = FAST,
    sea: str = "calm",
    seed: int = 1,
) -> tuple[FloatArray, FloatArray]:
    """Pressure and noisy outputs; a sea rolls the ship as much as the pump does."""
    pressure = random_pulses(samples * SAMPLE_TIME_S, limits, seed)
    y = respond(pressure, np.zeros(samples))
    time_s = np.arange(samples) * SAMPLE_TIME_S
    if sea != "calm":
        if sea == "one wave":
            moment = np.cos(WAVE_RAD_S * time_s + seed)
        else:
            storm = load_ndbc(SEAS / "ndbc_41010_2019-02_spectral_density.txt")
            waves = Sea.irregular(storm.at("2019-02-10T05:40"), seed)
            moment = waves.roll_moment(SHIP.stiffness_nm_rad).at(
                np.asarray(time_s, dtype=np.float64)
            )
        wave = respond(np.zeros(samples), moment)
        y = y + wave * np.std(y[:, 0]) / np.std(wave[:, 0])
    return pressure, y + noise * np.std(y, axis=0) * np.random.default_rng(seed).standard_normal(
        y.shape
    )


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
                lambda: okid(u, y, 200),
                lambda: okid(slow_u, slow_y, 200),
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
            "okid": peak_mb(lambda: okid(u, y, 200)),
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
        task = partial(okid, u, y, order)
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


def recursive() -> list[dict[str, Any]]:
    """Time of one update."""
    u, y = record()
    rows = []
    for order in (4, 20, 60, 120):
        model = RecursiveArx(order, np.std(y, axis=0), np.std(u, keepdims=True))
        count = 500
        for k in range(order + 1):
            model.update(u[k : k + 1], y[k])
        start = time.perf_counter()
        for k in range(order + 1, order + 1 + count):
            model.update(u[k : k + 1], y[k])
        rows.append({"order": order, "update_us": (time.perf_counter() - start) / count * 1e6})
    return rows


def ours(order: int, refined: bool) -> Callable[[FloatArray, FloatArray], tuple[FloatArray, ...]]:
    """OKID with frequencies found from the data, ERA, and refinement."""

    def identify(u: FloatArray, y: FloatArray) -> tuple[FloatArray, ...]:
        waves = find_disturbance_frequencies(u, y)
        result = okid(u, y, order, disturbance_frequencies_rad_s=waves)
        system = era(result.markov, 4)
        if refined:
            system = refine(system, result, u, y).system
        return tuple(np.asarray(part) for part in (system.A, system.B, system.C, system.D))

    return identify


def response(a: FloatArray, b: FloatArray, c: FloatArray, d: FloatArray) -> FloatArray:
    """Frequency response over the band, shape (101, 2)."""
    turns = np.exp(1j * BAND_RAD_S * SAMPLE_TIME_S)
    values = [c @ np.linalg.solve(z * np.eye(len(a)) - a, b[:, :1]) + d[:, :1] for z in turns]
    return np.array(values)[:, :, 0]


def accuracy(quick: bool) -> list[dict[str, Any]]:
    """Relative error of the frequency response from pressure to roll over 0.2-1.2 rad/s."""
    plant = sampled_plant()
    right = response(*(np.asarray(m) for m in (plant.A, plant.B, plant.C, plant.D)))
    methods = {
        "okid, era p = 120": ours(120, refined=False),
        "okid, era p = 200": ours(200, refined=False),
        "okid, era, refine p = 120": ours(120, refined=True),
        **published(),
    }
    rows = []
    for name, noise, sea in (
        ("clean", 0.0, "calm"),
        ("1 % noise", 0.01, "calm"),
        ("noise, one wave", 0.01, "one wave"),
        ("noise, measured sea", 0.01, "storm"),
    ):
        for method, identify in methods.items():
            errors, times = [], []
            for seed in range(2 if quick else 5):
                u, y = record(noise=noise, sea=sea, seed=seed)
                start = time.perf_counter()
                with contextlib.redirect_stdout(io.StringIO()):  # some of the packages talk
                    found = identify(u, y)
                times.append(time.perf_counter() - start)
                wrong = response(*found) - right
                errors.append(np.linalg.norm(wrong, axis=0) / np.linalg.norm(right, axis=0))
            roll, level = np.median(errors, axis=0)
            rows.append(
                {
                    "data": name,
                    "method": method,
                    "roll_error": float(roll),
                    "level_error": float(level),
                    "time_ms": min(times) * 1e3,
                }
            )
    return rows


def table(rows: list[dict[str, Any]]) -> None:
    """Print rows under the first one's keys."""
    keys = list(rows[0])
    cells = [
        [f"{r[k]:.3g}" if isinstance(r.get(k), float) else str(r.get(k, "-")) for k in keys]
        for r in rows
    ]
    widths = [max(map(len, column), default=0) for column in zip(keys, *cells, strict=True)]
    for line in [keys, *cells]:
        print("  ".join(cell.ljust(w) for cell, w in zip(line, widths, strict=True)))
    print()


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--json", action="store_true", help="print one JSON object")
    parser.add_argument("--quick", action="store_true", help="fewer and shorter measurements")
    arguments = parser.parse_args()
    first = speed(arguments.quick)
    rows = {"growth": growth(arguments.quick), "recursive": recursive()}
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of the packages compared with
        rows["accuracy"] = accuracy(arguments.quick)
    if arguments.json:
        print(json.dumps({"speed": first, **rows}))
        return
    print("OKID, order 200, 2,500 samples, two outputs")
    table([{"": name, "time ms": t} for name, t in first["time_ms"].items()])
    print(
        f"lstsq / okid {first['lstsq_over_okid']:.1f}, with a slow pump "
        f"{first['lstsq_over_okid_slow_pump']:.1f}"
    )
    print("relative error", {k: f"{v:.1e}" for k, v in first["relative_error"].items()})
    print("memory MB", {k: round(v, 1) for k, v in first["memory_mb"].items()}, "\n")
    for name, measured in rows.items():
        print(name)
        table(measured)


if __name__ == "__main__":
    main()
