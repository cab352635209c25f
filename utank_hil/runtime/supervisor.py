"""Mode and safety state machine: decides every tick whether the pump may be driven.

The pump pressure is non-zero only while armed by an operator, fed by fresh and plausible
measurements and inside limits. Everything else ends at zero pressure, latched until an operator
resets and arms again: arming needs a *rising* edge of the arm bit that this very supervisor saw
while ready, so neither a restart nor a fault is ever followed by pressure on its own.
"""

import math
from dataclasses import dataclass
from enum import Enum
from typing import Annotated, Final

from utank_hil.canbus.enumerations import Fault, Mode
from utank_hil.dynamics.ship import RollLimit
from utank_hil.parameters import Range, range_problems, refuse
from utank_hil.runtime import faults
from utank_hil.runtime.faults import MILLISECOND_NS, Reaction, Response

NEVER_NS = 1 << 62
"""Age of something that was never heard."""

_HeelLimit = Annotated[float, Range(above=0, most=0.28)]
_Silence = Annotated[float, Range(above=0, most=1000)]
_Patience = Annotated[float, Range(above=0, most=10_000)]
_BusLoad = Annotated[float, Range(above=0, most=0.85)]

# read once: in Python 3.11 a member costs eight times as much from its class as from here
_ACTIVE: Final = Mode.ACTIVE


class Demand(Enum):
    """What the rest of the tick has to do with the pump pressure."""

    CONTROL = "the controller's pressure, limited"
    RAMP = "to zero at the rate limit"
    ZERO = "zero at once"


@dataclass(frozen=True, slots=True)
class SafetyLimits:
    """Thresholds of the fault table, see the safety manual; times in milliseconds.

    The defaults are the table's. A ship or a machine may need others, but none at which a
    protection is as good as switched off:

    * Messages, the drive and the loop itself may be away for 1 s at most, the longest that the
      table lets any sensor be silent under pressure: a tenth of the roll of a ship like the first.
    * The operator's panel while armed, and a drive that is being enabled, get 10 s at most: a roll
      period, for which an operator may find his stop unheard, or his arming come late.
    * Roll 0.7 rad at most: 40 degrees, to which the IS Code 2008 (part A, 2.2.1) counts a ship's
      righting levers. Heel 0.28 rad at most: 16 degrees, which it lets a steady wind cause (2.3.1).
    * Bus load 0.85 at most: it is counted in mean frames of 143 bits, of which a bus that is full
      of the longest, 160 bits, shows 0.89.
    * Late ticks 10 of ten at most. They may be left to the limit of a single one and the drive's
      own timeout (None), for a bench under a kernel that keeps no time: `run` tells of it.

    Attributes
    ----------
    motion_age_ms, tank_age_ms, pump_age_ms : float
        Longest age of a sensor's last good sample while armed.
    tank_degraded_age_ms : float
        Age of the tank's last good sample from which half the pressure is allowed.
    drive_age_ms, echo_age_ms : float
        Longest age of the drive's status, and of its last new command echo.
    drive_enabled_within_ms : float
        Longest time the drive may be out of operation enabled while armed.
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

    motion_age_ms: _Silence = 30.0
    tank_age_ms: _Silence = 1000.0
    tank_degraded_age_ms: _Silence = 100.0
    pump_age_ms: _Silence = 1000.0
    drive_age_ms: _Silence = 60.0
    echo_age_ms: _Silence = 100.0
    drive_enabled_within_ms: _Silence = 40.0
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


@dataclass(slots=True)
class Observations:
    """What the supervisor looks at in one tick; one object, overwritten every tick.

    Ages are nanoseconds since the last accepted frame with plausible content, `NEVER_NS` if there
    was none. Edges are True in the one tick that first saw them.
    """

    motion_age_ns: int = NEVER_NS
    tank_age_ns: int = NEVER_NS
    pump_age_ns: int = NEVER_NS
    drive_age_ns: int = NEVER_NS
    echo_age_ns: int = NEVER_NS
    panel_age_ns: int = NEVER_NS
    drive_enabled: bool = False
    drive_fault: bool = False
    link_lost: bool = False
    address_conflict: bool = False
    versions_match: bool = True
    bus_load: float = 0.0
    protection_valid: bool = True
    high_level: bool = False
    roll_rad: float = 0.0
    heel_rad: float = 0.0
    tick_late_ns: int = 0
    overruns_in_ten: int = 0
    law_failed: bool = False
    command_pa: float = 0.0
    requested_mode: Mode = Mode.STANDBY
    arm_edge: bool = False
    armed: bool = False
    stop: bool = False
    reset_edge: bool = False


def _ns(milliseconds: float) -> int:
    return round(milliseconds * MILLISECOND_NS)


class Supervisor:
    """The controller's modes: INIT, STANDBY, PASSIVE, ACTIVE and FAULT.

    Attributes
    ----------
    mode : Mode
    fault : Fault
        Why the mode is FAULT (latched); in INIT, what is still missing; else NONE, or why the last
        arming was refused.
    demand : Demand
    drive_wanted : bool
        Whether the drive should be in operation enabled.
    degraded : bool
        Whether only half the pressure is allowed.
    """

    def __init__(self, limits: SafetyLimits) -> None:
        self._limits = limits
        self._motion_age_ns = _ns(limits.motion_age_ms)
        self._tank_age_ns = _ns(limits.tank_age_ms)
        self._tank_degraded_age_ns = _ns(limits.tank_degraded_age_ms)
        self._pump_age_ns = _ns(limits.pump_age_ms)
        self._drive_age_ns = _ns(limits.drive_age_ms)
        self._echo_age_ns = _ns(limits.echo_age_ms)
        self._drive_enabled_within_ns = _ns(limits.drive_enabled_within_ms)
        self._panel_age_to_arm_ns = _ns(limits.panel_age_to_arm_ms)
        self._panel_age_ns = _ns(limits.panel_age_armed_ms)
        self._arming_timeout_ns = _ns(limits.arming_timeout_ms)
        self._long_overrun_ns = _ns(limits.long_overrun_ms)
        self._overruns_in_ten = limits.overruns_in_ten or math.inf
        self.mode = Mode.INIT
        self.fault = Fault.NONE
        self.demand = Demand.ZERO
        self.drive_wanted = False
        self.degraded = False
        self._arming_since_ns: int | None = None
        self._drive_enabled_ns = 0
        self._zero_at_ns = 0

    @property
    def arming(self) -> bool:
        """Whether arming was accepted and the drive is being enabled."""
        return self._arming_since_ns is not None

    def update(self, seen: Observations, now_ns: int) -> None:
        """Take one tick's observations and set `mode`, `fault`, `demand` and `drive_wanted`."""
        if self.mode is _ACTIVE:
            self._while_active(seen, now_ns)
        elif self.mode is Mode.FAULT:
            self._while_faulted(seen, now_ns)
        else:
            self._while_disarmed(seen, now_ns)

    def _while_active(self, seen: Observations, now_ns: int) -> None:
        if seen.drive_enabled:
            self._drive_enabled_ns = now_ns
        self.degraded = seen.tank_age_ns > self._tank_degraded_age_ns
        response = self._first_fault(seen, now_ns)
        if response is not None:
            self._latch(response, now_ns)
        elif seen.stop:
            self._disarm(Mode.STANDBY)
        elif not seen.armed or seen.requested_mode is not _ACTIVE:
            # through PASSIVE even on the way to STANDBY: there the pressure ramps down
            self._disarm(Mode.PASSIVE)

    def _while_faulted(self, seen: Observations, now_ns: int) -> None:
        if self.demand is Demand.RAMP:
            if seen.drive_enabled:
                self._drive_enabled_ns = now_ns
            worse = self._first_fault(seen, now_ns)
            if (
                now_ns >= self._zero_at_ns
                or (worse is not None and worse.reaction is Reaction.STOP)
                or seen.stop
            ):
                self.demand = Demand.ZERO
                self.drive_wanted = False
        if seen.reset_edge and self.demand is Demand.ZERO and self._missing(seen) is Fault.NONE:
            self._disarm(Mode.STANDBY)

    def _while_disarmed(self, seen: Observations, now_ns: int) -> None:
        missing = self._missing(seen)
        if missing is not Fault.NONE or seen.stop:
            self._disarm(Mode.INIT if missing is not Fault.NONE else Mode.STANDBY)
            self.fault = missing
            return
        if self.mode is Mode.INIT:
            self._disarm(Mode.STANDBY)
        if self._arming_since_ns is not None:
            self._continue_arming(seen, now_ns, self._arming_since_ns)
        elif seen.requested_mode is Mode.ACTIVE and seen.arm_edge:
            self._begin_arming(seen, now_ns)
        elif seen.requested_mode is Mode.STANDBY and self.mode is Mode.PASSIVE:
            if seen.command_pa == 0.0:  # the ramp down has come to its end
                self._disarm(Mode.STANDBY)
        elif seen.requested_mode is Mode.PASSIVE and self.mode is Mode.STANDBY:
            self._disarm(Mode.PASSIVE)

    def _begin_arming(self, seen: Observations, now_ns: int) -> None:
        # being out of operation enabled counts from here on
        self._drive_enabled_ns = now_ns
        refusal = self._first_fault(seen, now_ns)
        if refusal is None and seen.panel_age_ns > self._panel_age_to_arm_ns:
            refusal = faults.OPERATOR_SILENT
        if refusal is not None:
            self.fault = refusal.fault
        else:
            self._arming_since_ns = now_ns
            self.drive_wanted = True

    def _continue_arming(self, seen: Observations, now_ns: int, since_ns: int) -> None:
        if not seen.armed or seen.requested_mode is not Mode.ACTIVE:
            self._disarm(Mode.STANDBY)
        elif seen.drive_enabled:
            self._arming_since_ns = None
            self._drive_enabled_ns = now_ns
            self.mode = Mode.ACTIVE
            self.demand = Demand.CONTROL
            self.fault = Fault.NONE
        elif now_ns - since_ns > self._arming_timeout_ns:
            self._disarm(Mode.STANDBY)
            self.fault = Fault.DRIVE_FAULT

    def _disarm(self, mode: Mode) -> None:
        self.mode = mode
        self.fault = Fault.NONE
        self.degraded = False
        self._arming_since_ns = None
        # in PASSIVE the drive holds zero pressure, enabled; elsewhere it is off
        self.drive_wanted = mode is Mode.PASSIVE
        self.demand = Demand.RAMP if mode is Mode.PASSIVE else Demand.ZERO

    def _latch(self, response: Response, now_ns: int) -> None:
        self.mode = Mode.FAULT
        self.fault = response.fault
        self._zero_at_ns = now_ns + response.zero_within_ns
        stop = response.reaction is Reaction.STOP
        self.demand = Demand.ZERO if stop else Demand.RAMP
        self.drive_wanted = not stop

    def _missing(self, seen: Observations) -> Fault:
        """Find what keeps the controller from being ready, whatever the operator wants."""
        if seen.link_lost:
            return Fault.BUS_LOST
        if seen.address_conflict:
            return Fault.ADDRESS_CONFLICT
        if seen.motion_age_ns > self._motion_age_ns:
            return Fault.MOTION_SILENT
        if seen.tank_age_ns > self._tank_degraded_age_ns:
            return Fault.TANK_SILENT
        if seen.pump_age_ns > self._pump_age_ns:
            return Fault.PUMP_SENSOR_SILENT
        if seen.drive_age_ns > self._drive_age_ns or seen.echo_age_ns > self._echo_age_ns:
            return Fault.DRIVE_SILENT
        if not seen.versions_match:
            return Fault.VERSION_MISMATCH
        return Fault.NONE

    def _first_fault(self, seen: Observations, now_ns: int) -> Response | None:
        """Find the first reason not to drive the pump; those that cut the pressure stand first."""
        limits = self._limits
        if seen.link_lost:
            return faults.BUS_LOST
        if seen.address_conflict:
            return faults.ADDRESS_CONFLICT
        if not seen.versions_match:
            return faults.VERSION_MISMATCH
        if seen.drive_fault or now_ns - self._drive_enabled_ns > self._drive_enabled_within_ns:
            return faults.DRIVE_FAULT
        if seen.drive_age_ns > self._drive_age_ns or seen.echo_age_ns > self._echo_age_ns:
            return faults.DRIVE_SILENT
        if seen.law_failed:
            return faults.LAW_FAILED
        if seen.high_level:
            return faults.LEVEL_LIMIT
        if seen.bus_load > limits.bus_load_limit:
            return faults.BUS_OVERLOAD
        if seen.tick_late_ns > self._long_overrun_ns:
            return faults.LONG_OVERRUN
        if seen.motion_age_ns > self._motion_age_ns:
            return faults.MOTION_SILENT
        if seen.tank_age_ns > self._tank_age_ns:
            return faults.TANK_SILENT
        if seen.pump_age_ns > self._pump_age_ns:
            return faults.PUMP_SENSOR_SILENT
        if not seen.protection_valid:
            return faults.PROTECTION
        if abs(seen.roll_rad) > limits.roll_limit_rad or abs(seen.heel_rad) > limits.heel_limit_rad:
            return faults.HEEL_LIMIT
        if seen.overruns_in_ten >= self._overruns_in_ten:
            return faults.REPEATED_OVERRUNS
        if seen.panel_age_ns > self._panel_age_ns:
            return faults.OPERATOR_SILENT
        return None
