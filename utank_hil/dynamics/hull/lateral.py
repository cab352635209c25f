"""A ship in sway, roll and yaw, or all six degrees, with its tank, from the data of its hull.

Body axes of the project (y to starboard, z down) about the centre of gravity of the ship without
its tank's water. With the velocities u = (sway, roll, yaw, level), mass matrix M(phi, h) of hull
and water, potential V of `utank_hil.dynamics.nonlinear`, oscillators e of the radiated waves with
directions b (`fit_radiation`) and wave forces F, Lagrange's equations are ::

    d/dt (M u)_i = 1/2 u dM/dq_i u - dV/dq_i + F_i - damping_i - (b' e')_i

They are exact in roll and level, and linear in what the hull makes of sway and yaw. What roll,
pump and valve are is that of `RollModel`; its roll equation follows where sway and yaw are held.
The data are those of the ship at rest, at the frequency of encounter.

A hull with port like starboard couples surge, heave and pitch with each other alone. In six degrees
they have equations of the same form, with the restoring matrix of the data. The water is at rest in
them but for its height Z (positive down), which the tank's downward velocity w - lx q meets::

    T has (w - lx q) Z',    Z = S_y sin phi + S_z cos phi

So gravity at the tank is g - w' + lx q', and the water pulls on heave and pitch by -Z''. Left out
is what pitch and surge make of the water's move off its place: second order, and small as they are.
"""

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt

from utank_hil.base.arrays import ComplexArray, FloatArray
from utank_hil.base.parameters import refuse
from utank_hil.dynamics.hull.hull_data import (
    LATERAL,
    TO_BODY_AXES,
    HullData,
    excitation_at,
    free_roll,
    wave_number,
)
from utank_hil.dynamics.hull.radiation import OSCILLATORS, Radiation, fit_radiation
from utank_hil.dynamics.nonlinear import RollModel
from utank_hil.dynamics.ship import RollShip
from utank_hil.dynamics.tank import GRAVITY_M_S2, Tank

_MOST_DRAUGHTS = 3.5
"""Wave number times mean draught up to which radiation is fitted. At 3.5 a wave has 3 % of its
pressure left there; shorter ones don't move a ship, and panel codes have irregular frequencies."""
_LEAST_FREQUENCIES = 8  #: That are fitted, however short their waves.
_MOST_FREQUENCIES = 64  #: In a fit, whose time goes with their number.
VERTICAL = np.array([0, 2, 4])  #: Surge, heave and pitch.
_HEAVE = 2
_MOST_COUPLING = 0.05
"""Of surge, heave and pitch with the others, per root of the diagonals: as asymmetry of meshes."""
_MOST_STIFFNESS_ERROR = 0.05
"""Inclining tests and hydrostatics of a mesh agree within some per cent."""


@dataclass(frozen=True)
class LateralHull:
    """Sway, roll and yaw of a hull: what its data say, and the memory fitted to it."""

    data: HullData  #: Of the ship at rest in deep water, with mass, inertia and centre of gravity.

    @cached_property
    def about_g(self) -> HullData:
        """The data about the centre of gravity."""
        return self.data.about_gravity_centre()

    @property
    def stiffness_nm_rad(self) -> float:
        """Restoring moment per roll angle."""
        return float(self.about_g.known("hydrostatic")[3, 3])

    @cached_property
    def rigid_mass(self) -> FloatArray:
        """Mass matrix, shape (3, 3)."""
        return _part(self.about_g.mass_matrix, LATERAL)

    @cached_property
    def radiation(self) -> Radiation:
        """Fitted radiation force of sway, roll and yaw."""
        return self._fitted(LATERAL, OSCILLATORS)

    @cached_property
    def vertical_radiation(self) -> Radiation:
        """Fitted radiation force of surge, heave and pitch."""
        return self._fitted(VERTICAL, OSCILLATORS + 1)

    def memory_errors(self, *, six: bool) -> dict[str, float]:
        """Return `Radiation.error` of each fit that a plant of three or six degrees uses."""
        errors = {"sway, roll and yaw": self.radiation.error}
        return errors | ({"surge, heave and pitch": self.vertical_radiation.error} if six else {})

    def _fitted(self, degrees: npt.NDArray[np.intp], oscillators: int) -> Radiation:
        hull = self.about_g
        limit = hull.infinite_added_mass
        added, damping = (
            np.array([_part(each, degrees) for each in matrices])
            for matrices in (hull.added_mass, hull.damping)
        )
        known = None if limit is None else _part(limit, degrees)
        omega = hull.frequency_rad_s
        heave_n_m = hull.known("hydrostatic")[_HEAVE, _HEAVE]
        draughts = omega**2 * hull.known("mass_kg") / (heave_n_m if heave_n_m > 0 else math.inf)
        count = max(int(np.sum(draughts <= _MOST_DRAUGHTS)), _LEAST_FREQUENCIES)
        felt = slice(None, count, math.ceil(count / _MOST_FREQUENCIES))
        return fit_radiation(omega[felt], added[felt], damping[felt], known, oscillators)

    def coupling(self) -> float:
        """Greatest mass or stiffness between the lateral degrees and the others.

        It is per root of the diagonals of both; a hull with port like starboard has none.
        """
        hull = self.about_g
        found = 0.0
        for matrix in (*(hull.mass_matrix + hull.added_mass), hull.known("hydrostatic")):
            size = np.sqrt(np.abs(np.diag(matrix)))
            shares = np.abs(matrix) / np.maximum(np.outer(size, size), 1e-300)
            free = np.outer(size, size) > 0
            between = np.ix_(LATERAL, VERTICAL)
            found = max(found, float(np.max(np.where(free, shares, 0.0)[between])))
        return found

    @property
    def radiation_ratio(self) -> float:
        """Damping ratio of free roll by radiation."""
        return free_roll(self.data).radiation_ratio

    def radiated_nms_rad(self) -> float:
        """Linear damping of free roll that radiation accounts for."""
        found = free_roll(self.data)
        stiffness = self.stiffness_nm_rad
        return found.radiation_ratio * stiffness * found.period_s / math.pi

    @property
    def effective_slope(self) -> float:
        """Roll moment of beam waves at the roll frequency, sway and yaw free, per C44 and slope."""
        free = free_roll(self.data)
        omega = 2 * math.pi / free.period_s
        force = free.mode @ excitation_at(self.about_g, omega, 90.0)[LATERAL]
        return float(abs(force)) * GRAVITY_M_S2 / (omega**2 * self.stiffness_nm_rad)

    def ship(self) -> RollShip:
        """Return the ship in roll alone: its free roll, sway and yaw free, with waves' damping.

        To that comes what the data have of viscous damping.
        """
        omega, stiffness = 2 * math.pi / free_roll(self.data).period_s, self.stiffness_nm_rad
        viscous, quadratic = (
            0.0 if each is None else float(np.interp(omega, self.data.frequency_rad_s, each))
            for each in (self.data.viscous_roll_nms_rad, self.data.quadratic_roll_nms2_rad2)
        )
        return RollShip(
            stiffness / omega**2,
            stiffness,
            self.radiated_nms_rad() + viscous,
            quadratic,
            displacement_n=self.data.known("mass_kg") * GRAVITY_M_S2,
        )

    def forces(
        self, omega_rad_s: FloatArray, heading_rad: FloatArray, *, six: bool = False
    ) -> ComplexArray:
        """Return sway force, roll and yaw moment per m of waves, shape (3, N), leads on the crest.

        Those of surge, heave and pitch follow if `six`, shape (6, N). Below the frequencies of the
        data they go with the slope, but heave with the height; above they are zero. The heading
        is the project's: a half pi from port to starboard. ValueError is raised for headings that
        the data do not cover.
        """
        hull = self.about_g
        least, most = hull.wave_frequency_rad_s[[0, -1]]
        forward_m = hull.reference_m[0]
        degrees = np.concatenate([LATERAL, VERTICAL]) if six else LATERAL
        found = np.zeros((len(degrees), len(omega_rad_s)), dtype=np.complex128)
        for n, (omega, heading) in enumerate(
            zip(omega_rad_s, np.broadcast_to(heading_rad, omega_rad_s.shape), strict=True)
        ):
            if omega > most:
                continue
            at = max(float(omega), float(least))
            force = (excitation_at(hull, at, -math.degrees(heading)) * TO_BODY_AXES)[degrees]
            number = wave_number(np.array([omega, at]), hull.water_depth_m, hull.gravity_m_s2)
            force *= np.where(degrees == _HEAVE, 1.0, number[0] / number[1])
            found[:, n] = force * np.exp(1j * number[0] * forward_m * math.cos(heading))
        return found


@dataclass(frozen=True)
class LateralModel:
    """A hull with the roll of a ship and a tank.

    ValueError is raised if the ship's stiffness is not that of the hull, its damping less than
    radiation's, or, in six degrees, the hull's port is not like its starboard.
    """

    hull: LateralHull
    #: Righting moment, heeling moments and damping; of the linear damping, which a decay test
    #: gives, radiation is taken off. Its inertia is the hull's.
    ship: RollShip
    tank: Tank
    six: bool = False  #: Whether surge, heave and pitch are free.

    def __post_init__(self) -> None:
        problems = []
        if self.six and (found := self.hull.coupling()) > _MOST_COUPLING:
            reason = f"couple heave, pitch or surge with roll, sway or yaw by {100 * found:.0f} %"
            reason = f"of {self.hull.data.source} {reason}: take sway_roll_yaw"
            refuse("hull", [("port and starboard", reason)])
        of_hull, of_ship = self.hull.stiffness_nm_rad, self.ship.stiffness_nm_rad
        if abs(of_hull / of_ship - 1) > _MOST_STIFFNESS_ERROR:
            reason = f"is {of_ship:.4g}, but {self.hull.data.source} has {of_hull:.4g}: make them"
            problems.append(("stiffness_nm_rad", f"{reason} agree"))
        elif self.viscous_nms_rad < 0:
            reason = f"is {self.ship.damping_nms_rad:.4g}, less than what waves alone take from it"
            least = self.hull.radiated_nms_rad()
            problems.append(("damping_nms_rad", f"{reason}, {least:.4g}: raise it"))
        refuse("ship", problems)

    @cached_property
    def viscous_nms_rad(self) -> float:
        """Linear roll damping beside radiation."""
        return self.ship.damping_nms_rad - self.hull.radiated_nms_rad()

    def packed(self, ship: RollShip) -> FloatArray:
        """Return the parameters of `lateral_kernel` for the ship as it is now."""
        tank = self.tank
        c = RollModel(ship, tank).coefficients
        hull = self.hull.rigid_mass + self.hull.radiation.infinite_added_mass
        flow = tank.density_kg_m3 * tank.reservoir_area_m2
        viscous = self.viscous_nms_rad + ship.damping_nms_rad - self.ship.damping_nms_rad
        return np.array([
            *hull[np.triu_indices(3)], c.inertia - c.ship_inertia, c.inertia_h2, c.coupling,
            c.level_inertia, tank.water_kg, tank.lx_m, flow, tank.width_m, tank.water_lever_kgm,
            tank.height_m - tank.lz_m,
            *reversed(tank.water_squares_kg_m2),
            viscous, c.quadratic_damping, c.offset_moment, c.wind_moment,
            c.area, c.loss, c.quadratic_loss, c.level_limit, c.restitution,
            *(self._vertical if self.six else ()),
        ])  # fmt: skip

    @cached_property
    def _vertical(self) -> FloatArray:
        """Upper halves of mass and stiffness of surge, heave and pitch, water included."""
        hull, tank = self.hull.about_g, self.tank
        water, lever, lx = tank.water_kg, tank.water_lever_kgm, tank.lx_m
        of_water = np.diag([water, water, water * lx * lx + tank.water_squares_kg_m2[1]])
        of_water[0, 2], of_water[1, 2] = lever, -lx * water
        upper = np.triu_indices(3)
        mass = _part(hull.mass_matrix, VERTICAL) + self.hull.vertical_radiation.infinite_added_mass
        stiffness = _part(hull.known("hydrostatic"), VERTICAL)
        stiffness[2, 2] += GRAVITY_M_S2 * lever  # the water's weight
        return np.concatenate([(mass + of_water)[upper], stiffness[upper]])

    @property
    def states(self) -> int:
        """Number of states."""
        return 8 + 2 * len(self.oscillators) + (6 + 2 * len(self.vertical) if self.six else 0)

    @property
    def oscillators(self) -> FloatArray:
        """Directions, square of the frequency, and losses, shape (n, 7)."""
        return _packed(self.hull.radiation)

    @property
    def vertical(self) -> FloatArray:
        """The same of surge, heave and pitch; without rows if they are not free."""
        return _packed(self.hull.vertical_radiation) if self.six else np.zeros((0, 7))


def _packed(found: Radiation) -> FloatArray:
    return np.column_stack([found.direction, found.frequency_rad_s**2, found.loss])


def _part(matrix: FloatArray, degrees: npt.NDArray[np.intp]) -> FloatArray:
    """Return the degrees of a (6, 6) matrix in body axes, made symmetric."""
    sign = TO_BODY_AXES[degrees]
    part = matrix[np.ix_(degrees, degrees)] * np.outer(sign, sign)
    return np.asarray((part + part.T) / 2)
