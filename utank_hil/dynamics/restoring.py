"""Restoring moment of a ship as a piecewise polynomial in the heel angle.

An odd polynomial (a single piece) and a table of righting levers (a quintic spline with slope
k1 / displacement at zero heel) have the same form, so that the compiled kernels need no branches.
The moment is odd: the pieces describe positive heel. The spline has four continuous derivatives,
which the integrators need for their order of accuracy.
"""

import math
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from utank_hil.base.arrays import FloatArray
from utank_hil.base.ordered_sums import orthogonal_triangle, product, solved
from utank_hil.dynamics.ship import RollShip


class Restoring(NamedTuple):
    """Pieces of the restoring moment."""

    #: Width of a piece; infinite for a polynomial. The last piece extends beyond its end.
    piece_rad: float
    #: shape (pieces, powers): Moment within a piece as a polynomial of the angle since the piece's
    #: start, lowest first.
    coefficients_nm: FloatArray

    def moment_nm(self, roll_rad: npt.ArrayLike) -> FloatArray:
        """Restoring moment at the given roll angles."""
        piece, since = self._locate(roll_rad)
        return np.sign(roll_rad) * _horner(self.coefficients_nm[piece], since)

    def _locate(self, roll_rad: npt.ArrayLike) -> tuple[npt.NDArray[np.intp], FloatArray]:
        """Piece of each angle, and the angle from the start of that piece."""
        heel = np.abs(np.asarray(roll_rad, dtype=np.float64))
        if math.isinf(self.piece_rad):
            return np.zeros(heel.shape, dtype=np.intp), heel
        piece = np.minimum(heel / self.piece_rad, len(self.coefficients_nm) - 1).astype(np.intp)
        return piece, heel - piece * self.piece_rad


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


def _horner(coefficients: FloatArray, x: FloatArray) -> FloatArray:
    value = np.zeros_like(x)
    for k in range(coefficients.shape[-1] - 1, -1, -1):
        value = value * x + coefficients[..., k]
    return value
