"""Roll of a free decay, by compiled Runge-Kutta steps."""

import math

import numpy as np

from utank_hil.base.arrays import FloatArray
from utank_hil.dynamics.jit import njit

_STEP_RAD = 0.05
"""Largest step in phase of the roll; the error stays below 1e-6 of the amplitude in 30 swings."""


@njit()
def _acceleration(f: float, v: float, p: FloatArray) -> float:
    w0, zeta, b2, k3 = float(p[0]), float(p[1]), float(p[2]), float(p[3])
    return -2 * zeta * w0 * v - b2 * abs(v) * v - w0 * w0 * (f + k3 * f * f * f)


@njit()
def decay_motion(time: FloatArray, p: FloatArray) -> FloatArray:
    """Return the roll at the samples, shape (n,); infinite from where it grows beyond 2 rad.

    `p`, shape (6,), is w0, zeta, b2, k3, first roll and rate.
    """
    out = np.full(len(time), np.inf)
    f, v = p[4], p[5]
    out[0] = f
    for n in range(1, len(time)):
        gap = time[n] - time[n - 1]
        steps = max(1, math.ceil(gap * p[0] / _STEP_RAD))
        h = gap / steps
        for _ in range(steps):
            a1 = _acceleration(f, v, p)
            v2 = v + h / 2 * a1
            a2 = _acceleration(f + h / 2 * v, v2, p)
            v3 = v + h / 2 * a2
            a3 = _acceleration(f + h / 2 * v2, v3, p)
            v4 = v + h * a3
            a4 = _acceleration(f + h * v3, v4, p)
            f += h / 6 * (v + 2 * (v2 + v3) + v4)
            v += h / 6 * (a1 + 2 * (a2 + a3) + a4)
        if not abs(f) < 2:
            break
        out[n] = f
    return out
