"""Compiled integration of ship, tank and pump; it imports numba, so import it late.

One call advances the plant by one tick in steps of 1 ms: the pump and its inner pressure loop once
a step, ship and water by the step of `utank_hil.dynamics.kernels`, with the pump's pressure held
over the step. The wave moment is a sum of rotating phasors, computed once a tick and interpolated
through the values of four ticks, with an error of 2e-8 of the amplitude for a wave at 3 rad/s.
"""

import numpy as np

from utank_hil.base.arrays import ComplexArray, FloatArray
from utank_hil.base.tick import TICK_S
from utank_hil.dynamics.jit import njit
from utank_hil.dynamics.kernels import (
    CAPSIZED_S,
    DAMPED_AROUND,
    STRIKE_LOSS,
    SUMMARY,
    Held,
    InStep,
    State,
    damping_w,
    righting_moment,
    rk4,
    step_with_impacts,
    sway_work_j,
    unpacked,
)
from utank_hil.dynamics.pump import PumpState, compile_pump
from utank_hil.dynamics.pump_curve import PumpCoefficients
from utank_hil.dynamics.valves import LOCKED

STEP_S = 1e-3
STEPS = round(TICK_S / STEP_S)

ROLL, ROLL_RATE, LEVEL, LEVEL_RATE = range(4)  # entries of the state vector
SPEED, REFERENCE, INTEGRAL, PRESSURE, TORQUE, POWER, LIMITED = range(4, 11)  # PumpState
SETPOINT, MODE = 11, 12
MOMENTS = slice(13, 17)  # wave moment at t - 1, t, t + 1 and t + 2 ticks
MOMENT_NOW = 14
VALVE_LOSS = 17  # Pa per (m/s)^2 of dh/dt
TIME = 18  # since the start, s
# work since the start in J: of the shaft, of the waves, of the pump on the water, and losses of
# damping and valve
SHAFT_WORK, WAVE_WORK, PUMP_WORK, DAMPED = range(19, 23)
SUMMED = slice(23, 23 + SUMMARY)  # summary of `utank_hil.dynamics.kernels`
# lateral acceleration of the centre of gravity over g, at the times of MOMENTS
SWAY = slice(23 + SUMMARY, 27 + SUMMARY)
SWAY_NOW = 24 + SUMMARY
HEAVE_NOW = 27 + SUMMARY  # downward acceleration at the tank, m/s^2
# change of the righting moment as a share, at the times of MOMENTS
CHANGE = slice(28 + SUMMARY, 32 + SUMMARY)
STATES = 32 + SUMMARY
CAPSIZED, STRUCK, DAMPED_STRIKING = 23 + CAPSIZED_S, 23 + STRIKE_LOSS, 23 + DAMPED_AROUND

# values of MODE: the rotor turns freely; it follows the set-point; the set-point is the pressure;
# there is no pump
FREE, DRIVEN, IMPOSED, ABSENT = 0, 1, 2, 3

CAPSIZE_RAD = np.pi / 2  #: Beyond it the model of the hull does not hold.

pump_step, pump_coast = compile_pump(njit())


def interpolation_weights() -> FloatArray:
    """Lagrange weights of the four moments at each half step of a tick, (2 STEPS + 1, 4)."""
    nodes = np.array([-1.0, 0.0, 1.0, 2.0])
    at = np.linspace(0.0, 1.0, 2 * STEPS + 1)
    weights = np.ones((len(at), 4))
    for i, node in enumerate(nodes):
        for other in nodes[nodes != node]:
            weights[:, i] *= (at - other) / (node - other)
    return weights


@njit(error_model="numpy")
def kept_pump(state: FloatArray) -> PumpState:
    """Return the pump as it is in the state."""
    return PumpState(
        state[SPEED],
        state[REFERENCE],
        state[INTEGRAL],
        state[PRESSURE],
        state[TORQUE],
        state[POWER],
        state[LIMITED] > 0.5,
    )


@njit(error_model="numpy")
def keep_pump(state: FloatArray, pump: PumpState) -> None:
    """Keep the pump in the state."""
    state[SPEED] = pump.speed_rad_s
    state[REFERENCE] = pump.reference_pa
    state[INTEGRAL] = pump.integral_pa
    state[PRESSURE] = pump.pressure_pa
    state[TORQUE] = pump.torque_nm
    state[POWER] = pump.power_w
    state[LIMITED] = 1.0 if pump.limited else 0.0


@njit(error_model="numpy")
def pump_after(
    state: FloatArray, pump: PumpState, flow_m3_s: float, coefficients: PumpCoefficients
) -> PumpState:
    """Return the pump after a step, in the mode of the state."""
    if state[MODE] == DRIVEN:
        pump = pump_step(pump, state[SETPOINT], flow_m3_s, STEP_S, coefficients)
    elif state[MODE] != ABSENT:
        pump = pump_coast(pump, flow_m3_s, STEP_S, coefficients)
    if state[MODE] == IMPOSED:
        pressure_pa, power_w = state[SETPOINT], state[SETPOINT] * flow_m3_s
        pump = PumpState(pump.speed_rad_s, 0.0, 0.0, pressure_pa, 0.0, power_w, False)
    return pump


@njit(error_model="numpy")
def _in_step(weights: FloatArray, step: int, first: float, values: FloatArray) -> InStep:
    """Return a wave's values at start, middle and end of a step."""
    middle = interpolated(weights, 2 * step + 1, values)
    return first, middle, interpolated(weights, 2 * step + 2, values)


@njit(error_model="numpy")
def advance_tick(
    state: FloatArray,
    row: FloatArray,
    restoring: FloatArray,
    linear: FloatArray,
    coefficients: tuple[float, ...],
    phasors: ComplexArray,
    rotations: ComplexArray,
    weights: FloatArray,
) -> None:
    """Advance `state` by one tick, in place; a capsized ship does not move.

    Parameters
    ----------
    row : ndarray, shape (18,)
        `RollCoefficients`, and the pieces of the restoring moment per radian.
    restoring : ndarray, shape (pieces, powers)
        Coefficients of `utank_hil.dynamics.ship.Restoring`.
    linear : ndarray, shape (4, 8) or (0, 8)
        Linear model that replaces `row` and `restoring`. Columns: state matrix, effect of pressure,
        effect of wave moment, accelerations by steady heeling moments, effect of sway.
    coefficients : tuple of float
        `PumpCoefficients` as a plain tuple: numba needs 2 us to unbox a named one.
    phasors, rotations : ndarray, shape (1 to 3, n)
        Wave components of moment, lateral acceleration and change of the righting moment, two ticks
        ahead, and their rotation per tick; `phasors` is advanced.
    weights : ndarray
        Result of `interpolation_weights`.
    """
    c = unpacked(row)
    pump_coefficients = PumpCoefficients(*coefficients)
    pump = kept_pump(state)
    x = (state[ROLL], state[ROLL_RATE], state[LEVEL], state[LEVEL_RATE])
    valve = state[VALVE_LOSS]
    if valve >= LOCKED:
        x = (x[0], x[1], x[2], 0.0)
    else:
        valve *= c.area
    moments, summary = state[MOMENTS], state[SUMMED]
    shaft_j, wave_j, pump_j, damped_j = 0.0, 0.0, 0.0, 0.0
    sway, change = state[SWAY], state[CHANGE]
    moment, lateral, share = (0.0, 0.0, moments[1]), (0.0, 0.0, sway[1]), (0.0, 0.0, change[1])
    # not STEPS: numba's cache would keep the number of an earlier tick
    for step in range(len(weights) // 2):
        if summary[CAPSIZED_S] < np.inf:
            x = (x[0], 0.0, x[2], 0.0)
            break
        flow_m3_s = c.area * x[3]
        pump = pump_after(state, pump, flow_m3_s, pump_coefficients)
        moment = _in_step(weights, step, moment[2], moments)
        lateral = _in_step(weights, step, lateral[2], sway)
        share = _in_step(weights, step, share[2], change)
        waves = (moment, lateral, share)
        force = c.area * pump.pressure_pa
        held = Held(c, row[17], restoring, force, valve)
        if len(linear) > 0:
            after = _linear_step(linear, x, moment, lateral, pump.pressure_pa)
        else:
            after = rk4(held, x, waves, STEP_S)
        if abs(after[2]) > c.level_limit and len(linear) == 0:
            time_s = state[TIME] + step * STEP_S
            after = step_with_impacts(held, x, waves, STEP_S, time_s, np.empty((0, 5)), summary)
        else:
            damped_j += (damping_w(c, x, valve) + damping_w(c, after, valve)) / 2 * STEP_S
        shaft_j += pump.power_w * STEP_S
        # force times distance, which also holds in a step with an impact
        wave_j += (moment[0] + moment[2]) / 2 * (after[0] - x[0])
        pump_j += force * (after[2] - x[2])
        if len(phasors) > 1:
            wave_j += sway_work_j(c, x, after, (lateral[0] + lateral[2]) / 2)
        if len(phasors) > 2:
            middle_rad = (x[0] + after[0]) / 2
            righting_nm = righting_moment(row[17], restoring, middle_rad)
            wave_j -= (share[0] + share[2]) / 2 * righting_nm * (after[0] - x[0])
        x = after
        if abs(x[0]) >= CAPSIZE_RAD and len(linear) == 0:
            summary[CAPSIZED_S] = state[TIME] + (step + 1) * STEP_S
    state[ROLL], state[ROLL_RATE], state[LEVEL], state[LEVEL_RATE] = x
    keep_pump(state, pump)
    state[SHAFT_WORK] += shaft_j
    state[WAVE_WORK] += wave_j
    state[PUMP_WORK] += pump_j
    state[DAMPED] += damped_j
    state[TIME] += (len(weights) // 2) * STEP_S
    for k, ahead in enumerate((moments, sway, change)):
        ahead[0], ahead[1], ahead[2] = ahead[1], ahead[2], ahead[3]
        if k < len(phasors):
            ahead[3] = turned_sum(phasors[k], rotations[k])


@njit(error_model="numpy")
def turned_sum(phasors: ComplexArray, rotations: ComplexArray) -> float:
    """Rotate all wave components by one tick, in place, and return their sum."""
    total: float = 0.0
    for n in range(len(phasors)):
        phasors[n] *= rotations[n]
        total += float(phasors[n].real)
    return total


@njit(error_model="numpy")
def interpolated(weights: FloatArray, row: int, moments: FloatArray) -> float:
    """Return a wave's value at a half step of the tick, from those at four ticks."""
    # explicit: a product of four numbers is not worth a call of the linear algebra library
    w, m = weights[row], moments
    return float(w[0] * m[0] + w[1] * m[1] + w[2] * m[2] + w[3] * m[3])


@njit(error_model="numpy")
def _linear_step(
    model: FloatArray, x: State, moments: InStep, sways: InStep, pressure_pa: float
) -> State:
    k1 = _rates(model, x, x, 0.0, pressure_pa, moments[0], sways[0])
    k2 = _rates(model, x, k1, STEP_S / 2, pressure_pa, moments[1], sways[1])
    k3 = _rates(model, x, k2, STEP_S / 2, pressure_pa, moments[1], sways[1])
    k4 = _rates(model, x, k3, STEP_S, pressure_pa, moments[2], sways[2])
    return (
        x[0] + STEP_S / 6 * (k1[0] + 2 * k2[0] + 2 * k3[0] + k4[0]),
        x[1] + STEP_S / 6 * (k1[1] + 2 * k2[1] + 2 * k3[1] + k4[1]),
        x[2] + STEP_S / 6 * (k1[2] + 2 * k2[2] + 2 * k3[2] + k4[2]),
        x[3] + STEP_S / 6 * (k1[3] + 2 * k2[3] + 2 * k3[3] + k4[3]),
    )


@njit(error_model="numpy")
def _rates(
    model: FloatArray,
    x: State,
    slope: State,
    time_s: float,
    pressure_pa: float,
    moment_nm: float,
    sway: float,
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
        roll + m[1, 4] * pressure_pa + m[1, 5] * moment_nm + m[1, 6] + m[1, 7] * sway,
        d,
        level + m[3, 4] * pressure_pa + m[3, 5] * moment_nm + m[3, 6] + m[3, 7] * sway,
    )
