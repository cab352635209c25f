"""Hydrodynamic data of a hull, in one convention, whichever code computed them.

Axes: x forward, y to port, z up; the origin lies in the waterline. Degrees in the order surge,
sway, heave, roll, pitch, yaw; rotations follow the right hand. Heading is the direction that the
waves travel to: 0 degrees along +x (following sea), 90 degrees to port. Time goes as exp(+i w t),
with w the frequency of encounter, so a positive phase is a lead over the crest of the undisturbed
wave at the origin, and deep-water waves are ``exp(i w t - i k (x cos b + y sin b))``::

    [-w^2 (M + A) + i w B + C] xi = X

These are not the body axes of `tank_wrench` (y to starboard, z down): multiply vectors by
`TO_BODY_AXES`, and matrices by it on both sides, and headings by -1.

Radiation and excitation of a hull between the points of its data, and its free roll.

At the frequency of free roll w, the undamped mode v of sway, roll and yaw (v = 1 in roll) turns the
coupled equations into one of roll alone, ``C44`` its stiffness::

    w^2 = C44 / (v (M + A) v),    zeta = w v B v / (2 C44)
"""

import math
from dataclasses import dataclass, field, replace
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from utank_hil.base.arrays import ComplexArray, FloatArray
from utank_hil.base.parameters import ParameterError, Problem, refuse

DEGREES = ("surge", "sway", "heave", "roll", "pitch", "yaw")
TO_BODY_AXES = np.array([1.0, -1.0, -1.0, 1.0, -1.0, -1.0])
_MOST_ASYMMETRY = 0.1
"""Panel codes keep the symmetry of A and B within 1 %, except at irregular frequencies."""


@dataclass(frozen=True, eq=False)
class HullData:
    """Mass, restoring, radiation and excitation of a hull in waves, SI units.

    ParameterError is raised if a shape is wrong, a number is not finite, frequencies or headings do
    not ascend, or a matrix that must be symmetric is not.
    """

    #: shape (n,): Frequencies of motion (of encounter) of the coefficients, ascending, without 0
    #: and infinity.
    frequency_rad_s: FloatArray
    added_mass: FloatArray  #: shape (n, 6, 6): Radiation about `reference_m`; first index: force.
    damping: FloatArray  #: shape (n, 6, 6)
    wave_frequency_rad_s: FloatArray  #: shape (k,): Wave frequencies of the excitation, ascending.
    #: shape (m,): Directions that the waves travel to, ascending, from above -180 up to 360.
    heading_deg: FloatArray
    #: shape (m, k, 6): Force and moment about `reference_m` per metre of wave amplitude.
    excitation: ComplexArray
    #: shape (6, 6): Restoring matrix C about `reference_m`, with the weight's part.
    hydrostatic: FloatArray | None = None
    mass_kg: float | None = None  #: Displaced mass.
    #: shape (3, 3): Inertia tensor about the centre of gravity: products of inertia with a negative
    #: sign.
    inertia_kg_m2: FloatArray | None = None
    gravity_centre_m: FloatArray | None = None  #: shape (3,): Centre of gravity from the origin.
    #: shape (3,): Point of the motions and moments, from the origin. Phases always refer to the
    #: origin.
    reference_m: FloatArray = field(default_factory=lambda: np.zeros(3))
    infinite_added_mass: FloatArray | None = None  #: shape (6, 6): Limit of the added mass.
    #: shape (n,): Linear roll damping beside radiation, where the source has it.
    viscous_roll_nms_rad: FloatArray | None = None
    quadratic_roll_nms2_rad2: FloatArray | None = None  #: shape (n,): Of the square of the rate.
    density_kg_m3: float = 1025.0
    gravity_m_s2: float = 9.81
    water_depth_m: float = math.inf  #: Infinite for deep water.
    speed_m_s: float = 0.0
    source: str = "hull"  #: Where the data come from, for messages.
    notes: tuple[str, ...] = ()  #: What the reader left out, added or found odd.

    def __post_init__(self) -> None:
        for name in self._shapes():
            if (value := getattr(self, name)) is not None:
                kind = np.complex128 if name == "excitation" else np.float64
                array = np.array(value, dtype=kind)
                array.setflags(write=False)
                object.__setattr__(self, name, array)
        refuse(self.source, self._array_problems() or self._value_problems())

    def _shapes(self) -> dict[str, tuple[int, ...]]:
        """Shape that each array must have."""
        n, k = np.size(self.frequency_rad_s), np.size(self.wave_frequency_rad_s)
        m, matrix = np.size(self.heading_deg), (6, 6)
        return {
            "frequency_rad_s": (n,),
            "added_mass": (n, 6, 6),
            "damping": (n, 6, 6),
            "wave_frequency_rad_s": (k,),
            "heading_deg": (m,),
            "excitation": (m, k, 6),
            "hydrostatic": matrix,
            "inertia_kg_m2": (3, 3),
            "gravity_centre_m": (3,),
            "reference_m": (3,),
            "infinite_added_mass": matrix,
            "viscous_roll_nms_rad": (n,),
            "quadratic_roll_nms2_rad2": (n,),
        }

    def _array_problems(self) -> list[Problem]:
        problems = []
        for name, shape in self._shapes().items():
            array = getattr(self, name)
            if array is None:
                continue
            if array.shape != shape or 0 in shape:
                problems.append((name, f"has shape {array.shape}, must have {shape}, not empty"))
            elif not np.all(np.isfinite(array)):
                problems.append((name, "holds numbers that are not finite"))
        return problems

    def _value_problems(self) -> list[Problem]:
        problems = []
        for name in ("frequency_rad_s", "wave_frequency_rad_s"):
            grid = getattr(self, name)
            if grid[0] <= 0 or np.any(np.diff(grid) <= 0):
                problems.append((name, "must be positive and ascend without doubled rows"))
        heading = self.heading_deg
        if np.any(np.diff(heading) <= 0) or heading[0] <= -180 or heading[-1] > 360:
            problems.append(("heading_deg", "must ascend, from above -180 up to 360 degrees"))
        if heading[-1] - heading[0] >= 360:
            problems.append(("heading_deg", "covers the circle twice: leave out one of the ends"))
        for name in ("mass_kg", "density_kg_m3", "gravity_m_s2", "water_depth_m"):
            value = getattr(self, name)
            if value is not None and not value > 0:
                problems.append((name, f"must be positive, got {value}"))
        inertia = self.inertia_kg_m2
        if inertia is not None and not (
            np.allclose(inertia, inertia.T, rtol=1e-6) and np.linalg.eigvalsh(inertia)[0] > 0
        ):
            problems.append(("inertia_kg_m2", "must be symmetric and positive definite"))
        if not self.speed_m_s >= 0:
            problems.append(("speed_m_s", f"must be zero or more, got {self.speed_m_s}"))
        matrices = ["hydrostatic"]
        if self.speed_m_s == 0:  # with speed, radiation couples degrees one way
            matrices += ["added_mass", "damping", "infinite_added_mass"]
        for name in matrices:
            value = getattr(self, name)
            if value is not None and (found := _asymmetry(value)) > _MOST_ASYMMETRY:
                problems.append((name, f"is not symmetric: halves differ by {100 * found:.0f} %"))
        return problems

    def known(self, name: str) -> Any:
        """Return a field, or raise `ParameterError` naming it if the source does not have it."""
        if (value := getattr(self, name)) is None:
            raise ParameterError(f"{self.source}:", [(name, "is missing")])
        return value

    @property
    def mass_matrix(self) -> FloatArray:
        """Rigid mass matrix about `reference_m`, shape (6, 6)."""
        matrix = np.zeros((6, 6))
        matrix[:3, :3] = self.known("mass_kg") * np.eye(3)
        matrix[3:, 3:] = self.known("inertia_kg_m2")
        back = inverse_shift(self.reference_m - self.known("gravity_centre_m"))
        return np.asarray(back.T @ matrix @ back)

    def about(self, point_m: npt.ArrayLike) -> "HullData":
        """Return the data with motions and moments about a point, shape (3,), from the origin."""
        point = np.asarray(point_m, dtype=np.float64)
        back = inverse_shift(point - self.reference_m)
        moved = {
            name: back.T @ value @ back
            for name in ("added_mass", "damping", "hydrostatic", "infinite_added_mass")
            if (value := getattr(self, name)) is not None
        }
        return replace(self, **moved, excitation=self.excitation @ back, reference_m=point)

    def about_gravity_centre(self) -> "HullData":
        """Return the data about the centre of gravity; `ParameterError` if that is not known."""
        return self.about(self.known("gravity_centre_m"))


def skew(vector: npt.ArrayLike) -> FloatArray:
    """Matrix of the cross product: ``skew(a) @ b`` is a x b."""
    x, y, z = np.asarray(vector, dtype=np.float64)
    return np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])


def inverse_shift(step_m: FloatArray) -> FloatArray:
    """S^-1 of motions xi' = S xi at a point that is `step_m` from the old one."""
    matrix = np.eye(6)
    matrix[:3, 3:] = skew(step_m)
    return matrix


def _asymmetry(matrix: FloatArray) -> float:
    """Median over frequencies of the greatest difference of halves, per root of diagonals."""
    size = np.sqrt(np.abs(np.einsum("...ii->...i", matrix)))
    scale = np.maximum(size[..., :, None] * size[..., None, :], 1e-300)
    apart = np.abs(matrix - np.swapaxes(matrix, -1, -2))
    # Codes print small couplings as noise beside the greatest entry of a symmetric hull.
    noise = 1e-6 * np.max(np.abs(matrix), axis=(-1, -2), keepdims=True)
    return float(np.median(np.max(np.where(apart > noise, apart / scale, 0.0), axis=(-1, -2))))


_WIDEST_GAP = (math.log(1.5) / 2) ** 2
"""Of frequencies around the free roll: 1.5 from one to the next. In its middle the wave's moment is
then 6 to 10 % wrong (two ships, by WAMIT and VERES)."""
LATERAL = np.array([1, 3, 5])  #: Sway, roll and yaw among the six degrees.
_MIRRORED = np.array([1, -1, 1, -1, 1, -1])
_MOST_TURN_DEG = 45.0
"""Between headings farther apart than this, forces are not known: seakeeping runs have 10 to 30."""


class UncoveredError(ValueError):
    """The data have no frequencies around the free roll; `gap` says where."""

    def __init__(self, source: str, gap: str) -> None:
        super().__init__(f"{source}: {gap}: compute the hull there, too")
        self.gap = gap


class FreeRoll(NamedTuple):
    """Free roll of a hull, with the damping of the waves that it radiates."""

    period_s: float  #: Natural period, sway and yaw free.
    radiation_ratio: float  #: Damping ratio.
    mode: FloatArray  #: shape (3,): sway, roll and yaw, 1 in roll.


def wave_number(omega_rad_s: FloatArray, depth_m: float, gravity_m_s2: float) -> FloatArray:
    """Return k with w^2 = g k tanh(k depth), in 1/m, by Newton's method."""
    deep = omega_rad_s**2 / gravity_m_s2
    if not math.isfinite(depth_m):
        return np.asarray(deep)
    k = np.maximum(deep, omega_rad_s / math.sqrt(gravity_m_s2 * depth_m))
    for _ in range(20):
        t = np.tanh(k * depth_m)
        k = k - (k * t - deep) / (t + k * depth_m * (1 - t**2))
    return np.asarray(k)


def radiation_at(hull: HullData, omega_rad_s: float) -> tuple[FloatArray, FloatArray]:
    """Added mass and damping, shape (6, 6), interpolated; ValueError outside of the data."""
    grid = hull.frequency_rad_s
    _inside(hull, "frequency_rad_s", grid, omega_rad_s)
    return _between(grid, hull.added_mass, omega_rad_s), _between(grid, hull.damping, omega_rad_s)


def excitation_at(hull: HullData, omega_rad_s: float, heading_deg: float) -> ComplexArray:
    """Return force and moment per metre, shape (6,), at a wave frequency and heading.

    Headings that the data lack are those of the other side of the ship, mirrored. ValueError is
    raised for a frequency outside of the data, and between headings far apart.
    """
    grid = hull.wave_frequency_rad_s
    _inside(hull, "wave_frequency_rad_s", grid, omega_rad_s)
    force = _between(grid, hull.excitation.transpose(1, 0, 2), omega_rad_s)
    both = np.concatenate([hull.heading_deg, -hull.heading_deg]) % 360
    around, first = np.unique(np.round(both, 6), return_index=True)
    force = np.concatenate([force, _MIRRORED * force])[first]
    around = np.concatenate([around[-1:] - 360, around, around[:1] + 360])
    force = np.concatenate([force[-1:], force, force[:1]])
    heading = heading_deg % 360
    n = int(np.searchsorted(around, heading))
    if around[n] - around[n - 1] > _MOST_TURN_DEG and around[n] != heading:
        near = f"{heading_deg:g} degrees, the nearest are {around[n - 1]:g} and {around[n]:g}"
        raise ValueError(f"{hull.source}: heading_deg does not cover {near}")
    return np.asarray(_between(around, force, heading), dtype=np.complex128)


def free_roll(hull: HullData) -> FreeRoll:
    """The free roll of the ship at rest.

    ValueError is raised if a figure lacks or she is not stable, UncoveredError if coefficients or
    forces have no frequencies around it.
    """
    ship = hull.about_gravity_centre()
    stiffness = float(ship.known("hydrostatic")[3, 3])
    if stiffness <= 0:
        raise ValueError(f"{hull.source}: C44 is {stiffness:.3g} N m/rad: GM must be positive")
    omega = math.sqrt(stiffness / (1.3 * ship.mass_matrix[3, 3]))  # hulls add a third in roll
    least, most = ship.frequency_rad_s[[0, -1]]
    for _ in range(50):
        added, damping = radiation_at(ship, min(max(omega, float(least)), float(most)))
        inertia = (ship.mass_matrix + added)[np.ix_(LATERAL, LATERAL)]
        mode = _mode(inertia)
        before, omega = omega, math.sqrt(stiffness / float(mode @ inertia @ mode))
        if abs(omega - before) < 1e-9 * omega:
            break
    _refuse_gap(hull, omega)
    radiated = float(mode @ damping[np.ix_(LATERAL, LATERAL)] @ mode)
    return FreeRoll(2 * math.pi / omega, omega * radiated / (2 * stiffness), mode)


def with_roll_period(hull: HullData, period_s: float) -> HullData:
    """Return the hull with the roll inertia of a free roll of this period, sway and yaw free.

    ValueError is raised as by `free_roll`, and if the added mass alone makes the period longer.
    """
    ship, omega = hull.about_gravity_centre(), 2 * math.pi / period_s
    _refuse_gap(hull, omega)
    stiffness = float(ship.known("hydrostatic")[3, 3])
    others = ship.mass_matrix + radiation_at(ship, omega)[0]
    others[3, 3] -= hull.known("inertia_kg_m2")[0, 0]
    lateral = others[np.ix_(LATERAL, LATERAL)]
    mode = _mode(lateral)
    needed = stiffness / omega**2 - float(mode @ lateral @ mode)
    if needed <= 0:
        raise ValueError(f"{hull.source}: added mass alone rolls slower than {period_s:g} s")
    inertia = np.array(hull.known("inertia_kg_m2"))
    inertia[0, 0] = needed
    return replace(hull, inertia_kg_m2=inertia)


def _mode(inertia: FloatArray) -> FloatArray:
    """Return sway, 1, yaw of free roll: sway and yaw have inertia alone."""
    others = np.ix_([0, 2], [0, 2])
    sway, yaw = -np.linalg.solve(inertia[others], inertia[[0, 2], 1])
    return np.array([sway, 1.0, yaw])


def _refuse_gap(hull: HullData, roll_rad_s: float) -> None:
    for name in ("frequency_rad_s", "wave_frequency_rad_s"):
        grid = getattr(hull, name)
        below, above = grid[grid <= 1.000001 * roll_rad_s], grid[grid >= 0.999999 * roll_rad_s]
        if len(below) and len(above):
            gap = math.log(roll_rad_s / below[-1]) * math.log(above[0] / roll_rad_s)
            if gap <= _WIDEST_GAP:
                continue
        nearest = " and ".join(f"{each:.3g}" for each in (*below[-1:], *above[:1]))
        raise UncoveredError(
            hull.source,
            f"{name} has none near the free roll, {roll_rad_s:.3g} rad/s "
            f"({2 * math.pi / roll_rad_s:.3g} s); next to it {nearest}",
        )


def _inside(hull: HullData, name: str, grid: FloatArray, at: float) -> None:
    if not grid[0] <= at <= grid[-1]:
        raise ValueError(f"{hull.source}: {name} goes from {grid[0]:g} to {grid[-1]:g}, not {at:g}")


def _between(grid: FloatArray, values: npt.NDArray[Any], at: float) -> Any:
    """Return values between those of a grid, which is their first index."""
    if len(grid) == 1:
        return values[0]
    n = int(np.clip(np.searchsorted(grid, at) - 1, 0, len(grid) - 2))
    share = (at - grid[n]) / (grid[n + 1] - grid[n])
    return (1 - share) * values[n] + share * values[n + 1]
