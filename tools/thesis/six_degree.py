"""A ship with tank in six degrees of freedom, in Fossen's vector form.

With eta the earth position of the centre of gravity and the Euler angles, nu = (u, v, w, p, q, r)::

    eta' = J(eta) nu
    M nu' + C(nu) nu + D nu + g(eta) = tau + tank(nu', h'')
    rho residual(nu', h'') = P - (c1 + c2 |h'|) h'

M is the mass matrix with added mass, C follows from M (nu' C nu = 0), and g from a potential::

    V = 1/2 k_z z^2 + k_zt z theta + 1/2 k_t theta^2 + V_roll(phi)

and from the buoyancy for the weight of the tank water, upward at the tank's station, so that the
upright ship is in equilibrium. Tank force, moment and residual are linear in (nu', h''): a linear
system of seven equations. The limits of the level are not modelled here.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from utank_hil.base.arrays import FloatArray
from utank_hil.dynamics.ship import Restoring, RollShip, restoring
from utank_hil.dynamics.tank import Tank
from utank_hil.dynamics.wrench import gravity_body, tank_wrench, water_moments

Matrix6 = tuple[tuple[float, ...], ...]
ZERO6: Matrix6 = ((0.0,) * 6,) * 6
MOTIONS = ("surge", "sway", "heave", "roll", "pitch", "yaw")


@dataclass(frozen=True, slots=True)
class SixDegreeShip:
    """A rigid ship with linear hydrodynamics, without its tank water.

    ValueError is raised if a matrix has the wrong shape or symmetry, or the mass matrix is not
    positive definite.
    """

    roll: RollShip  #: Ship in roll; its inertia includes ``added_mass[3][3]``.
    mass_kg: float
    pitch_inertia_kg_m2: float  #: Inertias about the centre of gravity, without added mass.
    yaw_inertia_kg_m2: float  #: Inertias about the centre of gravity, without added mass.
    product_xz_kg_m2: float = 0.0  #: Product of inertia, the integral of x z dm.
    added_mass: Matrix6 = ZERO6  #: Added mass about the centre of gravity, symmetric, SI units.
    #: Linear damping in SI units; ``[3][3]`` must be zero, because `roll` has the roll damping.
    damping: Matrix6 = ZERO6
    heave_stiffness_n_m: float = 0.0  #: Hydrostatic stiffnesses k_z, k_zt, k_t.
    heave_pitch_n: float = 0.0  #: Hydrostatic stiffnesses k_z, k_zt, k_t.
    pitch_stiffness_nm_rad: float = 0.0  #: Hydrostatic stiffnesses k_z, k_zt, k_t.

    def __post_init__(self) -> None:
        for name in ("added_mass", "damping"):
            matrix = np.array(getattr(self, name), dtype=np.float64)
            if matrix.shape != (6, 6) or not np.all(np.isfinite(matrix)):
                raise ValueError(f"ship {name} must hold 6 x 6 finite numbers")
        if not np.array_equal(np.array(self.added_mass), np.transpose(self.added_mass)):
            raise ValueError("ship added_mass must be symmetric")
        if self.damping[3][3] != 0:
            raise ValueError("ship damping[3][3] must be zero: give roll damping in `roll`")
        if not np.linalg.eigvalsh(self.mass_matrix()).min() > 0:
            raise ValueError("ship mass matrix, added mass included, must be positive definite")

    def mass_matrix(self) -> FloatArray:
        """Rigid and added mass about the centre of gravity, shape (6, 6)."""
        matrix = np.array(self.added_mass, dtype=np.float64)
        matrix[:3, :3] += self.mass_kg * np.eye(3)
        matrix[3, 3] = self.roll.inertia_kg_m2
        matrix[4, 4] += self.pitch_inertia_kg_m2
        matrix[5, 5] += self.yaw_inertia_kg_m2
        matrix[3, 5] -= self.product_xz_kg_m2
        matrix[5, 3] -= self.product_xz_kg_m2
        return matrix


@dataclass(frozen=True, slots=True)
class SixDegreeModel:
    """Ship and tank in six degrees of freedom.

    The state, shape (14,), is the earth position (x, y, z), the Euler angles (roll, pitch, yaw),
    the body velocities (u, v, w, p, q, r), the level and its rate. Motions outside of `free`, a
    subset of `MOTIONS`, are constrained to rest; ValueError is raised for an unknown one.
    """

    ship: SixDegreeShip
    tank: Tank
    free: tuple[str, ...] = MOTIONS
    _mass: FloatArray = field(init=False, repr=False, compare=False)
    _damping: FloatArray = field(init=False, repr=False, compare=False)
    _restoring: Restoring = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        unknown = set(self.free) - set(MOTIONS)
        if unknown:
            raise ValueError(f"unknown motions {sorted(unknown)}; known are {MOTIONS}")
        object.__setattr__(self, "_mass", self.ship.mass_matrix())
        object.__setattr__(self, "_damping", np.array(self.ship.damping, dtype=np.float64))
        object.__setattr__(self, "_restoring", restoring(self.ship.roll))

    def derivative(
        self, state: FloatArray, pressure_pa: float = 0.0, force: FloatArray | None = None
    ) -> FloatArray:
        """Return the time derivative of the state, shape (14,).

        `force`, shape (6,), is an external force and moment in body axes, as from waves.
        """
        angles, nu, level, speed = state[3:6], state[6:12], state[12], state[13]
        tank = self.tank
        water = water_moments(tank, level)
        zero = np.zeros(3)
        tank_force, tank_moment, residual = tank_wrench(
            tank, level, speed, 0.0, nu[:3], nu[3:], zero, zero, angles[0], angles[1]
        )
        loads = self._hull_loads(state)
        loads[:3] += tank_force
        loads[3:] += tank_moment
        if force is not None:
            loads += force
        area = tank.reservoir_area_m2
        loss = tank.loss_pa_per_m_s + tank.quadratic_loss_pa_per_m2_s2 * abs(speed)
        level_force = area * (pressure_pa - loss * speed - tank.density_kg_m3 * float(residual))

        matrix = np.zeros((7, 7))
        matrix[:6, :6] = self._mass
        matrix[:3, :3] += water.mass_kg * np.eye(3)
        matrix[:3, 3:6] -= _skew(water.first_kgm)
        matrix[3:6, :3] += _skew(water.first_kgm)
        matrix[3:6, 3:6] += water.inertia_kgm2
        matrix[:3, 6] = matrix[6, :3] = water.first_slope_kg
        matrix[3:6, 6] = matrix[6, 3:6] = water.swirl_kgm
        matrix[6, 6] = tank.density_kg_m3 * area * tank.effective_length_m
        moving = [*(MOTIONS.index(name) for name in self.free), 6]
        solved = np.zeros(7)
        solved[moving] = np.linalg.solve(
            matrix[np.ix_(moving, moving)], np.append(loads, level_force)[moving]
        )
        out = np.empty(14)
        out[:3] = body_to_earth(*angles) @ nu[:3]
        out[3:6] = euler_rates(angles[0], angles[1]) @ nu[3:]
        out[6:12] = solved[:6]
        out[12], out[13] = speed, solved[6]
        return out

    def _hull_loads(self, state: FloatArray) -> FloatArray:
        """Return hull forces and moments in body axes, without inertia and tank, shape (6,)."""
        ship, roll = self.ship, self.ship.roll
        z, angles, nu = state[2], state[3:6], state[6:12]
        rotation = body_to_earth(*angles)
        momentum = self._mass @ nu
        damping = self._damping @ nu
        damping[3] += (roll.damping_nms_rad + roll.quadratic_damping_nms2_rad2 * abs(nu[3])) * nu[3]
        # Generalized forces on the Euler angles are minus the gradient of the potential.
        heeling = roll.offset_moment_nm * np.cos(angles[0]) + roll.wind_moment_nm
        generalized = np.array(
            [
                heeling - float(self._restoring.moment_nm(angles[0])),
                -ship.pitch_stiffness_nm_rad * angles[1] - ship.heave_pitch_n * z,
                0.0,
            ]
        )
        heave = -ship.heave_stiffness_n_m * z - ship.heave_pitch_n * angles[1]
        buoyancy = -water_moments(self.tank, 0.0).mass_kg * gravity_body(angles[0], angles[1])
        loads = np.empty(6)
        loads[:3] = rotation.T @ np.array([0.0, 0.0, heave]) + buoyancy
        loads[3:] = euler_rates(angles[0], angles[1]).T @ generalized
        loads[3:] += np.cross([self.tank.lx_m, 0.0, 0.0], buoyancy)
        # The Coriolis and centripetal forces are C(nu) nu.
        loads[:3] -= np.cross(nu[3:], momentum[:3])
        loads[3:] -= np.cross(nu[:3], momentum[:3]) + np.cross(nu[3:], momentum[3:])
        return loads - damping


def simulate_six_degree(
    model: SixDegreeModel,
    duration_s: float,
    initial: FloatArray,
    *,
    pressure_pa: Callable[[float], float] = lambda _: 0.0,
    force: Callable[[float], FloatArray] = lambda _: np.zeros(6),
    samples: int = 1001,
    tolerance: float = 1e-10,
) -> tuple[FloatArray, FloatArray]:
    """Integrate with Dormand-Prince 8(5,3) from `initial`, shape (14,).

    RuntimeError is raised if the integrator fails.

    Parameters
    ----------
    pressure_pa, force : callable
        Functions of time in s; `force` is in body axes, shape (6,).
    samples, tolerance
        Output times and tolerance as in `simulate_reference`.

    Returns
    -------
    time_s : ndarray, shape (samples,)
    state : ndarray, shape (samples, 14)
    """
    from scipy.integrate import solve_ivp

    time = np.linspace(0.0, duration_s, samples)
    run = solve_ivp(
        lambda t, x: model.derivative(x, pressure_pa(t), force(t)),
        (0.0, duration_s),
        initial,
        "DOP853",
        t_eval=time,
        rtol=tolerance,
        atol=tolerance / 100,
    )
    if not run.success:
        raise RuntimeError(f"integration stopped at {run.t[-1]:.3f} s: {run.message}")
    return time, np.asarray(run.y.T, dtype=np.float64)


def _skew(vector: FloatArray) -> FloatArray:
    """Cross-product matrix of a vector."""
    x, y, z = vector
    return np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])


def body_to_earth(roll_rad: float, pitch_rad: float, yaw_rad: float) -> FloatArray:
    """Rotation matrix, shape (3, 3): earth components of a vector given in body axes.

    Euler angles are in the order of Fossen: earth to body by yaw, then pitch, then roll (thesis
    (2.5 ff.), corrected).
    """
    sf, cf = math.sin(roll_rad), math.cos(roll_rad)
    st, ct = math.sin(pitch_rad), math.cos(pitch_rad)
    sp, cp = math.sin(yaw_rad), math.cos(yaw_rad)
    return np.array(
        [
            [cp * ct, cp * st * sf - sp * cf, sp * sf + cp * cf * st],
            [sp * ct, cp * cf + sp * st * sf, sp * st * cf - cp * sf],
            [-st, ct * sf, ct * cf],
        ]
    )


def euler_rates(roll_rad: float, pitch_rad: float) -> FloatArray:
    """Matrix, shape (3, 3), from body rates (p, q, r) to rates of (roll, pitch, yaw).

    ValueError is raised at a pitch of 90 degrees, where Euler angles are singular.
    """
    sf, cf = math.sin(roll_rad), math.cos(roll_rad)
    ct, tt = math.cos(pitch_rad), math.tan(pitch_rad)
    if abs(ct) < 1e-9:
        raise ValueError(f"Euler angles are singular at a pitch of {pitch_rad} rad")
    return np.array([[1.0, sf * tt, cf * tt], [0.0, cf, -sf], [0.0, sf / ct, cf / ct]])
