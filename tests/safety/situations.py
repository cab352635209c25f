"""Situations for the fault table, all well but for what a test names, and a supervisor in them.

Names are flat: `motion_age_ms` is the age of the motion sensor's sample, `valve_off_ms` a field of
the valve's report, `drive_enabled` the drive's state.
"""

from typing import Any

from values import changed

from utank_hil.canbus.enumerations import DriveState, Mode
from utank_hil.canbus.measurements import Measurements, MotionSample
from utank_hil.safety import judging
from utank_hil.safety.situation import OwnState, Situation, ValveReport

MEASURED = Measurements(
    armed=False, stop=False, arm_edge=False, reset_edge=False, passive_edge=False, now_ns=0,
    requested_mode=Mode.STANDBY, panel_age_ms=0.0, panel_matches=True, motions=(MotionSample(),),
    port_level_m=0.0, starboard_level_m=0.0, level_m=0.0, tank_ns=0, tank_cycles=0,
    tank_age_ms=0.0, levels_discarded=0, high_level=False,
    pressure_pa=0.0, pump_age_ms=0.0, drive_state=None, drive_age_ms=0.0, drive_echo_ns=0,
    drive_echo=None, drive_fault=False, drive_warns=False, drive_held_back=False,
    drive_at_speed=False, power_w=0.0, valve_opening=1.0, valve_following=False, valve_fault=False,
    valve_echo_ns=0, valve_echo=None,
    valve_heard_ns=0, hardwired_stop=False, hardwired_age_ms=0.0, versions_match=True,
    protection_valid=True, address_conflict=False, claimed_twice=False, link_lost=False, frames=0,
    foreign=0, device_error=False,
)  # fmt: skip
"""Everything heard just now, and all well."""
OWN = OwnState(commissioned=True)
WELL = Situation(
    measured=MEASURED, own=OWN, motion=MotionSample(), motion_limit_ms=40.0, spare_age_ms=0.0,
    spare_limit_ms=100.0, found=0, heel_rad=0.0, tick_late_ms=0.0, overruns_in_ten=0, bus_load=0.0,
    rolled_over_ms=1e9, drive_out_ms=0.0, arming_ms=0.0,
)  # fmt: skip

_OF_MOTION = {"motion_age_ms": "age_ms", "roll_rad": "roll_rad", "motion_valid": "valid"}
_OF_VALVE = {f"valve_{name}": name for name in vars(ValveReport())}
_PARTS = tuple(set(vars(part)) for part in (WELL, OWN, MEASURED))


def situation(now_ns=0, **changes):
    """All well, but for the changes."""
    parts: tuple[dict[str, Any], ...] = ({}, {}, {"now_ns": now_ns})
    motion: dict[str, Any] = {}
    valve: dict[str, Any] = {}
    for name, value in changes.items():
        if name in _OF_MOTION:
            motion[_OF_MOTION[name]] = value
        elif name in _OF_VALVE:
            valve[_OF_VALVE[name]] = value
        elif name == "drive_enabled":
            parts[2]["drive_state"] = DriveState.OPERATION_ENABLED if value else None
        else:
            part = next(part for part, names in zip(parts, _PARTS, strict=True) if name in names)
            part[name] = value
    sample = changed(MotionSample(), **motion)
    return changed(
        WELL,
        measured=changed(MEASURED, motions=(sample,), **parts[2]),
        own=changed(OWN, valve=ValveReport(**valve), **parts[1]),
        motion=sample,
        **parts[0],
    )


def look(supervisor, now_ns, **changes):
    """One tick of a supervisor, which keeps its own timers."""
    seen = situation(now_ns, **changes)
    if "drive_out_ms" in changes:
        supervisor.drive_out_ms = changes["drive_out_ms"]
    supervisor.count(seen.measured, seen.motion.roll_rad, seen.own.command_pa)
    timers = ("rolled_over_ms", "drive_out_ms", "arming_ms")
    seen = changed(seen, **{name: getattr(supervisor, name) for name in timers})
    supervisor.update(seen, judging.standing(seen, supervisor.limits))
