"""The controller on the bus: from the frames that come in to the pump command that goes out."""

from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import Final

from utank_hil.base.tick import TICK_NS, TICK_S, Schedule
from utank_hil.canbus import (
    Address,
    Alarm,
    Catalogue,
    ControllerStatus,
    Fault,
    Frame,
    Mode,
    PassiveTwin,
    RetuningState,
    SeaEstimate,
    ShipEstimate,
)
from utank_hil.canbus.events import RetuningEvent
from utank_hil.canbus.measurements import Measurements, MotionSample
from utank_hil.canbus.profiles.device import SILENT_NS
from utank_hil.canbus.profiles.device_plan import NO_FOREIGN_DEVICES, ForeignDevices
from utank_hil.control.level_observer import LevelObserver
from utank_hil.dynamics.tank import Tank
from utank_hil.nodes.actuators import Actuators
from utank_hil.nodes.housekeeping import Housekeeping
from utank_hil.nodes.inbox import Inbox
from utank_hil.nodes.redundancy import Redundancy
from utank_hil.nodes.running_law import RunningLaw, is_fresh
from utank_hil.nodes.signals import Telemetry
from utank_hil.retuning.estimator import SAMPLE_TIME_S, EstimateFigures, Estimator
from utank_hil.safety.judge import Safety
from utank_hil.safety.monitoring import STALE_MS
from utank_hil.safety.situation import Demand, Judgement, OwnState

NANOSECONDS: Final = 1e-9

# read once: in Python 3.11 a member costs eight times as much from its class as from here
_ACTIVE: Final = Mode.ACTIVE
_FAULT: Final = Mode.FAULT
_CONTROL: Final = Demand.CONTROL


@dataclass(frozen=True, slots=True)
class ControllerSettings:
    """Settings of the controller node beside those of its parts."""

    configuration_version: int  #: Hash of the ship's data, to be equal on all nodes before arming.
    #: Whether a commissioning was passed with this configuration; else arming is refused.
    commissioned: bool
    tank: Tank
    redundancy: Redundancy  #: What the ship has twice.
    foreign: ForeignDevices = NO_FOREIGN_DEVICES  #: Devices that are not nodes of the catalogue.
    key: bytes = b""  #: Of the panel.


class ControllerNode:
    """The controller node.

    `law` is in charge while active; `estimator` estimates waves and ship from the motion.
    `start_ns` and `last_ns` are the times of the first and of the last tick.
    """

    name = "controller"
    period_ns = TICK_NS
    judgement: Judgement  #: Judgement of the last tick.

    def __init__(
        self,
        law: RunningLaw,
        safety: Safety,
        actuators: Actuators,
        telemetry: Telemetry,
        settings: ControllerSettings,
        catalogue: Catalogue,
        estimator: Estimator | None = None,
    ) -> None:
        self.law, self.safety = law, safety
        self.actuators, self.telemetry = actuators, telemetry
        #: Whether arming is allowed for all that commissioning is there for.
        self.commissioned = settings.commissioned
        self._estimator = estimator
        self.estimated = EstimateFigures() if estimator is None else estimator.figures
        monitors, version = safety.monitors, settings.configuration_version
        self.inbox = Inbox(
            catalogue,
            version,
            settings.tank.level_limit_m,
            pump=actuators.pump,
            valve=actuators.valve is not None,
            thresholds=None if monitors is None else monitors.thresholds,
            redundancy=settings.redundancy,
            foreign=settings.foreign,
            drive=actuators.drive,
            key=settings.key,
        )
        #: As of the last tick; before the first nothing is heard.
        self.measured: Measurements = self.inbox.snapshot(0)
        if monitors is not None:
            monitors.watch(self.inbox.watched, self.inbox.expected)
        self.level = LevelObserver(settings.tank, self.inbox.tank_cycle_ns * NANOSECONDS)
        self._versions = catalogue.version, version
        self._housekeeping = Housekeeping(Address.CONTROLLER, catalogue, version)
        self._status = catalogue.transmitter(ControllerStatus)
        self._twin = catalogue.transmitter(PassiveTwin)
        self._sea = catalogue.transmitter(SeaEstimate)
        self._ship = catalogue.transmitter(ShipEstimate)
        self._alarm_frames = catalogue.transmitter(Alarm)
        self._command_schedule = Schedule(actuators.cycle_ns)
        self._status_schedule = Schedule(self._status.cycle_ns)
        self._estimate_schedule = Schedule(round(SAMPLE_TIME_S / TICK_S) * TICK_NS)
        self._figures_schedule = Schedule(self._sea.cycle_ns)
        self._wake_schedule = Schedule(SILENT_NS)
        self._started = False
        # pragma: no mutate start: set by the first tick, the first levels; differences count
        self.start_ns = self.last_ns = 0
        self._level_cycles = 0
        self._frames_sent = 0
        # pragma: no mutate end

    @property
    def time_s(self) -> float:
        """Time from the first tick to the last."""
        return (self.last_ns - self.start_ns) * NANOSECONDS

    @property
    def mode(self) -> Mode:
        """Mode of the supervisor."""
        return self.safety.supervisor.mode

    @property
    def fault(self) -> Fault:
        """Fault of the supervisor, or else that of the limit on which the law ended."""
        return self.safety.supervisor.fault

    @property
    def command_pa(self) -> float:
        """Pressure commanded."""
        return self.actuators.command_pa

    @property
    def motion(self) -> MotionSample:
        """The last sample of the motion sensor in use."""
        return self.measured.motions[self.judgement.motion]

    @property
    def retuning_state(self) -> RetuningState:
        """Where retuning stands; IDLE without it."""
        return self.law.state or RetuningState.IDLE

    def receive(self, frame: Frame, now_ns: int) -> None:
        """Take one frame from the bus."""
        self.inbox.receive(frame, now_ns)

    def other_frames(self, count: int) -> None:
        """Take note of frames of other kinds on the bus."""
        self.inbox.other_frames(count)

    def link_error(self, now_ns: int, reason: str) -> None:
        """Take note that the bus could not be read or written."""
        self.inbox.link_error(now_ns, self.actuators.cycle_ns, reason)

    def tick(self, now_ns: int) -> Iterable[Frame]:
        """Do one tick: the way of a sample from measurement to pump command, top to bottom."""
        if not self._started:
            self._started = True
            self.start_ns = now_ns
        self.measured = measured = self.inbox.snapshot(now_ns)
        self._estimate_level(measured)
        self.judgement = judgement = self.safety.judge(measured, self._own_state(measured))
        if measured.reset_edge:
            self.actuators.request_reset()
        self._estimate_waves(measured, judgement)
        take_order = self.inbox.stations.take_retuning
        self.law.update(measured, judgement, self.level, self.actuators, take_order)
        if self.law.exchange is not None:
            for event in self.law.exchange.take_events():
                self.telemetry.tell(event, self.start_ns)
        self.actuators.limit(judgement, self.law.pressure_pa, self.level, self._share(judgement))
        frames = self._encode(measured, judgement)
        self.last_ns = now_ns
        self.telemetry.show(self)
        self._frames_sent += len(frames)
        return frames

    def stop(self, now_ns: int) -> Iterable[Frame]:  # noqa: ARG002
        """Leave the pump at zero, the valve at its fail position: the last commands of the node."""
        return self.actuators.stop()

    def _share(self, judgement: Judgement) -> float:
        """Share of the greatest pressure that is let through to the pump.

        A quarter or less until the water was seen to obey the pressure, whatever else is known;
        from then on what the law may count on.
        """
        unconfirmed_share = judgement.unconfirmed_share
        return self.law.share(judgement) if unconfirmed_share is None else unconfirmed_share

    def _estimate_level(self, measured: Measurements) -> None:
        """Level and its rate from measurements, or from the model while one is missing."""
        level, actuators = self.level, self.actuators
        cycles = measured.tank_cycles - self._level_cycles
        # the last pressure that was measured may have ended long ago
        fresh = measured.pump_age_ms <= STALE_MS
        pressure_pa = measured.pressure_pa if fresh else actuators.command_pa
        pressure_pa -= actuators.held_pa(measured, level.rate_m_s)
        if cycles:
            level.update(measured.level_m, pressure_pa, cycles)
            self._level_cycles = measured.tank_cycles
        elif (measured.now_ns - measured.tank_ns) * NANOSECONDS > level.next_due_s:
            level.predict(pressure_pa)

    def _own_state(self, measured: Measurements) -> OwnState:
        """What the node knows of itself, for the safety's judgement."""
        law, actuators, rate_m_s = self.law, self.actuators, self.level.rate_m_s
        echo_age_ms, drive_stays_on, valve = actuators.observe(measured)
        return OwnState(
            actuators.command_pa,
            rate_m_s,
            actuators.held_pa(measured, rate_m_s),
            echo_age_ms,
            drive_stays_on,
            valve,
            law.failed,
            law.excused,
            law.designed_for,
            self.estimated.gm_low,
            self.commissioned,
            self._frames_sent,
            law.doubts_forecast,
            law.passed_limit,
        )

    def _estimate_waves(self, measured: Measurements, judgement: Judgement) -> None:
        """Keep a sample of the motion, and note what it says of waves and ship."""
        estimator = self._estimator
        if estimator is None or not self._estimate_schedule.due(measured.now_ns):
            return
        motion = measured.motions[judgement.motion]
        estimate = estimator.sample(
            measured.now_ns,
            (motion.roll_rad, motion.roll_rate_rad_s, measured.level_m),
            fresh=is_fresh(measured, motion),
        )
        if estimate is not None and self.law.exchange is not None:
            self.law.exchange.note(estimate)
        news = estimator.take_news()
        if news:
            event = RetuningEvent(measured.now_ns, self.retuning_state, news)
            self.telemetry.tell(event, self.start_ns)

    def _encode(self, measured: Measurements, judgement: Judgement) -> list[Frame]:
        """Protected frames for what is due."""
        now_ns, safety = measured.now_ns, self.safety
        # first, because an address is claimed before anything is said from it
        frames = self._housekeeping.frames(now_ns, faulted=judgement.mode is _FAULT)
        if self._wake_schedule.due(now_ns):
            frames += self.inbox.wakes(now_ns)
        frames += self.inbox.setups(now_ns)
        if self.actuators.drive is not None:
            frames += self.actuators.drive.frames(now_ns)
        if self._command_schedule.due(now_ns):
            frames += self.actuators.frames(judgement, measured)
        if self._status_schedule.due(now_ns):
            self.telemetry.renew_slow()
            accepted = self.inbox.stations.take_accepted()
            for event in safety.update_alarms(accepted, now_ns, self.inbox.errors):
                received = self.inbox.received(event.code, safety.messages(event.code))
                self.telemetry.tell(replace(event, received=received), self.start_ns)
            frames.append(self._alarm_frames.frame(safety.alarms.next_message(now_ns)))
            frames.append(self._status.frame(self._status_message(measured, judgement)))
            if safety.monitors is not None:
                frames.append(self._twin.frame(safety.monitors.twin_message()))
        if self._estimator is not None and self._figures_schedule.due(now_ns):
            frames.append(self._sea.frame(self.estimated.sea))
            frames.append(self._ship.frame(self.estimated.ship))
        return frames

    def _status_message(self, measured: Measurements, judgement: Judgement) -> ControllerStatus:
        in_control = judgement.demand is _CONTROL
        catalogue_version, configuration_version = self._versions
        return ControllerStatus(
            mode=judgement.mode,
            fault=judgement.fault,
            armed=judgement.mode is _ACTIVE,
            alarm=self.safety.alarms.unaccepted,
            degraded=in_control and self._share(judgement) < 1.0,
            saturated=self.actuators.limiting or measured.drive_held_back,
            not_realtime=not self.telemetry.statistics.real_time,
            bus_load=self.safety.situation.bus_load,
            catalogue_version=catalogue_version,
            configuration_version=configuration_version,
            retuning=self.law.state,
            station=self.inbox.stations.in_command,
        )
