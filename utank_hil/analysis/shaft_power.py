"""Mean power that a pump's shaft draws in irregular waves."""

import math
from typing import Final

import numpy as np

from utank_hil.dynamics.pump import Pump, pump_load, pump_speed

_NODES: Final = 24  # Quadrature nodes for each variable. Chosen; no study.


def mean_shaft_power_w(
    pump: Pump, pressure_rms_pa: float, flow_rms_m3_s: float, water_power_w: float
) -> float:
    """Mean shaft power for Gaussian pressure and flow, with the rotor in equilibrium at each value.

    Power from the water counts as zero, as on the bench. In waves the shaft power is several times
    the mean power `water_power_w` (pressure times flow), because a pump is efficient at its rated
    point, not while pressure or flow changes sign.
    """
    if not (pressure_rms_pa > 0 and flow_rms_m3_s > 0):
        return 0.0
    correlation = min(1.0, max(-1.0, water_power_w / (pressure_rms_pa * flow_rms_m3_s)))
    rest = math.sqrt(1 - correlation**2)
    nodes, weights = np.polynomial.hermite_e.hermegauss(_NODES)
    mean_w = 0.0
    for first, share in zip(nodes.tolist(), weights.tolist(), strict=True):
        if first < 0:
            continue  # the power is symmetric in the sign
        for second, part in zip(nodes.tolist(), weights.tolist(), strict=True):
            pressure_pa = pressure_rms_pa * first
            flow_m3_s = flow_rms_m3_s * (correlation * first + rest * second)
            speed = pump_speed(pressure_pa, flow_m3_s, pump.coefficients)
            torque_nm, _ = pump_load(speed, flow_m3_s, pump.coefficients)
            mean_w += 2 * share * part * max(speed * torque_nm, 0.0)
    return mean_w / math.tau
