"""Fixed-step simulation of one ship or of a batch, on the compiled kernels.

The kernels are imported at the first run, so that importing this module imports no compiler.
"""

import math
from dataclasses import dataclass
from typing import NamedTuple, Protocol

import numpy as np
import numpy.typing as npt

from utank_hil.base.arrays import FloatArray
from utank_hil.dynamics.nonlinear import RollModel

IMPACTS_KEPT = 10_000  #: Strikes of a run that are kept. Chosen; no study.


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


class Impact(NamedTuple):
    """An impact of the water at a limit of the level."""

    time_s: float
    level_m: float  #: The limit; positive if starboard is full.
    speed_m_s: float  #: dh/dt just before the impact.
    #: Angular impulse of tank and water on the ship: its inertia times the jump of its roll rate.
    roll_impulse_nms: float
    #: Impulse of the stop on the water along h (pressure times reservoir area, over time).
    stop_impulse_ns: float


@dataclass(frozen=True, slots=True)
class RollRun:
    """Result of a simulation."""

    time_s: FloatArray  #: shape (n,)
    state: FloatArray  #: shape (n, 4): Roll, roll rate, level, level rate.
    impacts: tuple[Impact, ...]  #: Impacts at the limits of the level.
    #: Time at which the roll passed the capsize angle and the run ended; infinite if it did not.
    capsized_s: float


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
    from tools.thesis.simulate_kernel import advance
    from utank_hil.dynamics import kernels

    steps = whole_steps("duration_s", duration_s, step_s)
    hold = whole_steps("hold_s", step_s if hold_s is None else hold_s, step_s)
    state = np.array(initial, dtype=np.float64)
    if state.shape != (4,):
        raise ValueError(f"initial must have shape (4,), got {state.shape}")
    check_record_every(record_every)
    amplitude, frequency, phase = sea_rows(wave)
    if not len(amplitude) == len(frequency) == len(phase) == 1:
        raise ValueError("the arrays of a wave for one ship must be one-dimensional")
    out = np.empty((-(-steps // record_every), 4))
    summary = blank_summary(1)[0]
    impacts = np.empty((IMPACTS_KEPT, 5))
    pressure, valve_loss = rows_of(pressure_pa)[0], rows_of(valve_loss_pa_per_m2_s2)[0]
    advance(
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


def blank_summary(ships: int) -> FloatArray:
    """Summaries of ships that have not moved, shape (ships, SUMMARY)."""
    from utank_hil.dynamics import kernels

    summary = np.zeros((ships, kernels.SUMMARY))
    summary[:, kernels.CAPSIZED_S] = np.inf
    return summary


def sea_rows(wave: WaveComponents) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return amplitudes, frequencies and phases as rows of equal length."""
    amplitude, frequency, phase = (
        rows_of(x) for x in (wave.amplitude, wave.frequency_rad_s, wave.phase_rad)
    )
    if not amplitude.shape[1] == frequency.shape[1] == phase.shape[1]:
        raise ValueError(
            "the arrays of a wave must have as many components each, got "
            f"{amplitude.shape[1]}, {frequency.shape[1]} and {phase.shape[1]}"
        )
    return amplitude, frequency, phase


def check_record_every(record_every: int) -> None:
    """Refuse a number of steps below 1."""
    if record_every < 1:
        raise ValueError(f"record_every must be 1 or more, got {record_every}")


def rows_of(values: npt.ArrayLike) -> FloatArray:
    """Return values as contiguous rows, shape (1 or n, k)."""
    return np.atleast_2d(np.ascontiguousarray(values, dtype=np.float64))
