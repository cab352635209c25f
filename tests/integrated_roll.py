"""Roll of a ship without her tank by an adaptive integration, to compare with."""

import numpy as np
from scipy.integrate import solve_ivp


def integrated_roll(ship, moment, time_s, start_s=0.0, start=(0.0, 0.0)):
    """Angle and rate by an adaptive Runge-Kutta method, wave by wave from its cosine."""

    def rates(t, x):
        k = float(moment.amplitude @ np.cos(moment.frequency_rad_s * t + moment.phase_rad))
        k += ship.wind_moment_nm + ship.offset_moment_nm
        acceleration = k - ship.damping_nms_rad * x[1] - ship.stiffness_nm_rad * x[0]
        return [x[1], acceleration / ship.inertia_kg_m2]

    solution = solve_ivp(
        rates, (start_s, time_s[-1]), start, t_eval=time_s, rtol=1e-10, atol=1e-12, method="DOP853"
    )
    return np.asarray(solution.y)
