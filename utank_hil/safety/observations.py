"""What the controller judges its faults by."""

import math
from dataclasses import dataclass
from typing import Final

from utank_hil.canbus.enumerations import Mode

MILLISECOND_NS: Final = 1_000_000
# an eight-byte frame with a 29-bit identifier has 131 bits with its pause; stuffing adds 10 to the
# frames of this bus in the mean and 29 at most
MEAN_FRAME_BITS: Final = 143

VALVE_OFF: Final = 0.15
"""Part of its way that a valve may be from where the commands should have brought it."""


@dataclass(slots=True)
class Observations:
    """What the supervisor looks at in one tick; one object, overwritten every tick.

    Edges are True in the one tick that first saw them, and so is whatever stops or disarms.

    Attributes
    ----------
    motion_age_ms, tank_age_ms, pump_age_ms, drive_age_ms, panel_age_ms : float
        Time since the last accepted frame with plausible content; infinite if there was none.
    motion_spare_age_ms : float
        The same of the motion sensor that is not in use; zero without a second one.
    hardwired_age_ms : float
        The same of the hard-wired inputs; zero without them.
    echo_age_ms : float
        Time since the drive's echo of a new command.
    drive_enabled : bool
        The drive is in operation enabled.
    drive_out_ms : float
        Time for which it is not, while it should be; the supervisor counts it.
    arming_ms : float
        Time since arming was accepted; the supervisor counts it.
    drive_fault : bool
        The drive's status reports a fault.
    drive_warns : bool
        The drive's status has a warning.
    drive_stays_on : bool
        It was told to be off in vain.
    valve_age_ms, valve_echo_age_ms : float
        Time since the valve's status, and since its echo of a new command; zero without a valve.
    valve_fault : bool
        The valve's status reports a fault.
    valve_out_ms : float
        Time for which the valve does not follow, while it should.
    valve_off_ms : float
        Time for which it is not where the commands should have brought it.
    link_lost : bool
        The bus could not be read or written in the last command cycle.
    address_conflict : bool
        Another node sends with the controller's address, or has within `CONFLICT_NS`.
    claimed_twice : bool
        Another node's address was claimed under another name than before, within `CONFLICT_NS`.
    versions_match : bool
        Drive, sensors and valve run the controller's catalogue and configuration.
    panel_matches : bool
        So does the operator's panel.
    commissioned : bool
        A commissioning was passed with this configuration; never overwritten.
    bus_load : float
        Share of the bus in use over the last second.
    protection_valid : bool
        Messages that control needs arrive intact and in order.
    high_level : bool
        A high-level switch is closed or broken.
    hardwired_stop : bool
        The hard-wired stop loop is open or broken.
    roll_rad, heel_rad : float
        Roll, and its low-pass over a minute.
    rolled_over_ms : float
        Time since the roll was beyond its limit; the supervisor counts it.
    tick_late_ms : float
        Lateness of this tick.
    overruns_in_ten : int
        Late ticks among the last ten; one that is late by three counts three times.
    law_failed : bool
        The law raised an error, or its last answer is not finite.
    found : int
        What the monitors found, bits of `Finding`.
    gm_low : bool
        The metacentric height may be below the limit of the stability booklet.
    command_pa : float
        Pressure last commanded.
    requested_mode : Mode
        Mode the operator asks for.
    armed, stop : bool
        State of the operator's arm and stop bits.
    arm_edge, reset_edge : bool
        Rising edges of the operator's arm and reset bits.
    """

    motion_age_ms: float = math.inf
    tank_age_ms: float = math.inf
    pump_age_ms: float = math.inf
    drive_age_ms: float = math.inf
    motion_spare_age_ms: float = 0.0
    hardwired_age_ms: float = 0.0
    echo_age_ms: float = math.inf
    panel_age_ms: float = math.inf
    drive_enabled: bool = False
    drive_out_ms: float = 0.0
    arming_ms: float = 0.0
    drive_fault: bool = False
    drive_warns: bool = False
    drive_stays_on: bool = False
    valve_age_ms: float = 0.0
    valve_echo_age_ms: float = 0.0
    valve_fault: bool = False
    valve_out_ms: float = 0.0
    valve_off_ms: float = 0.0
    link_lost: bool = False
    address_conflict: bool = False
    claimed_twice: bool = False
    versions_match: bool = True
    panel_matches: bool = True
    commissioned: bool = False
    bus_load: float = 0.0
    protection_valid: bool = True
    high_level: bool = False
    hardwired_stop: bool = False
    roll_rad: float = 0.0
    rolled_over_ms: float = math.inf
    heel_rad: float = 0.0
    tick_late_ms: float = 0.0
    overruns_in_ten: int = 0
    law_failed: bool = False
    found: int = 0
    gm_low: bool = False
    command_pa: float = 0.0
    requested_mode: Mode = Mode.STANDBY
    passive_edge: bool = False
    arm_edge: bool = False
    armed: bool = False
    stop: bool = False
    reset_edge: bool = False
