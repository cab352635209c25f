"""Trade-off of a law between roll on one side, robustness and pressure on the other."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from utank_hil.analysis.loop import linear_tuning
from utank_hil.analysis.loop.margins import Robustness, robustness
from utank_hil.analysis.loop.sea_response import (
    MotionInSea,
    at_its_motion,
    at_work,
    motion_in_sea,
)
from utank_hil.control import ConstrainedDesign, DesignPlant, PredictiveDesign
from utank_hil.control.lqg_design import LQGDesign
from utank_hil.sea import Harmonics

Design = PredictiveDesign | ConstrainedDesign | LQGDesign

WEIGHT_FACTORS: Final = tuple(float(factor) for factor in np.geomspace(1e-2, 1e2, 17))
"""Factors on the weight of a law: four decades. Chosen; no study."""
HORIZON_FACTORS: Final = (0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 1.0, 1.15, 1.3, 1.5, 1.75, 2.0)
"""Factors on the control horizon. Chosen; no study."""


@dataclass(frozen=True, slots=True)
class TradePoint:
    """One law of a trade-off."""

    factor: float  #: Factor on the weight or horizon; 1 is the unchanged design.
    motion: MotionInSea | None  #: Linear prediction; None if the loop is unstable on its own ship.
    roll_below_passive: float | None  #: Reduction of the roll RMS relative to the passive tank.
    robustness: Robustness

    @property
    def refused(self) -> bool:
        """Whether the law misses a required margin."""
        return bool(self.robustness.failures())


@dataclass(frozen=True, slots=True)
class Trade:
    """A trade-off, from the least to the greatest effort."""

    varied: str  #: Name of the scaled parameter, in words.
    passive: MotionInSea  #: With the passive tank.
    points: tuple[TradePoint, ...]


def varied(design: Design) -> str:
    """Name of the parameter that `scaled` scales: a weight, or a deadbeat's control horizon."""
    if isinstance(design, LQGDesign):
        return "state weight"
    if isinstance(design, PredictiveDesign) and design.output_weight is None:
        return "control horizon"
    return "output weight"


def scaled(design: Design, factor: float) -> Design:
    """Return the design with its `varied` parameter multiplied.

    A horizon is rounded to whole samples and its window of targets keeps its length. A constrained
    design has its pressure weight divided, which is equivalent.
    """
    if isinstance(design, ConstrainedDesign):
        return replace(design, pressure_weight_rad2=design.pressure_weight_rad2 / factor)
    if isinstance(design, LQGDesign) or design.output_weight is not None:
        return linear_tuning.scaled(design, factor)
    horizon = max(1, round(factor * design.control_horizon))
    window = design.prediction_horizon - design.control_horizon
    return replace(design, control_horizon=horizon, prediction_horizon=horizon + window)


def trade(
    design: Design,
    plant: DesignPlant,
    wave_moment: Harmonics,
    *,
    factors: Sequence[float] | None = None,
    progress: Callable[[float], None] | None = None,
) -> Trade:
    """Design, judge and predict a law for each factor, in about half a second each.

    A constrained design is judged and predicted within its limits, where it is linear.
    `wave_moment` is the sea's roll moment in N m. The factors are positive, by default
    `WEIGHT_FACTORS` or `HORIZON_FACTORS`. `progress` is called with the finished fraction.
    """
    horizon = varied(design) == "control horizon"
    if factors is None:
        factors = HORIZON_FACTORS if horizon else WEIGHT_FACTORS
    # a longer horizon means less effort
    factors = sorted(factors, reverse=horizon)
    measured = (
        design.measured if isinstance(design, ConstrainedDesign) else design.predictor.measured
    )
    settled = at_its_motion(None, plant, measured, wave_moment)
    passive = motion_in_sea(None, settled, measured, wave_moment)
    working = at_work(plant, wave_moment)
    points = []
    for number, factor in enumerate(factors, 1):
        law = scaled(design, factor).law(working)
        judged = robustness(law, working, measured)
        motion = less = None
        if judged.nominal.radius < 1:
            settled = at_its_motion(law, plant, measured, wave_moment)
            motion = motion_in_sea(law, settled, measured, wave_moment)
            less = 1 - motion.roll_rms_rad / passive.roll_rms_rad
        points.append(TradePoint(factor, motion, less, judged))
        if progress is not None:
            progress(number / len(factors))
    return Trade(varied(design), passive, tuple(points))
