"""From measurements to judgement: what the controller may do with the pump, and why not."""

import math
from collections.abc import Collection
from typing import Final

from utank_hil.base.tick import LONG_AGO_NS, TICK_NS, TICK_S
from utank_hil.canbus.enumerations import Fault, Mode
from utank_hil.canbus.events import AlarmEvent
from utank_hil.canbus.measurements import Measurements, MotionSample
from utank_hil.safety import judging
from utank_hil.safety.alarms import AlarmList, Gravity, active_faults, stopping_faults
from utank_hil.safety.monitoring import Monitors
from utank_hil.safety.monitors.finding import Finding
from utank_hil.safety.monitors.senders import BusLoad, Heard
from utank_hil.safety.monitors.thresholds import DEGRADED_SHARE
from utank_hil.safety.safety_limits import SafetyLimits
from utank_hil.safety.situation import MILLISECOND_NS, Judgement, OwnState, Situation
from utank_hil.safety.supervisor import Supervisor

HEEL_TIME_CONSTANT_S: Final = 60.0
"""Three roll periods of a ship that rolls slowly: waves are gone from the mean, a list is not."""
HEEL_SHARE: Final = TICK_S / HEEL_TIME_CONSTANT_S
FIRST_HEEL_S: Final = 10.0
"""Time for which the heel counts as measured, as zero, at the start: no first roll is a heel."""
HEEL_AGE_MS: Final = 100.0
"""An older roll says nothing of the heel."""
SILENT_CYCLES: Final = 2.5
"""Two samples of a motion sensor are missing: the other sensor is used, before the first one counts
as silent."""
MOST_ERRORS: Final = 8
"""So many errors of devices are told while the alarm of the first one lasts."""
QUIET_START_NS: Final = 10_000_000_000
"""What is awaited at the start is an alarm only when it has not come by then."""
LOOKED_AT_NS: Final = 300_000_000
"""From the last alarms in INIT: all streams of messages have been looked at since."""
_TEN: Final = 10

_OF_PACE: Final = {
    Fault.FOREIGN_SENDER: Finding.SECOND_SENDER,
    Fault.NODE_SILENT: Finding.NODE_SILENT,
    Fault.BUS_DEGRADED: Finding.FRAMES_LOST,
}
# read once: in Python 3.11 a member costs eight times as much from its class as from here
_INIT: Final = Mode.INIT
_ACTIVE: Final = Mode.ACTIVE
_NO_FAULT: Final = Fault.NONE


class Lateness:
    """Late ticks."""

    late_ms: float  #: Lateness of this tick.
    in_ten: int  #: Late ticks among the last ten; one that is late by three counts three times.

    def __init__(self) -> None:
        self._last_ns: int | None = None
        self._history = 0

    def update(self, now_ns: int) -> None:
        """Take the time of a tick."""
        last_ns = now_ns if self._last_ns is None else self._last_ns
        self._last_ns = now_ns
        late_ns = max(0, now_ns - last_ns - TICK_NS)
        missed = min(-(-late_ns // TICK_NS), _TEN)  # grid points, each of which counts
        late = (1 << missed) - 1
        self._history = (self._history << max(1, missed) | late) & ((1 << _TEN) - 1)
        self.late_ms = late_ns / MILLISECOND_NS
        self.in_ten = self._history.bit_count()


class Heel:
    """Low-pass of the roll over `HEEL_TIME_CONSTANT_S`."""

    def __init__(self) -> None:
        self.heel_rad = 0.0
        self._share = TICK_S / FIRST_HEEL_S

    def update(self, roll_rad: float) -> None:
        """Take the roll of a tick."""
        # at first the mean of all that was measured, and of zeros: a heel is soon known
        self.heel_rad += self._share * (roll_rad - self.heel_rad)
        self._share = max(self._share / (1.0 + self._share), HEEL_SHARE)


class Safety:
    """Judges each tick what was measured; keeps its own timers and writes to nobody else.

    Without `monitors` the fault table has ages, states and limits only. `pump` says whether the
    tank has a pump to be watched. `motion_cycles_s` are the times between two samples of each
    motion sensor. `unprotected` says that neither counter nor checksum protects a motion sensor's
    messages: the pressure is as of a sensor in doubt unless a second one agrees.
    """

    situation: Situation  #: What was judged last.

    def __init__(
        self,
        limits: SafetyLimits,
        bit_rate: int,
        monitors: Monitors | None = None,
        *,
        pump: bool = True,
        motion_cycles_s: tuple[float, ...] = (TICK_S, TICK_S),
        unprotected: bool = False,
    ) -> None:
        self._silent_ms = [1e3 * SILENT_CYCLES * cycle_s for cycle_s in motion_cycles_s]
        self._oldest_ms = limits.motion_ages_ms
        self._spare_oldest_ms = [max(limits.motion_spare_age_ms, each) for each in self._oldest_ms]
        self._unprotected = unprotected
        self.supervisor = Supervisor(limits)
        self.monitors = monitors
        self.alarms = AlarmList()
        self._pump = pump
        self._degraded_share = DEGRADED_SHARE
        if monitors is not None:
            self._degraded_share = monitors.thresholds.degraded_share
        self._lateness, self._heel, self._load = Lateness(), Heel(), BusLoad(bit_rate)
        self._motion = 0
        self._start_ns: int | None = None
        self._alarming = False
        self._init_ns = LONG_AGO_NS
        self._passing: dict[Fault, Gravity] = {}
        self._errors: set[str] = set()
        self._mode_before = _INIT
        self._refused_by = _NO_FAULT

    @property
    def passive_roll_rad(self) -> float:
        """Roll of the passive twin; NaN without monitors."""
        return math.nan if self.monitors is None else self.monitors.twin.roll_rad

    @property
    def passive_roll_rms_rad(self) -> float:
        """Root mean square of it over some roll periods."""
        return math.nan if self.monitors is None else self.monitors.twin.rms_rad

    @property
    def roll_rms_rad(self) -> float:
        """Root mean square of the measured roll over some roll periods."""
        return math.nan if self.monitors is None else self.monitors.twin.ship_rms_rad

    def judge(self, measured: Measurements, own: OwnState) -> Judgement:
        """Judge one tick; `own` is what the controller knows of itself."""
        now_ns, supervisor, monitors = measured.now_ns, self.supervisor, self.monitors
        self._lateness.update(now_ns)
        load = self._load.update(now_ns, measured.frames + own.frames_sent)
        motions = measured.motions
        second = len(motions) == 2
        if second:
            self._leave_silent_sensor(motions)
        used = self._motion
        motion = motions[used]
        if motion.age_ms <= HEEL_AGE_MS:
            self._heel.update(motion.roll_rad)
        found = 0
        if monitors is not None:
            found = monitors.update(measured, own, used)
        supervisor.count(measured, motion.roll_rad, own.command_pa)
        spare_age_ms = motions[1 - used].age_ms if second else 0.0
        self.situation = situation = Situation(
            measured,
            own,
            motion,
            self._oldest_ms[used],
            spare_age_ms,
            self._spare_oldest_ms[1 - used],
            found,
            self._heel.heel_rad,
            self._lateness.late_ms,
            self._lateness.in_ten,
            load,
            supervisor.rolled_over_ms,
            supervisor.drive_out_ms,
            supervisor.arming_ms,
        )
        supervisor.update(situation, judging.standing(situation, supervisor.limits))
        self._note_causes(now_ns)
        heard = second and spare_age_ms <= situation.spare_limit_ms
        alone = self._alone(found, second=heard)
        unconfirmed_share, passive_roll_rad = None, math.nan
        if monitors is not None:
            passive_roll_rad = monitors.twin.roll_rad
            if self._pump and not monitors.confirmed:
                unconfirmed_share = monitors.thresholds.unconfirmed_share
        return Judgement(
            supervisor.mode,
            supervisor.fault,
            supervisor.demand,
            supervisor.drive_wanted,
            used,
            self._degraded_share if supervisor.degraded or alone else 1.0,
            unconfirmed_share,
            supervisor.standing,
            passive_roll_rad,
        )

    def _alone(self, found: int, *, second: bool) -> bool:
        """Whether unprotected motion is used that no `second` sensor, which is heard, confirms."""
        return self._unprotected and (not second or found & Finding.SENSORS_DISAGREE != 0)

    def _leave_silent_sensor(self, motions: tuple[MotionSample, ...]) -> None:
        """Use the other motion sensor if this one is silent, and that one is not."""
        used = self._motion
        spare, silent_ms = 1 - used, self._silent_ms
        if motions[used].age_ms > silent_ms[used] and motions[spare].age_ms <= silent_ms[spare]:
            self._motion = spare

    def _note_causes(self, now_ns: int) -> None:
        """Keep what may be gone before alarms are looked at, ten times a second."""
        supervisor = self.supervisor
        mode, standing = supervisor.mode, supervisor.standing
        if mode is _INIT and self._mode_before is not _INIT:
            # what it waits for from now on may be back before alarms are looked at
            self._passing[supervisor.fault] = Gravity.ENDS
        self._mode_before = mode
        if mode is not _ACTIVE:
            if standing & judging.STOPPING:  # pragma: no mutate: of none none are kept
                self._passing |= dict.fromkeys(stopping_faults(mode, standing), Gravity.ENDS)
        elif standing & judging.HALVING:  # what stops it is latched  # pragma: no mutate: likewise
            halving = judging.faults(standing & judging.HALVING)
            self._passing |= dict.fromkeys(halving, Gravity.HALVES)
        if supervisor.raised is not _NO_FAULT:
            self.alarms.raise_anew(supervisor.raised, mode, now_ns)
        if self._start_ns is None:
            self._start_ns = now_ns

    def messages(self, code: Fault) -> list[Heard]:
        """The messages by whose pace a fault was judged."""
        finding = _OF_PACE.get(code, 0)
        return [] if self.monitors is None else self.monitors.senders.of(finding)

    def update_alarms(
        self, accepted: list[int | None], now_ns: int, errors: Collection[str] = ()
    ) -> list[AlarmEvent]:
        """Update alarms; return what became of them. `accepted` are codes, None for all.

        `errors` are those that devices report now, in words: each is an alarm of its own.
        """
        supervisor, alarms = self.supervisor, self.alarms
        mode = supervisor.mode
        quiet = self._start_ns is None or now_ns - self._start_ns < QUIET_START_NS
        if mode is _INIT:
            self._init_ns = now_ns
        ready = now_ns - self._init_ns >= LOOKED_AT_NS
        self._alarming = self._alarming or ready or not quiet
        for code in accepted:
            alarms.accept(code, mode, now_ns)
        if not alarms.is_active(Fault.DEVICE_ERROR):
            self._errors.clear()
        elif len(self._errors) < MOST_ERRORS and not self._errors.issuperset(errors):
            alarms.raise_anew(Fault.DEVICE_ERROR, mode, now_ns)
        self._errors.update(errors)
        active = self._passing
        if self._alarming:
            now = active_faults(mode, supervisor.fault, supervisor.standing)
            active |= {code: max(each, active.get(code, each)) for code, each in now.items()}
        alarms.update(active, mode, now_ns)
        self._passing.clear()
        refused_by = supervisor.reset_refused_by
        if refused_by is not self._refused_by:
            self._refused_by = refused_by
            if refused_by is not _NO_FAULT:
                alarms.reset_refused(refused_by, mode, now_ns)
        return alarms.take_events()
