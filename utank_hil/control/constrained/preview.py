"""Preview: a forecast of the wave moment by others, as a measurement of the plan's future waves.

The unknowns of a plan are the error of the estimated state and the white noises to come of the sea
model. Both have known covariances, so a forecast z of the wave moment w, with an error that is
correlated as the waves are, updates them as a Kalman filter does::

    theta = T (Sigma + R)^-1 (z - W x),    Sigma = cov(w), T = cov(theta, w), R = d_i d_j rho_{i-j}

An error as large as the waves leaves what the estimate knows. The estimate itself is not changed:
the same forecast, heard again, would count twice. A plan for the noises to come is that of a model
that has them as states, shifted by one each sample.
"""

from typing import Final, NamedTuple

import numpy as np
import numpy.typing as npt

from utank_hil.base.arrays import FloatArray
from utank_hil.base.ordered_sums import positive_solved, product
from utank_hil.control.interface import WaveForecast

MOST_GAP_S: Final = 0.8
"""Longest time between two points that are interpolated: one message of two points is lost."""
_SPACING_S: Final = 0.2  # Least time between used points; nearer ones cost time and tell nothing.
_LEAST_SHARE: Final = 0.1
"""Least deviation over that of the waves: no model of ship and sea is better than that."""
_JUDGED: Final = 3  # Number of used points, the first ones, of which the estimate knows enough.
_MEMORY_S: Final = 10.0  # Time constant of the mean that judges a forecast: a roll period or so.
DOUBTED: Final = (1.5, 2.5)
"""Doubt below which a forecast is used again, and above which it is not. Right ones stayed below
2.1 in the storm, with the sign reversed it passed 2.5 within 10 s."""
_MOST_DOUBT: Final = 10.0  # Of one plan, which then knows no forecast; so doubt ends in 20 s.
_MOST_RAD: Final = 1.0  # No sea is as steep.


class Waves(NamedTuple):
    """The waves in a law's own model of n states."""

    row: FloatArray  #: shape (n,): from the state to the wave moment over the roll stiffness.
    noise: FloatArray  #: shape (n,): what unit white noise adds to the next state.
    process_covariance: FloatArray  #: shape (n, n)
    variance: FloatArray  #: shape (m,): of the measurements' noise.


class Foresight(NamedTuple):
    """What a forecast of the waves tells a plan of N samples; see `preview`."""

    by_state: FloatArray  #: shape (N, n): W.
    moment_covariance: FloatArray  #: shape (N, N): Sigma.
    learnt: FloatArray  #: shape (n + N, N): T.
    covariance: FloatArray  #: shape (N,): of moments so many samples apart, nothing known.
    least: int = 1  #: Samples that a forecast must reach; a shorter one is left out.

    @property
    def reach(self) -> tuple[int, int]:
        """Samples that a forecast must reach, and that are used of it."""
        return self.least, len(self.covariance)

    def weights(self, at: npt.NDArray[np.int64], error: FloatArray | float) -> FloatArray:
        """Return the covariance of the moments at samples, known to an error's covariance."""
        least = _LEAST_SHARE * _LEAST_SHARE * self.covariance[0]
        known: FloatArray = self.moment_covariance[at[:, None], at]
        whole: FloatArray = known + error + least * np.eye(len(at))
        return whole


class Preview:
    """The forecast that the next plan of a controller knows.

    `doubt` is the mean square of the forecasts' differences from the estimate, over the expected
    one; they are ignored, `doubted`, while they do not agree with the motion.
    """

    def __init__(self, foresight: Foresight, sample_time_s: float) -> None:
        self._foresight, covariance = foresight, foresight.covariance
        samples = len(covariance)
        apart = np.abs(np.arange(samples)[:, None] - np.arange(samples))
        self._correlation = (covariance / covariance[0])[apart]
        self._time_s = sample_time_s * np.arange(1, samples + 1)
        self._every = max(1, round(_SPACING_S / sample_time_s))
        self._share = sample_time_s / _MEMORY_S
        self.reset()

    def reset(self) -> None:
        """Forget what was forecast."""
        self._forecast: WaveForecast | None = None
        self.doubt, self.doubted = 1.0, False

    def take(self, forecast: WaveForecast | None) -> None:
        """Take the forecast for the next plan; None if there is none."""
        self._forecast = forecast

    def expected(self, state: FloatArray) -> FloatArray:
        """Return state and noises to come, shape (n + N,), as the forecast has them."""
        unknown = np.zeros(len(self._foresight.learnt))
        forecast, self._forecast = self._forecast, None
        if forecast is not None:
            at, moment, deviation = self._on_samples(forecast)
            if len(at) and at[-1] >= self._foresight.least - 1:
                self._weigh(unknown, state, at, moment, deviation)
        unknown[: len(state)] += state
        return unknown

    def _weigh(
        self,
        unknown: FloatArray,
        state: FloatArray,
        at: npt.NDArray[np.int64],
        moment: FloatArray,
        deviation: FloatArray,
    ) -> None:
        apart = moment - product(self._foresight.by_state[at], state)
        error = deviation[:, None] * deviation * self._correlation[at[:, None], at]
        spread = self._foresight.weights(at, error)
        expected = np.diagonal(spread)[:_JUDGED]
        ratio = float(np.mean(apart[:_JUDGED] * apart[:_JUDGED] / expected))
        self.doubt += self._share * (min(ratio, _MOST_DOUBT) - self.doubt)
        self.doubted = self.doubt > DOUBTED[not self.doubted]
        if ratio < _MOST_DOUBT and not self.doubted:
            unknown += product(self._foresight.learnt[:, at], positive_solved(spread, apart))

    def _on_samples(
        self, forecast: WaveForecast
    ) -> tuple[npt.NDArray[np.int64], FloatArray, FloatArray]:
        """Samples of the plan between two points, with moment and deviation there."""
        there = np.abs(forecast.moment_rad) <= _MOST_RAD  # False for NaN
        there &= (forecast.deviation_rad >= 0) & (forecast.deviation_rad <= _MOST_RAD)
        time_s, moment, deviation = (part[there] for part in forecast)
        at = np.arange(0, len(self._time_s), self._every)
        after = np.searchsorted(time_s, self._time_s[at], side="right")
        inside = (after > 0) & (after < len(time_s))
        at, after = at[inside], after[inside]
        span_s = time_s[after] - time_s[after - 1]
        near = span_s <= MOST_GAP_S
        at, after, span_s = at[near], after[near], span_s[near]
        share = (self._time_s[at] - time_s[after - 1]) / span_s
        return (
            at,
            moment[after - 1] + share * (moment[after] - moment[after - 1]),
            deviation[after - 1] + share * (deviation[after] - deviation[after - 1]),
        )
