"""Mean power that a pump's shaft draws in irregular waves."""

import math
from typing import Final

import numpy as np

from utank_hil.dynamics.pump import Pump, pump_load, pump_speed

_NODES: Final = 24


def mean_shaft_power_w(
    pump: Pump, pressure_rms_pa: float, flow_rms_m3_s: float, water_power_w: float
) -> float:
    """Mean power drawn for a Gaussian pressure and flow, the rotor at rest in each of their values.

    What flows back counts as nothing, as on the bench. In waves it is several times the power given
    to the water: a pump is efficient at its rated pressure and flow, not while either changes sign.

    Parameters
    ----------
    water_power_w : float
        Mean of pressure times flow.
    """
    if not (pressure_rms_pa > 0 and flow_rms_m3_s > 0):
        return 0.0
    correlation = min(1.0, max(-1.0, water_power_w / (pressure_rms_pa * flow_rms_m3_s)))
    rest = math.sqrt(1 - correlation**2)
    nodes, weights = np.polynomial.hermite_e.hermegauss(_NODES)
    mean_w = 0.0
    for first, share in zip(nodes.tolist(), weights.tolist(), strict=True):
        if first < 0:
            continue  # as much power to one side as to the other
        for second, part in zip(nodes.tolist(), weights.tolist(), strict=True):
            pressure_pa = pressure_rms_pa * first
            flow_m3_s = flow_rms_m3_s * (correlation * first + rest * second)
            speed = pump_speed(pressure_pa, flow_m3_s, pump.coefficients)
            torque_nm, _ = pump_load(speed, flow_m3_s, pump.coefficients)
            mean_w += 2 * share * part * max(speed * torque_nm, 0.0)
    return mean_w / math.tau
