"""Estimates of waves and ship from the motion, the request for them, and changes of the ship.

A change is a difference between the estimated ship and the one that a law was designed for,
independently of the sea. It counts, in either direction, if it exceeds three standard deviations
and the previous estimate was of the same ship.
"""

import math
from dataclasses import dataclass
from typing import Annotated, Final

from utank_hil.base.arrays import FloatArray
from utank_hil.base.elementary import exp, log
from utank_hil.base.parameters import Checked, Range
from utank_hil.canbus import Verdict
from utank_hil.canbus.events import ModelSummary
from utank_hil.dynamics.ship import RollShip
from utank_hil.sea import SlopeSpectrum

MOST_BANDS: Final = 1000
"""Most bands of a spectrum: above that of a one-hour record, and read between two ticks."""

SIGNIFICANT: Final = 3.0  #: Number of standard deviations from which a difference is significant.


@dataclass(frozen=True, slots=True)
class ShipFigures(Checked, owner="ship"):
    """A ship in roll, without tank water, and the uncertainty of its figures.

    Raises `ValueError` if stiffness or inertia is too small for the loop to compute with, or any
    value is too large.
    """

    stiffness_nm_rad: Annotated[float, Range(least=1e-6, most=1e30)]
    inertia_kg_m2: Annotated[float, Range(least=1e-6, most=1e30)]
    damping_nms_rad: Annotated[float, Range(least=0, most=1e30)]
    #: stiffness_deviation, period_deviation: relative standard deviations of stiffness and roll
    #: period.
    stiffness_deviation: Annotated[float, Range(least=0, most=1e3)] = 0.0
    period_deviation: Annotated[float, Range(least=0, most=1e3)] = 0.0

    @classmethod
    def of(cls, ship: RollShip) -> "ShipFigures":
        """Return the figures of a known ship."""
        return cls(ship.stiffness_nm_rad, ship.inertia_kg_m2, ship.damping_nms_rad)

    @classmethod
    def identified(cls, found: ModelSummary) -> "ShipFigures":
        """Return the figures of a ship; its stiffness is as uncertain as its square root."""
        return cls(
            found.stiffness_nm_rad,
            found.inertia_kg_m2,
            found.damping_nms_rad,
            2 * found.period_deviation,
            found.period_deviation,
        )

    @property
    def roll_period_s(self) -> float:
        """Natural roll period."""
        return 2 * math.pi * math.sqrt(self.inertia_kg_m2 / self.stiffness_nm_rad)

    def ship(self, configured: RollShip) -> RollShip:
        """Return the configured ship with these figures; levers scale with the stiffness."""
        return configured.with_figures(
            self.inertia_kg_m2, self.stiffness_nm_rad, self.damping_nms_rad
        )


@dataclass(frozen=True, slots=True, eq=False)
class MotionEstimate:
    """Waves and ship by the latest motion; `ValueError` for more bands than the loop can read."""

    #: of_sea, of_ship: whether the estimate of waves and ship is good, and if not, why.
    of_sea: Verdict
    of_ship: Verdict
    #: The ship found; if `of_ship` is not good, the known ship that the waves are based on. None if
    #: nothing was found.
    ship: ShipFigures | None = None
    waves: SlopeSpectrum | None = None  #: Wave moment per stiffness of that ship.
    #: Relative standard deviation of the root mean square of `waves`.
    rms_deviation: float = math.nan
    #: hs_m, tp_s: significant height and peak period of beam waves at the configured effective
    #: slope; NaN if beam waves can't be so long.
    hs_m: float = math.nan
    tp_s: float = math.nan
    duration_s: float = 0.0  #: Length of the record.

    def __post_init__(self) -> None:
        bands = 0 if self.waves is None else len(self.waves.omega_rad_s)
        if bands > MOST_BANDS:
            raise ValueError(f"an estimate has at most {MOST_BANDS} bands, got {bands}")


@dataclass(frozen=True, slots=True, eq=False)
class EstimateRequest:
    """Request for an estimate."""

    ship: ShipFigures  #: The known ship.
    record: FloatArray  #: shape (N, 3): latest samples, columns `estimator.COLUMNS`; gaps are NaN.


class ChangeMonitor:
    """Monitor that compares the present ship with the ship that a law was designed for."""

    def __init__(self, ship: ShipFigures) -> None:
        self._ship = ship
        self._latest: ShipFigures | None = None
        #: Ratio (1 or more) of the roll periods or of the square roots of the stiffnesses,
        #: whichever is larger; 1 while no difference is significant.
        self.change = 1.0

    def watch(self, estimate: MotionEstimate) -> None:
        """Take a new estimate; OUTDATED clears the change, one without a good ship leaves it."""
        now, before = estimate.ship, self._latest
        if estimate.of_ship is Verdict.OUTDATED:
            self._latest, self.change = None, 1.0
        if estimate.of_ship is not Verdict.GOOD or now is None:
            return
        self._latest = now
        if before is not None and ship_factor(now, before) == 1:
            self.change = ship_factor(now, self._ship)

    def restart(self) -> None:
        """Take the latest ship as the law's own."""
        self._ship = self._latest or self._ship
        self.change = 1.0


def ship_factor(now: ShipFigures, then: ShipFigures) -> float:
    """Factor, 1 or more, by which two ships differ; 1 if that is not significant."""
    by_period = _significant(
        now.roll_period_s / then.roll_period_s,
        _together(now.period_deviation, then.period_deviation),
    )
    by_stiffness = _significant(
        math.sqrt(now.stiffness_nm_rad / then.stiffness_nm_rad),
        _together(now.stiffness_deviation, then.stiffness_deviation) / 2,
    )
    return max(by_period, by_stiffness)


def _together(a: float, b: float) -> float:
    return math.sqrt(a * a + b * b)


def _significant(ratio: float, deviation: float) -> float:
    """Return the ratio as a factor of 1 or more; 1 if it is within the deviations."""
    change = abs(log(ratio))
    return exp(change) if change > SIGNIFICANT * deviation else 1.0
