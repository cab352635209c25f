"""The laws that a controller configuration can name, and the controllers they become."""

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, Final, Literal

from pydantic import Field

from utank_hil.configuration.files import Section
from utank_hil.configuration.spectra import LawSea
from utank_hil.control import Controller, LinearLaw, PassiveController, PredictiveDesign, PumpLimits
from utank_hil.control.constrained.design import ConstrainedDesign
from utank_hil.control.feedback_linearization import FeedbackLinearization
from utank_hil.control.fuzzy.direct import RobustFuzzy, SmallGainFuzzy
from utank_hil.control.fuzzy.indirect import IndirectFuzzy
from utank_hil.control.lqg_design import LQGDesign
from utank_hil.control.pd import PD_MEASURED, design_pd
from utank_hil.control.slope import slope_at_rest
from utank_hil.control.stimulation import Stimulation
from utank_hil.dynamics.linear import STATES
from utank_hil.parameters import NotNegative, ParameterError, Positive, Range

if TYPE_CHECKING:
    from utank_hil.configuration.vessel import Vessel


@dataclass(frozen=True, slots=True)
class BuiltLaw:
    """A law ready for the bus.

    Attributes
    ----------
    controller : Controller
        New, at rest.
    measured : tuple of str
        What it measures, in order; names of `STATES`.
    linear : LinearLaw or None
        The law for the analysis of its loop; of a nonlinear one its slope at rest, with the
        parameters that it starts from. None where there is no loop.
    """

    controller: Controller
    measured: tuple[str, ...]
    linear: LinearLaw | None = None


class PassiveLaw(Section):
    """No pump pressure: the tank on its own."""

    kind: Literal["passive"]


class PDLaw(Section):
    """PD on the level, the virtual optimal passive tank."""

    kind: Literal["pd"]


class LQGLaw(Section):
    """Linear-quadratic regulator with a Kalman filter that knows the sea."""

    kind: Literal["lqg"]
    design: LQGDesign


@dataclass(frozen=True, slots=True)
class ConstrainedGPCLaw(ConstrainedDesign):
    """Predictive law that plans within limits; its sea may be named as a scenario's is."""

    sea: LawSea


class FeedbackLinearizationLaw(Section):
    """Feedback linearization; keys as the parameters of `FeedbackLinearization`."""

    kind: Literal["feedback_linearization"]
    frequency_rad_s: Positive
    damping_ratio: Positive
    soft_level_m: Positive
    hard_level_m: Positive
    shift_rad_m: NotNegative = 0.0
    shift_length_m: Positive = 1.0
    level_damping_ratio: NotNegative = 0.0


class SmallGainFuzzyLaw(Section):
    """Direct adaptive fuzzy law (4.20)-(4.22)."""

    kind: Literal["fuzzy_small_gain"]
    design: SmallGainFuzzy


class RobustFuzzyLaw(Section):
    """Direct adaptive fuzzy law (4.23), (4.24)."""

    kind: Literal["fuzzy_robust"]
    design: RobustFuzzy


class IndirectFuzzyLaw(Section):
    """Indirect adaptive fuzzy law (4.25)."""

    kind: Literal["fuzzy_indirect"]
    design: IndirectFuzzy


class StimulationLaw(Section):
    """Rolls the ship on still water; keys as the parameters of `Stimulation`."""

    kind: Literal["stimulate"]
    amplitude_rad: Positive
    period_s: Positive
    ramp_s: Positive
    roll_limit_rad: Positive
    correction_s: Positive = 120.0
    duration_s: Annotated[float, Field(allow_inf_nan=True), Range(above=0, infinite=True)] = (
        math.inf
    )


Law = Annotated[
    PassiveLaw
    | PDLaw
    | LQGLaw
    | PredictiveDesign
    | ConstrainedGPCLaw
    | FeedbackLinearizationLaw
    | SmallGainFuzzyLaw
    | RobustFuzzyLaw
    | IndirectFuzzyLaw
    | StimulationLaw,
    Field(discriminator="kind"),
]

ADAPTIVE: Final = (SmallGainFuzzyLaw, RobustFuzzyLaw, IndirectFuzzyLaw)
"""Laws that learn: their margins are those of what they start from."""

NONLINEAR: Final = (FeedbackLinearizationLaw, *ADAPTIVE)
"""Laws whose margins are those of their slope at rest."""


def sample_time(law: Law) -> tuple[str, float]:
    """Dotted key below ``law`` and value of a law's sample time; without such a key, a tick's."""
    name, part = "", law
    for section in ("design", "predictor"):
        if hasattr(part, section):
            name, part = f"{name}{section}.", getattr(part, section)
    return f"{name}sample_time_s", getattr(part, "sample_time_s", 0.01)


def build_law(law: Law, vessel: "Vessel", delay_s: float, limits: PumpLimits) -> BuiltLaw:
    """Design a configured law for a vessel.

    Parameters
    ----------
    law : one of `Law`
    vessel : Vessel
    delay_s : float
        From the sampling of a measurement to the drive's answer.
    limits : PumpLimits
        For the laws that plan within them.

    Raises
    ------
    ValueError
        If a parameter does not fit the vessel.
    """
    ship, tank, lag_s = vessel.ship, vessel.tank, vessel.pump.lag_s
    match law:
        case PassiveLaw():
            return BuiltLaw(PassiveController(), ("roll_rad",))
        case PDLaw():
            pd = design_pd(ship, tank)
            return BuiltLaw(pd.controller(), PD_MEASURED, pd)
        case LQGLaw():
            try:
                lqg = law.design.law(ship, tank, delay_s, lag_s)
            except ParameterError as error:
                within = [(f"design.{name}", reason) for name, reason in error.problems]
                raise ParameterError(error.owner, within) from error
            return BuiltLaw(lqg.controller(), law.design.predictor.measured, lqg)
        case PredictiveDesign():
            predictive = law.law(ship, tank, delay_s, lag_s)
            return BuiltLaw(predictive.controller(), law.predictor.measured, predictive)
        case ConstrainedDesign():
            constrained = law.law(ship, tank, delay_s, lag_s, limits)
            return BuiltLaw(constrained.controller(), law.measured, constrained)
        case FeedbackLinearizationLaw():
            parameters = law.model_dump(exclude={"kind"})
            linearization = FeedbackLinearization(ship=ship, tank=tank, **parameters)
            return _nonlinear(linearization.controller, STATES)
        case StimulationLaw():
            parameters = law.model_dump(exclude={"kind"})
            plan = Stimulation(
                ship=ship,
                tank=tank,
                pressure_pa=limits.pressure_pa,
                level_limit_m=limits.level_m,
                **parameters,
            )
            return BuiltLaw(plan.controller(), STATES)
        case _:
            design = law.design
            return _nonlinear(design.controller, STATES[: len(design.ranges)])


def _nonlinear(controller: Callable[[], Controller], measured: tuple[str, ...]) -> BuiltLaw:
    return BuiltLaw(controller(), measured, slope_at_rest(controller, len(measured)))
