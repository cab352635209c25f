"""Adaptive high-order integration of the nonlinear coupled model, for verification.

Dormand-Prince 8(5,3) integrates between events. Every impact at a limit of the level is located to
rounding error and its impulse is applied. Water at rest on a limit leaves it when its acceleration
turns inward.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from tools.thesis.simulate import Impact, RollRun
from utank_hil.base.arrays import FloatArray
from utank_hil.dynamics.nonlinear import INSIDE_M, REST_M_S, RollModel


@dataclass(frozen=True, slots=True)
class _Event:
    """Terminal event in scipy's form: a function with attributes."""

    value: Callable[[float, FloatArray], float]
    direction: int
    terminal: bool = True

    def __call__(self, t: float, x: FloatArray) -> float:
        return self.value(t, x)


def simulate_reference(
    model: RollModel,
    duration_s: float,
    initial: tuple[float, float, float, float] | FloatArray,
    *,
    pressure_pa: Callable[[float], float] = lambda _: 0.0,
    wave_moment_nm: Callable[[float], float] = lambda _: 0.0,
    samples: int = 1001,
    tolerance: float = 1e-12,
    capsize_rad: float = np.pi,
) -> RollRun:
    """Integrate nearly to rounding error; raises RuntimeError if the integrator fails.

    Parameters
    ----------
    pressure_pa, wave_moment_nm : callable
        Smooth functions of time in s.
    samples : int
        Number of equally spaced output times, both ends included.
    tolerance : float
        Relative tolerance; the absolute one is a hundredth of it in SI units.
    capsize_rad : float
        Magnitude of the roll at which the run ends.
    """
    from scipy.integrate import solve_ivp

    c = model.coefficients
    times = np.linspace(0.0, duration_s, samples)
    out = np.full((samples, 4), np.nan)
    time, state = 0.0, np.array(initial, dtype=np.float64)
    stopped = bool(abs(state[2]) >= c.level_limit and state[3] == 0)
    impacts: list[Impact] = []
    capsized_s = np.inf
    filled = 0

    def slope(t: float, x: FloatArray) -> FloatArray:
        return model.derivative(x, pressure_pa(t), wave_moment_nm(t), stopped=stopped)

    def full(_t: float, x: FloatArray) -> float:  # This rises through zero at a limit.
        return float(abs(x[2]) - c.level_limit)

    def pressed(t: float, x: FloatArray) -> float:  # falls through zero at release
        free = model.derivative(x, pressure_pa(t), wave_moment_nm(t))
        return float(free[3] * np.sign(x[2]))

    def capsize(_t: float, x: FloatArray) -> float:
        return float(abs(x[0]) - capsize_rad)

    strike, release, over = _Event(full, 1), _Event(pressed, -1), _Event(capsize, 1)
    while time < duration_s and not np.isfinite(capsized_s):
        if stopped and pressed(time, state) <= 0:
            stopped = False
        run = solve_ivp(
            slope,
            (time, duration_s),
            state,
            "DOP853",
            dense_output=True,
            events=[release if stopped else strike, over],
            rtol=tolerance,
            atol=tolerance / 100,
        )
        if not run.success:
            raise RuntimeError(f"integration stopped at {run.t[-1]:.3f} s: {run.message}")
        end = run.t[-1]
        upto = np.searchsorted(times, end, side="right")
        if upto > filled:
            out[filled:upto] = run.sol(times[filled:upto]).T
            filled = int(upto)
        time, state = float(end), run.y[:, -1].copy()
        if run.t_events[1].size:
            capsized_s = time
        elif run.t_events[0].size and not stopped:
            state[2] = np.copysign(c.level_limit - INSIDE_M, state[2])
            state, impact = after_impact(model, time, state)
            impacts.append(impact)
            if c.restitution < 1 and abs(state[3]) < REST_M_S:
                state[3], stopped = 0.0, True
        elif run.t_events[0].size:
            stopped = False
    return RollRun(times[:filled], out[:filled], tuple(impacts), capsized_s)


def after_impact(model: RollModel, time_s: float, state: FloatArray) -> tuple[FloatArray, Impact]:
    """Return the state after an impact, and the impact.

    The state before, shape (4,), has its level at the limit and moving outward.
    """
    c = model.coefficients
    phi, phi_dot, h, h_dot = (float(x) for x in state)
    roll_inertia = c.inertia + c.inertia_h2 * h * h
    jump = -(1 + c.restitution) * h_dot
    roll_jump = -c.coupling / roll_inertia * jump
    after = np.array([phi, phi_dot + roll_jump, h, h_dot + jump])
    stop_impulse = (c.level_inertia - c.coupling * c.coupling / roll_inertia) * jump
    return after, Impact(time_s, h, h_dot, c.ship_inertia * roll_jump, stop_impulse)
