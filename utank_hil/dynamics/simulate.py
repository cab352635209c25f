"""Fixed-step simulation of one ship or of a batch, on the compiled kernels.

The kernels are imported at the first run, so that importing this module imports no compiler.
"""

import math
from collections.abc import Sequence
from typing import NamedTuple, Protocol

import numpy as np
import numpy.typing as npt

from utank_hil.base.arrays import FloatArray
from utank_hil.dynamics.nonlinear import Impact, RollModel
from utank_hil.dynamics.reference import RollRun

IMPACTS_KEPT = 10_000


class WaveComponents(Protocol):
    """Interface of a wave moment, such as `utank_hil.sea.Harmonics` for one ship."""

    @property
    def amplitude(self) -> npt.ArrayLike:
        """Amplitudes in N m."""

    @property
    def frequency_rad_s(self) -> npt.ArrayLike:
        """Frequencies of encounter."""

    @property
    def phase_rad(self) -> npt.ArrayLike:
        """Phases at time zero."""


class WaveMoment(NamedTuple):
    """Wave moment as a sum of ``amplitude cos(frequency t + phase)``.

    Arrays have shape (m,), or (n, m) for one sea per ship of a batch; amplitudes are in N m.
    """

    amplitude: npt.ArrayLike
    frequency_rad_s: npt.ArrayLike
    phase_rad: npt.ArrayLike


CALM = WaveMoment(np.zeros(0), np.zeros(0), np.zeros(0))


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


def simulate(
    model: RollModel,
    duration_s: float,
    initial: npt.ArrayLike = (0.0, 0.0, 0.0, 0.0),
    *,
    wave: WaveComponents = CALM,
    pressure_pa: npt.ArrayLike = 0.0,
    valve_loss_pa_per_m2_s2: npt.ArrayLike = 0.0,
    hold_s: float | None = None,
    step_s: float = 0.02,
    record_every: int = 1,
    capsize_rad: float = math.pi / 2,
) -> RollRun:
    """Simulate one ship with classical Runge-Kutta steps.

    The result lists the first 10,000 impacts at the level limits.

    ValueError is raised if a duration is not a whole number of steps, or shapes do not match.

    Parameters
    ----------
    duration_s : float
        A whole number of steps.
    initial : array_like, shape (4,)
        Roll, roll rate, level, level rate.
    pressure_pa, valve_loss_pa_per_m2_s2 : array_like, shape () or (k,)
        Samples, each held for `hold_s`, the last one to the end.
    hold_s : float, optional
        A whole number of steps; one step if not given.
    record_every : int
        Steps between the recorded states.
    capsize_rad : float
        Roll angle at which the ship counts as capsized and the run ends.
    """
    from utank_hil.dynamics import kernels

    steps = whole_steps("duration_s", duration_s, step_s)
    hold = whole_steps("hold_s", step_s if hold_s is None else hold_s, step_s)
    state = np.array(initial, dtype=np.float64)
    if state.shape != (4,):
        raise ValueError(f"initial must have shape (4,), got {state.shape}")
    _check_record_every(record_every)
    amplitude, frequency, phase = _sea(wave)
    if not len(amplitude) == len(frequency) == len(phase) == 1:
        raise ValueError("the arrays of a wave for one ship must be one-dimensional")
    out = np.empty((-(-steps // record_every), 4))
    summary = _blank_summary(1)[0]
    impacts = np.empty((IMPACTS_KEPT, 5))
    pressure, valve_loss = _rows(pressure_pa)[0], _rows(valve_loss_pa_per_m2_s2)[0]
    kernels.advance(
        *model.packed, amplitude[0], frequency[0], phase[0], pressure, valve_loss, hold,
        capsize_rad, 0, steps, step_s, state, summary, impacts, out, record_every,
    )  # fmt: skip
    capsized_s = float(summary[kernels.CAPSIZED_S])
    time = step_s * np.append(np.arange(0, steps, record_every), steps)
    history = np.vstack([out, state])
    if math.isfinite(capsized_s):
        before = time < capsized_s
        time, history = (
            np.append(time[before], capsized_s),
            np.vstack([history[:-1][before[:-1]], state]),
        )
    kept = impacts[: int(summary[kernels.STRIKES])]
    return RollRun(time, history, tuple(Impact(*map(float, row)) for row in kept), capsized_s)


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
    from utank_hil.dynamics import kernels

    steps = whole_steps("duration_s", duration_s, step_s)
    hold = whole_steps("hold_s", step_s if hold_s is None else hold_s, step_s)
    models = [models] if isinstance(models, RollModel) else list(models)
    coefficients, pieces, tables = zip(*(model.packed for model in models), strict=True)
    rows, per_piece, restoring = np.array(coefficients), np.array(pieces), _stacked(list(tables))
    if record_every is not None:
        _check_record_every(record_every)
    amplitude, frequency, phase = _sea(wave)
    pressure, valve_loss = _rows(pressure_pa), _rows(valve_loss_pa_per_m2_s2)
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
    summary = _blank_summary(ships)
    stride = record_every or steps
    samples = -(-steps // stride) if record_every else 0
    history = np.empty((ships, samples, 4))
    chunk = max(1, round(steps / 50 / (stride * kernels.REFRESH))) * stride * kernels.REFRESH
    for first in range(0, steps, chunk):  # Parts of the run allow Ctrl-C.
        part = slice(first // stride, (first + chunk) // stride)
        count = min(chunk, steps - first)
        kernels.advance_batch(
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


def whole_steps(name: str, duration_s: float, step_s: float) -> int:
    """Return the whole number of steps in a duration.

    ValueError is raised if the step is not positive, or the number is not whole and 1 or more.
    """
    if not (math.isfinite(step_s) and step_s > 0):
        raise ValueError(f"step_s must be positive and finite, got {step_s}")
    steps = round(duration_s / step_s)
    if steps < 1 or abs(steps * step_s - duration_s) > 1e-9 * duration_s:
        raise ValueError(f"{name} must be a whole number of steps of {step_s} s, got {duration_s}")
    return steps


def _blank_summary(ships: int) -> FloatArray:
    from utank_hil.dynamics import kernels

    summary = np.zeros((ships, kernels.SUMMARY))
    summary[:, kernels.CAPSIZED_S] = np.inf
    return summary


def _sea(wave: WaveComponents) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return amplitudes, frequencies and phases as rows of equal length."""
    amplitude, frequency, phase = (
        _rows(x) for x in (wave.amplitude, wave.frequency_rad_s, wave.phase_rad)
    )
    if not amplitude.shape[1] == frequency.shape[1] == phase.shape[1]:
        raise ValueError(
            "the arrays of a wave must have as many components each, got "
            f"{amplitude.shape[1]}, {frequency.shape[1]} and {phase.shape[1]}"
        )
    return amplitude, frequency, phase


def _check_record_every(record_every: int) -> None:
    if record_every < 1:
        raise ValueError(f"record_every must be 1 or more, got {record_every}")


def _rows(values: npt.ArrayLike) -> FloatArray:
    """Return values as contiguous rows, shape (1 or n, k)."""
    return np.atleast_2d(np.ascontiguousarray(values, dtype=np.float64))


def _stacked(restoring: list[FloatArray]) -> FloatArray:
    """Return restoring coefficients of all ships as one array, zero-padded to the highest power."""
    if len({len(table) for table in restoring}) > 1:
        raise ValueError("the ships of a batch must have righting levers of the same length")
    powers = max(table.shape[1] for table in restoring)
    return np.stack([np.pad(table, ((0, 0), (0, powers - table.shape[1]))) for table in restoring])
