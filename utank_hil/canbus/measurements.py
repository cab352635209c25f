"""What a controller has measured, as plain values.

Their fields are `Final`: they are written once, and the type check refuses to write them again.
A frozen dataclass takes ten times as long to make, and a named tuple thrice as long to read.
"""

from dataclasses import dataclass
from typing import Final, NamedTuple

from utank_hil.canbus.enumerations import DriveState, Mode

MEASURED: Final = ("roll_rad", "roll_rate_rad_s", "level_m")
"""Names of what a law may measure, of `MotionSample` or of `Measurements`."""


@dataclass(slots=True, eq=False)
class MotionSample:
    """The last good sample of one motion sensor.

    Attributes
    ----------
    roll_rad, roll_rate_rad_s : float
        Zero before the first sample.
    heard_ns : int
        Time of receipt.
    age_ms : float
        Time since then.
    valid : bool
        The sensor's messages arrive intact and in order.
    discarded : int
        Samples so far that were no motion of a ship.
    """

    roll_rad: Final[float] = 0.0
    roll_rate_rad_s: Final[float] = 0.0
    heard_ns: Final[int] = 0
    age_ms: Final[float] = 0.0
    valid: Final[bool] = True
    discarded: Final[int] = 0


class Wishes(NamedTuple):
    """What the operator ordered since the last look.

    Attributes
    ----------
    armed : bool
        The arm bit is set, and no frame since the last look disarmed.
    stop : bool
        The stop bit is set, or was in a frame since the last look.
    arm_edge, reset_edge : bool
        The arm bit, or the reset bit, was set since the last look.
    passive_edge : bool
        The mode asked for has changed to PASSIVE since the last look.
    """

    armed: bool = False
    stop: bool = False
    arm_edge: bool = False
    reset_edge: bool = False
    passive_edge: bool = False


@dataclass(slots=True, eq=False)
class Measurements:
    """Everything that was received, plausible, with its age, at one tick.

    Ages count from the last accepted frame with plausible content. An age of what is not on board
    is negative: it is never late. The first five fields are those of `Wishes`.

    Attributes
    ----------
    now_ns : int
        Time of the tick.
    requested_mode : Mode
        Mode that the operator asks for.
    panel_age_ms : float
    panel_matches : bool
        The panel in command runs the controller's catalogue and configuration.
    motions : tuple of MotionSample
        Of the one or two motion sensors.
    port_level_m, starboard_level_m : float
        Above still water.
    level_m : float
        Starboard up: half the difference of the two gauges.
    tank_ns, tank_cycles : int
        Time of receipt of the levels, and cycles of their message since the first.
    tank_age_ms : float
    levels_discarded : int
        Samples of the gauges so far that were no motion of water.
    high_level : bool
        A high-level switch is closed or broken.
    pressure_pa : float
        Across the pump.
    pump_age_ms : float
    drive_state : DriveState or None
    drive_age_ms : float
    drive_echo_ns, drive_echo : int, int or None
        Command counter that the drive's status sends back, and when it first came.
    drive_fault, drive_warns : bool
        The drive reports a fault, or a warning.
    drive_held_back : bool
        The drive says that its power or its speed is at the limit.
    power_w : float
        Electric power that the drive takes.
    valve_opening : float
    valve_following, valve_fault : bool
        The valve follows its commands; it reports a fault.
    valve_echo_ns, valve_echo : int, int or None
        Command counter that the valve's status sends back, and when it first came.
    valve_heard_ns : int
        Time of receipt of the last status with an opening.
    hardwired_stop : bool
        The hard-wired stop loop is open or broken, or was since the last look.
    hardwired_age_ms : float
    versions_match : bool
        Drive, sensors and valve run the controller's catalogue and configuration.
    protection_valid : bool
        Messages of gauges and drive arrive intact and in order.
    address_conflict, claimed_twice : bool
        Another node sent with the controller's address; one claimed the address of another.
    link_lost : bool
        The bus could not be read or written in the last command cycle.
    frames, foreign : int
        Frames so far, of any kind, and those that are not in the catalogue.
    """

    armed: Final[bool]
    stop: Final[bool]
    arm_edge: Final[bool]
    reset_edge: Final[bool]
    passive_edge: Final[bool]
    now_ns: Final[int]
    requested_mode: Final[Mode]
    panel_age_ms: Final[float]
    panel_matches: Final[bool]
    motions: Final[tuple[MotionSample, ...]]
    port_level_m: Final[float]
    starboard_level_m: Final[float]
    level_m: Final[float]
    tank_ns: Final[int]
    tank_cycles: Final[int]
    tank_age_ms: Final[float]
    levels_discarded: Final[int]
    high_level: Final[bool]
    pressure_pa: Final[float]
    pump_age_ms: Final[float]
    drive_state: Final[DriveState | None]
    drive_age_ms: Final[float]
    drive_echo_ns: Final[int]
    drive_echo: Final[int | None]
    drive_fault: Final[bool]
    drive_warns: Final[bool]
    drive_held_back: Final[bool]
    power_w: Final[float]
    valve_opening: Final[float]
    valve_following: Final[bool]
    valve_fault: Final[bool]
    valve_echo_ns: Final[int]
    valve_echo: Final[int | None]
    valve_heard_ns: Final[int]
    hardwired_stop: Final[bool]
    hardwired_age_ms: Final[float]
    versions_match: Final[bool]
    protection_valid: Final[bool]
    address_conflict: Final[bool]
    claimed_twice: Final[bool]
    link_lost: Final[bool]
    frames: Final[int]
    foreign: Final[int]
