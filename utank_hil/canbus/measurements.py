"""What a controller has measured, as plain values.

They are written once: the type check refuses to write them again, and so does Python where they are
compiled. A dataclass or a named tuple takes several times as long to make or to read there.
"""

from typing import Final, NamedTuple

from utank_hil.canbus.enumerations import DriveState, Mode
from utank_hil.canbus.messages import ForecastPoints

MEASURED: Final = ("roll_rad", "roll_rate_rad_s", "level_m")
"""Names of what a law may measure, of `MotionSample` or of `Measurements`."""


class MotionSample:
    """The last good sample of one motion sensor; zero before the first."""

    def __init__(
        self, roll_rad: float = 0.0, roll_rate_rad_s: float = 0.0, heard_ns: int = 0,
        age_ms: float = 0.0, valid: bool = True, discarded: int = 0,
    ) -> None:  # fmt: skip
        self.roll_rad: Final = roll_rad
        self.roll_rate_rad_s: Final = roll_rate_rad_s
        self.heard_ns: Final = heard_ns  #: Time of receipt.
        self.age_ms: Final = age_ms  #: Time since then.
        self.valid: Final = valid  #: The sensor's messages arrive intact and in order.
        self.discarded: Final = discarded  #: Samples so far that were no motion of a ship.


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


class Measurements:
    """Everything that was received, plausible, with its age, at one tick.

    Ages count from the last accepted frame with plausible content. An age of what is not on board
    is negative: it is never late. The first five fields are those of `Wishes`.
    """

    def __init__(
        self, armed: bool, stop: bool, arm_edge: bool, reset_edge: bool, passive_edge: bool,
        now_ns: int, requested_mode: Mode, panel_age_ms: float, panel_matches: bool,
        motions: tuple[MotionSample, ...], port_level_m: float, starboard_level_m: float,
        level_m: float, tank_ns: int, tank_cycles: int, tank_age_ms: float, levels_discarded: int,
        high_level: bool, pressure_pa: float, pump_age_ms: float, drive_state: DriveState | None,
        drive_age_ms: float, drive_echo_ns: int, drive_echo: int | None, drive_fault: bool,
        drive_warns: bool, drive_held_back: bool, drive_at_speed: bool, power_w: float,
        valve_opening: float, valve_following: bool, valve_fault: bool, valve_echo_ns: int,
        valve_echo: int | None, valve_heard_ns: int, hardwired_stop: bool,
        hardwired_age_ms: float, versions_match: bool, protection_valid: bool,
        address_conflict: bool, claimed_twice: bool, link_lost: bool,
        frames: int, foreign: int, device_error: bool,
        forecast: "tuple[tuple[int, ForecastPoints], ...]" = (),
        forecast_age_ms: float = 0.0,
    ) -> None:  # fmt: skip
        self.armed: Final = armed
        self.stop: Final = stop
        self.arm_edge: Final = arm_edge
        self.reset_edge: Final = reset_edge
        self.passive_edge: Final = passive_edge
        self.now_ns: Final = now_ns  #: Time of the tick.
        self.requested_mode: Final = requested_mode
        self.panel_age_ms: Final = panel_age_ms
        #: The panel in command runs this catalogue and configuration.
        self.panel_matches: Final = panel_matches
        self.motions: Final = motions  #: Of the one or two motion sensors.
        #: port_level_m, starboard_level_m: above still water.
        self.port_level_m: Final = port_level_m
        self.starboard_level_m: Final = starboard_level_m
        self.level_m: Final = level_m  #: Starboard up: half the difference of the two gauges.
        self.tank_ns: Final = tank_ns  #: Time of receipt of the levels.
        self.tank_cycles: Final = tank_cycles  #: Cycles of their message since the first.
        self.tank_age_ms: Final = tank_age_ms
        #: Samples of the gauges that were no motion of water.
        self.levels_discarded: Final = levels_discarded
        self.high_level: Final = high_level  #: A high-level switch is closed or broken.
        self.pressure_pa: Final = pressure_pa  #: Across the pump.
        self.pump_age_ms: Final = pump_age_ms
        self.drive_state: Final = drive_state
        self.drive_age_ms: Final = drive_age_ms
        #: drive_echo_ns, drive_echo: command counter that the drive's status sends back, and when
        #: it first came; of the valve likewise.
        self.drive_echo_ns: Final = drive_echo_ns
        self.drive_echo: Final = drive_echo
        self.drive_fault: Final = drive_fault
        self.drive_warns: Final = drive_warns
        #: The drive says that its power or its speed is at the limit.
        self.drive_held_back: Final = drive_held_back
        #: Its speed, or it does not say which of them.
        self.drive_at_speed: Final = drive_at_speed
        self.power_w: Final = power_w  #: Electric power that the drive takes.
        self.valve_opening: Final = valve_opening
        self.valve_following: Final = valve_following
        self.valve_fault: Final = valve_fault
        self.valve_echo_ns: Final = valve_echo_ns
        self.valve_echo: Final = valve_echo
        #: Time of receipt of the last status with an opening.
        self.valve_heard_ns: Final = valve_heard_ns
        #: The stop loop is, or was since the last look, open or broken.
        self.hardwired_stop: Final = hardwired_stop
        self.hardwired_age_ms: Final = hardwired_age_ms
        #: Of drive, sensors and valve, with the controller's.
        self.versions_match: Final = versions_match
        #: Messages of gauges and drive arrive intact and in order.
        self.protection_valid: Final = protection_valid
        #: Another node sent with the controller's address.
        self.address_conflict: Final = address_conflict
        self.claimed_twice: Final = claimed_twice  #: A node claimed the address of another.
        #: The bus could not be read or written in the last command cycle.
        self.link_lost: Final = link_lost
        self.frames: Final = frames  #: Frames so far, of any kind.
        self.foreign: Final = foreign  #: Those that are not in the catalogue.
        self.device_error: Final = device_error  #: A CANopen device reports an emergency.
        #: Points of a forecast of the waves by their time of receipt, also those that are too old.
        self.forecast: Final = forecast
        self.forecast_age_ms: Final = forecast_age_ms
