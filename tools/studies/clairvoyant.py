"""How little a ship could roll: the best pressure history for a whole record known in advance.

One large sparse quadratic programme over all samples (`best_history`), waves as the motion w(k)
that they cause with the tank passive::

    minimize    mean of squares of the roll in w(k) + y(k), and of c(k)'x(k) + d(k) v(k)
    subject to  x(k+1) = A x(k) + B v(k),    y(k) = C x(k) + D v(k),    x(1) = 0
                |v| <= P_max,    |v(k+1) - v(k)| <= rate Ts,    |level in w(k) + y(k)| <= h_max
                P h' <= W / At

The last one, on the power, is not convex. For water no faster than f it is replaced by its convex
hull (McCormick)::

    |f P + P_max h'| <= W / At + P_max f,    |h'| <= f

So what comes out is a bound: no controller that commands at these samples does better, and with a
power limit perhaps none can do as well. With c and d zero it is the clairvoyant bound. The linear
terms are those of `causal_bound`.
"""

import math
from dataclasses import dataclass

import numpy as np

from utank_hil.base.arrays import FloatArray
from utank_hil.control.interface import DesignPlant
from utank_hil.dynamics.linear import STATES
from utank_hil.dynamics.sampling import LinearModel, sample

_ROLL, _LEVEL, _SPEED = (STATES.index(s) for s in ("roll_rad", "level_m", "level_rate_m_s"))
_PRESSURE = len(STATES)  # the last state
FASTEST_WATER_M_S = 4.0  # f; counts with a finite power limit only


class NoHistoryError(ValueError):
    """No pressure history keeps a record within the limits, or none was found."""


@dataclass(frozen=True, slots=True, eq=False)
class ClairvoyantRun:
    """The best history."""

    roll_rms_rad: float
    motion: FloatArray  #: shape (N, 4): `STATES` at the end of each sample.
    pressure_pa: FloatArray  #: shape (N,): actual pressure then, behind the drive's lag.
    command_pa: FloatArray  #: shape (N,): held over each sample.
    linear_cost: float = 0.0  #: Mean of the linear terms, 0 without them.


def clairvoyant_bound(
    plant: DesignPlant, wave_motion: FloatArray, *, sample_time_s: float = 0.2
) -> ClairvoyantRun:
    """Least roll of the linear ship within the plant's limits, the waves known in advance.

    Raises `ValueError` if nothing keeps within the limits, or the solver fails.

    `wave_motion`, shape (N + 1, 4), is `STATES` with the tank passive (`passive_motion`) at 0, Ts,
    ... N Ts. The plant's delay makes no difference where the whole record is known.
    """
    model = pump_with_lag(plant, sample_time_s, delay_s=0.0)
    return best_history(plant, model, wave_motion[1:])


def pump_with_lag(plant: DesignPlant, sample_time_s: float, delay_s: float) -> LinearModel:
    """Sampled model from the command to `STATES` and the actual pressure; all are states."""
    pump = plant.model(STATES)
    whole = np.eye(len(STATES) + 1)
    sampled = sample(pump, sample_time_s, delay_s, plant.lag_s)
    if len(sampled.A) != len(whole):
        raise ValueError(f"delay_s must be below the sample time of {sample_time_s:g} s")
    # the pressure by its own lag: it is no output of the pump's model
    reach = -math.expm1(-(sample_time_s - delay_s) / plant.lag_s)
    return LinearModel(
        sampled.A, sampled.B, whole, np.vstack([sampled.D, [[reach]]]), sample_time_s
    )


def best_history(
    plant: DesignPlant,
    model: LinearModel,
    waves: FloatArray,
    state_slope: FloatArray | None = None,
    command_slope: FloatArray | None = None,
) -> ClairvoyantRun:
    """Least mean square of the roll plus the mean of linear terms, the waves known.

    Raises `ValueError` if nothing keeps within the limits, or the solver fails.

    Parameters
    ----------
    plant : DesignPlant
        Of which the limits count, and the tank.
    model : LinearModel
        From `pump_with_lag`.
    waves : ndarray, shape (N, 4)
        `STATES` with the tank passive.
    state_slope : ndarray, shape (N, 5), optional
        c(k), of the model's states in rad^2 per unit.
    command_slope : ndarray, shape (N,), optional
        d(k), in rad^2 per Pa.
    """
    import clarabel
    from scipy import sparse

    limits, count, states = plant.limits, len(waves), len(model.A)
    unit = limits.pressure_pa  # pressures in this unit, roll in degrees: all numbers near one
    degrees = np.rad2deg(1.0)
    scale = np.ones(states)
    scale[_PRESSURE] = unit
    a, b = model.A * scale / scale[:, None], model.B * unit / scale[:, None]
    d = model.D[:, 0] * unit / scale

    # unknowns: x(1) ... x(N), then v(1) ... v(N)
    each, back = sparse.eye(count), sparse.eye(count, k=-1)
    dynamics = sparse.hstack(
        [sparse.eye(count * states) - sparse.kron(back, a), -sparse.kron(back, b)]
    )

    def of_output(row: FloatArray) -> sparse.csc_matrix:
        return sparse.hstack([sparse.kron(each, row[None]), float(row @ d) * each])

    unit_rows = np.eye(states)
    no_state = sparse.csc_matrix((count, count * states))
    bounded = [  # (rows, offset, bound): |rows x + offset| <= bound
        (sparse.hstack([no_state, each]), np.zeros(count), 1.0),
        (
            sparse.hstack([no_state, each - back]),
            np.zeros(count),
            limits.rate_pa_s * model.dt / unit,
        ),
        (of_output(unit_rows[_LEVEL]), waves[:, _LEVEL], limits.level_m),
    ]
    if math.isfinite(limits.power_w):
        fastest, flow = FASTEST_WATER_M_S, limits.power_w / (plant.tank.reservoir_area_m2 * unit)
        cut = of_output(fastest * unit_rows[_PRESSURE] + unit_rows[_SPEED])
        bounded += [
            (cut, waves[:, _SPEED], flow + fastest),
            (of_output(unit_rows[_SPEED]), waves[:, _SPEED], fastest),
        ]
    rows = sparse.vstack([dynamics] + [sign * r for r, _, _ in bounded for sign in (1, -1)])
    right = [np.zeros(count * states)]
    right += [bound - sign * offset for _, offset, bound in bounded for sign in (1, -1)]

    roll = of_output(unit_rows[_ROLL])
    slope = np.zeros(count * (states + 1))
    if state_slope is not None:
        slope[: count * states] = (degrees**2 / count * state_slope * scale).ravel()
    if command_slope is not None:
        slope[count * states :] = degrees**2 / count * command_slope * unit
    settings = clarabel.DefaultSettings()
    settings.verbose = False
    limits_count = rows.shape[0] - count * states
    solution = clarabel.DefaultSolver(
        sparse.triu(2 / count * degrees**2 * roll.T @ roll).tocsc(),
        2 / count * degrees**2 * (roll.T @ waves[:, _ROLL]) + slope,
        rows.tocsc(),
        np.concatenate(right),
        [clarabel.ZeroConeT(count * states), clarabel.NonnegativeConeT(limits_count)],
        settings,
    ).solve()
    if solution.status != clarabel.SolverStatus.Solved:
        raise NoHistoryError(
            f"no pressure history keeps within the limits ({solution.status}): the waves alone may "
            f"lift the water beyond level_m = {limits.level_m}"
        )
    found = np.array(solution.x)
    command = found[count * states :]
    outputs = (found[: count * states].reshape(count, states) + np.outer(command, d)) * scale
    motion = waves + outputs[:, : len(STATES)]
    return ClairvoyantRun(
        roll_rms_rad=float(np.sqrt(np.mean(np.square(motion[:, _ROLL])))),
        motion=motion,
        pressure_pa=outputs[:, _PRESSURE],
        command_pa=command * unit,
        linear_cost=float(slope @ found) / degrees**2,
    )
