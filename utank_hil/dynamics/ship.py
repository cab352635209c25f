"""The ship in roll: inertia, damping, restoring moment and heeling moments.

Restoring moment of a ship as a piecewise polynomial in the heel angle.

An odd polynomial (a single piece) and a table of righting levers (a quintic spline with slope
k1 / displacement at zero heel) have the same form, so that the compiled kernels need no branches.
The moment is odd: the pieces describe positive heel. The spline has four continuous derivatives,
which the integrators need for their order of accuracy.
"""

import math
from dataclasses import dataclass, replace
from typing import Annotated, Final, NamedTuple

import numpy as np
import numpy.typing as npt

from utank_hil.base.arrays import FloatArray
from utank_hil.base.ordered_sums import orthogonal_triangle, product, solved
from utank_hil.base.parameters import Checked, Finite, Problem, Range
from utank_hil.dynamics.tank import IRREGULAR

RollLimit = Annotated[float, Range(above=0, most=0.7)]
"""Limit on roll in rad, at most 0.7 (40 degrees), up to which the IS Code 2008 (part A, 2.2.1)
rates a ship's righting levers."""

MOST_SWAY: Final = 1.0
"""Share of g times the slope by which the water particles at the surface are accelerated: a hull
in long waves goes with them."""

STIFFEST: Final = 1.6
"""Roll period in s over the root of the breadth in m, below which few ships roll: by T = 0.8 B /
sqrt(GM), GM is a quarter of the breadth."""

_MOST = 1e30  # Far beyond any ship; it keeps the results of designs finite.


@dataclass(frozen=True, slots=True)
class RollShip(Checked, owner="ship"):
    """A ship in roll alone, without its tank water.

    The restoring moment is ``k1 phi + k3 phi^3 + k5 phi^5 + ...`` or, if `gz_m` is given, the
    displacement times a spline through the righting levers. The linear models use only inertia,
    stiffness and linear damping.
    """

    #: Roll inertia I about the centre of gravity, added inertia included.
    inertia_kg_m2: Annotated[float, Range(above=0, most=_MOST)]
    #: Hydrostatic restoring moment k1 per roll angle at zero heel: displacement times GM.
    stiffness_nm_rad: Annotated[float, Range(above=0, most=_MOST)]
    #: Linear roll damping d1, thesis b44.
    damping_nms_rad: Annotated[float, Range(least=0, most=_MOST)] = 0.0
    #: Damping moment per ``|roll rate| roll rate``, thesis b44q.
    quadratic_damping_nms2_rad2: Annotated[float, Range(least=0, most=_MOST)] = 0.0
    #: Increase of the linear damping per speed ahead, by the lift on hull and keels: N m s/rad per
    #: m/s. The linear models and the laws leave it out.
    lift_damping_ns2_rad: Annotated[float, Range(least=0, most=_MOST)] = 0.0
    #: Higher coefficients (k3, k5, ...) of the restoring polynomial, N m per rad^3, rad^5, ...
    restoring_odd_nm: tuple[Finite, ...] = ()
    displacement_n: Finite = 0.0  #: Displacement as a weight; used with `gz_m` only.
    gz_step_rad: Finite = 0.0  #: Spacing of the heel angles of `gz_m`.
    #: Righting levers at heel 0, `gz_step_rad`, 2 `gz_step_rad`, ...; the first is 0.
    gz_m: tuple[Finite, ...] = ()
    #: Moment of off-centre weight in the upright ship; varies with the cosine of the roll angle.
    offset_moment_nm: Finite = 0.0
    wind_moment_nm: Finite = 0.0  #: Steady wind moment, the same at every angle.
    #: Lateral acceleration of the centre of gravity, as a share of g times the slope of the waves:
    #: 1 in long waves, 0.4 to 0.8 where ships roll most. Without it the ship does not sway, and the
    #: monitors allow for every share up to `MOST_SWAY`.
    sway_of_slope: Annotated[float, Range(least=0, most=MOST_SWAY)] | None = None

    def _problems(self) -> list[Problem]:
        if not self.gz_m:
            return []
        problems = []
        if self.restoring_odd_nm:
            problems.append(("gz_m", "and restoring_odd_nm exclude each other: remove one"))
        if len(self.gz_m) < 4 or self.gz_m[0] != 0:
            problems.append(("gz_m", "needs at least 4 levers, the first of them 0 at zero heel"))
        for name in ("displacement_n", "gz_step_rad"):
            value = getattr(self, name)
            if not (math.isfinite(value) and value > 0):
                problems.append((name, f"must be positive to go with gz_m, got {value}"))
        return problems

    def at_speed(self, speed_m_s: float) -> "RollShip":
        """Return the ship with its damping at a speed."""
        if self.lift_damping_ns2_rad == 0:
            return self
        damping = self.damping_nms_rad + self.lift_damping_ns2_rad * speed_m_s
        return replace(self, damping_nms_rad=damping, lift_damping_ns2_rad=0.0)

    def linearized(self, rate_rms_rad_s: float) -> "RollShip":
        """Return the ship with its quadratic damping of an irregular roll in the linear one."""
        more = IRREGULAR * rate_rms_rad_s * self.quadratic_damping_nms2_rad2
        damping = self.damping_nms_rad + more
        return replace(self, damping_nms_rad=damping, quadratic_damping_nms2_rad2=0.0)

    def with_figures(
        self, inertia_kg_m2: float, stiffness_nm_rad: float, damping_nms_rad: float
    ) -> "RollShip":
        """Return the ship with other figures of small roll; levers scale with the stiffness."""
        share = stiffness_nm_rad / self.stiffness_nm_rad
        return replace(
            self,
            inertia_kg_m2=inertia_kg_m2,
            stiffness_nm_rad=stiffness_nm_rad,
            damping_nms_rad=damping_nms_rad,
            gz_m=tuple(share * lever_m for lever_m in self.gz_m),
        )

    @property
    def heeling_moment_nm(self) -> float:
        """Steady moment on the upright ship in N m, for the linear models."""
        return self.offset_moment_nm + self.wind_moment_nm

    @property
    def natural_frequency_rad_s(self) -> float:
        """Natural roll frequency without the tank."""
        return math.sqrt(self.stiffness_nm_rad / self.inertia_kg_m2)


class Restoring(NamedTuple):
    """Pieces of the restoring moment."""

    #: Width of a piece; infinite for a polynomial. The last piece extends beyond its end.
    piece_rad: float
    #: shape (pieces, powers): Moment within a piece as a polynomial of the angle since the piece's
    #: start, lowest first.
    coefficients_nm: FloatArray

    def moment_nm(self, roll_rad: npt.ArrayLike) -> FloatArray:
        """Restoring moment at the given roll angles."""
        since = np.abs(np.asarray(roll_rad, dtype=np.float64))
        piece = np.zeros(since.shape, dtype=np.intp)
        if not math.isinf(self.piece_rad):
            last = len(self.coefficients_nm) - 1
            piece = np.minimum(since / self.piece_rad, last).astype(np.intp)
            since = since - piece * self.piece_rad
        moment = np.zeros_like(since)
        for power in self.coefficients_nm.T[::-1]:
            moment = moment * since + power[piece]
        return np.sign(roll_rad) * moment


def restoring(ship: RollShip) -> Restoring:
    """Restoring moment of the ship without its tank water."""
    if not ship.gz_m:
        odd = (ship.stiffness_nm_rad, *ship.restoring_odd_nm)
        coefficients = np.zeros((1, 2 * len(odd)))
        coefficients[0, 1::2] = odd
        return Restoring(math.inf, coefficients)
    from scipy.interpolate import BSpline

    levers = np.array(ship.gz_m)
    heel = ship.gz_step_rad * np.arange(len(levers))
    slope = ship.stiffness_nm_rad / ship.displacement_n
    # Even derivatives vanish at zero heel, so that the odd continuation is smooth there; one knot
    # less at the far end makes up for the third condition.
    knots = np.concatenate([np.zeros(6), heel[1:-2], np.full(6, heel[-1])])
    basis = BSpline(knots, np.eye(len(levers) + 3), 5)
    ends = [basis(0.0, nu=k) for k in (1, 2, 4)]
    orthogonal, triangle = orthogonal_triangle(np.vstack([*ends, basis(heel)]))
    wanted = product(orthogonal.T, np.concatenate([[slope, 0.0, 0.0], levers]))
    spline = BSpline(knots, solved(triangle, wanted[:, None])[:, 0], 5)
    taylor = [spline(heel[:-1], nu=k) / math.factorial(k) for k in range(6)]
    return Restoring(ship.gz_step_rad, ship.displacement_n * np.stack(taylor, axis=1))
