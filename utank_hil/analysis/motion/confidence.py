"""Confidence intervals of means: of independent values, and of records by batch means.

The samples of a record are correlated. Means over batches that are long against the correlation
time are hardly correlated, so their Student's t gives the interval of the record's mean (A. M. Law,
Simulation Modeling and Analysis, 5th ed., section 9.5.3).
"""

import math
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from utank_hil.base.arrays import FloatArray


class Interval(NamedTuple):
    """Confidence interval of a mean: mean - half_width ... mean + half_width."""

    mean: float
    half_width: float


def mean_interval(values: npt.ArrayLike) -> Interval:
    """Mean of independent, roughly normal values with its interval of 95 % (Student's t).

    `values`, shape (n,), are two or more, for a paired comparison the differences. Raises
    `ValueError` if there are fewer.
    """
    from scipy.stats import t as student

    numbers = np.asarray(values, dtype=np.float64)
    n = len(numbers)
    if n < 2:
        raise ValueError(f"a confidence interval needs two or more values, got {n}")
    quantile = float(student.ppf(0.975, n - 1))
    return Interval(float(numbers.mean()), quantile * float(numbers.std(ddof=1)) / math.sqrt(n))


def batch_means(values: FloatArray, batches: int) -> FloatArray:
    """Means of equal parts of a record, shape (batches,); a remainder at its end is left out.

    Raises `ValueError` if the record has fewer values than batches.
    """
    length = len(values) // batches
    if length < 1:
        raise ValueError(f"{len(values)} values make no {batches} batches")
    means: FloatArray = values[: batches * length].reshape(batches, length).mean(axis=1)
    return means


def rms_batches(values: FloatArray, batches: int) -> FloatArray:
    """Express the RMS of a record as the mean of one value for each batch, shape (batches,).

    The values are linear about the mean square (the delta method), so the differences of such
    values of two records in the same waves have the interval of the difference of their RMS.
    """
    squares = batch_means(np.square(values), batches)
    rms = math.sqrt(float(squares.mean()))
    return rms + (squares - rms**2) / (2.0 * rms) if rms > 0 else np.zeros(batches)
