"""Mode and safety state machine: decides every tick whether the pump may be driven.

The pump pressure is non-zero only while armed by an operator, fed by fresh and plausible
measurements and inside limits. Everything else ends at zero pressure, latched until an operator
resets and arms again. Arming needs a *rising* edge of the arm bit that this supervisor saw while
ready, so neither a restart nor a fault is ever followed by pressure on its own.

What counts as a fault, and what it does, is the table in `utank_hil.safety.faults`.
"""

from typing import Final

from utank_hil.base.tick import LONG_AGO_NS, NEVER_NS
from utank_hil.canbus.enumerations import DriveState, Fault, Mode
from utank_hil.canbus.measurements import Measurements
from utank_hil.safety import judging
from utank_hil.safety.faults import Condition, Reaction
from utank_hil.safety.safety_limits import SafetyLimits
from utank_hil.safety.situation import MILLISECOND_NS, Demand, Situation

# read once: in Python 3.11 a member costs eight times as much from its class as from here
_ACTIVE: Final = Mode.ACTIVE
_FAULT: Final = Mode.FAULT
_ENABLED: Final = DriveState.OPERATION_ENABLED
_NO_FAULT: Final = Fault.NONE
DISARMED_ZERO_WITHIN_MS: Final = 1000
"""When the pressure is cut after disarming, even if the ramp has not come to its end."""
PASSIVE_WITHIN_NS: Final = 2_000_000_000
"""So long PASSIVE that was asked for, and can't be entered yet, is due."""
RESET_WITHIN_MS: Final = 500
"""How long a reset waits for the causes to go: the drive's own fault goes by the reset itself."""
DEPARTURES: Final = 2.0
"""More often out of operation enabled, a drive counts as out of it. It falls by one each second."""


class Supervisor:
    """The controller's modes: INIT, STANDBY, PASSIVE, ACTIVE and FAULT.

    `raised` is what was latched in this tick, or refused arming in it; `reset_refused_by` is what
    lasts, in FAULT after a reset was refused. Else either is NONE.
    """

    #: rolled_over_ms, drive_out_ms, arming_ms: timers, as in `Situation`.
    rolled_over_ms: float
    drive_out_ms: float
    arming_ms: float
    standing: int
    """Conditions that hold, bits of `judging.standing`; without those of a drive that is to be off.
    """

    def __init__(self, limits: SafetyLimits) -> None:
        self.limits = limits
        self.mode = Mode.INIT
        #: Why the mode is FAULT (latched until reset); in INIT, what is still missing; else NONE,
        #: or why the last arming was refused.
        self.fault = Fault.NONE
        self.demand = Demand.ZERO
        self.drive_wanted = False  #: Whether the drive should be in operation enabled.
        #: Whether only `MonitorThresholds.degraded_share` of the pressure is allowed.
        self.degraded = False
        self.raised = self.reset_refused_by = Fault.NONE
        self._arming_since_ns: int | None = None
        self._reset_until_ns: int | None = None
        self._passive_until_ns = 0
        self._enabling_until_ns = 0  # in PASSIVE  # pragma: no mutate: before any tick
        self._begin_noting(0)  # pragma: no mutate: it begins anew with ACTIVE and PASSIVE
        self._rolled_over_ns = LONG_AGO_NS
        self._zero_at_ns = NEVER_NS  # the earliest end of those ramps that run

    @property
    def arming(self) -> bool:
        """Whether arming was accepted and the drive is being enabled."""
        return self._arming_since_ns is not None

    def count(self, measured: Measurements, roll_rad: float, command_pa: float) -> None:
        """Advance the timers, before the tick's conditions are judged.

        `roll_rad` is that of the motion sensor in use, `command_pa` the pressure last commanded.
        """
        now_ns = measured.now_ns
        if not abs(roll_rad) <= self.limits.roll_limit_rad:  # so that NaN is beyond it, too
            self._rolled_over_ns = now_ns
        self.rolled_over_ms = (now_ns - self._rolled_over_ns) / MILLISECOND_NS
        since_ns = self._arming_since_ns
        self.arming_ms = 0.0 if since_ns is None else (now_ns - since_ns) / MILLISECOND_NS
        enabled = measured.drive_state is _ENABLED
        if self.mode is _ACTIVE or (self.mode is _FAULT and self.demand is Demand.RAMP):
            self._note_drive(now_ns, enabled=enabled)
        elif self.mode is not _FAULT:
            self.drive_out_ms = 0.0  # off, as it should be
            if self.mode is Mode.PASSIVE:
                # while the pressure falls, what ends ACTIVE ends this
                if command_pa != 0.0 or now_ns >= self._enabling_until_ns:
                    self._note_drive(now_ns, enabled=enabled)
                else:  # it gets its time to get there
                    self._begin_noting(now_ns)
                    if enabled:
                        self._enabling_until_ns = 0  # pragma: no mutate: long ago

    def update(self, seen: Situation, standing: int) -> None:
        """Take one tick's situation and set `mode`, `fault`, `demand` and `drive_wanted`.

        `standing` are the conditions that hold in it, see `judging.standing`.
        """
        now_ns, measured = seen.measured.now_ns, seen.measured
        self.raised = _NO_FAULT
        self.standing = standing
        if self.mode is _ACTIVE:
            self._while_active(measured, now_ns)
            return
        # asked for once, it is due until it is there, or something else is asked for, or it is old
        if measured.passive_edge:
            self._passive_until_ns = now_ns + PASSIVE_WITHIN_NS
        asked = now_ns < self._passive_until_ns and self.mode is not Mode.PASSIVE
        if not asked or measured.requested_mode is not Mode.PASSIVE or measured.stop:
            self._passive_until_ns = 0
        if self.mode is _FAULT:
            self._while_faulted(measured, now_ns)
        else:
            self._while_disarmed(measured, now_ns, ramping=seen.own.command_pa != 0.0)

    def _while_active(self, measured: Measurements, now_ns: int) -> None:
        self.degraded = self.standing & judging.HALVING != 0
        found = judging.first_ending(self.standing)
        if found is not None:
            self._latch(*found, now_ns, stop=measured.stop)
        elif measured.stop:
            self._disarm(Mode.STANDBY)
        elif not measured.armed or measured.requested_mode is not _ACTIVE:
            # through PASSIVE even on the way to STANDBY: there the pressure ramps down
            self._disarm(Mode.PASSIVE)
            self._zero_at_ns = now_ns + DISARMED_ZERO_WITHIN_MS * MILLISECOND_NS

    def _while_faulted(self, measured: Measurements, now_ns: int) -> None:
        if self.demand is Demand.RAMP:
            self._ramp(now_ns)
            if now_ns >= self._zero_at_ns or measured.stop or self.standing & judging.STOPPING:
                self.demand = Demand.ZERO
                self.drive_wanted = False
        if measured.reset_edge:
            ramping = self.demand is Demand.RAMP
            self.reset_refused_by = self.fault if ramping else _NO_FAULT
            if not ramping:
                self._reset_until_ns = now_ns + RESET_WITHIN_MS * MILLISECOND_NS
        if self._reset_until_ns is not None:
            self._continue_reset(now_ns, self._reset_until_ns)

    def _continue_reset(self, now_ns: int, until_ns: int) -> None:
        self._excuse_drive()
        lasts = judging.first_lasting(self.standing)
        if lasts is None:
            self._disarm(Mode.STANDBY)
        elif now_ns >= until_ns:
            self._reset_until_ns = None
            self.reset_refused_by = lasts[0]

    def _while_disarmed(self, measured: Measurements, now_ns: int, *, ramping: bool) -> None:
        if self.mode is Mode.PASSIVE:
            if ramping:
                # so what ends ACTIVE ends this
                found = judging.first_ending(self.standing)
                if now_ns >= self._zero_at_ns:
                    self.demand = Demand.ZERO
            else:
                found = judging.first(self.standing & judging.ENDING_PASSIVE)
            if found is not None:
                self._latch(*found, now_ns, stop=measured.stop)
                return
        # INIT cuts the pressure: what would not end ACTIVE waits for the end of the ramp
        missing = None if ramping else judging.first_awaited(self.standing)
        if missing is not None:
            self._disarm(Mode.INIT, missing[0])
            return
        if measured.stop:
            self._disarm(Mode.STANDBY)
            return
        if self.mode is Mode.INIT:
            self._disarm(Mode.STANDBY)
        if self.arming:
            self._continue_arming(measured, now_ns, ramping=ramping)
        elif measured.requested_mode is _ACTIVE and measured.arm_edge and measured.armed:
            self._begin_arming(now_ns)
        elif measured.requested_mode is Mode.STANDBY and self.mode is Mode.PASSIVE:
            if not ramping:
                self._disarm(Mode.STANDBY)
        # an old order says nothing of now
        elif self._passive_until_ns and measured.panel_age_ms <= self.limits.panel_age_to_arm_ms:
            self._disarm(Mode.PASSIVE)
            within_ms = self.limits.arming_timeout_ms
            self._enabling_until_ns = now_ns + round(within_ms * MILLISECOND_NS)

    def _begin_arming(self, now_ns: int) -> None:
        self._excuse_drive()
        refusal = judging.first_refusing(self.standing)
        if refusal is not None:
            self.fault = self.raised = refusal[0]
        else:
            self._arming_since_ns = now_ns
            self.drive_wanted = True

    def _continue_arming(self, measured: Measurements, now_ns: int, *, ramping: bool) -> None:
        # being out of operation enabled does not count yet; all else counts until ACTIVE
        refusal = judging.first_refusing(self.standing)
        if not measured.armed or measured.requested_mode is not _ACTIVE:
            self._end_arming(_NO_FAULT, ramping=ramping)
        elif refusal is not None:
            self._end_arming(refusal[0], ramping=ramping)
        elif measured.drive_state is _ENABLED:
            self._arming_since_ns = None
            self._begin_noting(now_ns)
            self.mode = _ACTIVE
            self.demand = Demand.CONTROL
            self.fault = Fault.NONE
            self._zero_at_ns = NEVER_NS
        else:
            found = judging.first(self.standing & judging.GIVING_UP)
            if found is not None:
                self._end_arming(found[0], ramping=ramping)

    def _end_arming(self, fault: Fault, *, ramping: bool) -> None:
        """Give arming up; a ramp that it began in goes on to its end."""
        self._disarm(Mode.PASSIVE if ramping else Mode.STANDBY, fault)
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

    def _latch(self, fault: Fault, condition: Condition, now_ns: int, *, stop: bool) -> None:
        self.mode = _FAULT
        self.fault = self.raised = fault
        self._arming_since_ns = None
        stop |= condition.reaction is Reaction.STOP
        self.demand = Demand.ZERO if stop else Demand.RAMP
        self.drive_wanted = not stop
        self._ramp(now_ns)

    def _ramp(self, now_ns: int) -> None:
        """Shorten the ramp to the earliest end that a condition asks for."""
        found = judging.soonest_ramp(self.standing)
        if found is not None:
            zero_at_ns = now_ns + found[1].zero_within_ms * MILLISECOND_NS
            self._zero_at_ns = min(self._zero_at_ns, zero_at_ns)

    def _excuse_drive(self) -> None:
        """Leave out that the drive is off: it should be."""
        self.drive_out_ms = 0.0
        self.standing &= ~judging.DRIVE_OUT

    def _begin_noting(self, now_ns: int) -> None:
        self._drive_enabled_ns = self._noted_ns = now_ns
        self._was_enabled = True
        self._departures = 0.0

    def _note_drive(self, now_ns: int, *, enabled: bool) -> None:
        departures = max(self._departures - (now_ns - self._noted_ns) * 1e-9, 0.0)
        self._noted_ns = now_ns
        if self._was_enabled and not enabled:
            departures += 1.0
        self._departures = departures
        self._was_enabled = enabled
        if enabled and departures <= DEPARTURES:  # pragma: no mutate: it is never just that
            self._drive_enabled_ns = now_ns
        self.drive_out_ms = (now_ns - self._drive_enabled_ns) / MILLISECOND_NS
