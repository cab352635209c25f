"""Mode and safety state machine: decides every tick whether the pump may be driven.

The pump pressure is non-zero only while armed by an operator, fed by fresh and plausible
measurements and inside limits. Everything else ends at zero pressure, latched until an operator
resets and arms again. Arming needs a *rising* edge of the arm bit that this supervisor saw while
ready, so neither a restart nor a fault is ever followed by pressure on its own.

What counts as a fault, and what it does, is the table in `utank_hil.safety.faults`.
"""

from enum import Enum
from typing import Final

from utank_hil.canbus.enumerations import Fault, Mode
from utank_hil.safety import judging
from utank_hil.safety.faults import Condition, Reaction
from utank_hil.safety.observations import MILLISECOND_NS, Observations
from utank_hil.safety.safety_limits import SafetyLimits

# read once: in Python 3.11 a member costs eight times as much from its class as from here
_ACTIVE: Final = Mode.ACTIVE
_NO_FAULT: Final = Fault.NONE
DISARMED_ZERO_WITHIN_MS: Final = 1000
"""When the pressure is cut after disarming, even if the ramp has not come to its end."""
PASSIVE_WITHIN_NS: Final = 2_000_000_000
"""So long PASSIVE that was asked for, and can't be entered yet, is due."""
RESET_WITHIN_MS: Final = 500
"""How long a reset waits for the causes to go: the drive's own fault goes by the reset itself."""
DEPARTURES: Final = 2.0
"""More often out of operation enabled, a drive counts as out of it. It falls by one each second."""
_NEVER_NS: Final = 1 << 62


class Demand(Enum):
    """What the rest of the tick has to do with the pump pressure."""

    CONTROL = "the controller's pressure, limited"
    RAMP = "to zero at the rate limit"
    ZERO = "zero at once"


class Supervisor:
    """The controller's modes: INIT, STANDBY, PASSIVE, ACTIVE and FAULT.

    Attributes
    ----------
    limits : SafetyLimits
        As given.
    mode : Mode
    fault : Fault
        Why the mode is FAULT (latched until reset); in INIT, what is still missing; else NONE, or
        why the last arming was refused.
    demand : Demand
    drive_wanted : bool
        Whether the drive should be in operation enabled.
    degraded : bool
        Whether only `MonitorThresholds.degraded_share` of the pressure is allowed.
    raised : Fault
        What was latched in this tick, or refused arming in it; else NONE.
    reset_refused_by : Fault
        What lasts, in FAULT after a reset was refused; else NONE.
    """

    def __init__(self, limits: SafetyLimits) -> None:
        self.limits = limits
        self.mode = Mode.INIT
        self.fault = Fault.NONE
        self.demand = Demand.ZERO
        self.drive_wanted = False
        self.degraded = False
        self.raised = self.reset_refused_by = Fault.NONE
        self._arming_since_ns: int | None = None
        self._reset_until_ns: int | None = None
        self._passive_until_ns = 0
        self._enabling_until_ns = 0  # in PASSIVE
        self._begin_noting(0)
        self._rolled_over_ns = -_NEVER_NS
        self._zero_at_ns = _NEVER_NS  # the earliest end of those ramps that run

    @property
    def arming(self) -> bool:
        """Whether arming was accepted and the drive is being enabled."""
        return self._arming_since_ns is not None

    def update(self, seen: Observations, now_ns: int) -> None:
        """Take one tick's observations and set `mode`, `fault`, `demand` and `drive_wanted`."""
        self.raised = _NO_FAULT
        if abs(seen.roll_rad) > self.limits.roll_limit_rad:
            self._rolled_over_ns = now_ns
        if self.mode is _ACTIVE:
            self._while_active(seen, now_ns)
            return
        seen.rolled_over_ms = (now_ns - self._rolled_over_ns) / MILLISECOND_NS
        # asked for once, it is due until it is there, or something else is asked for, or it is old
        if seen.passive_edge:
            self._passive_until_ns = now_ns + PASSIVE_WITHIN_NS
        asked = now_ns < self._passive_until_ns and self.mode is not Mode.PASSIVE
        if not asked or seen.requested_mode is not Mode.PASSIVE or seen.stop:
            self._passive_until_ns = 0
        if self.mode is Mode.FAULT:
            self._while_faulted(seen, now_ns)
        else:
            self._while_disarmed(seen, now_ns)

    def _while_active(self, seen: Observations, now_ns: int) -> None:
        self._note_drive(seen, now_ns)
        self.degraded = judging.first_halving(seen, self.limits) is not None
        found = judging.first_ending(seen, self.limits)
        if found is not None:
            self._latch(*found, seen, now_ns)
        elif seen.stop:
            self._disarm(Mode.STANDBY)
        elif not seen.armed or seen.requested_mode is not _ACTIVE:
            # through PASSIVE even on the way to STANDBY: there the pressure ramps down
            self._disarm(Mode.PASSIVE)
            self._zero_at_ns = now_ns + DISARMED_ZERO_WITHIN_MS * MILLISECOND_NS

    def _while_faulted(self, seen: Observations, now_ns: int) -> None:
        if self.demand is Demand.RAMP:
            self._note_drive(seen, now_ns)
            self._ramp(seen, now_ns)
            if now_ns >= self._zero_at_ns or seen.stop or judging.first_stopping(seen, self.limits):
                self.demand = Demand.ZERO
                self.drive_wanted = False
        if seen.reset_edge:
            ramping = self.demand is Demand.RAMP
            self.reset_refused_by = self.fault if ramping else _NO_FAULT
            if not ramping:
                self._reset_until_ns = now_ns + RESET_WITHIN_MS * MILLISECOND_NS
        if self._reset_until_ns is not None:
            self._continue_reset(seen, now_ns, self._reset_until_ns)

    def _continue_reset(self, seen: Observations, now_ns: int, until_ns: int) -> None:
        seen.drive_out_ms = 0.0  # off, as it should be
        lasts = judging.first_lasting(seen, self.limits)
        if lasts is None:
            self._disarm(Mode.STANDBY)
        elif now_ns >= until_ns:
            self._reset_until_ns = None
            self.reset_refused_by = lasts[0]

    def _while_disarmed(self, seen: Observations, now_ns: int) -> None:
        ramping = seen.command_pa != 0.0
        seen.drive_out_ms = 0.0  # off, as it should be
        if self.mode is Mode.PASSIVE:
            if ramping:
                # so what ends ACTIVE ends this
                self._note_drive(seen, now_ns)
                found = judging.first_ending(seen, self.limits)
                if now_ns >= self._zero_at_ns:
                    self.demand = Demand.ZERO
            else:
                self._note_passive_drive(seen, now_ns)
                found = judging.first_ending_passive(seen, self.limits)
            if found is not None:
                self._latch(*found, seen, now_ns)
                return
        # INIT cuts the pressure: what would not end ACTIVE waits for the end of the ramp
        missing = None if ramping else judging.first_awaited(seen, self.limits)
        if missing is not None:
            self._disarm(Mode.INIT, missing[0])
            return
        if seen.stop:
            self._disarm(Mode.STANDBY)
            return
        if self.mode is Mode.INIT:
            self._disarm(Mode.STANDBY)
        if self._arming_since_ns is not None:
            self._continue_arming(seen, now_ns, self._arming_since_ns)
        elif seen.requested_mode is Mode.ACTIVE and seen.arm_edge and seen.armed:
            self._begin_arming(seen, now_ns)
        elif seen.requested_mode is Mode.STANDBY and self.mode is Mode.PASSIVE:
            if not ramping:
                self._disarm(Mode.STANDBY)
        # an old order says nothing of now
        elif self._passive_until_ns and seen.panel_age_ms <= self.limits.panel_age_to_arm_ms:
            self._disarm(Mode.PASSIVE)
            within_ms = self.limits.arming_timeout_ms
            self._enabling_until_ns = now_ns + round(within_ms * MILLISECOND_NS)

    def _begin_arming(self, seen: Observations, now_ns: int) -> None:
        seen.drive_out_ms = 0.0  # off, as it should be
        refusal = judging.first_refusing(seen, self.limits)
        if refusal is not None:
            self.fault = self.raised = refusal[0]
        else:
            self._arming_since_ns = now_ns
            self.drive_wanted = True

    def _continue_arming(self, seen: Observations, now_ns: int, since_ns: int) -> None:
        seen.arming_ms = (now_ns - since_ns) / MILLISECOND_NS
        if not seen.armed or seen.requested_mode is not Mode.ACTIVE:
            self._end_arming(seen, _NO_FAULT)
            return
        # being out of operation enabled does not count yet; all else counts until ACTIVE
        refusal = judging.first_refusing(seen, self.limits)
        if refusal is not None:
            self._end_arming(seen, refusal[0])
        elif seen.drive_enabled:
            self._arming_since_ns = None
            self._begin_noting(now_ns)
            self.mode = Mode.ACTIVE
            self.demand = Demand.CONTROL
            self.fault = Fault.NONE
            self._zero_at_ns = _NEVER_NS
        else:
            found = judging.first_giving_up(seen, self.limits)
            if found is not None:
                self._end_arming(seen, found[0])

    def _end_arming(self, seen: Observations, fault: Fault) -> None:
        """Give arming up; a ramp that it began in goes on to its end."""
        self._disarm(Mode.STANDBY if seen.command_pa == 0.0 else Mode.PASSIVE, fault)
        self.raised = fault

    def _disarm(self, mode: Mode, fault: Fault = Fault.NONE) -> None:
        self.mode = mode
        self.fault = fault
        self.degraded = False
        self._arming_since_ns = None
        # in PASSIVE the drive holds zero pressure, enabled; elsewhere it is off
        self.drive_wanted = mode is Mode.PASSIVE
        self.demand = Demand.RAMP if mode is Mode.PASSIVE else Demand.ZERO
        self._reset_until_ns = None

    def _latch(self, fault: Fault, condition: Condition, seen: Observations, now_ns: int) -> None:
        self.mode = Mode.FAULT
        self.fault = self.raised = fault
        self._arming_since_ns = None
        stop = condition.reaction is Reaction.STOP or seen.stop
        self.demand = Demand.ZERO if stop else Demand.RAMP
        self.drive_wanted = not stop
        self._ramp(seen, now_ns)

    def _ramp(self, seen: Observations, now_ns: int) -> None:
        """Shorten the ramp to the earliest end that a condition asks for."""
        found = judging.soonest_ramp(seen, self.limits)
        if found is not None:
            zero_at_ns = now_ns + found[1].zero_within_ms * MILLISECOND_NS
            self._zero_at_ns = min(self._zero_at_ns, zero_at_ns)

    def _note_passive_drive(self, seen: Observations, now_ns: int) -> None:
        """Count how long it is out of operation enabled; it gets its time to get there."""
        if now_ns < self._enabling_until_ns:
            self._begin_noting(now_ns)
            if seen.drive_enabled:
                self._enabling_until_ns = 0
        else:
            self._note_drive(seen, now_ns)

    def _begin_noting(self, now_ns: int) -> None:
        self._drive_enabled_ns = self._noted_ns = now_ns
        self._was_enabled = True
        self._departures = 0.0

    def _note_drive(self, seen: Observations, now_ns: int) -> None:
        enabled = seen.drive_enabled
        departures = max(self._departures - (now_ns - self._noted_ns) * 1e-9, 0.0)
        self._noted_ns = now_ns
        if self._was_enabled and not enabled:
            departures += 1.0
        self._departures = departures
        self._was_enabled = enabled
        if enabled and departures <= DEPARTURES:
            self._drive_enabled_ns = now_ns
        seen.drive_out_ms = (now_ns - self._drive_enabled_ns) / MILLISECOND_NS
