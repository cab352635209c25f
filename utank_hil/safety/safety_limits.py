"""The thresholds of the fault table, as the section `safety` of a configuration sets them."""

from dataclasses import dataclass
from typing import Annotated

from utank_hil.base.parameters import Range, range_problems, refuse
from utank_hil.dynamics.ship import RollLimit

_HeelLimit = Annotated[float, Range(least=1e-3, most=0.28)]
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

    Raises `ValueError` if a threshold is out of its range.
    """

    #: Longest age of the motion sensor's last good sample while armed.
    motion_age_ms: _Silence = 40.0
    #: The same of the second motion sensor; None: that of the first.
    motion_2_age_ms: _Silence | None = None
    #: Age of the last good sample of the motion sensor that is not in use, where there are two,
    #: from which it is an alarm; no less than the age that is allowed while it is in use.
    motion_spare_age_ms: _Silence = 100.0
    #: Longest age of the hard-wired inputs, where there are such.
    hardwired_age_ms: _Silence = 150.0
    #: Longest age of the tank sensor's last good sample while armed.
    tank_age_ms: _Silence = 1000.0
    #: Age of that sample from which half the pressure is allowed.
    tank_degraded_age_ms: _Silence = 100.0
    #: Longest age of the pump sensor's last good sample while armed.
    pump_age_ms: _Silence = 1000.0
    #: Age of that sample from which half the pressure is allowed.
    pump_degraded_age_ms: _Silence = 200.0
    forecast_age_ms: _Silence = 600.0  #: Longest age of a point of a forecast that is used.
    drive_age_ms: _Silence = 60.0  #: Longest age of the drive's status.
    echo_age_ms: _Silence = 100.0  #: Longest age of the drive's last new command echo.
    #: Longest time the drive may be out of operation enabled while armed.
    drive_enabled_within_ms: _Silence = 40.0
    valve_age_ms: _Silence = 60.0  #: Longest age of the valve's status.
    valve_echo_age_ms: _Silence = 100.0  #: Longest age of the valve's last new command echo.
    valve_follows_within_ms: _Silence = 100.0  #: Longest time the valve may not follow while armed.
    #: Longest time it may be elsewhere than where the commands should have brought it.
    valve_off_within_ms: _Silence = 300.0
    panel_age_to_arm_ms: _Silence = 600.0  #: Longest silence of the operator panel for arming.
    panel_age_armed_ms: _Patience = 5000.0  #: Longest silence of the operator panel while armed.
    arming_timeout_ms: _Patience = 2000.0  #: Time the drive gets from arming to operation enabled.
    roll_limit_rad: RollLimit = 0.35  #: Largest roll angle while armed.
    heel_limit_rad: _HeelLimit = 0.14  #: Largest mean roll angle while armed.
    bus_load_limit: _BusLoad = 0.8  #: Largest share of the bus in use over a second.
    long_overrun_ms: _Silence = 50.0  #: One tick this late cuts the pressure.
    #: So many late ticks among the last ten end in a ramp to zero; None: they are not judged.
    overruns_in_ten: Annotated[int, Range(least=1, most=10)] | None = 3

    @property
    def motion_ages_ms(self) -> tuple[float, float]:
        """Longest age of either motion sensor's last good sample while armed."""
        second_ms = self.motion_2_age_ms
        return self.motion_age_ms, self.motion_age_ms if second_ms is None else second_ms

    def __post_init__(self) -> None:
        refuse("safety", range_problems(self))
