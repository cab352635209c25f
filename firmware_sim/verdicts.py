"""Which runs of a bench count: one that capsized, failed or was idle gives no reduction."""

from dataclasses import dataclass
from typing import Final

import numpy as np
import numpy.typing as npt

from firmware_sim.bench import BenchResult
from firmware_sim.run import Run
from firmware_sim.scenario import PASSIVE
from firmware_sim.ship_side import PASSIVE_SCRIPT
from utank_hil.canbus import Fault, Mode
from utank_hil.nodes.panel import Action
from utank_hil.safety.faults import fault_text

LEAST_IN_CHARGE: Final = 0.9
"""Least share of the time ordered by the operator in which the controller must be in charge."""

_ORDERS: Final = {
    Action.ARM: Mode.ACTIVE,
    Action.PASSIVE: Mode.PASSIVE,
    Action.DISARM: Mode.PASSIVE,
    Action.STANDBY: Mode.STANDBY,
    Action.STOP: Mode.STANDBY,
}


@dataclass(frozen=True, slots=True)
class Mark:
    """Why a run is not ranked.

    Attributes
    ----------
    word : str
        For a cell of a table.
    why : str
        A sentence without the run's name.
    """

    word: str
    why: str


def mark_of(result: BenchResult, run: Run) -> Mark | None:
    """Why a run is not ranked; None for one that is."""
    if not result.compares(run):
        return Mark(
            "not compared",
            f"not compared, ended at {run.end_s:g} s with {result.rows_compared(run)} of the "
            f"{result.expected_rows} rows from {result.settle_s:g} s to {result.end_s:g} s",
        )
    if run.capsized_s < result.end_s:
        return Mark("capsized", f"the ship capsized at {run.capsized_s:.1f} s")
    mode, fault = (int(run.column(name)[-1]) for name in ("mode", "fault"))
    if fault != Fault.NONE:
        words = fault_text(Fault(fault))
        return Mark("fault", f"the controller ended in {Mode(mode).name}, fault {words}")
    share, wanted = _obeyed_share(result, run), _wanted(run)
    if share is None:
        return Mark("idle", f"no order to go to {wanted.name} before the end of the window")
    if share < LEAST_IN_CHARGE:
        return Mark(
            "idle",
            f"the controller was in {wanted.name} for {share:.1%} of the time that the operator "
            f"wanted it there; {LEAST_IN_CHARGE:.0%} are asked for",
        )
    return None


def active_share(result: BenchResult, run: Run) -> float:
    """Share of the window in which the controller was in charge."""
    return float((run.column("mode")[_window(result, run)] == Mode.ACTIVE).mean())


def _wanted(run: Run) -> Mode:
    return Mode.PASSIVE if run.name == PASSIVE else Mode.ACTIVE


def _obeyed_share(result: BenchResult, run: Run) -> float | None:
    """Share of the time ordered in the window in which the mode was the one that is compared."""
    ordered = _window(result, run) & (_orders(result, run) == _wanted(run))
    if not ordered.any():
        return None
    return float((run.column("mode")[ordered] == _wanted(run)).mean())


def _orders(result: BenchResult, run: Run) -> npt.NDArray[np.int64]:
    """The mode that the operator wanted at each row; his clock starts when the controller is ready.

    Of the passive run, the pump at zero: switched off, its rotor would turn with the water.
    """
    script = PASSIVE_SCRIPT if run.name == PASSIVE else result.scenario.operator
    time_s, orders = run.column("time_s"), np.full(len(run.rows), int(Mode.STANDBY))
    ready = np.flatnonzero(run.column("mode") != Mode.INIT)
    start_s = time_s[ready[0]] if len(ready) else np.inf
    for timed in sorted(script, key=lambda timed: timed.time_s):
        if timed.action in _ORDERS:
            orders[time_s >= start_s + timed.time_s] = _ORDERS[timed.action]
    return orders


def _window(result: BenchResult, run: Run) -> npt.NDArray[np.bool_]:
    return run.between(result.settle_s, result.end_s)
