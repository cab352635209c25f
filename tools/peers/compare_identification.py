"""Identification of the first ship beside published packages: error, time and memory.

500 s of random pulses, roll and level measured; clean, with 1 % noise, with noise and one wave, and
with noise and the measured storm, which rolls the ship as much as the pump does. Error: relative
2-norm of the frequency response from pressure to roll and to level over 0.2 to 1.2 rad/s, median of
the seeds. Memory: growth of the process at its peak, noticed above a few MB.

Ours runs with one setting throughout. Each published method is tried with several orders and block
rows, and the best by the true answer is shown, with its own time; of its models under one wave
the mode at the wave's frequency is taken away, as a user would. "At first" is what a method gives
at the true order with 60 block rows. "Physics" is a fit of ship and tank to OKID's model, starting
from a ship of 40 % more stiffness and half the damping.

Example: make peers && .cache/peers/bin/python -m tools.peers.compare_identification --seeds 2
"""

import contextlib
import dataclasses
import io
import time
import warnings
from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np
from rich.console import Console
from rich.progress import Progress

from tools.peers.identification_records import (
    MEASURED,
    PLANT,
    SAMPLE_TIME_S,
    SHIP,
    WAVE_RAD_S,
    Matrices,
    record,
    response_error,
    without_mode,
)
from tools.peers.memory import peak_mb
from tools.peers.published_identification import PUBLISHED, Identify
from tools.printing import command_line, show
from utank_hil.base.arrays import FloatArray
from utank_hil.identification import era, find_disturbance_frequencies, okid
from utank_hil.identification.ship_fit import fit_ship

TRUE_ORDER = 4
ROWS = {  # noise, sea, and (order, block rows) that published methods are tried with
    "clean": (0.0, "calm", ((4, 60),)),
    "1 % noise": (0.01, "calm", ((4, 60), (4, 120))),
    "noise, one wave": (0.01, "one wave", ((4, 60), (6, 120), (6, 200))),
    "noise, measured sea": (0.01, "storm", ((4, 60), (8, 120), (8, 200))),
}
Method = Callable[[FloatArray, FloatArray], Matrices]


def realized(order: int, u: FloatArray, y: FloatArray) -> Matrices:
    """OKID with frequencies found from the data, and ERA."""
    waves = find_disturbance_frequencies(u, y, sample_time_s=SAMPLE_TIME_S)
    result = okid(u, y, order, disturbance_frequencies_rad_s=waves, sample_time_s=SAMPLE_TIME_S)
    system = era(result.markov, TRUE_ORDER, sample_time_s=SAMPLE_TIME_S)
    a, b, c, d = (np.asarray(part) for part in (system.A, system.B, system.C, system.D))
    return a, b, c, d


def physical(order: int, u: FloatArray, y: FloatArray) -> Matrices:
    """Ship and tank fitted to OKID's model."""
    waves = find_disturbance_frequencies(u, y, sample_time_s=SAMPLE_TIME_S)
    result = okid(u, y, order, disturbance_frequencies_rad_s=waves, sample_time_s=SAMPLE_TIME_S)
    expected = dataclasses.replace(
        SHIP,
        stiffness_nm_rad=1.4 * SHIP.stiffness_nm_rad,
        damping_nms_rad=0.5 * SHIP.damping_nms_rad,
    )
    fit = fit_ship(result, u, dataclasses.replace(PLANT, ship=expected), MEASURED)
    found = dataclasses.replace(PLANT, ship=fit.ship, tank=fit.tank)
    return found.sampled(MEASURED, SAMPLE_TIME_S)[:4]


OURS: dict[str, Method] = {
    "OKID p = 120, ERA": partial(realized, 120),
    "OKID p = 200, ERA": partial(realized, 200),
    "OKID p = 120, physics": partial(physical, 120),
}


def methods(sea: str, settings: tuple[tuple[int, int], ...]) -> dict[str, dict[str, Method]]:
    """By name, and by setting: one each for ours."""
    found = {name: {"": method} for name, method in OURS.items()}
    for name, identify in PUBLISHED.items():
        found[name] = {}
        for order, rows in settings:

            def method(
                u: FloatArray,
                y: FloatArray,
                identify: Identify = identify,
                order: int = order,
                rows: int = rows,
            ) -> Matrices:
                model = identify(u, y, order, rows)
                spare = sea == "one wave" and order > TRUE_ORDER
                return without_mode(model, WAVE_RAD_S) if spare else model

            found[name][f"order {order}, {rows} rows"] = method
    return found


def measure(method: Method, records: list[tuple[FloatArray, FloatArray]]) -> dict[str, Any]:
    """Median error, least time and memory of a method, or why it failed."""
    errors, times = [], []
    for u, y in records:
        begin = time.perf_counter()
        try:
            with contextlib.redirect_stdout(io.StringIO()):  # some of the packages talk
                model = method(u, y)
        except (ArithmeticError, ValueError) as error:  # LinAlgError is a ValueError
            return {"failed": f"{type(error).__name__}: {error}"}
        times.append(time.perf_counter() - begin)
        errors.append(response_error(model))
    roll, level = np.median(errors, axis=0).tolist()
    with contextlib.redirect_stdout(io.StringIO()):
        memory = peak_mb(lambda: method(*records[0]))
    return {
        "roll_error": roll,
        "level_error": level,
        "time_ms": min(times) * 1e3,
        "memory_mb": memory,
    }


def compare(seeds: int, progress: Progress) -> list[dict[str, Any]]:
    """A row for each kind of data and method, the best setting of each."""
    rows = []
    total = sum(len(OURS) + len(PUBLISHED) * len(settings) for *_, settings in ROWS.values())
    bar = progress.add_task("", total=total)
    for data, (noise, sea, settings) in ROWS.items():
        records = [record(noise=noise, sea=sea, seed=seed) for seed in range(seeds)]
        for name, by_setting in methods(sea, settings).items():
            tried = []
            for setting, method in by_setting.items():
                progress.update(bar, description=f"{data}: {name} {setting}")
                tried.append({"setting": setting, **measure(method, records)})
                progress.advance(bar)
            best = min(tried, key=lambda one: one.get("roll_error", np.inf))
            rows.append({"data": data, "method": name, **best, "tried": tried})
    return rows


def main() -> None:
    """Measure and print."""
    parser = command_line(__doc__)
    parser.add_argument("--seeds", type=int, default=3, help="records of each kind")
    arguments = parser.parse_args()
    if arguments.seeds < 1:
        parser.error("--seeds must be 1 or more")
    warnings.simplefilter("ignore")  # of the packages
    with Progress(console=Console(stderr=True), transient=True) as progress:
        rows = compare(arguments.seeds, progress)
    show({"seeds": arguments.seeds, "rows": rows}, arguments)


if __name__ == "__main__":
    main()
