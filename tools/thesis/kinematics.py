"""Transformation between body and earth axes, thesis (2.5 ff.), corrected.

Euler angles (roll, pitch, yaw) in the order of Fossen: earth to body by yaw, then pitch, then roll.
"""

import math

import numpy as np

from utank_hil.base.arrays import FloatArray


def body_to_earth(roll_rad: float, pitch_rad: float, yaw_rad: float) -> FloatArray:
    """Rotation matrix, shape (3, 3): earth components of a vector given in body axes."""
    sf, cf = math.sin(roll_rad), math.cos(roll_rad)
    st, ct = math.sin(pitch_rad), math.cos(pitch_rad)
    sp, cp = math.sin(yaw_rad), math.cos(yaw_rad)
    return np.array(
        [
            [cp * ct, cp * st * sf - sp * cf, sp * sf + cp * cf * st],
            [sp * ct, cp * cf + sp * st * sf, sp * st * cf - cp * sf],
            [-st, ct * sf, ct * cf],
        ]
    )


def euler_rates(roll_rad: float, pitch_rad: float) -> FloatArray:
    """Matrix, shape (3, 3), from body rates (p, q, r) to rates of (roll, pitch, yaw).

    ValueError is raised at a pitch of 90 degrees, where Euler angles are singular.
    """
    sf, cf = math.sin(roll_rad), math.cos(roll_rad)
    ct, tt = math.cos(pitch_rad), math.tan(pitch_rad)
    if abs(ct) < 1e-9:
        raise ValueError(f"Euler angles are singular at a pitch of {pitch_rad} rad")
    return np.array([[1.0, sf * tt, cf * tt], [0.0, cf, -sf], [0.0, sf / ct, cf / ct]])
