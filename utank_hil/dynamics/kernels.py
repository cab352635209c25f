"""Compiled fixed-step integration of the nonlinear coupled model; imports numba, so import it late.

The method is the classical Runge-Kutta of order four. Pump pressure and valve loss are held over
whole steps. Behind a valve that is `LOCKED` the water does not move.

A step in which the level passes its limit ends at the impact, found by the Illinois method. The
impulse is applied, and the rest of the step follows.
"""

import math
from typing import NamedTuple

from utank_hil.base import elementary
from utank_hil.base.arrays import FloatArray
from utank_hil.dynamics import nonlinear
from utank_hil.dynamics.jit import njit
from utank_hil.dynamics.nonlinear import INSIDE_M, REST_M_S, RollCoefficients
from utank_hil.dynamics.valves import LOCKED

STRIKES_PER_STEP = 8  # The water comes to rest at the stop beyond these.
# Entries of a ship's summary; the last two are the energy of impacts, and the damping energy in
# steps with impacts.
CAPSIZED_S, MAX_ROLL, MAX_LEVEL, STRIKES, MAX_IMPULSE, STRIKE_LOSS, DAMPED_AROUND = range(7)
SUMMARY = 7

State = tuple[float, float, float, float]
InStep = tuple[float, float, float]  #: Values of a quantity at start, middle and end of a step.
InWaves = tuple[InStep, InStep, InStep]
"""Roll moment of the waves, lateral acceleration over g, and the righting moment's change as a
share."""


class Held(NamedTuple):
    """The ship with its tank, and what pump and valve do over a step."""

    c: RollCoefficients
    per_piece: float  #: This and the next are of `righting_moment`.
    restoring: FloatArray
    pump: float  #: Pressure times the reservoir area.
    valve: float  #: Loss times the reservoir area.


# No kernel reorders or fuses sums (`fastmath`): processors would differ in their last digits.
sine_cosine = njit(error_model="numpy")(elementary.sine_cosine)
forces = njit(error_model="numpy", inline="always")(nonlinear.forces)


@njit(error_model="numpy")
def unpacked(row: FloatArray) -> RollCoefficients:
    """The coefficients from an array."""
    return RollCoefficients(
        row[0], row[1], row[2], row[3], row[4], row[5], row[6], row[7], row[8], row[9],
        row[10], row[11], row[12], row[13], row[14], row[15], row[16],
    )  # fmt: skip


@njit(error_model="numpy", inline="always")
def righting_moment(per_piece: float, restoring: FloatArray, phi: float) -> float:
    """Restoring moment, from the pieces of `utank_hil.dynamics.ship.Restoring`."""
    heel = abs(phi)
    piece = min(int(heel * per_piece), restoring.shape[0] - 1)
    if piece > 0:
        heel -= piece / per_piece
    righting = 0.0
    for k in range(restoring.shape[1] - 1, -1, -1):
        righting = righting * heel + restoring[piece, k]
    return -righting if phi < 0 else righting


# Passing the coefficients four times a step would cost a third of the step.
@njit(error_model="numpy", inline="always")
def accelerations(
    s: Held, phi: float, phi_dot: float, h: float, h_dot: float,
    moment: float, sway: float, change: float,
) -> tuple[float, float]:  # fmt: skip
    """Roll and level acceleration by `utank_hil.dynamics.nonlinear.forces`."""
    c = s.c
    sin, cos = sine_cosine(phi)
    righting = (1.0 + change) * righting_moment(s.per_piece, s.restoring, phi)
    roll_inertia, roll_moment, level_force = forces(
        c, righting, sin, cos, phi_dot, h, h_dot, moment, sway, s.pump, s.valve
    )
    if s.valve >= LOCKED:
        return roll_moment / roll_inertia, 0.0
    scale = 1 / (roll_inertia * c.level_inertia - c.coupling * c.coupling)
    h_ddot = (roll_inertia * level_force - c.coupling * roll_moment) * scale
    if abs(h) >= c.level_limit and h * h_dot >= 0 and h * h_ddot > 0:  # pressed against the stop
        return roll_moment / roll_inertia, 0.0
    return (c.level_inertia * roll_moment - c.coupling * level_force) * scale, h_ddot


@njit(error_model="numpy")
def rk4(s: Held, state: State, waves: InWaves, dt: float) -> State:
    """Advance by one Runge-Kutta step."""
    x, v1, h, w1 = state
    (m1, m2, m4), (s1, s2, s4), (c1, c2, c4) = waves
    half = 0.5 * dt
    a1, b1 = accelerations(s, x, v1, h, w1, m1, s1, c1)
    v2, w2 = v1 + half * a1, w1 + half * b1
    a2, b2 = accelerations(s, x + half * v1, v2, h + half * w1, w2, m2, s2, c2)
    v3, w3 = v1 + half * a2, w1 + half * b2
    a3, b3 = accelerations(s, x + half * v2, v3, h + half * w2, w3, m2, s2, c2)
    v4, w4 = v1 + dt * a3, w1 + dt * b3
    a4, b4 = accelerations(s, x + dt * v3, v4, h + dt * w3, w4, m4, s4, c4)
    sixth = dt / 6
    return (
        x + sixth * (v1 + 2 * (v2 + v3) + v4),
        v1 + sixth * (a1 + 2 * (a2 + a3) + a4),
        h + sixth * (w1 + 2 * (w2 + w3) + w4),
        w1 + sixth * (b1 + 2 * (b2 + b3) + b4),
    )


@njit(error_model="numpy")
def damping_w(c: RollCoefficients, state: State, valve: float) -> float:
    """Return the power dissipated by damping of the ship, losses of the tank, and the valve."""
    _, v, _, w = state
    ship = c.damping + c.quadratic_damping * abs(v)
    water = c.loss + (c.quadratic_loss + valve) * abs(w)
    return float(ship * v * v + water * w * w)


@njit(error_model="numpy")
def sway_work_j(c: RollCoefficients, before: State, after: State, sway: float) -> float:
    """Return the work on the water of a lateral acceleration over g."""
    raised = 0.0
    for side, state in ((1.0, before), (-1.0, after)):
        phi, _, h, _ = state
        sine, cosine = sine_cosine(phi)
        across = c.weight_h * h
        down = c.weight_lever - c.weight_h2 * h * h
        raised += side * (across * cosine - down * sine)
    return sway * raised


@njit(error_model="numpy")
def within(values: InStep, begin: float, end: float) -> InStep:
    """Interpolate quadratically at start, middle and end of a part of the step."""
    a, b, c = values
    slope, curvature = 4 * b - 3 * a - c, 2 * (a + c - 2 * b)
    mid = 0.5 * (begin + end)
    return (
        a + begin * (slope + begin * curvature),
        a + mid * (slope + mid * curvature),
        a + end * (slope + end * curvature),
    )


@njit(error_model="numpy")
def _part_of(waves: InWaves, begin: float, end: float) -> InWaves:
    moment, sway, change = waves
    return within(moment, begin, end), within(sway, begin, end), within(change, begin, end)


@njit(error_model="numpy")
def _damped_j(c: RollCoefficients, before: State, after: State, valve: float, time: float) -> float:
    return (damping_w(c, before, valve) + damping_w(c, after, valve)) / 2 * time


@njit(error_model="numpy")
def step_with_impacts(
    s: Held, state: State, waves: InWaves, dt: float, time: float, impacts: FloatArray,
    summary: FloatArray,
) -> State:  # fmt: skip
    """Return the state after a step with impacts, each counted and written to `impacts`."""
    c, valve = s.c, s.valve
    done = 0.0
    limit = c.level_limit
    for strike in range(STRIKES_PER_STEP + 1):
        left = 1.0 - done
        part = _part_of(waves, done, 1.0)
        after = rk4(s, state, part, left * dt)
        if abs(after[2]) <= limit:
            summary[DAMPED_AROUND] += _damped_j(c, state, after, valve, left * dt)
            return after
        side = math.copysign(1.0, after[2])
        low, high = 0.0, left
        g_low, g_high = side * state[2] - limit, side * after[2] - limit
        for _ in range(60):
            if g_high < 1e-13 or high - low < 1e-15 or g_low >= 0:
                break
            share = high - g_high * (high - low) / (g_high - g_low)
            part = _part_of(waves, done, done + share)
            candidate = rk4(s, state, part, share * dt)
            g = side * candidate[2] - limit
            if g > 0:
                high, g_high, after = share, g, candidate
                g_low *= 0.5
            else:
                low, g_low = share, g
                g_high *= 0.5
        done += high
        summary[DAMPED_AROUND] += _damped_j(c, state, after, valve, high * dt)
        x, v, _h, w = after
        roll_inertia = c.inertia + c.inertia_h2 * limit * limit
        rebound = -c.restitution * w
        if (c.restitution < 1 and abs(rebound) < REST_M_S) or strike == STRIKES_PER_STEP:
            rebound = 0.0
        jump = rebound - w
        roll_jump = -c.coupling / roll_inertia * jump
        stop_impulse = (c.level_inertia - c.coupling * c.coupling / roll_inertia) * jump
        number = int(summary[STRIKES])
        if number < impacts.shape[0]:
            impacts[number, 0] = time + done * dt
            impacts[number, 1] = side * limit
            impacts[number, 2] = w
            impacts[number, 3] = c.ship_inertia * roll_jump
            impacts[number, 4] = stop_impulse
        summary[STRIKES] += 1
        summary[STRIKE_LOSS] -= stop_impulse * (w + rebound) / 2
        summary[MAX_IMPULSE] = max(summary[MAX_IMPULSE], abs(c.ship_inertia * roll_jump))
        # At rest exactly on the limit, where `accelerations` holds it, or just inside, so that the
        # next impact is a change of sign.
        h = side * (limit if rebound == 0.0 else limit - INSIDE_M)
        state = (x, v + roll_jump, h, rebound)
    part, left = _part_of(waves, done, 1.0), 1.0 - done
    x, v, h, w = rk4(s, state, part, left * dt)
    return x, v, math.copysign(min(abs(h), limit), h), w
