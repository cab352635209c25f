"""A low-pass filter that gives derivatives without differentiating."""

import numpy as np

from utank_hil.dynamics.sampling import transition_and_step


class DerivativeFilter:
    """1 / (s / w + 1)^2 with its first and second derivative, for inputs that run straight.

    `frequency_rad_s` is w, `period_s` the time between two inputs. `value` and `rate` are the
    output and its first derivative, `last` is the last input.
    """

    __slots__ = (
        "_a11", "_a12", "_a21", "_a22", "_b1", "_b2", "_c1", "_c2", "_w", "last", "rate", "value",
    )  # fmt: skip

    def __init__(self, frequency_rad_s: float, period_s: float) -> None:
        w = frequency_rad_s
        # states: value, rate, input; the input's slope is constant over a period
        states = np.array([[0.0, 1.0, 0.0], [-w * w, -2 * w, w * w], [0.0, 0.0, 0.0]])
        transition, ramp = transition_and_step(states, np.array([[0.0], [0.0], [1.0]]), period_s)
        (self._a11, self._a12, _), (self._a21, self._a22, _) = transition[:2].tolist()
        self._b1, self._b2 = (ramp[:2, 0] / period_s).tolist()
        self._c1, self._c2 = (transition[:2, 2] - ramp[:2, 0] / period_s).tolist()
        self._w = w
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
        bend: float = w * (w * (value - new) - 2 * rate)
        return bend
