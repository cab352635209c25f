"""Simulation of many ships on all cores; imports numba."""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from numba import prange

from utank_hil.base.arrays import FloatArray
from utank_hil.dynamics import kernels
from utank_hil.dynamics.jit import njit
from utank_hil.dynamics.kernels import advance
from utank_hil.dynamics.nonlinear import RollModel
from utank_hil.dynamics.simulate import (
    CALM,
    WaveComponents,
    blank_summary,
    check_record_every,
    rows_of,
    sea_rows,
    whole_steps,
)


class BatchResult(NamedTuple):
    """Results for a batch of n ships."""

    state: FloatArray  #: shape (n, 4): Final state, or the state at capsizing.
    capsized_s: FloatArray  #: shape (n,): Time of capsizing, infinite for a ship that survived.
    max_roll_rad: FloatArray  #: shape (n,)
    max_level_m: FloatArray  #: shape (n,)
    strikes: npt.NDArray[np.int64]  #: shape (n,): Number of impacts at the limits of the level.
    max_roll_impulse_nms: FloatArray  #: shape (n,): Greatest angular impulse of these impacts.
    time_s: FloatArray  #: shape (k,): Times of `history`.
    history: FloatArray  #: shape (n, k, 4): States, if `record_every` was given; else k = 0.


def simulate_batch(
    models: RollModel | Sequence[RollModel],
    duration_s: float,
    initial: npt.ArrayLike = (0.0, 0.0, 0.0, 0.0),
    *,
    wave: WaveComponents = CALM,
    pressure_pa: npt.ArrayLike = 0.0,
    valve_loss_pa_per_m2_s2: npt.ArrayLike = 0.0,
    hold_s: float | None = None,
    step_s: float = 0.02,
    record_every: int | None = None,
    capsize_rad: float = math.pi / 2,
) -> BatchResult:
    """Simulate many ships on all cores; the result does not depend on the number of cores.

    Models, initial states, seas and inputs are each given once for all ships, or once per ship.
    Results and errors are those of `simulate`.

    Parameters
    ----------
    initial : array_like, shape (4,) or (n, 4)
    wave : WaveMoment
        Sea with arrays of shape (m,) or (n, m).
    pressure_pa, valve_loss_pa_per_m2_s2 : array_like, shape (), (k,) or (n, k)
        Samples, each held for `hold_s`, the last one to the end.
    record_every : int, optional
        Steps between recorded states; by default nothing is recorded.
    """
    steps = whole_steps("duration_s", duration_s, step_s)
    hold = whole_steps("hold_s", step_s if hold_s is None else hold_s, step_s)
    models = [models] if isinstance(models, RollModel) else list(models)
    coefficients, pieces, tables = zip(*(model.packed for model in models), strict=True)
    rows, per_piece, restoring = np.array(coefficients), np.array(pieces), _stacked(list(tables))
    if record_every is not None:
        check_record_every(record_every)
    amplitude, frequency, phase = sea_rows(wave)
    pressure, valve_loss = rows_of(pressure_pa), rows_of(valve_loss_pa_per_m2_s2)
    start = np.atleast_2d(np.asarray(initial, dtype=np.float64))
    lengths = {len(x) for x in (rows, amplitude, frequency, phase, pressure, valve_loss, start)}
    lengths.discard(1)
    if len(lengths) > 1 or start.shape[1] != 4:
        raise ValueError(
            "models, initial states, seas and inputs must each be one or one per ship, initial "
            f"states of shape (n, 4); got leading lengths {sorted(lengths)}, initial {start.shape}"
        )
    ships = max(lengths, default=1)
    state = np.array(np.broadcast_to(start, (ships, 4)))
    summary = blank_summary(ships)
    stride = record_every or steps
    samples = -(-steps // stride) if record_every else 0
    history = np.empty((ships, samples, 4))
    chunk = max(1, round(steps / 50 / (stride * kernels.REFRESH))) * stride * kernels.REFRESH
    for first in range(0, steps, chunk):  # Parts of the run allow Ctrl-C.
        part = slice(first // stride, (first + chunk) // stride)
        count = min(chunk, steps - first)
        _advance_batch(
            rows, per_piece, restoring, amplitude, frequency, phase, pressure, valve_loss, hold,
            capsize_rad, first, count, step_s, state, summary, history[:, part], stride,
        )  # fmt: skip
    return BatchResult(
        state,
        summary[:, kernels.CAPSIZED_S].copy(),
        summary[:, kernels.MAX_ROLL].copy(),
        summary[:, kernels.MAX_LEVEL].copy(),
        summary[:, kernels.STRIKES].astype(np.int64),
        summary[:, kernels.MAX_IMPULSE].copy(),
        np.asarray(step_s * stride * np.arange(samples), dtype=np.float64),
        history,
    )


def _stacked(restoring: list[FloatArray]) -> FloatArray:
    """Return restoring coefficients of all ships as one array, zero-padded to the highest power."""
    if len({len(table) for table in restoring}) > 1:
        raise ValueError("the ships of a batch must have righting levers of the same length")
    powers = max(table.shape[1] for table in restoring)
    return np.stack([np.pad(table, ((0, 0), (0, powers - table.shape[1]))) for table in restoring])


@njit(parallel=True, error_model="numpy")
def _advance_batch(
    rows: FloatArray,
    per_piece: FloatArray,
    restoring: FloatArray,
    amplitude: FloatArray,
    frequency: FloatArray,
    phase: FloatArray,
    pressure: FloatArray,
    valve_loss: FloatArray,
    hold: int,
    capsize: float,
    first: int,
    steps: int,
    dt: float,
    state: FloatArray,
    summary: FloatArray,
    out: FloatArray,
    stride: int,
) -> None:
    """`advance` for every row of `state` (n, 4), on all cores.

    Every other array has a leading axis of length n, or of length 1 for all ships.
    """
    for n in prange(state.shape[0]):
        advance(
            rows[n % rows.shape[0]],
            per_piece[n % per_piece.shape[0]],
            restoring[n % restoring.shape[0]],
            amplitude[n % amplitude.shape[0]],
            frequency[n % frequency.shape[0]],
            phase[n % phase.shape[0]],
            pressure[n % pressure.shape[0]],
            valve_loss[n % valve_loss.shape[0]],
            hold, capsize, first, steps, dt, state[n], summary[n], np.empty((0, 5)), out[n], stride,
        )  # fmt: skip
