"""What the best unbiased estimator of the ship's modes could do."""

import numpy as np
from roll_plant import SAMPLE_TIME_S
from scipy.signal import lfilter, ss2tf

from utank_hil.base.arrays import FloatArray


def cramer_rao(truth, u, noise):
    """Least standard deviations of frequencies and damping ratios, any unbiased estimator.

    For a common denominator of order 4 and two free numerators, white noise on each output.
    """
    numerators, denominator = ss2tf(truth.a, truth.b[:, :1], truth.c, np.zeros((2, 1)))
    delays = np.eye(5)
    information = np.zeros((14, 14))
    inputs = np.array([lfilter(delays[i], denominator, u) for i in range(5)])
    for j in range(2):
        y = lfilter(numerators[j], denominator, u)
        slopes = np.zeros((14, len(u)))
        slopes[:4] = [-lfilter(delays[i], denominator, y) for i in range(1, 5)]
        slopes[4 + 5 * j : 9 + 5 * j] = inputs
        information += slopes @ slopes.T / noise[j] ** 2
    size = np.sqrt(np.diag(information))
    covariance = np.linalg.inv(information / np.outer(size, size)) / np.outer(size, size)

    def values(coefficients):
        s = np.log(np.roots(np.concatenate([[1.0], coefficients]))) / SAMPLE_TIME_S
        s = s[s.imag > 0]
        s = s[np.argsort(np.abs(s))]
        return np.concatenate([np.abs(s), -s.real / np.abs(s)])

    step = 1e-7
    jacobian = np.column_stack(
        [
            (values(denominator[1:] + step * e) - values(denominator[1:] - step * e)) / (2 * step)
            for e in np.eye(4)
        ]
    )
    bound: FloatArray = np.sqrt(np.diag(jacobian @ covariance[:4, :4] @ jacobian.T))
    return bound
