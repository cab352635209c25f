"""The programme of the clairvoyant bound, taken from the project as it hands it to its solver.

::

    minimize    1/2 x'P x + q'x    subject to    A_e x = b_e,    A_i x <= b_i
"""

from dataclasses import dataclass
from typing import Any
from unittest.mock import patch

import numpy as np
from scipy import sparse

from tools.peers.plan_programmes import HOUR, STORM
from tools.studies.clairvoyant import clairvoyant_bound
from utank_hil.analysis.loop.loop_simulation import passive_motion
from utank_hil.base.arrays import FloatArray
from utank_hil.configuration import Vessel
from utank_hil.control.design_plant import DesignPlant
from utank_hil.control.limits import PumpLimits
from utank_hil.dynamics.linear import STATES
from utank_hil.sea import EffectiveSlope, Sea, load_ndbc

SAMPLE_TIME_S = 0.2
_ROLL = STATES.index("roll_rad")


@dataclass(frozen=True, slots=True, eq=False)
class BoundProgramme:
    """A large sparse programme.

    Attributes
    ----------
    cost : scipy.sparse.csc_matrix, shape (n, n)
        Upper triangle of P.
    gradient : ndarray, shape (n,)
    rows : scipy.sparse.csc_matrix, shape (e + i, n)
        A_e above A_i.
    right : ndarray, shape (e + i,)
    equalities : int
        e.
    passive_deg2 : float
        Mean square of the roll with the tank passive: the cost at x = 0.
    """

    cost: sparse.csc_matrix
    gradient: FloatArray
    rows: sparse.csc_matrix
    right: FloatArray
    equalities: int
    passive_deg2: float

    def roll_rms_deg(self, x: FloatArray) -> float:
        """Roll that a solution leaves."""
        whole = self.cost + sparse.triu(self.cost, 1).T
        left = x @ (whole @ x) / 2 + self.gradient @ x + self.passive_deg2
        return float(np.sqrt(max(left, 0.0)))

    def violation(self, x: FloatArray) -> float:
        """Largest violation; rows are in SI units, pressures in units of the greatest."""
        beyond = self.rows @ x - self.right
        beyond[: self.equalities] = np.abs(beyond[: self.equalities])
        return float(beyond.max())


class _TakenError(Exception):
    """The solver was about to be set up with these arguments."""


def _take(*arguments: Any) -> None:
    raise _TakenError(*arguments)


def bound_programme(vessel: Vessel, seconds: float) -> BoundProgramme:
    """Programme of the first `seconds` of the storm hour, 50 kPa, 100 kPa/s, 4 m, seed 1."""
    ship, tank = vessel.ship, vessel.tank
    sea = Sea.irregular(load_ndbc(STORM).at(HOUR), seed=1)
    moment = sea.roll_moment(ship.stiffness_nm_rad, EffectiveSlope(0.5))
    samples = round(seconds / SAMPLE_TIME_S)
    waves = passive_motion(ship, tank, moment, SAMPLE_TIME_S, samples + 1)
    try:
        with patch("clarabel.DefaultSolver", _take):
            clairvoyant_bound(DesignPlant(ship, tank, limits=PumpLimits(level_m=4.0)), waves)
    except _TakenError as taken:
        cost, gradient, rows, right, cones, _ = taken.args
    passive = np.rad2deg(waves[1:, _ROLL])
    return BoundProgramme(
        cost=cost,
        gradient=np.asarray(gradient),
        rows=rows,
        right=np.asarray(right),
        equalities=int(cones[0].dim),
        passive_deg2=float(np.mean(passive**2)),
    )
