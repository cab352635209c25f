"""Estimates of waves and ship from the motion, and the request for them."""

import math
from dataclasses import dataclass
from typing import Annotated, Final

from utank_hil.base.arrays import FloatArray
from utank_hil.base.parameters import Range, range_problems, refuse
from utank_hil.canbus import Verdict
from utank_hil.canbus.events import ModelSummary
from utank_hil.dynamics.ship import RollShip
from utank_hil.sea import SlopeSpectrum

MOST_BANDS: Final = 1000
"""Most bands of a spectrum: above that of a one-hour record, and read between two ticks."""


@dataclass(frozen=True, slots=True)
class ShipFigures:
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

    def __post_init__(self) -> None:
        refuse("ship", range_problems(self))

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
    """Estimate of waves and ship from the latest part of the motion record.

    Raises `ValueError` if the waves have more bands than the loop can read between two ticks.
    """

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
    record: FloatArray  #: shape (N, 4): latest samples, columns `estimator.COLUMNS`; gaps are NaN.
