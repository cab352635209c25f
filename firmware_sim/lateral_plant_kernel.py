"""Compiled integration of a ship in three or six degrees with tank and pump; imports numba.

As `plant_kernel`, with the ship by the step of `utank_hil.dynamics.hull.lateral_kernel`, which
takes two steps of the pump at once.
"""

import numpy as np

from firmware_sim import plant_kernel as kernel
from utank_hil.base.arrays import ComplexArray, FloatArray
from utank_hil.dynamics.hull import lateral_kernel as lateral
from utank_hil.dynamics.jit import njit
from utank_hil.dynamics.kernels import CAPSIZED_S, MAX_IMPULSE, STRIKE_LOSS, STRIKES
from utank_hil.dynamics.pump_curve import PumpCoefficients
from utank_hil.dynamics.tank import GRAVITY_M_S2
from utank_hil.dynamics.valves import LOCKED


@njit(error_model="numpy")
def advance_tick(
    state: FloatArray,
    x: FloatArray,
    ahead: FloatArray,
    parameters: FloatArray,
    oscillators: FloatArray,
    vertical: FloatArray,
    per_piece: float,
    restoring: FloatArray,
    coefficients: tuple[float, ...],
    phasors: ComplexArray,
    rotations: ComplexArray,
    weights: FloatArray,
) -> None:
    """Advance `state` and `x` by one tick, in place; a capsized ship does not move.

    Parameters
    ----------
    state : ndarray
        As of `plant_kernel`.
    x : ndarray
        State of `lateral_kernel`.
    ahead : ndarray, shape (5 or 8, 4)
        Forces of `lateral_kernel.rates` at t - 1, t, t + 1 and t + 2 ticks.
    phasors, rotations : ndarray, shape (3, 4, 6 or 7, n)
        Wave components of these forces; the last may be missing, that of a turn is.
    parameters, oscillators, vertical, per_piece, restoring
        Of `LateralModel`.
    """
    pump_coefficients = PumpCoefficients(*coefficients)
    pump, summary = kernel.kept_pump(state), state[kernel.SUMMED]
    area, valve = parameters[22], state[kernel.VALVE_LOSS]
    if valve >= LOCKED:
        x[lateral.LEVEL_RATE] = 0.0
    else:
        valve *= area
    books, shaft_j, rows = np.zeros(lateral.BOOKS), 0.0, len(ahead)
    books[lateral.IMPULSE] = summary[MAX_IMPULSE]
    room = np.empty((7, 7)), np.empty(7), np.empty((3, rows)), np.empty((3, len(x)))
    ship = lateral.Step(parameters, oscillators, vertical, per_piece, restoring, valve, *room)
    forces = np.empty((3, rows))
    forces[2] = ahead[:, 1]
    for step in range(len(weights) // 4):
        if summary[CAPSIZED_S] < np.inf:
            x[lateral.ROLL_RATE] = x[lateral.LEVEL_RATE] = 0.0
            break
        push = 0.0
        for _ in range(2):
            pump = kernel.pump_after(state, pump, area * x[lateral.LEVEL_RATE], pump_coefficients)
            shaft_j += pump.power_w * kernel.STEP_S
            push += area * pump.pressure_pa / 2
        for i in range(rows):
            forces[0, i] = forces[2, i]
            forces[1, i] = kernel.interpolated(weights, 4 * step + 2, ahead[i])
            forces[2, i] = kernel.interpolated(weights, 4 * step + 4, ahead[i])
        lateral.advance(ship, x, forces, push, 2 * kernel.STEP_S, books)
        if abs(x[lateral.ROLL]) >= kernel.CAPSIZE_RAD:
            summary[CAPSIZED_S] = state[kernel.TIME] + (step + 1) * 2 * kernel.STEP_S
    rates = np.empty(len(x))
    lateral.rates(ship, x, forces[2], area * pump.pressure_pa, rates)
    state[kernel.ROLL], state[kernel.ROLL_RATE] = x[lateral.ROLL], x[lateral.ROLL_RATE]
    state[kernel.LEVEL], state[kernel.LEVEL_RATE] = x[lateral.LEVEL], x[lateral.LEVEL_RATE]
    state[kernel.SWAY_NOW] = (rates[lateral.SWAY_RATE] + forces[2, rows - 1]) / GRAVITY_M_S2
    kernel.keep_pump(state, pump)
    state[kernel.SHAFT_WORK] += shaft_j
    state[kernel.WAVE_WORK] += books[lateral.WAVE_WORK]
    state[kernel.PUMP_WORK] += books[lateral.PUMP_WORK]
    state[kernel.DAMPED] += books[lateral.DAMPED]
    summary[STRIKE_LOSS] += books[lateral.STRUCK]
    summary[STRIKES] += books[lateral.NUMBER]
    summary[MAX_IMPULSE] = books[lateral.IMPULSE]
    state[kernel.TIME] += (len(weights) // 2) * kernel.STEP_S
    if rows > 5:
        at = lateral.WAVES + 2 * len(oscillators) + 3
        state[kernel.HEAVE_NOW] = rates[at + 1] - parameters[11] * rates[at + 2]
    for i in range(rows):
        row = ahead[i]
        row[0], row[1], row[2] = row[1], row[2], row[3]
        row[3] = kernel.turned_sum(phasors[i], rotations[i]) if i < len(phasors) else 0.0
    state[kernel.MOMENT_NOW] = ahead[1, 1]
