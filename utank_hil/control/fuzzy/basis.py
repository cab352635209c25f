"""Fuzzy basis functions of Takagi-Sugeno rules, thesis (4.15) and (4.26).

Each input x_i has three linguistic values, negative, zero and positive, with Gaussian memberships
exp(-((x_i - c) / sigma)^2 / 2) about the centres -c_i, 0, c_i; the outer two stay 1 beyond their
centres. (4.26) misprints the square, and centres that are all at or below zero. A rule's weight is
the product of its memberships over the sum of all rules' products. The sum factors::

    xi_{jk...}(x) = nu_1j(x_1) nu_2k(x_2) ...,    nu_ij = mu_ij / sum_j mu_ij

so the basis takes three exponentials per input and sums to one by construction, and
xi xi' = prod_i sum_j nu_ij^2 needs no rules.
"""

import math

import numpy as np

from utank_hil.base.arrays import FloatArray
from utank_hil.base.elementary import exp, log

SETS = 3
# Neighbouring sets cross at a membership of one half; the thesis gives no width.
WIDTH = 1 / math.sqrt(8 * log(2))


class FuzzyBasis:
    """Basis of 3^n rules.

    Each of `ranges` is c_i of an input, in its unit: the value from which "positive" holds fully.
    """

    def __init__(self, ranges: tuple[float, ...]) -> None:
        if not ranges or not all(math.isfinite(c) and c > 0 for c in ranges):
            raise ValueError(f"fuzzy ranges must be positive and finite, got {ranges}")
        self.ranges = np.array(ranges, dtype=np.float64)
        self.rules = SETS ** len(ranges)  #: 3^n; 81 for four inputs.
        self._scales = [1 / c for c in ranges]

    def memberships(self, x: FloatArray) -> list[tuple[float, float, float]]:
        """Normalised memberships nu of each input (negative, zero, positive), summing to one."""
        # Plain arithmetic on a dozen numbers is several times faster than arrays.
        return [
            _degrees(value * scale) for value, scale in zip(x.tolist(), self._scales, strict=True)
        ]

    def __call__(self, x: FloatArray) -> FloatArray:
        """Basis xi, shape (3^n,), of inputs of shape (n,); the last input's set changes fastest."""
        xi: FloatArray = np.ones(1)
        for row in self.memberships(x):
            xi = np.multiply.outer(xi, row).ravel()
        return xi

    def square(self, x: FloatArray) -> float:
        """Squared length xi xi' of the basis: near 1 at a lone rule, less between rules."""
        square = 1.0
        for negative, zero, positive in self.memberships(x):
            square *= negative * negative + zero * zero + positive * positive
        return square


def _degrees(x: float) -> tuple[float, float, float]:
    """Normalised memberships of an input that is given in units of its range."""
    negative = 1.0 if x <= -1 else _gauss(x + 1)
    zero = _gauss(x)
    positive = 1.0 if x >= 1 else _gauss(x - 1)
    total = negative + zero + positive
    return negative / total, zero / total, positive / total


def _gauss(distance: float) -> float:
    return exp(-(distance * distance) / (2 * WIDTH * WIDTH))
