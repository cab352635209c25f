"""What the fault table is judged by in one tick, and the judgement: values that nobody changes."""

from dataclasses import dataclass
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


@dataclass(slots=True, eq=False)
class ValveReport:
    """How the valve follows its commands; zero where there is none."""

    #: age_ms, echo_age_ms: time since the valve's status, and since its echo of a new command.
    age_ms: Final[float] = 0.0
    echo_age_ms: Final[float] = 0.0
    fault: Final[bool] = False  #: The status reports a fault.
    out_ms: Final[float] = 0.0  #: Time for which the valve does not follow, while it should.
    #: Time for which it is not where the commands should have brought it.
    off_ms: Final[float] = 0.0


NO_VALVE: Final = ValveReport()


@dataclass(slots=True, eq=False)
class OwnState:
    """What the controller knows of itself before it judges."""

    command_pa: Final[float] = 0.0  #: Pressure last commanded.
    level_rate_m_s: Final[float] = 0.0  #: Estimated rate of the tank's level.
    held_pa: Final[float] = 0.0  #: Pressure that a valve takes from the water.
    echo_age_ms: Final[float] = 0.0  #: Time since the drive's echo of a new command.
    drive_stays_on: Final[bool] = False  #: The drive was commanded off in vain.
    valve: Final[ValveReport] = NO_VALVE
    law_failed: Final[bool] = False  #: The law raised an error, or its last answer is not finite.
    #: The roll is caused on purpose, or the pump rests: it says nothing of the law.
    excused: Final[bool] = False
    #: Identified ship that the law in charge was designed for; None for the configuration's.
    designed_for: "Final[ModelSummary | ShipFigures | None]" = None
    #: The metacentric height may be below the limit of the stability booklet.
    gm_low: Final[bool] = False
    commissioned: Final[bool] = False  #: A commissioning was passed with this configuration.
    frames_sent: Final[int] = 0  #: Frames that the controller has sent since its start.
    doubts_forecast: Final[bool] = False  #: The law ignores forecasts that the motion contradicts.
    law_passed_limit: Final[bool] = False  #: The law ended by itself, at a limit of its own.


@dataclass(slots=True, eq=False)
class Situation:
    """All that a condition of the fault table may look at."""

    measured: Final[Measurements]
    own: Final[OwnState]
    motion: Final[MotionSample]  #: The sensor in use.
    motion_spare_age_ms: Final[float]  #: Age of the other sensor's sample; zero without one.
    found: Final[int]  #: What the monitors found, bits of `Finding`.
    heel_rad: Final[float]  #: Low-pass of the roll over a minute.
    tick_late_ms: Final[float]  #: Lateness of this tick.
    #: Late ticks among the last ten; one that is late by three counts three times.
    overruns_in_ten: Final[int]
    bus_load: Final[float]  #: Share of the bus in use over the last second.
    rolled_over_ms: Final[float]  #: Time since the roll was beyond its limit.
    #: Time for which the drive is not in operation enabled, while it should be.
    drive_out_ms: Final[float]
    arming_ms: Final[float]  #: Time since arming was accepted; zero outside of arming.


class Demand(Enum):
    """What the rest of the tick has to do with the pump pressure."""

    CONTROL = "the controller's pressure, limited"
    RAMP = "to zero at the rate limit"
    ZERO = "zero at once"


@dataclass(slots=True, eq=False)
class Judgement:
    """What the controller obeys in one tick."""

    #: mode, fault: as `Supervisor` has them.
    mode: Final[Mode]
    fault: Final[Fault]
    demand: Final[Demand]
    drive_wanted: Final[bool]  #: Whether the drive should be in operation enabled.
    motion: Final[int]  #: Place of the motion sensor that is to be used.
    share: Final[float]  #: Share of the greatest pressure that is allowed by what is degraded.
    #: Share that is allowed in its place until the water was seen to move as roll and pressure push
    #: it; None from then on.
    unconfirmed_share: Final[float | None]
    standing: Final[int]  #: Conditions of the fault table that hold, bits of `judging.standing`.
    #: What the ship would roll without the pump; NaN if that is not known.
    passive_roll_rad: Final[float]
