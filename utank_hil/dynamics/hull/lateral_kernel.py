"""Compiled integration of `LateralModel`; imports numba, so import it late.

The state is roll, its rate, level, its rate, sway, its velocity, yaw, its rate, and position and
velocity of each oscillator of the radiated waves. The method is the classical Runge-Kutta of order
four. A step in which the level passes its limit ends at the impact, found by the Illinois method;
all velocities jump by the mass matrix, and the rest of the step follows.
"""

import math

from utank_hil.base.arrays import FloatArray
from utank_hil.dynamics.jit import njit
from utank_hil.dynamics.kernels import righting_moment, sine_cosine, within
from utank_hil.dynamics.nonlinear import INSIDE_M, REST_M_S
from utank_hil.dynamics.tank import GRAVITY_M_S2

ROLL, ROLL_RATE, LEVEL, LEVEL_RATE, SWAY, SWAY_RATE, YAW, YAW_RATE, WAVES = range(9)
# Work and losses of a step in J, the impulses of impacts on the ship, and their number.
WAVE_WORK, PUMP_WORK, DAMPED, STRUCK, IMPULSE, NUMBER = range(6)
BOOKS = 6
G = GRAVITY_M_S2


@njit(error_model="numpy")
def mass_matrix(p: FloatArray, phi: float, h: float, m: FloatArray) -> None:
    """Write the mass matrix of (sway, roll, yaw, level) to `m` (4, 4), its upper half."""
    sin, cos = sine_cosine(phi)
    flow, across, lx = p[12], p[12] * p[13], p[11]
    side, down = across * h, p[14] - flow * h * h
    lever = -(down * cos + side * sin)
    depth = p[16] + p[7] * h * h
    m[0, 0] = p[0] + p[10]
    m[0, 1] = p[1] + lever
    m[0, 2] = p[2] + p[10] * lx
    m[0, 3] = across * cos + 2 * flow * h * sin
    m[1, 1] = p[3] + p[6] + p[7] * h * h
    m[1, 2] = p[4] + lx * lever
    m[1, 3] = p[8]
    m[2, 2] = (
        p[5] + p[10] * lx * lx + depth * sin * sin + 2 * across * p[15] * h * sin * cos
        + p[17] * cos * cos
    )  # fmt: skip
    m[2, 3] = lx * m[0, 3]
    m[3, 3] = p[9]


@njit(error_model="numpy")
def _solve(m: FloatArray, x: FloatArray, count: int) -> None:
    """Solve the first `count` symmetric equations in place; `m` holds the upper half."""
    for i in range(count):
        for k in range(i + 1, count):
            share = m[i, k] / m[i, i]
            for j in range(k, count):
                m[k, j] -= share * m[i, j]
            x[k] -= share * x[i]
    for i in range(count - 1, -1, -1):
        for j in range(i + 1, count):
            x[i] -= m[i, j] * x[j]
        x[i] /= m[i, i]


@njit(error_model="numpy")
def rates(
    p: FloatArray,
    oscillators: FloatArray,
    per_piece: float,
    restoring: FloatArray,
    x: FloatArray,
    force: FloatArray,
    pump: float,
    valve: float,
    m: FloatArray,
    q: FloatArray,
    out: FloatArray,
) -> None:
    """Write the rates of the state `x` to `out`.

    `force`, shape (3,), is the waves' sway force, roll and yaw moment; `pump` and `valve` are the
    reservoir area times pressure, and times valve loss; `m`, shape (4, 4), and `q`, shape (4,), are
    room to work in.
    """
    phi, roll, h, speed, sway, yaw = x[0], x[1], x[2], x[3], x[5], x[7]
    sin, cos = sine_cosine(phi)
    flow, across, lx = p[12], p[12] * p[13], p[11]
    side, down = across * h, p[14] - flow * h * h
    righting = righting_moment(per_piece, restoring, phi)
    mass_matrix(p, phi, h, m)
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
    q[0] = force[0] - moved
    q[1] = (
        force[1] + p[21] + p[20] * cos - (p[18] + p[19] * abs(roll)) * roll - righting
        + G * (side * cos - down * sin) + by_phi - lever * along - 2 * p[7] * h * speed * roll
    )  # fmt: skip
    q[2] = force[2] - lx * moved - (spin_phi * roll + spin_h * speed) * yaw
    q[3] = (
        pump - (p[23] + (p[24] + valve) * abs(speed)) * speed
        + G * (across * sin - 2 * flow * h * cos) + by_h - pull * along
    )  # fmt: skip
    count = len(oscillators)
    lost0, lost1, lost2 = 0.0, 0.0, 0.0
    for j in range(count):
        rate = x[WAVES + count + j]
        lost0 += oscillators[j, 4] * rate
        lost1 += oscillators[j, 5] * rate
        lost2 += oscillators[j, 6] * rate
    for j in range(count):
        place, rate = x[WAVES + j], x[WAVES + count + j]
        b0, b1, b2 = oscillators[j, 0], oscillators[j, 1], oscillators[j, 2]
        q[0] -= b0 * rate
        q[1] -= b1 * rate
        q[2] -= b2 * rate
        out[WAVES + j] = rate
        driven = b0 * sway + b1 * roll + b2 * yaw
        lost = oscillators[j, 4] * lost0 + oscillators[j, 5] * lost1 + oscillators[j, 6] * lost2
        out[WAVES + count + j] = driven - lost - oscillators[j, 3] * place
    at_stop = abs(h) >= p[25] and h * speed >= 0
    level_force = q[3]
    if at_stop:
        q0, q1, q2 = q[0], q[1], q[2]
        _solve(m, q, 4)
        if h * q[3] > 0:  # pressed against the stop
            q[0], q[1], q[2], q[3] = q0, q1, q2, level_force
            mass_matrix(p, phi, h, m)
            _solve(m, q, 3)
            q[3] = 0.0
    else:
        _solve(m, q, 4)
    out[ROLL], out[ROLL_RATE], out[LEVEL], out[LEVEL_RATE] = roll, q[1], speed, q[3]
    out[SWAY], out[SWAY_RATE], out[YAW], out[YAW_RATE] = sway, q[0], yaw, q[2]


@njit(error_model="numpy")
def dissipation_w(p: FloatArray, oscillators: FloatArray, x: FloatArray, valve: float) -> float:
    """Return the power that roll damping, the tank's losses and radiated waves take."""
    roll, speed = x[ROLL_RATE], x[LEVEL_RATE]
    power = (p[18] + p[19] * abs(roll)) * roll * roll
    power += (p[23] + (p[24] + valve) * abs(speed)) * speed * speed
    count = len(oscillators)
    for channel in range(4, 7):
        lost = 0.0
        for j in range(count):
            lost += oscillators[j, channel] * x[WAVES + count + j]
        power += lost * lost
    return float(power)


@njit(error_model="numpy")
def _rk4(
    p: FloatArray,
    oscillators: FloatArray,
    per_piece: float,
    restoring: FloatArray,
    x: FloatArray,
    forces: FloatArray,
    pump: float,
    valve: float,
    dt: float,
    room: FloatArray,
    m: FloatArray,
    q: FloatArray,
    after: FloatArray,
) -> None:
    """Write the state after a step to `after`; `forces` (3, 3) are at start, middle and end."""
    count = len(x)
    k, y = room[0], room[1]
    for i in range(count):
        after[i] = x[i]
        y[i] = x[i]
    for stage in range(4):
        rates(
            p, oscillators, per_piece, restoring, y, forces[(stage + 1) // 2], pump, valve, m, q, k
        )
        weight = dt / 3 if 0 < stage < 3 else dt / 6
        ahead = dt if stage == 2 else dt / 2
        for i in range(count):
            after[i] += weight * k[i]
            y[i] = x[i] + ahead * k[i]


@njit(error_model="numpy")
def _within(forces: FloatArray, begin: float, end: float, part: FloatArray) -> None:
    """Interpolate forces at start, middle and end of a part of the step, quadratically."""
    for i in range(3):
        values = (forces[0, i], forces[1, i], forces[2, i])
        part[0, i], part[1, i], part[2, i] = within(values, begin, end)


@njit(error_model="numpy")
def advance(
    p: FloatArray,
    oscillators: FloatArray,
    per_piece: float,
    restoring: FloatArray,
    x: FloatArray,
    forces: FloatArray,
    pump: float,
    valve: float,
    dt: float,
    books: FloatArray,
    room: FloatArray,
) -> None:
    """Advance the state `x` by a step, in place, and add to `books`.

    The parameters are those of `LateralModel`. `forces`, shape (3, 3), are the waves' at start,
    middle and end of the step; `room`, shape (4, n), has n of at least the length of `x` and 29.
    """
    count = len(x)
    after = room[2, :count]
    m, q, part = room[3, :16].reshape(4, 4), room[3, 16:20], room[3, 20:29].reshape(3, 3)
    limit, done = p[25], 0.0
    for strike in range(9):
        left = 1.0 - done
        _within(forces, done, 1.0, part)
        _rk4(p, oscillators, per_piece, restoring, x, part, pump, valve, left * dt,
             room, m, q, after)  # fmt: skip
        struck = abs(after[LEVEL]) > limit
        if struck and strike == 8:
            after[LEVEL] = math.copysign(limit, after[LEVEL])
            struck = False
        if struck:
            side = math.copysign(1.0, after[LEVEL])
            low, high = 0.0, left
            g_low, g_high = side * x[LEVEL] - limit, side * after[LEVEL] - limit
            for _ in range(60):
                if abs(g_high) < 1e-13 or high - low < 1e-15 or g_low >= 0:
                    break
                s = high - g_high * (high - low) / (g_high - g_low)
                _within(forces, done, done + s, part)
                _rk4(p, oscillators, per_piece, restoring, x, part, pump, valve, s * dt,
                     room, m, q, after)  # fmt: skip
                g = side * after[LEVEL] - limit
                if g > 0:
                    high, g_high = s, g
                    g_low *= 0.5
                else:
                    low, g_low = s, g
                    g_high *= 0.5
            left = high
            _within(forces, done, done + left, part)
            _rk4(p, oscillators, per_piece, restoring, x, part, pump, valve, left * dt,
                 room, m, q, after)  # fmt: skip
        for i, place in enumerate((SWAY, ROLL, YAW)):
            work = 0.5 * (part[0, i] + part[2, i]) * (after[place] - x[place])
            books[WAVE_WORK] += work
        books[PUMP_WORK] += pump * (after[LEVEL] - x[LEVEL])
        lost = dissipation_w(p, oscillators, x, valve) + dissipation_w(p, oscillators, after, valve)
        books[DAMPED] += lost / 2 * left * dt
        for i in range(count):
            x[i] = after[i]
        if not struck:
            return
        done += left
        speed = x[LEVEL_RATE]
        rebound = -p[26] * speed
        if p[26] < 1 and abs(rebound) < REST_M_S:
            rebound = 0.0
        jump = rebound - speed
        mass_matrix(p, x[ROLL], x[LEVEL], m)
        for i in range(3):
            q[i] = -m[i, 3] * jump
        impulse = m[3, 3] * jump
        pulls = (m[0, 3], m[1, 3], m[2, 3])
        inertia = p[3]
        _solve(m, q, 3)
        for i in range(3):
            impulse += pulls[i] * q[i]
        x[SWAY_RATE] += q[0]
        x[ROLL_RATE] += q[1]
        x[YAW_RATE] += q[2]
        x[LEVEL_RATE] = rebound
        x[LEVEL] = side * (limit if rebound == 0.0 else limit - INSIDE_M)
        books[STRUCK] -= impulse * (speed + rebound) / 2
        books[IMPULSE] = max(books[IMPULSE], abs(inertia * q[1]))
        books[NUMBER] += 1
