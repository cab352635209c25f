"""The controller on the bus: from the frames that come in to the pump command that goes out."""

import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Final

import numpy as np

from utank_hil.base.arrays import FloatArray
from utank_hil.base.periodic import Schedule
from utank_hil.base.tick import TICK_NS, TICK_S, is_whole_ticks
from utank_hil.canbus import (
    Address,
    Alarm,
    Catalogue,
    ControllerStatus,
    ControlWord,
    Fault,
    Frame,
    Mode,
    PassiveTwin,
    PumpCommand,
    RetuningState,
    SeaEstimate,
    ShipEstimate,
)
from utank_hil.canbus.events import AlarmEvent, RetuningEvent
from utank_hil.control.interface import PRESSURE, VALVE, Controller, Plans, StartsAnew
from utank_hil.control.level_observer import LevelObserver
from utank_hil.control.limiter import CommandLimiter
from utank_hil.nodes.drive_sequence import DriveSequence
from utank_hil.nodes.housekeeping import Housekeeping
from utank_hil.nodes.inbox import Inbox
from utank_hil.nodes.monitoring import STALE_MS, Monitors
from utank_hil.nodes.observer import Observer
from utank_hil.nodes.redundancy import Redundancy
from utank_hil.nodes.signals import SIGNALS, put_quick, put_slow
from utank_hil.nodes.valve_command import ValveCommander
from utank_hil.retuning.estimator import SAMPLE_TIME_S, EstimateFigures, Estimator
from utank_hil.retuning.law_exchange import LawExchange
from utank_hil.runners.statistics import LoopStatistics
from utank_hil.safety.alarms import AlarmList, Gravity, active_faults, all_stopping
from utank_hil.safety.faults import FAULTS
from utank_hil.safety.judging import all_halving, first_stopping
from utank_hil.safety.monitors.thresholds import DEGRADED_SHARE
from utank_hil.safety.observations import MILLISECOND_NS
from utank_hil.safety.supervisor import Demand, Supervisor

NANOSECONDS: Final = 1e-9
FRESH_MS: Final = 50.0
"""An older measurement is a gap in the record that the ship is identified from."""
WATCHED_PERIODS: Final = 4.0
"""Roll periods of measurements after which a plan may use the full pressure. A law knows no waves
at first: armed after one period, it took the water to the high-level switches in 4 of 50 storms.
Armed 5 s after a gap of 30 s it did so in 25 of 32, and with two periods in 3 of 12: a gap is a
new start, and in waves that are as high as ever."""
FRESH_PRESSURE_NS: Final = round(STALE_MS * MILLISECOND_NS)
"""In the place of an older pressure the level is predicted with the command, as the twin's roll."""

# read once: in Python 3.11 a member costs eight times as much from its class as from here
_ACTIVE: Final = Mode.ACTIVE
_INIT: Final = Mode.INIT
_FAULT: Final = Mode.FAULT
_CONTROL: Final = Demand.CONTROL
_NO_FAULT: Final = Fault.NONE
_FAULT_OF_LIMIT: Final = {row.law_limit: row.code for row in FAULTS if row.law_limit}

QUIET_START_NS: Final = 10_000_000_000
"""What is awaited at the start is an alarm only when it has not come by then."""

Measure = Callable[[Inbox, LevelObserver], FloatArray]
EventSink = Callable[[RetuningEvent | AlarmEvent, int], None]


@dataclass(frozen=True, slots=True)
class ControllerSettings:
    """Settings of the controller node beside its law and its limits.

    Attributes
    ----------
    configuration_version : int
        Hash of the ship's data, to be equal on all nodes before arming.
    commissioned : bool
        Whether a commissioning was passed with this configuration; else arming is refused.
    command_timeout_s : float
        Sent with every command: the drive stops on its own after so long a silence.
    bit_rate : int
        Of the bus, to judge its load.
    level_limit_m : float
        Level at which a reservoir is full or empty, to tell what is no measurement.
    redundancy : Redundancy
        What else the ship has.
    """

    configuration_version: int
    commissioned: bool
    command_timeout_s: float
    bit_rate: int
    level_limit_m: float
    redundancy: Redundancy


class ControllerNode:
    """The controller node.

    Parameters
    ----------
    controller : Controller
        The law in charge while active. Its sample time must be a whole number of ticks.
    measure : callable
        Picks the law's measurement vector from what was heard.
    level : LevelObserver
        For the limiter, and for laws that want the level's rate.
    limiter : CommandLimiter
    supervisor : Supervisor
    settings : ControllerSettings
    catalogue : Catalogue
    estimator : Estimator, optional
        Tells waves and ship from the motion.
    statistics : LoopStatistics, optional
        Of the loop that drives this node, to be shown in the telemetry.
    commands : tuple of str
        What the controller commands, see `BuiltLaw`.
    pump : bool
        Whether the tank has a pump to be commanded.
    valve : ValveCommander, optional
        If the tank has a valve.
    monitors : Monitors, optional
        Of sensors, pump and bus; without them the fault table has ages, states and limits only.
    retuning : LawExchange, optional
        The controller again, when it is one that retunes itself.
    sink : callable, optional
        Takes one telemetry row (columns `SIGNALS`); must copy it and not wait.
    sink_every : int
        Ticks from one row to the next; the first tick has one.
    event_sink : callable, optional
        Takes each event of retuning and alarms, with the time of the first tick, as it happens;
        must not wait.

    Attributes
    ----------
    start_ns, last_ns : int
        Time of the first and of the last tick.
    inbox : Inbox
        What was received.
    seen : Observations
        What the supervisor judges.
    supervisor : Supervisor
    monitors : Monitors or None
        As given.
    alarms : AlarmList
    estimated : EstimateFigures
        What is known of waves and ship.
    command_pa : float
        Pressure commanded.
    statistics : LoopStatistics
        Of the loop; without any, in lockstep, all zero.
    law_error : str
        What first went wrong with the law, an exception or an answer that is not finite; empty if
        nothing did.

    Raises
    ------
    ValueError
        If the controller's sample time is not a whole number of ticks.
    """

    name = "controller"
    period_ns = TICK_NS

    def __init__(
        self,
        controller: Controller,
        measure: Measure,
        level: LevelObserver,
        limiter: CommandLimiter,
        supervisor: Supervisor,
        settings: ControllerSettings,
        catalogue: Catalogue,
        *,
        commands: tuple[str, ...] = (PRESSURE,),
        pump: bool = True,
        valve: ValveCommander | None = None,
        monitors: Monitors | None = None,
        retuning: LawExchange | None = None,
        estimator: Estimator | None = None,
        statistics: LoopStatistics | None = None,
        sink: Callable[[FloatArray], None] | None = None,
        sink_every: int = 1,
        event_sink: EventSink | None = None,
    ) -> None:
        if not is_whole_ticks(controller.sample_time_s):
            raise ValueError(
                f"sample time {controller.sample_time_s} s is not a whole number of ticks of "
                f"{TICK_S} s; design the controller for a multiple of it"
            )
        self._controller = controller
        self._plans = controller if isinstance(controller, Plans) else None
        self._starts_anew = controller if isinstance(controller, StartsAnew) else None
        self._retuning = retuning
        self._estimator = estimator
        self.estimated = EstimateFigures() if estimator is None else estimator.figures
        self._measure = measure
        self._limiter = limiter
        self.supervisor = supervisor
        self._settings = settings
        self.statistics = statistics or LoopStatistics(real_time=True)
        self._sink, self._sink_every = sink, sink_every
        self._ticks_to_row = 0
        self._event_sink = event_sink
        self._law_commands = commands
        self._pump = pump
        self._valve = valve
        self.monitors = monitors
        self.inbox = Inbox(
            catalogue,
            settings.configuration_version,
            settings.level_limit_m,
            pump=pump,
            valve=valve is not None,
            gates=None if monitors is None else monitors.gates,
            redundancy=settings.redundancy,
        )
        if monitors is not None:
            monitors.watch(self.inbox.watched, self.inbox.expected)
        self._catalogue_version = catalogue.version
        self._level = level
        self._drive_sequence = DriveSequence()
        self._housekeeping = Housekeeping(
            Address.CONTROLLER, catalogue, settings.configuration_version
        )
        self._commands = catalogue.transmitter(PumpCommand)
        self._status = catalogue.transmitter(ControllerStatus)
        self._twin = catalogue.transmitter(PassiveTwin)
        self._sea = catalogue.transmitter(SeaEstimate)
        self._ship = catalogue.transmitter(ShipEstimate)
        self._alarm_frames = catalogue.transmitter(Alarm)
        self.alarms = AlarmList()
        self._alarming = False
        self._passing: dict[Fault, Gravity] = {}
        self._mode_before = _INIT
        self._refused_by = _NO_FAULT
        self._observer = Observer(self.inbox, settings.bit_rate, self._commands.cycle_ns)
        self.seen = self._observer.seen
        self.seen.commissioned = settings.commissioned
        self._row = np.zeros(len(SIGNALS))
        self._all_due = True
        self._applied = np.zeros(len(commands))
        self._samples = Schedule(round(controller.sample_time_s / TICK_S) * TICK_NS)
        self._first_share = 0.0
        self._watched_share, self._watched_step = 0.0, 1.0
        if monitors is not None:
            # as before the water responds: less gained nothing, and hid wrong signs for longer
            self._first_share = monitors.thresholds.unconfirmed_share
            watched_s = WATCHED_PERIODS * monitors.thresholds.roll_period_s
            self._watched_step = controller.sample_time_s / watched_s
        self._command_schedule = Schedule(self._commands.cycle_ns)
        self._status_schedule = Schedule(self._status.cycle_ns)
        self._estimate_schedule = Schedule(round(SAMPLE_TIME_S / TICK_S) * TICK_NS)
        self._figures_schedule = Schedule(self._sea.cycle_ns)
        self._started = self._answered = False
        self._engaged = self._interrupted = False
        self.start_ns = self.last_ns = 0
        self._observed_cycles = 0
        self._frames_sent = 0
        self._law_pa = self._law_loss = 0.0
        self._law_failed = self._law_raised = False  # raised: until the operator resets
        self.law_error = ""
        self.command_pa = 0.0

    @property
    def time_s(self) -> float:
        """Time from the first tick to the last."""
        return (self.last_ns - self.start_ns) * NANOSECONDS

    @property
    def mode(self) -> Mode:
        """Mode of the supervisor."""
        return self.supervisor.mode

    @property
    def fault(self) -> Fault:
        """Fault of the supervisor, or else that of the limit on which the law ended."""
        return self.supervisor.fault or self._law_fault

    @property
    def _share(self) -> float:
        """Of the pressure, that the command may be."""
        monitors = self.monitors
        if monitors is not None and self._pump and not monitors.confirmed:
            return monitors.thresholds.unconfirmed_share
        return self._plan_share

    @property
    def _plan_share(self) -> float:
        """The same where the water obeys."""
        if self._plans is None:
            return self._degraded_share
        return min(self._degraded_share, max(self._first_share, self._watched_share))

    @property
    def _fresh(self) -> bool:
        """Whether the law's measurement is no older than a gap in its record may be."""
        return max(self.seen.motion_age_ms, self.seen.tank_age_ms) <= FRESH_MS

    @property
    def _degraded_share(self) -> float:
        """The same of a law that knows the waves."""
        if not self.supervisor.degraded:
            return 1.0
        monitors = self.monitors
        return DEGRADED_SHARE if monitors is None else monitors.thresholds.degraded_share

    @property
    def fallbacks(self) -> int | None:
        """Of a law that searches for plans, see `Plans`; else None."""
        return None if self._plans is None else self._plans.fallbacks

    @property
    def _law_fault(self) -> Fault:
        law = self._starts_anew
        return _FAULT_OF_LIMIT.get(law.passed_limit, _NO_FAULT) if law else _NO_FAULT

    @property
    def retuning_state(self) -> RetuningState:
        """Where retuning stands; IDLE without it."""
        return RetuningState.IDLE if self._retuning is None else self._retuning.state

    @property
    def twin_roll_rad(self) -> float:
        """Roll of the passive twin; NaN without monitors."""
        return math.nan if self.monitors is None else self.monitors.twin.roll_rad

    @property
    def twin_roll_rms_rad(self) -> float:
        """Root mean square of it over some roll periods."""
        return math.nan if self.monitors is None else self.monitors.twin.rms_rad

    @property
    def roll_rms_rad(self) -> float:
        """Root mean square of the measured roll over some roll periods."""
        return math.nan if self.monitors is None else self.monitors.twin.ship_rms_rad

    @property
    def retuning_events(self) -> tuple[RetuningEvent, ...]:
        """What was done last to retune the controller."""
        return () if self._retuning is None else tuple(self._retuning.events)

    def receive(self, frame: Frame, now_ns: int) -> None:
        """Take one frame from the bus."""
        self.inbox.receive(frame, now_ns)

    def other_frames(self, count: int) -> None:
        """Take note of frames of other kinds on the bus."""
        self.inbox.frames += count
        self.inbox.foreign += count

    def link_error(self, now_ns: int, reason: str) -> None:  # noqa: ARG002
        """Take note that the bus could not be read or written."""
        self._observer.link_error(now_ns)

    def tick(self, now_ns: int) -> Iterable[Frame]:
        """Do one tick: the way of a sample from measurement to pump command, top to bottom."""
        if not self._started:
            self._started = True
            self.start_ns = now_ns
        self._estimate(now_ns)
        self._observe(now_ns)
        self.supervisor.update(self.seen, now_ns)
        self._note_causes(now_ns)
        self._control(now_ns)
        self._limit()
        frames = self._encode(now_ns)
        self.last_ns = now_ns
        self._show()
        self._frames_sent += len(frames)
        return frames

    def stop(self, now_ns: int) -> Iterable[Frame]:  # noqa: ARG002
        """Leave the pump at zero, the valve at its fail position: the last commands of the node."""
        self.command_pa = 0.0
        return self._command_frames(ControlWord.QUICK_STOP, follow=False)

    def _estimate(self, now_ns: int) -> None:
        """Level and its rate from measurements, or from the model while one is missing."""
        inbox, level = self.inbox, self._level
        cycles = inbox.tank_cycles - self._observed_cycles
        # the last pressure that was measured may have ended long ago
        fresh = now_ns - inbox.pump_ns <= FRESH_PRESSURE_NS
        pressure_pa = inbox.pressure_pa if fresh else self.command_pa
        if self._valve is not None:
            pressure_pa -= self._valve.held_pa(inbox, level.rate_m_s)
        if cycles:
            level.update(inbox.level_m, pressure_pa, cycles)
            self._observed_cycles = inbox.tank_cycles
        elif (now_ns - inbox.tank_ns) * NANOSECONDS > level.next_due_s:
            level.predict(pressure_pa)

    def _observe(self, now_ns: int) -> None:
        """Ages, states and operator's edges, for the supervisor."""
        seen = self.seen
        self._observer.observe(now_ns, self._frames_sent)
        seen.law_failed, seen.command_pa = self._law_failed, self.command_pa
        seen.drive_stays_on = self._pump and self._drive_sequence.ignored
        if self.monitors is not None:
            excused, rate_m_s, valve = False, self._level.rate_m_s, self._valve
            held_pa = 0.0 if valve is None else valve.held_pa(self.inbox, rate_m_s)
            if self._retuning is not None:
                excused = self._retuning.excused
                self.monitors.follow(self._retuning.laws.active.found)
            seen.found = self.monitors.update(
                now_ns, self.inbox, seen, rate_m_s, excused=excused, held_pa=held_pa
            )
        if seen.reset_edge:
            self._drive_sequence.request_reset()
        if self._estimator is not None and self._estimate_schedule.due(now_ns):
            self._look_at_motion(self._estimator, now_ns)
        if self._valve is not None:
            self._valve.observe(self.inbox, seen, now_ns)
            if seen.reset_edge:
                self._valve.request_reset()

    def _look_at_motion(self, estimator: Estimator, now_ns: int) -> None:
        """Keep a sample of the motion, and note what it tells of waves and ship."""
        inbox, seen = self.inbox, self.seen
        estimate = estimator.sample(
            now_ns,
            inbox.pressure_pa,
            (inbox.roll_rad, inbox.roll_rate_rad_s, inbox.level_m),
            fresh=self._fresh,
        )
        if estimate is not None:
            seen.gm_low = self.estimated.gm_low
            if self._retuning is not None:
                self._retuning.note(estimate)
        news = estimator.take_news()
        if news and self._event_sink is not None:
            self._event_sink(RetuningEvent(now_ns, self.retuning_state, news), self.start_ns)

    def _note_causes(self, now_ns: int) -> None:
        """Keep what may be gone before alarms, ten times a second, or the law are looked at."""
        supervisor, seen = self.supervisor, self.seen
        if supervisor.mode is _INIT and self._mode_before is not _INIT:
            # what it waits for from now on may be back before alarms are looked at
            self._passing[supervisor.fault] = Gravity.ENDS
        self._mode_before = supervisor.mode
        self._interrupted |= supervisor.demand is not _CONTROL
        if supervisor.mode is not _ACTIVE:
            if first_stopping(seen, supervisor.limits):
                self._passing |= dict.fromkeys(all_stopping(supervisor, seen), Gravity.ENDS)
        elif supervisor.degraded:  # what stops it is latched
            self._passing |= dict.fromkeys(all_halving(seen, supervisor.limits), Gravity.HALVES)
        if supervisor.raised is not _NO_FAULT:
            self.alarms.raise_anew(supervisor.raised, supervisor.mode, now_ns)

    def _control(self, now_ns: int) -> None:
        """Let the law answer when a sample is due, in charge or not."""
        due = self._samples.due(now_ns)
        if due:
            self._note_applied()
        try:
            self._start_anew()
            if not due:
                return
            if self._plans is not None:
                self._watch()
                self._plans.allow(self._plan_share)
            self._law_pa, self._law_loss = self._answer(now_ns)
            if not math.isfinite(self._law_pa + self._law_loss):
                self._law_failed = True
                wrong = f"{self._law_pa:g} Pa"
                if math.isfinite(self._law_pa):
                    wrong = f"a valve loss of {self._law_loss:g}"
                self.law_error = self.law_error or f"its answer is {wrong}"
                self._forget()
            elif not self._law_raised:
                self._law_failed = False
        # a law may be anybody's: whatever it raises cuts the pressure
        except (Exception, SystemExit) as error:
            self._law_failed = self._law_raised = True
            self.law_error = self.law_error or f"{type(error).__name__}: {error}"
        if self._law_failed:
            self._law_pa = 0.0
        elif self._valve is not None:
            self._valve.ask(self._law_loss)
        if self._retuning is not None and self._event_sink is not None:
            for event in self._retuning.take_events():
                self._event_sink(event, self.start_ns)

    def _note_applied(self) -> None:
        """Keep what left, and what was done of it, since the last answer."""
        mean_pa = self._limiter.mean_since_last_call()
        for index, name in enumerate(self._law_commands):
            if name == VALVE and self._valve is not None:
                self._applied[index] = self._valve.applied_loss(self.inbox)
            else:
                self._applied[index] = mean_pa

    def _start_anew(self) -> None:
        """Reset a law that asks for it when an operator arms or resets, and one that raised."""
        seen, anew = self.seen, self._starts_anew
        # in charge nothing but disarming and arming again brings back a law that has ended
        if anew and (seen.arm_edge or seen.reset_edge) and self.supervisor.mode is not _ACTIVE:
            anew.reset()
        if self._law_failed and seen.reset_edge:
            self._law_failed = self._law_raised = False
            self._forget()

    def _watch(self) -> None:
        """Count what a law that plans has watched; it learns nothing in a gap."""
        seen, limits = self.seen, self.supervisor.limits
        if seen.motion_age_ms > limits.motion_age_ms or seen.tank_age_ms > limits.tank_age_ms:
            self._forget()
        else:
            self._watched_share += self._watched_step

    def _forget(self) -> None:
        """Have the law begin anew."""
        self._controller.reset()
        self._watched_share = 0.0

    def _answer(self, now_ns: int) -> tuple[float, float]:
        """The law's pressure and valve loss for the newest measurement."""
        # the command that left since the last answer: anti-windup and bumpless take-over
        if self._answered:
            self._controller.applied(self._applied.copy())  # a law may keep it
        if self._retuning is not None:
            # what was in charge at the last answer and not since is for one answer out of charge
            self._engaged = self.supervisor.demand is _CONTROL and not (
                self._engaged and self._interrupted
            )
            self._interrupted = False
            self._retuning.update(
                now_ns,
                self.inbox.stations.take_retuning(now_ns),
                engaged=self._engaged,
                fresh=self._fresh,
                passive_roll_rad=self.twin_roll_rad,
            )
        self._answered = True
        answer = self._controller.step(self._measure(self.inbox, self._level))
        answered = dict(zip(self._law_commands, answer, strict=True))
        return float(answered.get(PRESSURE, 0.0)), float(answered.get(VALVE, 0.0))

    def _limit(self) -> None:
        """Turn the law's pressure, or zero, into a permitted one."""
        demand, limiter, level = self.supervisor.demand, self._limiter, self._level
        if not self._pump:
            return
        if demand is _CONTROL:
            self.command_pa = limiter.limit(
                self._law_pa, level.level_m, level.rate_m_s, self._share
            )
        elif demand is Demand.RAMP:
            self.command_pa = limiter.ramp_to_zero()
        else:
            self.command_pa = limiter.cut()

    def _encode(self, now_ns: int) -> list[Frame]:
        """Protected frames for what is due."""
        supervisor = self.supervisor
        # first, because an address is claimed before anything is said from it
        frames = self._housekeeping.frames(now_ns, faulted=supervisor.mode is _FAULT)
        if self._command_schedule.due(now_ns):
            word = self._drive_sequence.next_word(
                self.inbox.drive_state, wanted=supervisor.drive_wanted
            )
            frames += self._command_frames(word, follow=supervisor.demand is _CONTROL)
        if self._status_schedule.due(now_ns):
            self._all_due = True
            self._update_alarms(now_ns)
            frames.append(self._alarm_frames.frame(self.alarms.next_message(now_ns)))
            frames.append(
                self._status.frame(
                    ControllerStatus(
                        mode=supervisor.mode,
                        fault=self.fault,
                        armed=supervisor.mode is Mode.ACTIVE,
                        alarm=self.alarms.unaccepted,
                        degraded=supervisor.demand is _CONTROL and self._share < 1.0,
                        saturated=self._limiter.limiting or self.inbox.drive_held_back,
                        not_realtime=not self.statistics.real_time,
                        bus_load=self.seen.bus_load,
                        catalogue_version=self._catalogue_version,
                        configuration_version=self._settings.configuration_version,
                        retuning=None if self._retuning is None else self._retuning.state,
                        station=self.inbox.stations.in_command,
                    )
                )
            )
            if self.monitors is not None:
                frames.append(self._twin.frame(self.monitors.twin_message()))
        if self._estimator is not None and self._figures_schedule.due(now_ns):
            frames.append(self._sea.frame(self.estimated.sea_message()))
            frames.append(self._ship.frame(self.estimated.ship_message()))
        return frames

    def _update_alarms(self, now_ns: int) -> None:
        """Raise, accept and rectify alarms, and hand on what became of them."""
        supervisor, alarms = self.supervisor, self.alarms
        mode = supervisor.mode
        self._alarming = (
            self._alarming or mode is not Mode.INIT or now_ns - self.start_ns >= QUIET_START_NS
        )
        for code in self.inbox.stations.take_accepted():
            alarms.accept(code, mode, now_ns)
        active = self._passing
        if self._alarming:
            now = active_faults(supervisor, self.seen, self._law_fault)
            active |= {code: max(each, active.get(code, each)) for code, each in now.items()}
        alarms.update(active, mode, now_ns)
        self._passing.clear()
        refused_by = supervisor.reset_refused_by
        if refused_by is not self._refused_by:
            self._refused_by = refused_by
            if refused_by is not _NO_FAULT:
                alarms.reset_refused(refused_by, mode, now_ns)
        for event in alarms.take_events():
            if self._event_sink is not None:
                self._event_sink(event, self.start_ns)

    def _command_frames(self, word: ControlWord, *, follow: bool) -> list[Frame]:
        """The next commands of what is on board."""
        frames = []
        if self._pump:
            timeout_s = self._settings.command_timeout_s
            frames.append(self._commands.frame(PumpCommand(self.command_pa, word, timeout_s)))
            self.inbox.pump_echo.sent(self._commands.counter)
        if self._valve is not None:
            frames.append(self._valve.frame(self.inbox, follow=follow))
        return frames

    def _show(self) -> None:
        """Hand a telemetry row to the sink when one is due."""
        if self._sink is None:
            return
        if self._ticks_to_row == 0:
            self._ticks_to_row = self._sink_every
            put_quick(self._row, self)
            if self._all_due:
                self._all_due = False
                put_slow(self._row, self)
            self._sink(self._row)
            self.statistics.begin_row()
        self._ticks_to_row -= 1
