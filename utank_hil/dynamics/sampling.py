"""Exact discretization of a continuous model with a first-order input lag and any input delay.

Timing of the loop. At t_k = k Ts the controller measures y(t_k) and computes a command. The command
takes effect at t_k + d (sensor delay, bus, controller tick, drive), is held for Ts, and reaches the
plant through the actuator's lag, T u_a' + u_a = command. The input of the sampled model has the
index of the next sample::

    v(k + 1) = command computed at t_k, acts over [t_k + d, t_k + d + Ts)

So y(k) depends on v(k) directly when d < Ts (D is not zero), and a law that computes v(k + 1) from
y(k), y(k - 1), ... uses the newest measurement.

With d = (n + f) Ts, n whole and 0 <= f < 1, x the continuous state (lag included), Phi = exp(A Ts),
Gamma(t) the response of x after a time t to a unit step of the command::

    x(t_k) = Phi x(t_{k-1}) + G1 v(k - 1 - n) + G0 v(k - n)
    G0 = Gamma((1 - f) Ts),    G1 = exp(A (1 - f) Ts) Gamma(f Ts)

The states of the sampled model are xi(k) = x(t_k) - G0 v(k - n), then v(k - 1), ..., v(k - n).
"""

import math
from typing import TYPE_CHECKING, Final, NamedTuple

import numpy as np

from utank_hil.base.arrays import ComplexArray, FloatArray
from utank_hil.base.ordered_sums import exponential

if TYPE_CHECKING:
    from control import StateSpace


_AT_ONCE: Final = 1_000_000  # Elements of the resolvents held at a time: 16 MB.


class LinearModel(NamedTuple):
    """Matrices of a linear model, with the names of control.StateSpace, which imports plotting.

    `dt` is the sample time in seconds, 0 if continuous.
    """

    A: FloatArray
    B: FloatArray
    C: FloatArray
    D: FloatArray
    dt: float


def sampled_model(
    system: "StateSpace", sample_time_s: float, delay_s: float = 0.0, lag_s: float = 0.0
) -> "StateSpace":
    """Discrete model from command to sampled outputs, with the timing of the module docstring.

    ValueError is raised if a time is out of range, or the model is discrete or has feedthrough.

    Parameters
    ----------
    system : control.StateSpace
        Continuous model without feedthrough; all inputs are pump inputs. Select signals by name:
        ``coupled_model(ship, tank)[["roll_rad"], ["pressure_pa"]]``.
    delay_s : float
        Time from measurement to effect at the drive; any value, not only whole samples.
    lag_s : float
        Time constant of the drive's inner pressure loop.

    Returns
    -------
    control.StateSpace
        States: those of `system`, the lags of its inputs (if `lag_s` > 0), past commands.
    """
    from control import ss  # This import would bring plotting into the process.

    model = sample(system, sample_time_s, delay_s, lag_s)
    return ss(*model, inputs=system.input_labels, outputs=system.output_labels)


def sample(
    system: "StateSpace | LinearModel", sample_time_s: float, delay_s: float, lag_s: float
) -> LinearModel:
    """Sample a model as `sampled_model` does, without python-control."""
    for name, time in (("delay_s", delay_s), ("lag_s", lag_s)):
        if not (math.isfinite(time) and time >= 0):
            raise ValueError(f"{name} must be zero or more and finite, got {time}")
    if not (math.isfinite(sample_time_s) and sample_time_s > 0):
        raise ValueError(f"sample_time_s must be positive and finite, got {sample_time_s}")
    if system.dt != 0:
        raise ValueError(f"the model to be sampled must be continuous, its dt is {system.dt}")
    if np.any(system.D):
        raise ValueError("the model to be sampled must have no feed-through (D = 0)")
    a, b, c = _with_lag(system.A, system.B, system.C, lag_s)
    whole = math.floor(delay_s / sample_time_s)
    early_s = delay_s - whole * sample_time_s
    late_transition, late_step = transition_and_step(a, b, sample_time_s - early_s)
    early_transition, early_step = transition_and_step(a, b, early_s)
    transition = late_transition @ early_transition
    effect = transition @ late_step + late_transition @ early_step
    return LinearModel(*_shifted(transition, effect, c, c @ late_step, whole), sample_time_s)


def transition_and_step(
    a: FloatArray, b: FloatArray, time_s: float
) -> tuple[FloatArray, FloatArray]:
    """Transition matrix exp(A t), and the step response of the state to each input at time t."""
    states = a.shape[0]
    block = np.zeros((states + b.shape[1],) * 2)
    block[:states, :states] = a
    block[:states, states:] = b
    whole = exponential(block * time_s)
    return whole[:states, :states], whole[:states, states:]


def _with_lag(
    a: FloatArray, b: FloatArray, c: FloatArray, lag_s: float
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return the model with a first-order lag of time constant `lag_s` at each input."""
    if lag_s == 0:
        return a, b, c
    states, inputs = b.shape
    rate = np.eye(inputs) / lag_s
    return (
        np.block([[a, b], [np.zeros((inputs, states)), -rate]]),
        np.vstack([np.zeros((states, inputs)), rate]),
        np.hstack([c, np.zeros((c.shape[0], inputs))]),
    )


def _shifted(
    a: FloatArray, b: FloatArray, c: FloatArray, d: FloatArray, samples: int
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Return the discrete model with its input delayed by whole samples."""
    for _ in range(samples):  # The newest past command becomes a state.
        states, inputs = b.shape
        a = np.block([[a, b], [np.zeros((inputs, states + inputs))]])
        c = np.hstack([c, d])
        b = np.vstack([np.zeros((states, inputs)), np.eye(inputs)])
        d = np.zeros((c.shape[0], inputs))
    return a, b, c, d


def noise_covariance(a: FloatArray, noise: FloatArray, time_s: float) -> FloatArray:
    """Covariance of the state after a time of continuous white noise of unit spectral density.

    State matrix `a` is (n, n), the input matrix `noise` of k noises (n, k). Source: C. F. Van Loan,
    Computing integrals involving the matrix exponential, IEEE Transactions on Automatic Control 23
    (1978) 395-404.
    """
    from scipy.linalg import expm

    n = len(a)
    block = np.zeros((2 * n, 2 * n))
    block[:n, :n], block[:n, n:], block[n:, n:] = -a, noise @ noise.T, a.T
    whole = expm(block * time_s)
    covariance: FloatArray = whole[n:, n:].T @ whole[:n, n:]
    return (covariance + covariance.T) / 2


def state_space_response(system: "StateSpace | LinearModel", points: ComplexArray) -> ComplexArray:
    """C (p I - A)^-1 B + D at complex points s (or z), shape (N,); (N, outputs, inputs)."""
    a, b, c, d = system.A, system.B, system.C, system.D
    points = np.asarray(points, dtype=np.complex128)
    unit, b_complex = np.eye(len(a)), b.astype(np.complex128)
    response = np.empty((len(points), *d.shape), dtype=np.complex128)
    chunk = max(1, _AT_ONCE // max(1, a.size))
    for first in range(0, len(points), chunk):
        part = slice(first, first + chunk)
        resolvent = points[part, None, None] * unit - a
        response[part] = c @ np.linalg.solve(resolvent, b_complex) + d
    return response
