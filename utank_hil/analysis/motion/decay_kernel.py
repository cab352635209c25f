"""Roll of a free decay and its derivatives by the parameters, by compiled Runge-Kutta steps."""

import math

import numpy as np

from utank_hil.base.arrays import FloatArray
from utank_hil.dynamics.jit import njit

_STEP_RAD = 0.05
"""Largest step in phase of the roll; the error stays below 1e-6 of the amplitude in 30 swings."""


@njit()
def _slope(x: FloatArray, p: FloatArray, out: FloatArray) -> None:
    w0, zeta, b2, k3 = p[0], p[1], p[2], p[3]
    f, v = x[0], x[1]
    out[0] = v
    out[1] = -2 * zeta * w0 * v - b2 * abs(v) * v - w0 * w0 * (f + k3 * f * f * f)
    by_f = -w0 * w0 * (1 + 3 * k3 * f * f)
    by_v = -2 * zeta * w0 - 2 * b2 * abs(v)
    for n in range(6):
        out[2 + n] = x[8 + n]
        out[8 + n] = by_f * x[2 + n] + by_v * x[8 + n]
    out[8] -= 2 * zeta * v + 2 * w0 * (f + k3 * f * f * f)
    out[9] -= 2 * w0 * v
    out[10] -= abs(v) * v
    out[11] -= w0 * w0 * f * f * f


@njit()
def decay_motion(time: FloatArray, p: FloatArray) -> FloatArray:
    """Return roll and rate, then the derivatives of both, at the samples.

    `p`, shape (6,), is w0, zeta, b2, k3, first roll and rate. The result, shape (n, 14), is roll,
    rate, the derivatives of roll by the six parameters and those of rate; infinite from where the
    roll grows beyond 2 rad.
    """
    out = np.full((len(time), 14), np.inf)
    x, at, k, total = np.zeros(14), np.zeros(14), np.zeros(14), np.zeros(14)
    x[0], x[1], x[6], x[13] = p[4], p[5], 1.0, 1.0
    out[0] = x
    for n in range(1, len(time)):
        gap = time[n] - time[n - 1]
        steps = max(1, math.ceil(gap * p[0] / _STEP_RAD))
        h = gap / steps
        for _ in range(steps):
            _slope(x, p, k)
            for stage in range(4):
                weight = 1.0 if stage in (0, 3) else 2.0
                far = h if stage == 2 else h / 2
                for i in range(14):
                    total[i] = (0.0 if stage == 0 else total[i]) + weight * k[i]
                    at[i] = x[i] + far * k[i]
                if stage < 3:
                    _slope(at, p, k)
            for i in range(14):
                x[i] += h / 6 * total[i]
        if not abs(x[0]) < 2:
            break
        out[n] = x
    return out
