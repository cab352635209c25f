"""Compiled integration of `LateralModel`; imports numba, so import it late.

The state is roll, its rate, level, its rate, sway, its velocity, yaw, its rate, and position and
velocity of each oscillator of the radiated waves; in six degrees surge, heave, pitch, their
velocities and their own oscillators follow. The method is the classical Runge-Kutta of order four.
A step in which the level passes its limit ends at the impact, found by the Illinois method;
all velocities jump by the mass matrix, and the rest of the step follows.
"""

import math
from typing import NamedTuple

from utank_hil.base.arrays import FloatArray
from utank_hil.dynamics.jit import njit
from utank_hil.dynamics.kernels import righting_moment, sine_cosine, within
from utank_hil.dynamics.nonlinear import INSIDE_M, REST_M_S
from utank_hil.dynamics.tank import GRAVITY_M_S2
from utank_hil.dynamics.valves import LOCKED

ROLL, ROLL_RATE, LEVEL, LEVEL_RATE, SWAY, SWAY_RATE, YAW, YAW_RATE, WAVES = range(9)
# Rows of the mass matrix; without surge, heave and pitch the first three are not used.
M_HEAVE, M_PITCH, M_SWAY, M_ROLL, M_YAW, M_LEVEL = range(1, 7)
# Work and losses of a step in J, the impulses of impacts on the ship, and their number.
WAVE_WORK, PUMP_WORK, DAMPED, STRUCK, IMPULSE, NUMBER = range(6)
BOOKS = 6
G = GRAVITY_M_S2


class Step(NamedTuple):
    """What a step needs: the parameters of `LateralModel`, the valve, and room to work in."""

    p: FloatArray
    oscillators: FloatArray
    vertical: FloatArray
    per_piece: float
    restoring: FloatArray
    valve: float  #: Its loss times the reservoir area.
    m: FloatArray  #: shape (7, 7)
    q: FloatArray  #: shape (7,)
    part: FloatArray  #: shape (3, 5 or 8): forces at start, middle and end of a part of the step.
    room: FloatArray  #: shape (3, n): the last row is the state after the part.


@njit(error_model="numpy")
def mass_matrix(p: FloatArray, phi: float, h: float, six: bool, m: FloatArray) -> None:
    """Write the mass matrix of (surge, heave, pitch, sway, roll, yaw, level) to `m`, (7, 7).

    It is the upper half, from the row of sway on where there are not `six` degrees.
    """
    sin, cos = sine_cosine(phi)
    flow, across, lx = p[12], p[12] * p[13], p[11]
    side, down = across * h, p[14] - flow * h * h
    lever = -(down * cos + side * sin)
    depth = p[16] + p[7] * h * h
    m[3, 3] = p[0] + p[10]
    m[3, 4] = p[1] + lever
    m[3, 5] = p[2] + p[10] * lx
    m[3, 6] = across * cos + 2 * flow * h * sin
    m[4, 4] = p[3] + p[6] + p[7] * h * h
    m[4, 5] = p[4] + lx * lever
    m[4, 6] = p[8]
    m[5, 5] = (
        p[5] + p[10] * lx * lx + depth * sin * sin + 2 * across * p[15] * h * sin * cos
        + p[17] * cos * cos
    )  # fmt: skip
    m[5, 6] = lx * m[3, 6]
    m[6, 6] = p[9]
    if not six:
        return
    at = 27
    for i in range(3):
        for j in range(i, 3):
            m[i, j] = p[at]
            at += 1
        for j in range(3, 7):
            m[i, j] = 0.0
    m[1, 4] = side * cos - down * sin
    m[1, 6] = across * sin - 2 * flow * h * cos
    m[2, 4], m[2, 6] = -lx * m[1, 4], -lx * m[1, 6]


@njit(error_model="numpy")
def _solve(m: FloatArray, x: FloatArray, first: int, end: int) -> None:
    """Solve the symmetric equations `first` to `end` in place; `m` holds the upper half."""
    for i in range(first, end):
        for k in range(i + 1, end):
            share = m[i, k] / m[i, i]
            for j in range(k, end):
                m[k, j] -= share * m[i, j]
            x[k] -= share * x[i]
    for i in range(end - 1, first - 1, -1):
        for j in range(i + 1, end):
            x[i] -= m[i, j] * x[j]
        x[i] /= m[i, i]


@njit(error_model="numpy")
def _radiate(
    oscillators: FloatArray, x: FloatArray, at: int, v: tuple[float, float, float],
    q: FloatArray, row: int, out: FloatArray,
) -> None:  # fmt: skip
    """Take the force of radiated waves off three rows of `q`, and write the oscillators' rates.

    Their states begin at `at`; they are driven by the velocities `v`.
    """
    count = len(oscillators)
    lost0, lost1, lost2 = 0.0, 0.0, 0.0
    for j in range(count):
        rate = x[at + count + j]
        lost0 += oscillators[j, 4] * rate
        lost1 += oscillators[j, 5] * rate
        lost2 += oscillators[j, 6] * rate
    for j in range(count):
        place, rate = x[at + j], x[at + count + j]
        b0, b1, b2 = oscillators[j, 0], oscillators[j, 1], oscillators[j, 2]
        q[row] -= b0 * rate
        q[row + 1] -= b1 * rate
        q[row + 2] -= b2 * rate
        out[at + j] = rate
        driven = b0 * v[0] + b1 * v[1] + b2 * v[2]
        lost = oscillators[j, 4] * lost0 + oscillators[j, 5] * lost1 + oscillators[j, 6] * lost2
        out[at + count + j] = driven - lost - oscillators[j, 3] * place


@njit(error_model="numpy")
def _move_up_and_along(s: Step, x: FloatArray, at: int, force: FloatArray, out: FloatArray) -> None:
    """Write the forces of surge, heave and pitch, whose states begin at `at`, to `s.q`."""
    p, q = s.p, s.q
    speeds = (x[at + 3], x[at + 4], x[at + 5])
    for i in range(3):
        out[at + i] = speeds[i]
    x0, x1, x2 = x[at], x[at + 1], x[at + 2]
    # The water's acceleration downwards but for those of roll and level, times its mass.
    sin, cos = sine_cosine(x[ROLL])
    flow, across, h = p[12], p[12] * p[13], x[LEVEL]
    side, down = across * h, p[14] - flow * h * h
    roll, speed = x[ROLL_RATE], x[LEVEL_RATE]
    moved = 2 * s.m[M_SWAY, M_LEVEL] * roll * speed - (side * sin + down * cos) * roll * roll
    moved -= 2 * flow * cos * speed * speed
    q[0] = force[3] - (p[33] * x0 + p[34] * x1 + p[35] * x2)
    q[1] = force[4] - (p[34] * x0 + p[36] * x1 + p[37] * x2) - moved
    q[2] = force[5] - (p[35] * x0 + p[37] * x1 + p[38] * x2) + p[11] * moved
    _radiate(s.vertical, x, at + 6, speeds, q, 0, out)


@njit(error_model="numpy")
def rates(s: Step, x: FloatArray, force: FloatArray, pump: float, out: FloatArray) -> None:
    """Write the rates of the state `x` to `out`.

    `force`, shape (5,) or (8,), is the waves' sway force, roll and yaw moment, then in six degrees
    surge and heave force and pitch moment, the righting moment's change as a share, and the lateral
    acceleration of a turn, which the force on the hull gives the ship; `pump` is the reservoir area
    times pressure.
    """
    p, m, q = s.p, s.m, s.q
    phi, roll, h, speed, sway, yaw = x[0], x[1], x[2], x[3], x[5], x[7]
    sin, cos = sine_cosine(phi)
    flow, across, lx = p[12], p[12] * p[13], p[11]
    side, down = across * h, p[14] - flow * h * h
    change, turn = force[len(force) - 2], force[len(force) - 1]
    righting = (1.0 + change) * righting_moment(s.per_piece, s.restoring, phi)
    at = WAVES + 2 * len(s.oscillators)
    six = len(x) > at
    first = 0 if six else 3
    mass_matrix(p, phi, h, six, m)
    # Derivatives of the mass matrix by roll and level.
    lever_phi = down * sin - side * cos
    lever_h = 2 * flow * h * cos - across * sin
    pull_phi = 2 * flow * h * cos - across * sin
    pull_h = 2 * flow * sin
    depth = p[16] + p[7] * h * h
    spin_phi = 2 * sin * cos * (depth - p[17]) + 2 * across * p[15] * h * (cos * cos - sin * sin)
    spin_h = 2 * p[7] * h * sin * sin + 2 * across * p[15] * sin * cos
    along = sway + lx * yaw  # Yaw moves the tank sideways as sway does.
    # 1/2 u M_q u of roll and level, then the rate of M times u.
    by_phi = along * (lever_phi * roll + pull_phi * speed) + 0.5 * spin_phi * yaw * yaw
    by_h = along * (lever_h * roll + pull_h * speed) + p[7] * h * roll * roll
    by_h += 0.5 * spin_h * yaw * yaw
    lever = lever_phi * roll + lever_h * speed
    pull = pull_phi * roll + pull_h * speed
    moved = lever * roll + pull * speed
    q[3] = force[0] - moved
    q[4] = (
        force[1] + p[21] + p[20] * cos - (p[18] + p[19] * abs(roll)) * roll - righting
        + G * (side * cos - down * sin) + by_phi - lever * along - 2 * p[7] * h * speed * roll
    )  # fmt: skip
    q[5] = force[2] - lx * moved - (spin_phi * roll + spin_h * speed) * yaw
    q[6] = (
        pump - (p[23] + (p[24] + s.valve) * abs(speed)) * speed
        + G * (across * sin - 2 * flow * h * cos) + by_h - pull * along
    )  # fmt: skip
    q[4] += turn * (down * cos + side * sin)  # The water does not turn with the ship by itself.
    q[6] -= turn * m[3, 6]
    _radiate(s.oscillators, x, WAVES, (sway, roll, yaw), q, 3, out)
    if six:
        _move_up_and_along(s, x, at, force, out)
    at_stop = abs(h) >= p[25] and h * speed >= 0
    if s.valve >= LOCKED:
        _solve(m, q, first, 6)
        q[6] = 0.0
    elif at_stop:
        for i in range(first, 7):
            out[i] = q[i]
        _solve(m, q, first, 7)
        if h * q[6] > 0:  # pressed against the stop
            for i in range(first, 7):
                q[i] = out[i]
            mass_matrix(p, phi, h, six, m)
            _solve(m, q, first, 6)
            q[6] = 0.0
    else:
        _solve(m, q, first, 7)
    out[ROLL], out[ROLL_RATE], out[LEVEL], out[LEVEL_RATE] = roll, q[4], speed, q[6]
    out[SWAY], out[SWAY_RATE], out[YAW], out[YAW_RATE] = sway, q[3], yaw, q[5]
    if six:
        for i in range(3):
            out[at + 3 + i] = q[i]


@njit(error_model="numpy")
def _radiated_w(oscillators: FloatArray, x: FloatArray, at: int) -> float:
    """Power that the losses of oscillators take, whose states begin at `at`."""
    power = 0.0
    count = len(oscillators)
    for channel in range(4, 7):
        lost = 0.0
        for j in range(count):
            lost += oscillators[j, channel] * x[at + count + j]
        power += lost * lost
    return power


@njit(error_model="numpy")
def dissipation_w(s: Step, x: FloatArray) -> float:
    """Return the power that roll damping, the tank's losses and radiated waves take."""
    p, roll, speed = s.p, x[ROLL_RATE], x[LEVEL_RATE]
    power = (p[18] + p[19] * abs(roll)) * roll * roll
    power += (p[23] + (p[24] + s.valve) * abs(speed)) * speed * speed
    power += _radiated_w(s.oscillators, x, WAVES)
    at = WAVES + 2 * len(s.oscillators)
    if len(x) > at:
        power += _radiated_w(s.vertical, x, at + 6)
    return float(power)


@njit(error_model="numpy")
def _move(
    s: Step, x: FloatArray, forces: FloatArray, pump: float, begin: float, end: float, dt: float
) -> None:
    """Write the state after a part of the step, of the duration `dt`, and the forces in it.

    `forces`, shape (3, n), are those at start, middle and end of the whole step.
    """
    k, y, after = s.room[0], s.room[1], s.room[2]
    for i in range(forces.shape[1]):
        values = (forces[0, i], forces[1, i], forces[2, i])
        s.part[0, i], s.part[1, i], s.part[2, i] = within(values, begin, end)
    for i in range(len(x)):
        after[i] = x[i]
        y[i] = x[i]
    for stage in range(4):
        rates(s, y, s.part[(stage + 1) // 2], pump, k)
        weight = dt / 3 if 0 < stage < 3 else dt / 6
        ahead = dt if stage == 2 else dt / 2
        for i in range(len(x)):
            after[i] += weight * k[i]
            y[i] = x[i] + ahead * k[i]


@njit(error_model="numpy")
def _move_to_impact(
    s: Step, x: FloatArray, forces: FloatArray, pump: float, done: float, dt: float
) -> float:
    """Move to the impact that the rest of the step brings; return its share of the step."""
    limit, level = s.p[25], s.room[2, LEVEL]
    side = math.copysign(1.0, level)
    low, high = 0.0, 1.0 - done
    g_low, g_high = side * x[LEVEL] - limit, side * level - limit
    for _ in range(60):
        if abs(g_high) < 1e-13 or high - low < 1e-15 or g_low >= 0:
            break
        share = high - g_high * (high - low) / (g_high - g_low)
        _move(s, x, forces, pump, done, done + share, share * dt)
        g = side * s.room[2, LEVEL] - limit
        if g > 0:
            high, g_high = share, g
            g_low *= 0.5
        else:
            low, g_low = share, g
            g_high *= 0.5
    _move(s, x, forces, pump, done, done + high, high * dt)
    return high


@njit(error_model="numpy")
def _sideways(p: FloatArray, phi: float, h: float) -> float:
    """First moment of the water to starboard, in kg m."""
    sin, cos = sine_cosine(phi)
    return float(p[12] * p[13] * h * cos - (p[14] - p[12] * h * h) * sin)


@njit(error_model="numpy")
def _book(s: Step, x: FloatArray, pump: float, share: float, dt: float, books: FloatArray) -> None:
    """Add the work and the losses from `x` to the state after a part of the step."""
    part, after = s.part, s.room[2]
    change, turn = part.shape[1] - 2, part.shape[1] - 1
    at = WAVES + 2 * len(s.oscillators)
    for i, place in enumerate((SWAY, ROLL, YAW)):
        work = 0.5 * (part[0, i] + part[2, i]) * (after[place] - x[place])
        books[WAVE_WORK] += work
    for i in range(3, change):
        work = 0.5 * (part[0, i] + part[2, i]) * (after[at + i - 3] - x[at + i - 3])
        books[WAVE_WORK] += work
    if part[0, change] != 0 or part[2, change] != 0:
        righting = righting_moment(s.per_piece, s.restoring, 0.5 * (x[ROLL] + after[ROLL]))
        work = 0.5 * (part[0, change] + part[2, change]) * righting * (after[ROLL] - x[ROLL])
        books[WAVE_WORK] -= work
    moved = _sideways(s.p, after[ROLL], after[LEVEL]) - _sideways(s.p, x[ROLL], x[LEVEL])
    books[WAVE_WORK] -= 0.5 * (part[0, turn] + part[2, turn]) * moved
    books[PUMP_WORK] += pump * (after[LEVEL] - x[LEVEL])
    lost = dissipation_w(s, x)
    lost += dissipation_w(s, after)
    books[DAMPED] += lost / 2 * share * dt


@njit(error_model="numpy")
def _rebound(s: Step, x: FloatArray, side: float, books: FloatArray) -> None:
    """Let the water rebound from its limit on a side, with a jump of all velocities."""
    p, m, q, column = s.p, s.m, s.q, s.part[0]
    at = WAVES + 2 * len(s.oscillators)
    six = len(x) > at
    first = 0 if six else 3
    speed = x[LEVEL_RATE]
    rebound = -p[26] * speed
    if p[26] < 1 and abs(rebound) < REST_M_S:
        rebound = 0.0
    jump = rebound - speed
    mass_matrix(p, x[ROLL], x[LEVEL], six, m)
    impulse = m[M_LEVEL, M_LEVEL] * jump
    for i in range(first, M_LEVEL):
        q[i] = -m[i, M_LEVEL] * jump
        column[i - first] = m[i, M_LEVEL]  # `_solve` changes the matrix
    _solve(m, q, first, M_LEVEL)
    for i in range(first, M_LEVEL):
        impulse += column[i - first] * q[i]
    x[SWAY_RATE] += q[M_SWAY]
    x[ROLL_RATE] += q[M_ROLL]
    x[YAW_RATE] += q[M_YAW]
    if six:
        for i in range(3):
            x[at + 3 + i] += q[i]
    x[LEVEL_RATE] = rebound
    x[LEVEL] = side * (p[25] if rebound == 0.0 else p[25] - INSIDE_M)
    books[STRUCK] -= impulse * (speed + rebound) / 2
    books[IMPULSE] = max(books[IMPULSE], abs(p[3] * q[M_ROLL]))
    books[NUMBER] += 1


@njit(error_model="numpy")
def advance(
    s: Step, x: FloatArray, forces: FloatArray, pump: float, dt: float, books: FloatArray
) -> None:
    """Advance the state `x` by a step, in place, and add to `books`.

    `forces`, shape (3, 5) or (3, 8), are those of `rates` at start, middle and end of the step.
    """
    limit, done, after = s.p[25], 0.0, s.room[2]
    for strike in range(9):
        left = 1.0 - done
        _move(s, x, forces, pump, done, 1.0, left * dt)
        side = math.copysign(1.0, after[LEVEL])
        struck = abs(after[LEVEL]) > limit
        if struck and strike == 8:
            after[LEVEL] = side * limit
            struck = False
        if struck:
            left = _move_to_impact(s, x, forces, pump, done, dt)
        _book(s, x, pump, left, dt, books)
        for i in range(len(x)):
            x[i] = after[i]
        if not struck:
            return
        done += left
        _rebound(s, x, side, books)
