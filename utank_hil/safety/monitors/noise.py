"""Noise of a signal, the power of what can't be its motion; its filtered derivatives."""

import math
from typing import Final

import numpy as np

from utank_hil.dynamics.sampling import transition_and_step

NOISE_S: Final = 0.7
MOST: Final = 2.0
"""A residual counts as so many limits at most: one jump is no noise."""
NOISE_DEVIATIONS: Final = 5.4
"""One sample of 30 million, of which 1000 h have 36, is further out."""
LIKE_ROLL: Final = 1.2
"""Deviation of what looks like a roll's push, over that of a sample: 0.9 where the roll is now in
the middle, 1.2 where it is greatest, for any tank (motions of 0.7 to 1.3 w0)."""


def within(value: float, most: float) -> float:
    """The value, cut to +-most; a fifth of the time of `min` and `max`."""
    return -most if value < -most else most if value > most else value


class Noise:
    """Power of a residual, averaged over 0.7 s, against a limit on its standard deviation."""

    def __init__(self, limit: float) -> None:
        self._limit_power = limit * limit
        self._most = MOST * limit
        self.power = 0.0  #: Averaged square of the residual.
        self.found = False

    def update(self, residual: float, elapsed_s: float) -> bool:
        """Take a residual; return whether there is too much noise."""
        residual = within(residual, self._most)
        self.power += (residual * residual - self.power) * min(elapsed_s / NOISE_S, 1.0)
        self.found = self.power > self._limit_power
        return self.found


class SecondDifference:
    """What three samples in a row leave of a smooth signal; white noise s leaves sqrt(6) s."""

    def __init__(self) -> None:
        self.restart()

    def restart(self) -> None:
        """Begin anew after a gap."""
        self._last = self._before = self._step_s = math.nan

    def update(self, value: float) -> float:
        """Take the next sample; return the second difference, zero as long as there is none."""
        difference = value - 2 * self._last + self._before
        self._before, self._last = self._last, value
        return difference if difference == difference else 0.0

    def update_after(self, value: float, step_s: float) -> float:
        """The same of samples that are not equally far apart: `step_s` since the last one.

        What is left of the line through the last two; scaled so that white noise leaves as much.
        """
        ratio = step_s / self._step_s
        bend = value - self._last - ratio * (self._last - self._before)
        self._before, self._last, self._step_s = self._last, value, step_s
        if bend != bend:
            return 0.0
        return bend * math.sqrt(6.0 / (1.0 + (1.0 + ratio) * (1.0 + ratio) + ratio * ratio))


class DerivativeFilter:
    """1 / ((s / w)^2 + 2 z s / w + 1) with its first two derivatives, for inputs that run straight.

    `frequency_rad_s` is w, `period_s` the time between two inputs, `ratio` the damping ratio z.
    `value` and `rate` are the output and its first derivative, `last` is the last input.
    """

    __slots__ = (
        "_a11", "_a12", "_a21", "_a22", "_b1", "_b2", "_c1", "_c2", "_twice", "_w", "last",
        "rate", "value",
    )  # fmt: skip

    def __init__(self, frequency_rad_s: float, period_s: float, ratio: float = 1.0) -> None:
        w, twice = frequency_rad_s, 2 * ratio
        # states: value, rate, input; the input's slope is constant over a period
        states = np.array([[0.0, 1.0, 0.0], [-w * w, -twice * w, w * w], [0.0, 0.0, 0.0]])
        transition, ramp = transition_and_step(states, np.array([[0.0], [0.0], [1.0]]), period_s)
        (self._a11, self._a12, _), (self._a21, self._a22, _) = transition[:2].tolist()
        self._b1, self._b2 = (ramp[:2, 0] / period_s).tolist()
        self._c1, self._c2 = (transition[:2, 2] - ramp[:2, 0] / period_s).tolist()
        self._w, self._twice = w, twice
        self.start(0.0)

    def start(self, value: float) -> None:
        """Begin anew with a constant input."""
        self.last = self.value = value
        self.rate = 0.0

    def update(self, value: float) -> float:
        """Take the next value; return the second derivative."""
        last, old, rate, w = self.last, self.value, self.rate, self._w
        self.last = value
        self.value = new = self._a11 * old + self._a12 * rate + self._b1 * value + self._c1 * last
        self.rate = rate = self._a21 * old + self._a22 * rate + self._b2 * value + self._c2 * last
        bend: float = w * (w * (value - new) - self._twice * rate)
        return bend


def most_pushes_of_noise(of_sample: float, samples: float) -> tuple[float, float]:
    """What gauges' noise looks like to the tank's equation, root mean square, at most in 1000 h.

    `of_sample` is the push that would hold the level off by the noise of one sample, `samples` is
    the memory. First the part that looks like a roll's push, which the memory averages. Then all of
    it: the derivatives, filtered at 2 w0, make it up to (2 w0 / w0)^2 times as large, and a mean
    square has two degrees of freedom a sample (Wilson and Hilferty's quantile).
    """
    like_roll = LIKE_ROLL * of_sample / math.sqrt(samples)
    spread = 2 / (9 * 2 * samples)
    root = 1 - spread + NOISE_DEVIATIONS * math.sqrt(spread)
    return NOISE_DEVIATIONS * like_roll, 4 * of_sample * root * math.sqrt(root)
