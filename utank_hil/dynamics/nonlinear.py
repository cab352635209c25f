"""Nonlinear coupled model of roll and tank at any angle, from Lagrange's equations.

With q = (phi, h), kinetic and potential energy::

    T = 1/2 (m0 + m2 h^2) phi'^2 + m_c phi' h' + 1/2 m_h h'^2
    V = V_ship(phi) - g (S_y sin phi + S_z cos phi)

    m0 = I + water at rest    m2 = 2 rho At (H - lz)     m_c = -rho At L (H + lz)
    m_h = rho At (2H + L At/Ap)    S_y = rho At L h      S_z = s0 - rho At h^2

the equations of motion are::

    (m0 + m2 h^2) phi'' + m_c h'' = K_wave + K_wind + K_offset cos phi - (b1 + b2 |phi'|) phi'
        - R(phi) - 2 m2 h h' phi' + g S_y cos phi - g S_z sin phi
    m_c phi'' + m_h h'' = At P - At (c1 + c2 |h'|) h' + m2 h phi'^2
        + rho g At L sin phi - 2 rho g At h cos phi

They replace thesis (4.2)-(4.4), whose printed h phi'^2 and h h' phi' terms violate conservation of
energy.

Where the centre of gravity is accelerated sideways by a, to starboard, gravity in a frame that
moves with it is (-a, g) instead of (0, g). The ship's own weight and buoyancy act in it on the
hull, whose wave moment contains what the waves do; on the water the potential of a is added::

    V_sway = a (S_y cos phi - S_z sin phi)

Water in a ship that lies along the slope s of a long wave, a = g tan s and phi = s, is at rest.

The level is stopped where one reservoir is full or the other one empty. The stop is an impulse J on
the level alone: h' changes to -e h', and the roll rate jumps through the coupling,
d phi' = -m_c / (m0 + m2 h^2) d h'. While the water is pressed against the stop, h'' = 0.
"""

import math
from dataclasses import dataclass, field, replace
from functools import lru_cache
from typing import Any, Final, NamedTuple

import numpy as np
import numpy.typing as npt

from utank_hil.base.arrays import FloatArray
from utank_hil.base.elementary import sines_cosines
from utank_hil.dynamics.ship import Restoring, RollShip, restoring
from utank_hil.dynamics.tank import GRAVITY_M_S2, Tank

REST_M_S = 1e-4  # A slower rebound ends at rest, which bounds the number of bounces.
INSIDE_M = 1e-12  # Distance from the limit after an impact, so that the next is a sign change.


class RollCoefficients(NamedTuple):
    """Coefficients of the equations of motion in SI units; the kernels rely on their order."""

    inertia: float  # m0
    inertia_h2: float  # m2
    coupling: float  # m_c
    level_inertia: float  # m_h
    weight_lever: float  # g s0
    weight_h: float  # rho g At L
    weight_h2: float  # rho g At
    damping: float  # b1
    quadratic_damping: float  # b2
    offset_moment: float
    wind_moment: float
    area: float  # At
    loss: float  # At c1
    quadratic_loss: float  # At c2
    level_limit: float
    restitution: float
    ship_inertia: float  # I, without water


def forces(
    c: RollCoefficients, righting: Any, sin: Any, cos: Any, phi_dot: Any, h: Any, h_dot: Any,
    moment: Any, sway: Any, pump: Any, valve: Any,
) -> tuple[Any, Any, Any]:  # fmt: skip
    """Roll inertia, roll moment and force on the level, of numbers or arrays; kernels compile it.

    `sway` is the centre of gravity's lateral acceleration over g, positive to starboard: to the
    water it turns gravity. `pump` is area times pressure, `valve` area times valve loss.
    """
    roll_inertia = c.inertia + c.inertia_h2 * h * h
    roll_moment = (
        moment
        + c.wind_moment
        + (c.offset_moment + c.weight_h * h) * cos
        - (c.damping + c.quadratic_damping * abs(phi_dot)) * phi_dot
        - righting
        - 2 * c.inertia_h2 * h * h_dot * phi_dot
        - (c.weight_lever - c.weight_h2 * h * h) * sin
        + sway * (c.weight_h * h * sin + (c.weight_lever - c.weight_h2 * h * h) * cos)
    )
    level_force = (
        pump
        - (c.loss + (c.quadratic_loss + valve) * abs(h_dot)) * h_dot
        + c.inertia_h2 * h * phi_dot * phi_dot
        + c.weight_h * sin
        - 2 * c.weight_h2 * h * cos
        - sway * (c.weight_h * cos + 2 * c.weight_h2 * h * sin)
    )
    return roll_inertia, roll_moment, level_force


@dataclass(frozen=True, slots=True)
class RollModel:
    """Ship and tank in roll; states (roll_rad, roll_rate_rad_s, level_m, level_rate_m_s)."""

    ship: RollShip
    tank: Tank
    coefficients: RollCoefficients = field(init=False, repr=False)
    restoring: Restoring = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "coefficients", _coefficients(self.ship, self.tank))
        object.__setattr__(self, "restoring", restoring(self.ship))

    @property
    def packed(self) -> tuple[FloatArray, float, FloatArray]:
        """Coefficients, pieces of the restoring moment per rad, and their coefficients."""
        pieces = self.restoring
        return np.array(self.coefficients), 1 / pieces.piece_rad, pieces.coefficients_nm

    def derivative(
        self,
        state: npt.ArrayLike,
        pressure_pa: npt.ArrayLike = 0.0,
        wave_moment_nm: npt.ArrayLike = 0.0,
        valve_loss_pa_per_m2_s2: npt.ArrayLike = 0.0,
        sway_m_s2: npt.ArrayLike = 0.0,
        *,
        stopped: bool = False,
    ) -> FloatArray:
        """Time derivative of the state, for one state or many.

        The inputs have shape (...): the valve loss is the output of `valves`, the sway the lateral
        acceleration. The level is held if `stopped`, as while the water is pressed against a limit.
        """
        c = self.coefficients
        phi, phi_dot, h, h_dot = np.moveaxis(np.asarray(state, dtype=np.float64), -1, 0)
        sin, cos = sines_cosines(phi)
        sway = np.asarray(sway_m_s2) / GRAVITY_M_S2
        pump = c.area * np.asarray(pressure_pa)
        valve = c.area * np.asarray(valve_loss_pa_per_m2_s2)
        moment, righting = np.asarray(wave_moment_nm), self.restoring.moment_nm(phi)
        roll_inertia, roll_moment, level_force = forces(
            c, righting, sin, cos, phi_dot, h, h_dot, moment, sway, pump, valve
        )
        if stopped:
            phi_ddot, h_ddot = roll_moment / roll_inertia, np.zeros_like(h)
        else:
            determinant = roll_inertia * c.level_inertia - c.coupling * c.coupling
            phi_ddot = (c.level_inertia * roll_moment - c.coupling * level_force) / determinant
            h_ddot = (roll_inertia * level_force - c.coupling * roll_moment) / determinant
        return np.stack(np.broadcast_arrays(phi_dot, phi_ddot, h_dot, h_ddot), axis=-1)


def _coefficients(ship: RollShip, tank: Tank) -> RollCoefficients:
    flow, at = tank.density_kg_m3 * tank.reservoir_area_m2, tank.reservoir_area_m2
    return RollCoefficients(
        inertia=ship.inertia_kg_m2 + sum(tank.water_squares_kg_m2),
        inertia_h2=2 * flow * (tank.height_m - tank.lz_m),
        coupling=tank.swirl_kgm,
        level_inertia=flow * tank.effective_length_m,
        weight_lever=GRAVITY_M_S2 * tank.water_lever_kgm,
        weight_h=GRAVITY_M_S2 * tank.across_kg,
        weight_h2=GRAVITY_M_S2 * flow,
        damping=ship.damping_nms_rad,
        quadratic_damping=ship.quadratic_damping_nms2_rad2,
        offset_moment=ship.offset_moment_nm,
        wind_moment=ship.wind_moment_nm,
        area=at,
        loss=at * tank.loss_pa_per_m_s,
        quadratic_loss=at * tank.quadratic_loss_pa_per_m2_s2,
        level_limit=tank.level_limit_m,
        restitution=tank.restitution,
        ship_inertia=ship.inertia_kg_m2,
    )


_HEELS_RAD: Final = np.radians(np.linspace(0.0, 89.9, 2000))  # The step is 0.05 degrees.
_HALVINGS: Final = 12  # The result is accurate to a four-thousandth of the pressure.


class SteadyHeel(NamedTuple):
    """A ship at rest; `at_the_end` means that a reservoir is full or empty."""

    roll_rad: float
    at_the_end: bool


class RightingRange(NamedTuple):
    """Range of heel in which a ship rights itself with the water at rest in its tank."""

    greatest_rad: float  #: Heel of the greatest righting moment.
    #: Heel from which it capsizes; infinite if there is none up to 90 degrees.
    vanishing_rad: float


@lru_cache(maxsize=16)  # a vessel's checks ask for it several times
def righting_range(model: RollModel) -> RightingRange:
    """Return the righting range of a ship, without its steady moments."""
    push, _ = _at_rest(upright(model), _HEELS_RAD, 0.0)
    over = np.flatnonzero(push[1:] > 0)
    vanishing_rad = float(_HEELS_RAD[1 + over[0]]) if over.size else math.inf
    before = push[: 1 + over[0]] if over.size else push
    return RightingRange(float(_HEELS_RAD[np.argmin(before)]), vanishing_rad)


def greatest_held_pa(model: RollModel, most_pa: float, within_rad: float) -> float:
    """Greatest slowly raised pressure with a heel of `within_rad`, without steady moments."""
    model = upright(model)

    def is_held(pressure_pa: float) -> bool:
        heel = steady_heel(model, pressure_pa)
        return heel is not None and abs(heel.roll_rad) <= within_rad

    if is_held(most_pa):
        return most_pa
    low_pa, high_pa = 0.0, most_pa
    for _ in range(_HALVINGS):
        middle_pa = (low_pa + high_pa) / 2
        if is_held(middle_pa):
            low_pa = middle_pa
        else:
            high_pa = middle_pa
    return low_pa


def steady_heel(model: RollModel, pressure_pa: float = 0.0) -> SteadyHeel | None:
    """Return the rest position on the side of the steady moment; None if the ship capsizes."""
    side = float(np.sign(_at_rest(model, np.zeros(1), pressure_pa)[0][0]))
    if side == 0:
        return SteadyHeel(0.0, False)
    heels = side * _HEELS_RAD
    push, flat_m = _at_rest(model, heels, pressure_pa)
    back = np.flatnonzero(push * side < 0)
    if not back.size:
        return None
    after = int(back[0])
    share = push[after - 1] / (push[after - 1] - push[after])
    roll_rad = heels[after - 1] + share * (heels[after] - heels[after - 1])
    return SteadyHeel(float(roll_rad), bool(abs(flat_m[after]) > model.coefficients.level_limit))


def upright(model: RollModel) -> RollModel:
    """Return a ship without its steady moments."""
    ship = replace(model.ship, offset_moment_nm=0.0, wind_moment_nm=0.0)
    return RollModel(ship, model.tank)


def _at_rest(
    model: RollModel, roll_rad: FloatArray, pressure_pa: float
) -> tuple[FloatArray, FloatArray]:
    """Return the roll acceleration, and the level of the water without limits."""
    c = model.coefficients
    sine, cosine = sines_cosines(roll_rad)
    flat_m = (c.weight_h * sine + c.area * pressure_pa) / (2 * c.weight_h2 * cosine)
    level_m = np.clip(flat_m, -c.level_limit, c.level_limit)
    still = np.zeros_like(roll_rad)
    states = np.stack([roll_rad, still, level_m, still], axis=-1)
    with np.errstate(all="ignore"):  # Levers may overflow.
        return model.derivative(states, pressure_pa, stopped=True)[:, 1], flat_m
