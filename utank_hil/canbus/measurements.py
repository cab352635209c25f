"""What a controller has measured, as plain values.

Their fields are `Final`: they are written once, and the type check refuses to write them again.
A frozen dataclass takes ten times as long to make, and a named tuple thrice as long to read.
"""

from dataclasses import dataclass
from typing import Final, NamedTuple

from utank_hil.canbus.enumerations import DriveState, Mode
from utank_hil.canbus.messages import ForecastPoints

MEASURED: Final = ("roll_rad", "roll_rate_rad_s", "level_m")
"""Names of what a law may measure, of `MotionSample` or of `Measurements`."""


@dataclass(slots=True, eq=False)
class MotionSample:
    """The last good sample of one motion sensor; zero before the first."""

    roll_rad: Final[float] = 0.0
    roll_rate_rad_s: Final[float] = 0.0
    heard_ns: Final[int] = 0  #: Time of receipt.
    age_ms: Final[float] = 0.0  #: Time since then.
    valid: Final[bool] = True  #: The sensor's messages arrive intact and in order.
    discarded: Final[int] = 0  #: Samples so far that were no motion of a ship.


class Wishes(NamedTuple):
    """What the operator ordered since the last look."""

    armed: bool = False  #: The arm bit is set, and no frame since the last look disarmed.
    stop: bool = False  #: The stop bit is set, or was in a frame since the last look.
    #: arm_edge, reset_edge: the arm bit, or the reset bit, was set since the last look.
    arm_edge: bool = False
    reset_edge: bool = False
    passive_edge: bool = False  #: The mode asked for has changed to PASSIVE since the last look.


class RetuningOrder(NamedTuple):
    """What the operator ordered since the last sample."""

    #: retune, undo: the button was pressed.
    retune: bool = False
    undo: bool = False
    forbidden: bool = False  #: Retuning is forbidden, or was for a moment.


@dataclass(slots=True, eq=False)
class Measurements:
    """Everything that was received, plausible, with its age, at one tick.

    Ages count from the last accepted frame with plausible content. An age of what is not on board
    is negative: it is never late. The first five fields are those of `Wishes`.
    """

    armed: Final[bool]
    stop: Final[bool]
    arm_edge: Final[bool]
    reset_edge: Final[bool]
    passive_edge: Final[bool]
    now_ns: Final[int]  #: Time of the tick.
    requested_mode: Final[Mode]
    panel_age_ms: Final[float]
    panel_matches: Final[bool]  #: The panel in command runs this catalogue and configuration.
    motions: Final[tuple[MotionSample, ...]]  #: Of the one or two motion sensors.
    #: port_level_m, starboard_level_m: above still water.
    port_level_m: Final[float]
    starboard_level_m: Final[float]
    level_m: Final[float]  #: Starboard up: half the difference of the two gauges.
    tank_ns: Final[int]  #: Time of receipt of the levels.
    tank_cycles: Final[int]  #: Cycles of their message since the first.
    tank_age_ms: Final[float]
    levels_discarded: Final[int]  #: Samples of the gauges that were no motion of water.
    high_level: Final[bool]  #: A high-level switch is closed or broken.
    pressure_pa: Final[float]  #: Across the pump.
    pump_age_ms: Final[float]
    drive_state: Final[DriveState | None]
    drive_age_ms: Final[float]
    #: drive_echo_ns, drive_echo: command counter that the drive's status sends back, and when it
    #: first came; of the valve likewise.
    drive_echo_ns: Final[int]
    drive_echo: Final[int | None]
    drive_fault: Final[bool]
    drive_warns: Final[bool]
    drive_held_back: Final[bool]  #: The drive says that its power or its speed is at the limit.
    drive_at_speed: Final[bool]  #: Its speed, or it does not say which of them.
    power_w: Final[float]  #: Electric power that the drive takes.
    valve_opening: Final[float]
    valve_following: Final[bool]
    valve_fault: Final[bool]
    valve_echo_ns: Final[int]
    valve_echo: Final[int | None]
    valve_heard_ns: Final[int]  #: Time of receipt of the last status with an opening.
    hardwired_stop: Final[bool]  #: The stop loop is, or was since the last look, open or broken.
    hardwired_age_ms: Final[float]
    versions_match: Final[bool]  #: Of drive, sensors and valve, with the controller's.
    protection_valid: Final[bool]  #: Messages of gauges and drive arrive intact and in order.
    address_conflict: Final[bool]  #: Another node sent with the controller's address.
    claimed_twice: Final[bool]  #: A node claimed the address of another.
    link_lost: Final[bool]  #: The bus could not be read or written in the last command cycle.
    frames: Final[int]  #: Frames so far, of any kind.
    foreign: Final[int]  #: Those that are not in the catalogue.
    #: Points of a forecast of the waves by their time of receipt, also those that are too old.
    forecast: "Final[tuple[tuple[int, ForecastPoints], ...]]" = ()
    forecast_age_ms: Final[float] = 0.0
