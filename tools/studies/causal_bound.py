"""How little a ship could roll under any law that does not know the future.

The sea is that of a `SeaModel`: white noise through its filter. All that a law can know of the
present is then the estimate xh of a Kalman predictor, driven by its innovations nu of covariance
S::

    xh(k+1) = A xh(k) + B v(k) + L nu(k),    roll(k) = c xh(k) + d v(k) + e(k)

e, the filter's error, has a constant variance that no law changes. For a law that does not know the
future any quadratic value V(x) = x'P x has increments of zero mean::

    M(k) = V(xh(k+1)) - E V(xh(k+1)) = 2 (P L nu)'(A xh + B v) + nu'L'P L nu - tr(L'P L S)

so the programme of the clairvoyant bound with the mean of M(k) subtracted from its objective stays,
on average, below what any causal law reaches (information relaxation). M is linear in state and
command, so only linear terms join the programme. Every P gives a valid bound; a tight one is the
solution of a Riccati equation whose weights stand for the limits. In a linear problem without
limits, with that P at the end, each record gives the optimal cost exactly.

The bound holds for the sea of the model, floor and order included, and for the sensors' noise.

References
----------
D. B. Brown, J. E. Smith, P. Sun, Information relaxations and duality in stochastic dynamic
programs, Operations Research 58 (2010) 785-801.
M. B. Haugh, A. E. B. Lim, Linear-quadratic control and information relaxations, Operations Research
Letters 40 (2012) 521-528.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from tools.studies.clairvoyant import best_history, clairvoyant_bound, pump_with_lag
from utank_hil.analysis.loop.loop_simulation import SensorNoise
from utank_hil.analysis.motion.statistics import Interval, mean_interval
from utank_hil.base.arrays import FloatArray
from utank_hil.control.constrained.design import sea_plant
from utank_hil.control.interface import DesignPlant
from utank_hil.control.lqg import kalman_predictor
from utank_hil.control.sea_model import SeaModel
from utank_hil.dynamics.linear import STATES
from utank_hil.dynamics.sampling import LinearModel

_MEASURED: Final = ("roll_rad", "roll_rate_rad_s", "level_m")
_LIMIT_SHARE: Final = 0.2
"""Level or pressure at its limit is valued as this share of the passive roll's mean square."""
_SETTLING_S: Final = 400.0


@dataclass(frozen=True, slots=True, eq=False)
class Innovations:
    """A sampled plant as a law can know it."""

    #: From the command to `STATES`; first the states of `pump_with_lag`, then the sea's.
    model: LinearModel
    gain: FloatArray  #: shape (n, m): L.
    covariance: FloatArray  #: shape (m, m): S.
    roll_error_rad2: float  #: Variance of e.

    def increments(
        self, value: FloatArray, nu: FloatArray, passive: FloatArray, states: int
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        """M(k) as c(k)'x(k) + d(k) v(k) + rest(k), x the part that the pump makes.

        Parameters
        ----------
        value : ndarray, shape (n, n)
            P.
        nu : ndarray, shape (N, m)
        passive : ndarray, shape (N, n)
            xh without the pump.
        states : int
            Of the pump's part of the model.

        Returns
        -------
        state_slope : ndarray, shape (N, states)
        command_slope, rest : ndarray, shape (N,)
        """
        a, b = self.model.A, self.model.B[:, 0]
        jump = nu @ self.gain.T
        slope = 2 * jump @ value
        mean = float(np.trace(self.gain.T @ value @ self.gain @ self.covariance))
        by_jump = np.einsum("ki,ij,kj->k", jump, value, jump) - mean
        rest = np.einsum("ki,ki->k", slope, passive @ a.T) + by_jump
        return slope @ a[:, :states], slope @ b, rest


@dataclass(frozen=True, slots=True)
class CausalRun:
    """Mean squares of the roll in one record, in rad^2."""

    #: passive, clairvoyant: with the passive tank, and with the waves known in advance.
    passive: float
    clairvoyant: float
    causal: float  #: Its mean over many records is below that of any law.


@dataclass(frozen=True, slots=True)
class CausalBound:
    """The bounds over several records."""

    #: passive_rad, clairvoyant_rad, causal_rad: roll RMS, the first one exact. The second one is
    #: the share of it that the records have.
    passive_rad: float
    clairvoyant_rad: float
    causal_rad: float
    share: Interval  #: Part of the way from passive to clairvoyant that no causal law exceeds.


class CausalProblem:
    """A ship in a sea, and what its sensors tell.

    The plant has the limits that the bounds keep, and a delay below the sample time; the noise is
    white, once a sample. `passive_rad` is the roll RMS of the ship with the passive tank.
    """

    def __init__(
        self,
        plant: DesignPlant,
        sea: SeaModel,
        noise: SensorNoise = SensorNoise(),  # noqa: B008 - frozen
        sample_time_s: float = 0.2,
    ) -> None:
        self._plant = plant
        self._pump = pump_with_lag(plant, sample_time_s, plant.delay_s)
        self._std = np.array([noise.roll_rad, noise.roll_rate_rad_s, noise.level_m])
        model, process, *_ = sea_plant(sea, plant, sample_time_s=sample_time_s)
        n = len(model.A) - 1  # without the heel
        model = model._replace(A=model.A[:n, :n], B=model.B[:n], C=model.C[:, :n])
        self._process = process[:n, :n]
        self._rows = [STATES.index(name) for name in _MEASURED]
        seen = model._replace(C=model.C[self._rows], D=model.D[self._rows])
        gain, covariance = kalman_predictor(seen, self._process, np.diag(self._std**2))
        roll = STATES.index("roll_rad")
        error = covariance[roll, roll] - self._std[roll] ** 2
        self.innovations = Innovations(model, gain, covariance, float(error))
        self.passive_rad = self._passive()
        self._value = self._limits_value()

    def run(self, seed: int, duration_s: float = 600.0) -> CausalRun:
        """The bounds in one record.

        Raises `ValueError` if nothing keeps within the limits, or the solver fails.
        """
        found, plant = self.innovations, self._plant
        settle, count = (round(t / found.model.dt) for t in (_SETTLING_S, duration_s))
        truth, known, nu = self._record(np.random.default_rng(seed), settle + count)
        truth, known, nu = truth[settle:], known[settle:], nu[settle:]
        waves, foreseen = truth @ found.model.C.T, known @ found.model.C.T
        best = clairvoyant_bound(
            plant, np.vstack([np.zeros(len(STATES)), waves]), sample_time_s=found.model.dt
        )
        states, command, rest = found.increments(self._value, nu, known, len(self._pump.A))
        relaxed = best_history(plant, self._pump, foreseen, -states, -command)
        causal = relaxed.roll_rms_rad**2 + relaxed.linear_cost - float(rest.mean())
        roll = STATES.index("roll_rad")
        return CausalRun(
            float(np.mean(waves[:, roll] ** 2)),
            best.roll_rms_rad**2,
            causal + found.roll_error_rad2,
        )

    def _record(
        self, rng: np.random.Generator, count: int
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        """States as they are and as they are known, the tank passive, and the innovations."""
        a, c = self.innovations.model.A, self.innovations.model.C[self._rows]
        values, vectors = np.linalg.eigh(self._process)
        root = vectors * np.sqrt(np.maximum(values, 0.0))
        pushes = rng.standard_normal((count, len(a))) @ root.T
        errors = rng.standard_normal((count, len(c))) * self._std
        truth, known, nu = (np.zeros((count, size)) for size in (len(a), len(a), len(c)))
        for k in range(count):
            nu[k] = c @ (truth[k] - known[k]) + errors[k]
            if k + 1 < count:
                truth[k + 1] = a @ truth[k] + pushes[k]
                known[k + 1] = a @ known[k] + self.innovations.gain @ nu[k]
        return truth, known, nu

    def _passive(self) -> float:
        from scipy.linalg import solve_discrete_lyapunov

        model = self.innovations.model
        roll = model.C[STATES.index("roll_rad")]
        spread = solve_discrete_lyapunov(model.A, self._process)
        return math.sqrt(float(roll @ spread @ roll))

    def _limits_value(self) -> FloatArray:
        """P of the problem whose weights stand for the limits."""
        from scipy.linalg import solve_discrete_are

        model, limits = self.innovations.model, self._plant.limits
        share = _LIMIT_SHARE * self.passive_rad**2
        weight = np.diag([1.0, 0.0, share / limits.level_m**2, 0.0])
        value: FloatArray = solve_discrete_are(
            model.A,
            model.B,
            model.C.T @ weight @ model.C,
            share / limits.pressure_pa**2 + model.D.T @ weight @ model.D,
            s=model.C.T @ weight @ model.D,
        )
        return value


def causal_bound(problem: CausalProblem, runs: Sequence[CausalRun]) -> CausalBound:
    """The bounds over two or more records, the share with the 95 % interval of a jackknife."""
    squares = np.array([[run.passive, run.clairvoyant, run.causal] for run in runs])
    count, total = len(squares), squares.sum(axis=0)
    passive = problem.passive_rad

    def bounds(mean: FloatArray) -> tuple[FloatArray, FloatArray]:
        waves, best, causal = np.moveaxis(mean, -1, 0)
        # a record with higher waves has a higher clairvoyant bound; the causal one has paid for it
        clairvoyant = passive * np.sqrt(best / waves)
        # the clairvoyant one bounds causal laws, too: a loose value may fall below it
        return clairvoyant, np.sqrt(np.maximum(causal, clairvoyant**2))

    def share(best: FloatArray, causal: FloatArray) -> FloatArray:
        return (passive - causal) / (passive - best)

    best, causal = bounds(total / count)
    left_out = share(*bounds((total - squares) / (count - 1)))
    interval = mean_interval(count * share(best, causal) - (count - 1) * left_out)
    return CausalBound(passive, float(best), float(causal), interval)
