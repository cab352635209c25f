"""How little a ship could roll: the best pressure history for a whole record known in advance.

One large sparse quadratic programme over all samples, x = (roll, roll rate, level, level rate, pump
pressure), commands held over a sample, waves as the motion w(k) that they cause with the tank
passive::

    minimize    mean square of the roll in w(k) + x(k)
    subject to  x(k+1) = A x(k) + B u(k),    x(0) = 0
                |u| <= P_max,    |u(k+1) - u(k)| <= rate Ts,    |level in w(k) + x(k)| <= h_max
                P h' <= W / At

The last one, on the power, is not convex. For water no faster than v it is replaced by its convex
hull (McCormick)::

    |v P + P_max h'| <= W / At + P_max v,    |h'| <= v

So what comes out is a bound: no controller that commands at these samples does better, and with a
power limit perhaps none can do as well.
"""

import math
from dataclasses import dataclass

import numpy as np

from utank_hil.arrays import FloatArray
from utank_hil.control.design_plant import DesignPlant
from utank_hil.dynamics.linear import STATES
from utank_hil.dynamics.sampling import transition_and_step

_ROLL, _LEVEL, _SPEED = (STATES.index(s) for s in ("roll_rad", "level_m", "level_rate_m_s"))
_STATES = len(STATES) + 1  # and the pressure


@dataclass(frozen=True, slots=True, eq=False)
class ClairvoyantRun:
    """The best history.

    Attributes
    ----------
    roll_rms_rad : float
    motion : ndarray, shape (N, 4)
        `STATES` at the end of each sample.
    pressure_pa : ndarray, shape (N,)
        Actual pressure then, behind the drive's lag.
    command_pa : ndarray, shape (N,)
        Held over each sample.
    """

    roll_rms_rad: float
    motion: FloatArray
    pressure_pa: FloatArray
    command_pa: FloatArray


def clairvoyant_bound(
    plant: DesignPlant,
    wave_motion: FloatArray,
    *,
    sample_time_s: float = 0.2,
    fastest_water_m_s: float = 4.0,
) -> ClairvoyantRun:
    """Least roll of the linear ship within the plant's limits, the waves known in advance.

    Parameters
    ----------
    plant : DesignPlant
        Its delay makes no difference where the whole record is known.
    wave_motion : ndarray, shape (N + 1, 4)
        `STATES` with the tank passive (`passive_motion`), at 0, Ts, ... N Ts.
    sample_time_s : float
    fastest_water_m_s : float
        v; counts with a finite power limit only.

    Raises
    ------
    ValueError
        If nothing keeps within the limits, or the solver fails.
    """
    import clarabel
    from scipy import sparse

    limits = plant.limits
    waves = wave_motion[1:]
    count = len(waves)
    unit = limits.pressure_pa  # pressures in this unit, roll in degrees: all numbers near one
    scale = np.ones(_STATES)
    scale[-1] = unit
    a, b = _plant_with_lag(plant, sample_time_s)
    a, b = a * scale / scale[:, None], b * unit / scale[:, None]

    # unknowns: x(1) ... x(N), then u(0) ... u(N-1)
    each, back = sparse.eye(count), sparse.eye(count, k=-1)
    dynamics = sparse.hstack(
        [sparse.eye(count * _STATES) - sparse.kron(back, a), -sparse.kron(each, b)]
    )

    def of_state(row: FloatArray) -> sparse.csc_matrix:
        return sparse.hstack([sparse.kron(each, row[None]), sparse.csc_matrix((count, count))])

    unit_rows = np.eye(_STATES)
    command = sparse.hstack([sparse.csc_matrix((count, count * _STATES)), each])
    step = sparse.hstack([sparse.csc_matrix((count, count * _STATES)), each - back])
    bounded = [  # (rows, offset, bound): |rows x + offset| <= bound
        (command, np.zeros(count), 1.0),
        (step, np.zeros(count), limits.rate_pa_s * sample_time_s / unit),
        (of_state(unit_rows[_LEVEL]), waves[:, _LEVEL], limits.level_m),
    ]
    if math.isfinite(limits.power_w):
        v, flow = fastest_water_m_s, limits.power_w / (plant.tank.reservoir_area_m2 * unit)
        cut = of_state(v * unit_rows[-1] + unit_rows[_SPEED])
        bounded += [
            (cut, waves[:, _SPEED], flow + v),
            (of_state(unit_rows[_SPEED]), waves[:, _SPEED], v),
        ]
    rows = sparse.vstack([dynamics] + [sign * r for r, _, _ in bounded for sign in (1, -1)])
    right = [np.zeros(count * _STATES)]
    right += [bound - sign * offset for _, offset, bound in bounded for sign in (1, -1)]

    degrees = np.rad2deg(1.0)
    roll = of_state(degrees * unit_rows[_ROLL])
    settings = clarabel.DefaultSettings()
    settings.verbose = False
    limits_count = rows.shape[0] - count * _STATES
    solution = clarabel.DefaultSolver(
        sparse.triu(2 / count * roll.T @ roll).tocsc(),
        2 / count * degrees * (roll.T @ waves[:, _ROLL]),
        rows.tocsc(),
        np.concatenate(right),
        [clarabel.ZeroConeT(count * _STATES), clarabel.NonnegativeConeT(limits_count)],
        settings,
    ).solve()
    if solution.status != clarabel.SolverStatus.Solved:
        raise ValueError(
            f"no pressure history keeps within the limits ({solution.status}): the waves alone may "
            f"lift the water beyond level_m = {limits.level_m}"
        )
    x = np.array(solution.x)
    states = x[: count * _STATES].reshape(count, _STATES) * scale
    motion = waves + states[:, : len(STATES)]
    return ClairvoyantRun(
        roll_rms_rad=float(np.sqrt(np.mean(np.square(motion[:, _ROLL])))),
        motion=motion,
        pressure_pa=states[:, -1],
        command_pa=x[count * _STATES :] * unit,
    )


def _plant_with_lag(plant: DesignPlant, sample_time_s: float) -> tuple[FloatArray, FloatArray]:
    """State after a sample from that before it, and from the command held over it."""
    pump = plant.model(STATES)
    n = len(STATES)
    a = np.block([[pump.A, pump.B], [np.zeros((1, n)), np.full((1, 1), -1 / plant.lag_s)]])
    return transition_and_step(a, np.append(np.zeros(n), 1 / plant.lag_s)[:, None], sample_time_s)
