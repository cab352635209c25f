"""Mean of a few independent values with its confidence interval."""

import math
from typing import NamedTuple

import numpy as np
import numpy.typing as npt


class Interval(NamedTuple):
    """Confidence interval of a mean: mean - half_width ... mean + half_width.

    Attributes
    ----------
    mean, half_width : float
    """

    mean: float
    half_width: float


def mean_interval(values: npt.ArrayLike, confidence: float = 0.95) -> Interval:
    """Mean of independent, roughly normal values with its confidence interval (Student's t).

    Parameters
    ----------
    values : array_like, shape (n,)
        Two or more values; for a paired comparison the differences.
    confidence : float
        Probability that the interval holds the true mean.

    Raises
    ------
    ValueError
        If there are fewer than two values, or the confidence is not between 0 and 1.
    """
    from scipy.stats import t as student

    numbers = np.asarray(values, dtype=np.float64)
    n = len(numbers)
    if n < 2:
        raise ValueError(f"a confidence interval needs two or more values, got {n}")
    if not 0 < confidence < 1:
        raise ValueError(f"confidence must be between 0 and 1, got {confidence}")
    quantile = float(student.ppf((1 + confidence) / 2, n - 1))
    return Interval(float(numbers.mean()), quantile * float(numbers.std(ddof=1)) / math.sqrt(n))
