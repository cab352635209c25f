"""The thresholds of the fault table, as the section `safety` of a configuration sets them."""

from dataclasses import dataclass
from typing import Annotated

from utank_hil.base.parameters import Range, range_problems, refuse
from utank_hil.dynamics.ship import RollLimit

_HeelLimit = Annotated[float, Range(above=0, most=0.28)]
_Silence = Annotated[float, Range(above=0, most=1000)]
_Patience = Annotated[float, Range(above=0, most=10_000)]
_BusLoad = Annotated[float, Range(above=0, most=0.85)]


@dataclass(frozen=True, slots=True)
class SafetyLimits:
    """Thresholds of the fault table (`utank_hil.safety.faults`); times in milliseconds.

    The defaults are those of `docs/safety.md`. A ship or a machine may need others, but none at
    which a protection is as good as switched off:

    * Messages and the drive may be silent, and a tick late, for 1 s at most: the longest silence of
      a sensor under pressure in the table, a tenth of the roll period of a ship like the first.
    * The panel while armed, and a drive that is being enabled, get 10 s at most: a roll period, in
      which a stop may not be received, or an arming take effect late.
    * Roll 0.7 rad at most: 40 degrees, to which the IS Code 2008 (part A, 2.2.1) counts a ship's
      righting levers. Heel 0.28 rad at most: 16 degrees, which it lets a steady wind cause (2.3.1).
    * Bus load 0.85 at most: it is counted in mean frames of 143 bits, of which a bus that is full
      of the longest, 160 bits, shows 0.89.
    * Late ticks 10 of ten at most. None leaves them to the limit of a single one and to the drive's
      own timeout, for a bench in an emulated kernel; `run` reports it.

    Attributes
    ----------
    motion_age_ms, tank_age_ms, pump_age_ms : float
        Longest age of a sensor's last good sample while armed.
    motion_spare_age_ms : float
        Age of the last good sample of the motion sensor that is not in use, where there are two,
        from which half the pressure is allowed.
    hardwired_age_ms : float
        Longest age of the hard-wired inputs, where there are such.
    tank_degraded_age_ms, pump_degraded_age_ms : float
        Age of the sensor's last good sample from which half the pressure is allowed.
    drive_age_ms, echo_age_ms : float
        Longest age of the drive's status, and of its last new command echo.
    drive_enabled_within_ms : float
        Longest time the drive may be out of operation enabled while armed.
    valve_age_ms, valve_echo_age_ms : float
        Longest age of the valve's status, and of its last new command echo.
    valve_follows_within_ms : float
        Longest time the valve may not follow while armed.
    valve_off_within_ms : float
        Longest time it may be elsewhere than where the commands should have brought it.
    panel_age_to_arm_ms, panel_age_armed_ms : float
        Longest silence of the operator panel for arming, and while armed.
    arming_timeout_ms : float
        Time the drive gets from arming to operation enabled.
    roll_limit_rad, heel_limit_rad : float
        Largest roll angle, and largest mean roll angle, while armed.
    bus_load_limit : float
        Largest share of the bus in use over a second.
    long_overrun_ms : float
        One tick this late cuts the pressure.
    overruns_in_ten : int or None
        So many late ticks among the last ten end in a ramp to zero; None: they are not judged.

    Raises
    ------
    ValueError
        If a threshold is out of its range.
    """

    motion_age_ms: _Silence = 40.0
    motion_spare_age_ms: _Silence = 100.0
    hardwired_age_ms: _Silence = 150.0
    tank_age_ms: _Silence = 1000.0
    tank_degraded_age_ms: _Silence = 100.0
    pump_age_ms: _Silence = 1000.0
    pump_degraded_age_ms: _Silence = 200.0
    drive_age_ms: _Silence = 60.0
    echo_age_ms: _Silence = 100.0
    drive_enabled_within_ms: _Silence = 40.0
    valve_age_ms: _Silence = 60.0
    valve_echo_age_ms: _Silence = 100.0
    valve_follows_within_ms: _Silence = 100.0
    valve_off_within_ms: _Silence = 300.0
    panel_age_to_arm_ms: _Silence = 600.0
    panel_age_armed_ms: _Patience = 5000.0
    arming_timeout_ms: _Patience = 2000.0
    roll_limit_rad: RollLimit = 0.35
    heel_limit_rad: _HeelLimit = 0.14
    bus_load_limit: _BusLoad = 0.8
    long_overrun_ms: _Silence = 50.0
    overruns_in_ten: Annotated[int, Range(least=1, most=10)] | None = 3

    def __post_init__(self) -> None:
        refuse("safety", range_problems(self))
