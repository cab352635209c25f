"""Linear-quadratic control, thesis section 3.4, with a Kalman filter for unmeasured states.

For x(k+1) = A x(k) + B u(k) + w(k), y(k) = C x(k) + D u(k) + v(k):

* `design_lqr`: u = -K x that minimizes the sum of x'Q x + u'R u + 2 x'N u;
* `design_lqg`: the same gain on the estimate of a Kalman predictor from y(k-1), y(k-2), ... ::

      xhat(k+1) = A xhat(k) + B u(k) + L (y(k) - C xhat(k) - D u(k)),    u(k) = -K xhat(k)

The sampled models of `utank_hil.dynamics.sampling` have the loop's own timing, with delay, lag and
the newest measurement.

`GentleController` does with less pressure, by gains of the same estimate at a higher cost of it. A
part of a law's command is no optimum for less pressure. Its phase is that of the full command, so
in seas beside the roll period a small part rolls the ship more, not less: the first ship's clipped
law, loaded to 0.85 times its roll period in waves of 8 s, rolls it 0.66 times the passive roll with
all of its command and 1.25 times with a tenth. With the pressure's cost divided by the square of a
share the gain is the best one for about that share of the pressure, and the roll hardly exceeds the
passive one with any (1.02 times over loads of 0.85 to 1.3 and waves of 6 to 14 s, without limits).
"""

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

import numpy as np
import numpy.typing as npt

from utank_hil.base.arrays import ComplexArray, FloatArray, plausible
from utank_hil.base.ordered_sums import product
from utank_hil.control.arx import discrete_matrices
from utank_hil.control.gain import GainLaw
from utank_hil.dynamics.sampling import LinearModel, state_space_response

if TYPE_CHECKING:
    from control import StateSpace


def design_lqr(
    system: "StateSpace | LinearModel",
    state_weight: npt.ArrayLike,
    input_weight: npt.ArrayLike = 1.0,
    cross_weight: npt.ArrayLike | None = None,
) -> GainLaw:
    """Linear-quadratic regulator of a discrete model whose whole state is measured.

    ValueError is raised if the model is not discrete, or a weight has the wrong shape or is not
    positive. numpy.linalg.LinAlgError is raised if no stabilizing gain exists.

    Parameters
    ----------
    system : control.StateSpace or LinearModel
        Discrete, n states, r inputs.
    state_weight : array_like, shape (n, n) or ()
        Q, symmetric and not negative; a number is a multiple of the unit matrix.
    input_weight : array_like, shape (r, r) or ()
        R, symmetric and positive.
    cross_weight : array_like, shape (n, r), optional
        N.

    Returns
    -------
    GainLaw
        ``gain`` K, shape (r, n); its controller is stepped with the state.
    """
    from scipy.linalg import solve_discrete_are

    a, b, _, _, sample_time_s = discrete_matrices(system)
    states, inputs = b.shape
    q = _weight("state_weight", state_weight, states)
    r = _weight("input_weight", input_weight, inputs)
    if np.linalg.eigvalsh(r).min() <= 0:
        raise ValueError("input_weight must be positive definite")
    n = np.zeros((states, inputs)) if cross_weight is None else np.asarray(cross_weight, float)
    if n.shape != (states, inputs):
        raise ValueError(f"cross_weight must have shape ({states}, {inputs}), got {n.shape}")
    value: FloatArray = solve_discrete_are(a, b, q, r, s=n)
    gain = np.linalg.solve(r + b.T @ value @ b, b.T @ value @ a + n.T)
    return GainLaw(np.asarray(gain, dtype=np.float64), sample_time_s)


def kalman_predictor(
    system: "StateSpace | LinearModel",
    process_covariance: npt.ArrayLike,
    measurement_covariance: npt.ArrayLike,
) -> tuple[FloatArray, FloatArray]:
    """Stationary Kalman predictor of a discrete model with n states and m outputs.

    The errors are those of `design_lqr`.

    The white noises w and v have the covariances `process_covariance`, shape (n, n), and
    `measurement_covariance`, shape (m, m), positive definite. Returns L, shape (n, m), and the
    covariance of the innovation y(k) - C xhat(k) - D u(k), shape (m, m), which is white for the
    true model and covariances.
    """
    from scipy.linalg import solve_discrete_are

    a, _, c, _, _ = discrete_matrices(system)
    process = _weight("process_covariance", process_covariance, len(a))
    measurement = _weight("measurement_covariance", measurement_covariance, len(c))
    error: FloatArray = solve_discrete_are(a.T, c.T, process, measurement)
    innovation = c @ error @ c.T + measurement
    gain = np.linalg.solve(innovation, c @ error @ a.T).T
    return np.asarray(gain, dtype=np.float64), innovation


def design_lqg(
    system: "StateSpace | LinearModel",
    regulator: GainLaw,
    process_covariance: npt.ArrayLike,
    measurement_covariance: npt.ArrayLike,
) -> "LQGLaw":
    """Combine a regulator with a Kalman predictor of the state from the outputs.

    ValueError is raised if model and regulator do not match.

    Parameters
    ----------
    system : control.StateSpace or LinearModel
        Discrete; its outputs are the measurements.
    regulator : GainLaw
        From `design_lqr`, of the same states.
    process_covariance, measurement_covariance : array_like
        As in `kalman_predictor`.
    """
    a, b, c, d, sample_time_s = discrete_matrices(system)
    if regulator.gain.shape != b.T.shape or regulator.sample_time_s != sample_time_s:
        raise ValueError("the regulator was designed for other states or another sample time")
    gain, innovation = kalman_predictor(system, process_covariance, measurement_covariance)
    return LQGLaw(LinearModel(a, b, c, d, sample_time_s), regulator.gain, gain, innovation)


@dataclass(frozen=True, slots=True, eq=False)
class LQGLaw:
    """Regulator and Kalman predictor."""

    model: LinearModel  #: Discrete, from inputs to the measured outputs.
    gain: FloatArray  #: shape (r, n): K.
    observer_gain: FloatArray  #: shape (n, m): L.
    #: shape (m, m): none for a predictor not designed for a known noise.
    innovation_covariance: FloatArray | None = None

    @property
    def sample_time_s(self) -> float:
        """Time between two steps."""
        return self.model.dt

    def controller(self, washout_share: float = 0.0) -> "LQGController":
        """Return a new controller at rest; `washout_share` as in `WashoutLaw.share`."""
        return LQGController(self, washout_share)

    def matrices(self) -> LinearModel:
        """State-space model from y to u; its states are the predicted ones."""
        a, b, c, d, dt = self.model
        closed = a - b @ self.gain - self.observer_gain @ (c - d @ self.gain)
        inputs, outputs = len(self.gain), len(c)
        return LinearModel(closed, self.observer_gain, -self.gain, np.zeros((inputs, outputs)), dt)

    def response(self, z: ComplexArray) -> ComplexArray:
        """Transfer matrix from y to u at the points `z`, shape (N,); shape (N, r, m)."""
        return state_space_response(self.matrices(), z)

    def reference_gain(self) -> FloatArray | None:
        """Feedforward gain on a constant target of the outputs; shape (r, m).

        It is the steady input that brings the outputs nearest to the target (least squares), plus
        the gain times the resulting state. None if the model has a pole at 1, and so no steady
        state of an input.
        """
        a, b, c, d, _ = self.model
        try:
            steady = np.linalg.solve(np.eye(len(a)) - a, b)
        except np.linalg.LinAlgError:
            return None
        feedforward: FloatArray = (np.eye(b.shape[1]) + self.gain @ steady) @ np.linalg.pinv(
            c @ steady + d
        )
        return feedforward


class LQGController:
    """Stepping of an `LQGLaw`.

    Predicted state, mean of the outputs, last input and newest measurement are kept in one vector,
    so that a step is one product: from it to the next state, mean and input.

    `washout_share` is the weight of the newest sample in the mean that is subtracted from the
    outputs (`WashoutLaw`); 0 for no washout.
    """

    def __init__(self, law: LQGLaw, washout_share: float = 0.0) -> None:
        self.sample_time_s = law.sample_time_s
        a, b, c, d, _ = law.model
        (states, inputs), outputs = b.shape, len(c)
        self._own = states + outputs + inputs  # the memory without the measurement
        self._command = slice(states + outputs, self._own)
        state, mean, command, measured = np.split(
            np.eye(self._own + outputs), [states, states + outputs, self._own]
        )
        expected = product(c, state) + product(d, command)
        self._surprise = (1 - washout_share) * (measured - mean) - expected
        next_state = product(a, state) + product(b, command)
        next_state += product(law.observer_gain, self._surprise)
        next_mean = mean + washout_share * (measured - mean)
        self._advance = np.vstack([next_state, next_mean, -product(law.gain, next_state)])
        # computed here, as a step has no time for it; without one, steps without target still work
        self._reference_gain = law.reference_gain()
        self.reset()

    def reset(self) -> None:
        """Set state, mean and input to zero."""
        self._memory = np.zeros(self._advance.shape[1])
        self._stepped = self._memory.copy()

    @property
    def innovation(self) -> FloatArray:
        """Newest measurement less its prediction, shape (m,); white for the true model."""
        return product(self._surprise, self._stepped)

    def step(self, y: FloatArray, reference: FloatArray | None = None) -> FloatArray:
        """Take the newest measurement, shape (m,), and return the command, shape (r,).

        `reference`, shape (m,), is a constant target of the outputs, with a washout relative to
        their mean.

        ValueError is raised if there is a reference without a steady state (`reference_gain`).
        """
        memory, own = self._memory, self._own
        memory[own:] = plausible(y)
        following = product(self._advance, memory)
        command = following[self._command]
        if reference is not None:
            if self._reference_gain is None:
                raise ValueError(
                    "reference: the law's model has a pole at 1 and so no steady state to hold a "
                    "target with; step it without, or give the model's pole some decay"
                )
            command += product(self._reference_gain, reference)
        # the previous vector is kept for the innovation
        self._memory, self._stepped = self._stepped, memory
        self._memory[:own] = following
        return command

    def applied(self, u: FloatArray) -> None:
        """Replace the newest input by the actual command, from which the predictor continues."""
        self._memory[self._command] = u


def _weight(name: str, values: npt.ArrayLike, size: int) -> FloatArray:
    """Symmetric matrix, given as such or as a multiple of the unit matrix."""
    weight = np.asarray(values, dtype=np.float64)
    if weight.ndim == 0:
        weight = weight * np.eye(size)
    if weight.shape != (size, size):
        raise ValueError(f"{name} must have shape ({size}, {size}), got {weight.shape}")
    if not np.allclose(weight, weight.T, rtol=1e-9, atol=1e-12 * np.abs(weight).max()):
        raise ValueError(f"{name} must be symmetric")
    if not math.isfinite(weight.sum()) or np.diag(weight).min() < 0:
        raise ValueError(f"{name} must be finite and not negative")
    return weight


SHARES: Final = (1.0, 0.5, 0.25, 0.12, 0.05)
"""Shares for which there are gains, by factors of about two; between two of them, and from the last
to none, the gain is interpolated."""
_POINTS: Final = (*SHARES, 0.0)


class GentleController(LQGController):
    """Stepping of an `LQGLaw`, with `gains`, (len(SHARES) - 1, n), for the shares below one."""

    def __init__(self, law: LQGLaw, gains: FloatArray) -> None:
        super().__init__(law)
        ahead = self._advance[: law.gain.shape[1]]
        self._rows = -product(np.vstack([law.gain, gains, np.zeros_like(law.gain)]), ahead)

    def use(self, share: float) -> None:
        """Take the gain for a share from 0 to 1."""
        share = min(max(share, 0.0), SHARES[0])
        lower = 1
        while share < _POINTS[lower]:
            lower += 1
        upper = lower - 1
        part = (_POINTS[upper] - share) / (_POINTS[upper] - _POINTS[lower])
        self._advance[-1] = (1.0 - part) * self._rows[upper] + part * self._rows[lower]
