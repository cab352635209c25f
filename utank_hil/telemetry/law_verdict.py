"""How far the law of a log is from the one that is designed today: numbers, roll and margins."""

from dataclasses import dataclass
from typing import NamedTuple

from utank_hil.configuration import ControllerConfig
from utank_hil.control.interface import PRESSURE, BuiltLaw
from utank_hil.telemetry.law_values import ValueDifference


class LoopFigures(NamedTuple):
    """What a law does to its ship, by its impulse responses at rest."""

    #: Predicted roll RMS in a broad sea, relative to that with the passive tank; no limits.
    roll_part: float
    peak_sensitivity: float
    gain_margin: float  #: Greatest factor of the gain that leaves the loop stable; inf if any does.
    phase_margin_rad: float


@dataclass(frozen=True, slots=True)
class LawVerdict:
    """The law that answered recorded frames, and its distance from the one designed today."""

    why_not_recorded: str  #: Why the law designed here answered; empty if the recorded one did.
    #: Differences between the recorded law and the one designed here; they fail no replay.
    differences: list[ValueDifference]
    #: loops: of the recorded law and of that designed here; None where the laws are equal, or a
    #: loop can't be judged.
    loops: tuple[LoopFigures, LoopFigures] | None

    @property
    def deviation(self) -> float:
        """Largest relative deviation in any array of the design; 0 if the designs are equal."""
        return max((each.deviation for each in self.differences), default=0.0)


def loop_figures(law: BuiltLaw, config: ControllerConfig) -> LoopFigures | None:
    """Return what the loop of a law of the pump does; None if it has none or can't be judged."""
    # here: a replay with equal laws needs none of it
    from utank_hil.analysis.loop.impulse_response import NoImpulseResponse, impulse_response_law
    from utank_hil.analysis.loop.margins import margins
    from utank_hil.analysis.loop.sea_response import moment_of, motion_in_sea
    from utank_hil.analysis.loop.self_tuning import unknown_sea
    from utank_hil.dynamics.linear import pump_model

    if law.commands != (PRESSURE,) or not law.closes_loop:
        return None
    plant = config.design_plant
    try:
        linear = impulse_response_law(law.controller, law.measured)
    except NoImpulseResponse:
        return None
    system = pump_model(plant.ship, plant.tank, law.measured)
    found = margins(linear, system, plant.delay_s, plant.lag_s, with_delay_margin=False)
    waves = moment_of(unknown_sea(plant.ship), plant.ship)
    roll, passive = (
        motion_in_sea(each, plant, law.measured, waves).roll_rms_rad for each in (linear, None)
    )
    return LoopFigures(
        roll / passive, found.peak_sensitivity, found.gain_high, found.phase_margin_rad
    )
