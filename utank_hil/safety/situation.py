"""What the fault table is judged by in one tick, and the judgement: values that nobody changes."""

from enum import Enum
from typing import TYPE_CHECKING, Final

from utank_hil.canbus.enumerations import Fault, Mode
from utank_hil.canbus.measurements import Measurements, MotionSample

if TYPE_CHECKING:  # who prints the words of a fault needs no ship
    from utank_hil.canbus.events import ModelSummary
    from utank_hil.retuning.estimate import ShipFigures

MILLISECOND_NS: Final = 1_000_000
VALVE_OFF: Final = 0.15
"""Part of its way that a valve may be from where the commands should have brought it."""
THROTTLED_OFF: Final = 0.02
"""The same for heel removal, which opens it by 0.05 or so."""


class ValveReport:
    """How the valve follows its commands; zero where there is none."""

    def __init__(
        self, age_ms: float = 0.0, echo_age_ms: float = 0.0, fault: bool = False,
        out_ms: float = 0.0, off_ms: float = 0.0,
    ) -> None:  # fmt: skip
        #: age_ms, echo_age_ms: time since the valve's status, and since its echo of a new command.
        self.age_ms: Final = age_ms
        self.echo_age_ms: Final = echo_age_ms
        self.fault: Final = fault  #: The status reports a fault.
        self.out_ms: Final = out_ms  #: Time for which the valve does not follow, while it should.
        #: Time for which it is not where the commands should have brought it.
        self.off_ms: Final = off_ms


NO_VALVE: Final = ValveReport()


class OwnState:
    """What the controller knows of itself before it judges."""

    def __init__(
        self, command_pa: float = 0.0, level_rate_m_s: float = 0.0, held_pa: float = 0.0,
        echo_age_ms: float = 0.0, drive_stays_on: bool = False, valve: ValveReport = NO_VALVE,
        law_failed: bool = False, excused: bool = False,
        designed_for: "ModelSummary | ShipFigures | None" = None, gm_low: bool = False,
        commissioned: bool = False, frames_sent: int = 0, doubts_forecast: bool = False,
        law_passed_limit: bool = False,
    ) -> None:  # fmt: skip
        self.command_pa: Final = command_pa  #: Pressure last commanded.
        self.level_rate_m_s: Final = level_rate_m_s  #: Estimated rate of the tank's level.
        self.held_pa: Final = held_pa  #: Pressure that a valve takes from the water.
        self.echo_age_ms: Final = echo_age_ms  #: Time since the drive's echo of a new command.
        self.drive_stays_on: Final = drive_stays_on  #: The drive was commanded off in vain.
        self.valve: Final = valve
        #: The law raised an error, or its last answer is not finite.
        self.law_failed: Final = law_failed
        #: The roll is caused on purpose, or the pump rests: it says nothing of the law.
        self.excused: Final = excused
        #: Identified ship that the law in charge was designed for; None for the configuration's.
        self.designed_for: Final = designed_for
        #: The metacentric height may be below the limit of the stability booklet.
        self.gm_low: Final = gm_low
        #: A commissioning was passed with this configuration.
        self.commissioned: Final = commissioned
        #: Frames that the controller has sent since its start.
        self.frames_sent: Final = frames_sent
        #: The law ignores forecasts that the motion contradicts.
        self.doubts_forecast: Final = doubts_forecast
        #: The law ended by itself, at a limit of its own.
        self.law_passed_limit: Final = law_passed_limit


class Situation:
    """All that a condition of the fault table may look at."""

    def __init__(
        self, measured: Measurements, own: OwnState, motion: MotionSample,
        motion_limit_ms: float, spare_age_ms: float, spare_limit_ms: float, found: int,
        heel_rad: float, tick_late_ms: float, overruns_in_ten: int, bus_load: float,
        rolled_over_ms: float, drive_out_ms: float, arming_ms: float,
    ) -> None:  # fmt: skip
        self.measured: Final = measured
        self.own: Final = own
        self.motion: Final = motion  #: The sensor in use.
        self.motion_limit_ms: Final = motion_limit_ms  #: Longest age of its sample.
        self.spare_age_ms: Final = spare_age_ms  #: Of the other sensor's sample; zero without one.
        self.spare_limit_ms: Final = spare_limit_ms  #: Longest age of that.
        self.found: Final = found  #: What the monitors found, bits of `Finding`.
        self.heel_rad: Final = heel_rad  #: Low-pass of the roll over a minute.
        self.tick_late_ms: Final = tick_late_ms  #: Lateness of this tick.
        #: Late ticks among the last ten; one that is late by three counts three times.
        self.overruns_in_ten: Final = overruns_in_ten
        self.bus_load: Final = bus_load  #: Share of the bus in use over the last second.
        self.rolled_over_ms: Final = rolled_over_ms  #: Time since the roll was beyond its limit.
        #: Time for which the drive is not in operation enabled, while it should be.
        self.drive_out_ms: Final = drive_out_ms
        #: Time since arming was accepted; zero outside of arming.
        self.arming_ms: Final = arming_ms


class Demand(Enum):
    """What the rest of the tick has to do with the pump pressure."""

    CONTROL = "the controller's pressure, limited"
    RAMP = "to zero at the rate limit"
    ZERO = "zero at once"


class Judgement:
    """What the controller obeys in one tick."""

    def __init__(
        self, mode: Mode, fault: Fault, demand: Demand, drive_wanted: bool, motion: int,
        share: float, unconfirmed_share: float | None, standing: int, passive_roll_rad: float,
    ) -> None:  # fmt: skip
        #: mode, fault: as `Supervisor` has them.
        self.mode: Final = mode
        self.fault: Final = fault
        self.demand: Final = demand
        #: Whether the drive should be in operation enabled.
        self.drive_wanted: Final = drive_wanted
        self.motion: Final = motion  #: Place of the motion sensor that is to be used.
        #: Share of the greatest pressure that is allowed by what is degraded.
        self.share: Final = share
        #: Share that is allowed in its place until the water was seen to move as roll and pressure
        #: push it; None from then on.
        self.unconfirmed_share: Final = unconfirmed_share
        #: Conditions of the fault table that hold, bits of `judging.standing`.
        self.standing: Final = standing
        #: What the ship would roll without the pump; NaN if that is not known.
        self.passive_roll_rad: Final = passive_roll_rad
