"""One ship from many starts, or in many waves, on all cores; imports numba."""

import math
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from numba import prange

from tools.thesis.simulate import (
    CALM,
    WaveComponents,
    blank_summary,
    check_record_every,
    sea_rows,
    whole_steps,
)
from tools.thesis.simulate_kernel import REFRESH, advance
from utank_hil.base.arrays import FloatArray
from utank_hil.dynamics import kernels
from utank_hil.dynamics.jit import njit
from utank_hil.dynamics.nonlinear import RollModel


class BatchResult(NamedTuple):
    """Results of n runs."""

    state: FloatArray  #: shape (n, 4): Final state, or the state at capsizing.
    capsized_s: FloatArray  #: shape (n,): Time of capsizing, infinite where the ship survived.
    max_roll_rad: FloatArray  #: shape (n,)
    time_s: FloatArray  #: shape (k,): Times of `history`.
    history: FloatArray  #: shape (n, k, 4): States, if `record_every` was given; else k = 0.


def simulate_batch(
    model: RollModel,
    duration_s: float,
    initial: npt.ArrayLike = (0.0, 0.0, 0.0, 0.0),
    *,
    wave: WaveComponents = CALM,
    step_s: float = 0.02,
    record_every: int | None = None,
) -> BatchResult:
    """Simulate on all cores; the result does not depend on the number of cores.

    The initial state, shape (4,) or (n, 4), and the arrays of the sea, shape (m,) or (n, m), are
    given once for all runs, or once for each. Results and errors are those of `simulate`; the steps
    between recorded states are `record_every`, by default nothing is recorded.
    """
    steps = whole_steps("duration_s", duration_s, step_s)
    if record_every is not None:
        check_record_every(record_every)
    amplitude, frequency, phase = sea_rows(wave)
    start = np.atleast_2d(np.asarray(initial, dtype=np.float64))
    lengths = {len(x) for x in (amplitude, frequency, phase, start)} - {1}
    if len(lengths) > 1 or start.shape[1] != 4:
        raise ValueError(
            "initial states and seas must each be one or one per run, initial states of shape "
            f"(n, 4); got leading lengths {sorted(lengths)}, initial {start.shape}"
        )
    runs = max(lengths, default=1)
    state = np.array(np.broadcast_to(start, (runs, 4)))
    summary = blank_summary(runs)
    stride = record_every or steps
    samples = -(-steps // stride) if record_every else 0
    history = np.empty((runs, samples, 4))
    chunk = max(1, round(steps / 50 / (stride * REFRESH))) * stride * REFRESH
    for first in range(0, steps, chunk):  # Parts of the run allow Ctrl-C.
        part = history[:, first // stride : (first + chunk) // stride]
        count = min(chunk, steps - first)
        _advance_batch(
            *model.packed, amplitude, frequency, phase, first, count, step_s, state, summary, part,
            stride,
        )  # fmt: skip
    return BatchResult(
        state,
        summary[:, kernels.CAPSIZED_S].copy(),
        summary[:, kernels.MAX_ROLL].copy(),
        np.asarray(step_s * stride * np.arange(samples), dtype=np.float64),
        history,
    )


@njit(parallel=True, error_model="numpy")
def _advance_batch(
    row: FloatArray,
    per_piece: float,
    restoring: FloatArray,
    amplitude: FloatArray,
    frequency: FloatArray,
    phase: FloatArray,
    first: int,
    steps: int,
    dt: float,
    state: FloatArray,
    summary: FloatArray,
    out: FloatArray,
    stride: int,
) -> None:
    """`advance` for every row of `state` (n, 4), on all cores; the waves have n rows or one."""
    for n in prange(state.shape[0]):
        advance(
            row,
            per_piece,
            restoring,
            amplitude[n % amplitude.shape[0]],
            frequency[n % frequency.shape[0]],
            phase[n % phase.shape[0]],
            np.zeros(1),
            np.zeros(1),
            1, math.pi / 2, first, steps, dt,
            state[n], summary[n], np.empty((0, 5)), out[n], stride,
        )  # fmt: skip
