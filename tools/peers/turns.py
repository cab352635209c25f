"""Timing side by side: everybody does the same tasks, in turns, and the least time of each counts.

What a busy machine adds to a task is not its cost; it seldom hits the same task in every round.
"""

import gc
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TypeVar

import numpy as np
from rich.progress import Progress

from utank_hil.base.arrays import FloatArray

Task = TypeVar("Task")


@dataclass(frozen=True, slots=True, eq=False)
class Costs:
    """What the tasks took, and what came of them.

    Attributes
    ----------
    time_s : ndarray, shape (tasks,)
    answers : ndarray, shape (tasks,)
        Of the last round.
    """

    time_s: FloatArray
    answers: FloatArray


def percentiles_us(time_s: FloatArray) -> dict[str, float]:
    """Median, 99th percentile and maximum."""
    values = np.percentile(time_s * 1e6, [50, 99, 100])
    return dict(zip(("p50_us", "p99_us", "max_us"), values.tolist(), strict=True))


def in_turns(
    solvers: dict[str, Callable[[Task], float]],
    tasks: Sequence[Task],
    rounds: int,
    progress: Progress,
) -> dict[str, Costs]:
    """Costs of every solver; each sees all tasks in order before the next one does."""
    bar = progress.add_task("", total=rounds * len(solvers) * len(tasks))
    best = {name: np.full(len(tasks), np.inf) for name in solvers}
    answers = {name: np.full(len(tasks), np.nan) for name in solvers}
    for _ in range(rounds):
        for name, solve in solvers.items():
            progress.update(bar, description=name)
            gc.collect()
            gc.disable()
            for index, task in enumerate(tasks):
                begin = time.perf_counter_ns()
                answer = solve(task)
                took = (time.perf_counter_ns() - begin) * 1e-9
                best[name][index] = min(best[name][index], took)
                answers[name][index] = answer
                if index % 50 == 49:
                    progress.advance(bar, 50)
            gc.enable()
            progress.advance(bar, len(tasks) % 50)
    progress.remove_task(bar)
    return {name: Costs(best[name], answers[name]) for name in solvers}
