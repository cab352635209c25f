"""Compiled integration of ship, tank and pump. Imports numba: import it late.

One call advances the plant by one tick in steps of 1 ms: the pump and its inner pressure
loop once a step, the coupled linear model by classical Runge-Kutta with the pump's pressure held
over the step. The wave moment is a sum of rotating phasors, summed once a tick and interpolated in
between through four ticks' values; for a wave at 3 rad/s that is exact to 2e-8 of its amplitude.
"""

import numpy as np
from numba import njit

from utank_hil.arrays import ComplexArray, FloatArray
from utank_hil.dynamics.pump import PumpCoefficients, PumpState, compile_pump
from utank_hil.tick import TICK_S

STEP_S = 1e-3
STEPS = round(TICK_S / STEP_S)

# entries of the state vector
ROLL, ROLL_RATE, LEVEL, LEVEL_RATE = range(4)
SPEED, REFERENCE, INTEGRAL, PRESSURE, TORQUE, POWER, LIMITED = range(4, 11)  # PumpState
SETPOINT, MODE = 11, 12
MOMENTS = slice(13, 17)  # wave moment at t - 1, t, t + 1 and t + 2 ticks
MOMENT_NOW = 14
ENERGY = 17  # taken by the shaft since the start, J
STATES = 18

# values of MODE: the rotor turns freely, follows the set-point, or the set-point is the pressure
FREE, DRIVEN, IMPOSED = 0, 1, 2

State = tuple[float, float, float, float]

pump_step, pump_coast = compile_pump(njit(cache=True))


def interpolation_weights() -> FloatArray:
    """Lagrange weights on the four moments, for each half step of a tick; (2 STEPS + 1, 4)."""
    nodes = np.array([-1.0, 0.0, 1.0, 2.0])
    at = np.linspace(0.0, 1.0, 2 * STEPS + 1)
    weights = np.ones((len(at), 4))
    for i, node in enumerate(nodes):
        for other in nodes[nodes != node]:
            weights[:, i] *= (at - other) / (node - other)
    return weights


@njit(cache=True, error_model="numpy")
def advance_tick(
    state: FloatArray,
    model: FloatArray,
    coefficients: tuple[float, ...],
    phasors: ComplexArray,
    rotations: ComplexArray,
    weights: FloatArray,
) -> None:
    """Advance `state` by one tick, in place.

    Parameters
    ----------
    state : ndarray, shape (STATES,)
    model : ndarray, shape (4, 7)
        Columns: state matrix, effect of pressure, effect of wave moment; the last holds in its
        first row the tank area that turns the level's rate into flow, and in the second and fourth
        the accelerations by what heels the ship steadily.
    coefficients : tuple of float
        `PumpCoefficients` as a plain tuple: a named one takes numba 2 us to take in.
    phasors, rotations : ndarray, shape (n,)
        Wave components two ticks ahead, and their turn in one tick; `phasors` moves on.
    weights : ndarray
        From `interpolation_weights`.
    """
    pump_coefficients = PumpCoefficients(*coefficients)
    pump = PumpState(
        state[SPEED],
        state[REFERENCE],
        state[INTEGRAL],
        state[PRESSURE],
        state[TORQUE],
        state[POWER],
        state[LIMITED] > 0.5,
    )
    x = (state[ROLL], state[ROLL_RATE], state[LEVEL], state[LEVEL_RATE])
    moments = state[MOMENTS]
    energy_j = 0.0
    first = moments[1]
    # not STEPS: numba's cache would keep the number of an earlier tick
    for step in range(len(weights) // 2):
        flow_m3_s = model[0, 6] * x[3]
        if state[MODE] == DRIVEN:
            pump = pump_step(pump, state[SETPOINT], flow_m3_s, STEP_S, pump_coefficients)
        else:
            pump = pump_coast(pump, flow_m3_s, STEP_S, pump_coefficients)
        if state[MODE] == IMPOSED:
            pressure_pa, power_w = state[SETPOINT], state[SETPOINT] * flow_m3_s
            pump = PumpState(pump.speed_rad_s, 0.0, 0.0, pressure_pa, 0.0, power_w, False)
        energy_j += pump.power_w * STEP_S
        middle = _interpolated(weights, 2 * step + 1, moments)
        last = _interpolated(weights, 2 * step + 2, moments)
        k1 = _rates(model, x, x, 0.0, pump.pressure_pa, first)
        k2 = _rates(model, x, k1, STEP_S / 2, pump.pressure_pa, middle)
        k3 = _rates(model, x, k2, STEP_S / 2, pump.pressure_pa, middle)
        k4 = _rates(model, x, k3, STEP_S, pump.pressure_pa, last)
        x = (
            x[0] + STEP_S / 6 * (k1[0] + 2 * k2[0] + 2 * k3[0] + k4[0]),
            x[1] + STEP_S / 6 * (k1[1] + 2 * k2[1] + 2 * k3[1] + k4[1]),
            x[2] + STEP_S / 6 * (k1[2] + 2 * k2[2] + 2 * k3[2] + k4[2]),
            x[3] + STEP_S / 6 * (k1[3] + 2 * k2[3] + 2 * k3[3] + k4[3]),
        )
        first = last
    state[ROLL], state[ROLL_RATE], state[LEVEL], state[LEVEL_RATE] = x
    state[SPEED] = pump.speed_rad_s
    state[REFERENCE] = pump.reference_pa
    state[INTEGRAL] = pump.integral_pa
    state[PRESSURE] = pump.pressure_pa
    state[TORQUE] = pump.torque_nm
    state[POWER] = pump.power_w
    state[LIMITED] = 1.0 if pump.limited else 0.0
    state[ENERGY] += energy_j
    moments[0], moments[1], moments[2] = moments[1], moments[2], moments[3]
    moments[3] = turned_sum(phasors, rotations)


@njit(cache=True, error_model="numpy")
def turned_sum(phasors: ComplexArray, rotations: ComplexArray) -> float:
    """Turn all wave components by one tick, in place, and return their sum."""
    total: float = 0.0
    for n in range(len(phasors)):
        phasors[n] *= rotations[n]
        total += float(phasors[n].real)
    return total


@njit(cache=True, error_model="numpy")
def _interpolated(weights: FloatArray, row: int, moments: FloatArray) -> float:
    # written out: a product of four numbers is not worth a call of the linear algebra library
    w, m = weights[row], moments
    return float(w[0] * m[0] + w[1] * m[1] + w[2] * m[2] + w[3] * m[3])


@njit(cache=True, error_model="numpy")
def _rates(
    model: FloatArray, x: State, slope: State, time_s: float, pressure_pa: float, moment_nm: float
) -> State:
    """Rates of the state at x + time_s * slope."""
    a = x[0] + time_s * slope[0]
    b = x[1] + time_s * slope[1]
    c = x[2] + time_s * slope[2]
    d = x[3] + time_s * slope[3]
    m = model
    roll = m[1, 0] * a + m[1, 1] * b + m[1, 2] * c + m[1, 3] * d
    level = m[3, 0] * a + m[3, 1] * b + m[3, 2] * c + m[3, 3] * d
    return (
        b,
        roll + m[1, 4] * pressure_pa + m[1, 5] * moment_nm + m[1, 6],
        d,
        level + m[3, 4] * pressure_pa + m[3, 5] * moment_nm + m[3, 6],
    )
