"""What the controller judges its faults by."""

import math
from dataclasses import dataclass

from utank_hil.canbus.enumerations import Mode


@dataclass(slots=True)
class Observations:
    """What the supervisor looks at in one tick; one object, overwritten every tick.

    Edges are True in the one tick that first saw them.

    Attributes
    ----------
    motion_age_ms, tank_age_ms, pump_age_ms, drive_age_ms, panel_age_ms : float
        Time since the last accepted frame with plausible content; infinite if there was none.
    echo_age_ms : float
        Time since the drive's echo of a new command.
    drive_enabled : bool
        The drive is in operation enabled.
    drive_out_ms : float
        Time for which it is not, while it should be; the supervisor counts it.
    arming_ms : float
        Time since arming was accepted; the supervisor counts it.
    drive_fault : bool
        The drive's status tells of a fault.
    link_lost : bool
        The bus could not be read or written in the last command cycle.
    address_conflict : bool
        Another node sends with the controller's address.
    versions_match : bool
        Drive and sensors run the controller's catalogue and configuration.
    bus_load : float
        Share of the bus in use over the last second.
    protection_valid : bool
        Messages that control needs arrive intact and in order.
    high_level : bool
        A high-level switch is closed or broken.
    roll_rad, heel_rad : float
        Roll, and its low-pass over a minute.
    tick_late_ms : float
        Lateness of this tick.
    overruns_in_ten : int
        Late ticks among the last ten.
    law_failed : bool
        The law raised an error, or its last answer is not finite.
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
    echo_age_ms: float = math.inf
    panel_age_ms: float = math.inf
    drive_enabled: bool = False
    drive_out_ms: float = 0.0
    arming_ms: float = 0.0
    drive_fault: bool = False
    link_lost: bool = False
    address_conflict: bool = False
    versions_match: bool = True
    bus_load: float = 0.0
    protection_valid: bool = True
    high_level: bool = False
    roll_rad: float = 0.0
    heel_rad: float = 0.0
    tick_late_ms: float = 0.0
    overruns_in_ten: int = 0
    law_failed: bool = False
    command_pa: float = 0.0
    requested_mode: Mode = Mode.STANDBY
    arm_edge: bool = False
    armed: bool = False
    stop: bool = False
    reset_edge: bool = False
