"""Makes what the controller judges its faults by."""

from collections import deque
from typing import Final

from utank_hil.base.periodic import Schedule
from utank_hil.base.tick import TICK_NS, TICK_S
from utank_hil.canbus.enumerations import DriveFault, DriveState
from utank_hil.nodes.inbox import Inbox
from utank_hil.safety.observations import MEAN_FRAME_BITS, MILLISECOND_NS, Observations

LOAD_LOOK_NS: Final = 10 * TICK_NS
LOAD_LOOKS: Final = 10
"""The load is that of a second, known anew every tenth: a flood may begin between two seconds."""
HEEL_TIME_CONSTANT_S: Final = 60.0
HEEL_SHARE: Final = TICK_S / HEEL_TIME_CONSTANT_S
FIRST_HEEL_S: Final = 10.0
"""At the start the heel is zero as if it had been measured for so long: no first roll is a heel."""
HEEL_AGE_MS: Final = 100.0
"""An older roll says nothing of the heel."""
CONFLICT_NS: Final = 10_000_000_000
"""A second sender of the controller's address is gone when it has been silent for so long."""
STRANGE_NS: Final = 1_000_000_000
"""A second motion sensor of another version is gone when it has been silent for so long."""
_ALL_LATE: Final = 0x3FF

# read once: in Python 3.11 a member costs eight times as much from its class as from here
_DRIVE_ENABLED: Final = DriveState.OPERATION_ENABLED
_DRIVE_FAULT: Final = DriveState.FAULT
_DRIVE_BRAKES: Final = DriveState.FAULT_REACTION_ACTIVE
_NO_DRIVE_FAULT: Final = DriveFault.NONE


class Observer:
    """Makes the observations of each tick from what was received.

    Parameters
    ----------
    inbox : Inbox
    bit_rate : int
        Of the bus, to judge its load.
    command_cycle_ns : int
        The bus counts as lost for so long after an error.

    Attributes
    ----------
    seen : Observations
        `law_failed`, `found`, `gm_low`, `drive_stays_on` and `command_pa` are the node's own to
        set.
    """

    def __init__(self, inbox: Inbox, bit_rate: int, command_cycle_ns: int) -> None:
        self.seen = Observations()
        self._inbox = inbox
        self._bit_rate = bit_rate
        self._command_cycle_ns = command_cycle_ns
        self._last_ns: int | None = None
        self._late_history = 0
        self._link_lost_ns: int | None = None
        self._load_schedule = Schedule(LOAD_LOOK_NS)
        # at the first tick only a backlog was received
        self._frames_counted: deque[tuple[int, int]] = deque(maxlen=LOAD_LOOKS + 1)
        self._heel_share = TICK_S / FIRST_HEEL_S

    def link_error(self, now_ns: int) -> None:
        """Take note that the bus could not be read or written."""
        self._link_lost_ns = now_ns

    def observe(self, now_ns: int, frames_sent: int) -> None:
        """Overwrite `seen`, once a tick; `frames_sent` by the node since its start."""
        inbox, seen = self._inbox, self.seen
        stations = inbox.stations
        if self._last_ns is None:
            self._last_ns = now_ns
        late_ns = max(0, now_ns - self._last_ns - TICK_NS)
        self._last_ns = now_ns
        missed = -(-late_ns // TICK_NS)  # grid points, each of which counts
        late = (1 << missed) - 1 if missed < 10 else _ALL_LATE
        self._late_history = (self._late_history << max(1, missed) | late) & _ALL_LATE
        seen.tick_late_ms = late_ns / MILLISECOND_NS
        seen.overruns_in_ten = self._late_history.bit_count()
        # first of all: who is in command may change
        (
            seen.armed,
            seen.stop,
            seen.arm_edge,
            seen.reset_edge,
            seen.passive_edge,
        ) = stations.take(now_ns)
        seen.requested_mode = stations.requested_mode
        motions = inbox.motions
        if motions is not None:
            if motions.silent(now_ns):
                inbox.exchange_motion(motions)
            seen.motion_spare_age_ms = (now_ns - motions.spare.heard_ns) / MILLISECOND_NS
        seen.motion_age_ms = (now_ns - inbox.motion_ns) / MILLISECOND_NS
        seen.tank_age_ms = (now_ns - inbox.tank_ns) / MILLISECOND_NS
        seen.pump_age_ms = (now_ns - inbox.pump_ns) / MILLISECOND_NS
        seen.drive_age_ms = (now_ns - inbox.drive_ns) / MILLISECOND_NS
        seen.echo_age_ms = (now_ns - inbox.pump_echo.heard_ns) / MILLISECOND_NS
        seen.panel_age_ms = (now_ns - stations.heard_ns) / MILLISECOND_NS
        seen.drive_enabled = inbox.drive_state is _DRIVE_ENABLED
        seen.drive_fault = (
            inbox.drive_state is _DRIVE_FAULT
            or inbox.drive_state is _DRIVE_BRAKES
            or inbox.drive_fault is not _NO_DRIVE_FAULT
        )
        seen.drive_warns = inbox.drive_warns
        seen.link_lost = (
            self._link_lost_ns is not None and now_ns - self._link_lost_ns <= self._command_cycle_ns
        )
        seen.address_conflict = now_ns - inbox.conflict_ns <= CONFLICT_NS
        seen.claimed_twice = now_ns - inbox.claimed_twice_ns <= CONFLICT_NS
        seen.versions_match = inbox.versions_match and now_ns - inbox.second_strange_ns > STRANGE_NS
        seen.panel_matches = inbox.panel_matches
        seen.protection_valid = inbox.protection_valid
        seen.high_level = inbox.high_level
        hardwired = inbox.hardwired
        if hardwired is not None:
            seen.high_level |= hardwired.high_level
            seen.hardwired_stop = hardwired.stop or hardwired.stop_heard
            hardwired.stop_heard = False
            seen.hardwired_age_ms = (now_ns - hardwired.heard_ns) / MILLISECOND_NS
        seen.roll_rad = inbox.roll_rad
        if seen.motion_age_ms <= HEEL_AGE_MS:
            # at first the mean of all that was measured, and of zeros: a heel is soon known
            seen.heel_rad += self._heel_share * (inbox.roll_rad - seen.heel_rad)
            self._heel_share = max(self._heel_share / (1.0 + self._heel_share), HEEL_SHARE)
        if self._load_schedule.due(now_ns):
            self._count_load(now_ns, inbox.frames + frames_sent)

    def _count_load(self, now_ns: int, frames: int) -> None:
        counted = self._frames_counted
        counted.append((now_ns, frames))
        if len(counted) > LOAD_LOOKS:
            since_ns, before = counted[0]
            bits = (frames - before) * MEAN_FRAME_BITS
            self.seen.bus_load = bits / (self._bit_rate * (now_ns - since_ns) * 1e-9)
