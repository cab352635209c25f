"""A controller node on a table: hand-made frames in, pump commands out."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from utank_hil.assembly import measure_of
from utank_hil.base.arrays import FloatArray
from utank_hil.base.tick import TICK_NS, TICK_S
from utank_hil.canbus import (
    Address,
    ControllerStatus,
    ControlWord,
    DriveFault,
    DriveState,
    DriveStatus1,
    DriveStatus2,
    Frame,
    Heartbeat,
    Mode,
    NodeState,
    OperatorCommand,
    PumpCommand,
    Quality,
    ResetCause,
    SensorMotion,
    SensorPump,
    SensorTank,
    Switch,
    load_catalogue,
)
from utank_hil.configuration import Vessel, load_config
from utank_hil.control import CommandLimiter, DesignPlant, PumpLimits
from utank_hil.control.interface import PRESSURE
from utank_hil.nodes.actuators import Actuators
from utank_hil.nodes.controller import ControllerNode, ControllerSettings
from utank_hil.nodes.redundancy import NO_REDUNDANCY
from utank_hil.nodes.running_law import RunningLaw
from utank_hil.nodes.signals import SIGNALS, Telemetry
from utank_hil.safety.judge import Safety
from utank_hil.safety.monitoring import Monitors
from utank_hil.safety.monitors.thresholds import SensorFigures
from utank_hil.safety.safety_limits import SafetyLimits

CATALOGUE = load_catalogue()
VESSEL = load_config(Path("configs/ships/thesis_first.yaml"), Vessel)
VERSION = VESSEL.version
LIMITS = PumpLimits()
MS = 1_000_000


def new_monitors(vessel=VESSEL):
    return Monitors(DesignPlant(vessel.ship, vessel.tank), 0.35, SensorFigures(), 250_000)


_FOLLOWED = {
    ControlWord.SHUTDOWN: DriveState.READY_TO_SWITCH_ON,
    ControlWord.SWITCH_ON: DriveState.SWITCHED_ON,
    ControlWord.ENABLE_OPERATION: DriveState.OPERATION_ENABLED,
}


@dataclass
class ToyLaw:
    """Answers with what the test wants and notes what it is told."""

    sample_time_s: float = 0.2
    answer_pa: float = 0.0
    seen: list[FloatArray] = field(default_factory=list)
    told: list[float] = field(default_factory=list)
    calls: list[str] = field(default_factory=list)

    def step(self, y, reference=None):
        self.calls.append("step")
        self.seen.append(y)
        return np.array([self.answer_pa])

    def applied(self, u):
        self.calls.append("applied")
        self.told.append(float(u[0]))

    def reset(self):
        self.calls.append("reset")


@dataclass
class PlanningLaw(ToyLaw):
    fallbacks: int = 3
    allowed: list[float] = field(default_factory=list)

    def allow(self, share):
        self.allowed.append(share)


class ControllerBench:
    """Everything else on the bus, healthy unless a test says otherwise.

    Fields that a test changes: the truth that is sent (`motion`, `tank`, `pump`, `drive_state`,
    `drive_fault`, `drive_warns`, `order`), `silent` (message types that are not sent) and `spoil`
    (a function applied to every frame on its way, which may return none or several).
    """

    def __init__(
        self,
        start_ns=0,
        law=None,
        *,
        measure=None,
        commands=(PRESSURE,),
        monitors=None,
        pump=True,
        valve=None,
        estimator=None,
        redundancy=NO_REDUNDANCY,
        **telemetry,
    ):
        self.law = ToyLaw() if law is None else law
        self.rows: list[FloatArray] = []
        limits = SafetyLimits()
        thresholds = None if monitors is None else monitors.thresholds
        measure = measure or measure_of(("roll_rad", "level_m"))
        limiter = CommandLimiter(LIMITS, VESSEL.tank, TICK_S)
        self.node = ControllerNode(
            RunningLaw(self.law, measure, commands, limits=limits, thresholds=thresholds),
            Safety(limits, 250_000, monitors, pump=pump),
            Actuators(limiter, CATALOGUE, 0.05, pump=pump, valve=valve),
            Telemetry(sink=lambda row: self.rows.append(row.copy()), **telemetry),
            ControllerSettings(VERSION, True, VESSEL.tank, redundancy),
            CATALOGUE,
            estimator,
        )
        self.level = self.node.level
        self.start_ns = self.now_ns = start_ns
        self.motion = SensorMotion(0.0, 0.0, Quality.GOOD)
        self.tank = SensorTank(0.0, 0.0, Switch.OFF, Switch.OFF, Quality.GOOD)
        self.pump = SensorPump(0.0, 0.0, Quality.GOOD)
        self.drive_state: DriveState | None = DriveState.SWITCH_ON_DISABLED
        self.drive_follows = True
        self.drive_fault = DriveFault.NONE
        self.drive_warns = False
        self.drive_limits = (False,) * 4
        self.order = OperatorCommand(Mode.STANDBY, *(False,) * 4)
        self.versions = self.panel_versions = (CATALOGUE.version, VERSION)
        self.silent: set[type] = set()
        self.spoil: Callable[[type, Frame], Iterable[Frame]] = lambda kind, frame: (frame,)
        self._tick_index = 0
        self._senders = {
            kind: CATALOGUE.transmitter(kind)
            for kind in (
                SensorMotion, SensorTank, SensorPump, DriveStatus1, DriveStatus2, OperatorCommand,
            )
        }  # fmt: skip
        self._beats = {
            address: CATALOGUE.transmitter(Heartbeat, address)
            for address in (Address.DRIVE, Address.SENSORS, Address.OPERATOR)
        }
        self._commands = CATALOGUE.receiver(PumpCommand)
        self._statuses = CATALOGUE.receiver(ControllerStatus)
        self.commands: list[tuple[int, PumpCommand]] = []
        self.status: ControllerStatus | None = None
        self.sent: list[Frame] = []

    @property
    def ms(self):
        """Time since the start in milliseconds."""
        return (self.now_ns - self.start_ns) / MS

    @property
    def pressure_pa(self):
        """Pressure of the last command."""
        return self.commands[-1][1].pressure_pa

    @property
    def word(self):
        """Control word of the last command."""
        return self.commands[-1][1].control_word

    def column(self, name):
        """One column of the telemetry."""
        return np.array(self.rows)[:, SIGNALS.index(name)]

    def order_is(self, **changes):
        """Change what the panel sends from now on; it sends at once on a change."""
        self.order = self.order._replace(**changes)
        self._send(OperatorCommand, self.order)

    def restart_panel(self):
        """The panel's counter begins anew."""
        self._senders[OperatorCommand] = CATALOGUE.transmitter(OperatorCommand)

    def send(self, frame):
        """Let the node hear one frame, now."""
        self.node.receive(frame, self.now_ns)

    def encode(self, message):
        """The next frame of a message."""
        return self._senders[type(message)].frame(message)

    def _send(self, kind, message):
        if kind not in self.silent:
            for frame in self.spoil(kind, self._senders[kind].frame(message)):
                self.send(frame)

    def tick(self, late_ticks=0):
        """Send what is due, tick the node, and listen; `late_ticks` grid points are left out."""
        self.now_ns += late_ticks * TICK_NS
        index = self._tick_index
        self._send(SensorMotion, self.motion)
        if index % 2 == 0:
            self._send(SensorTank, self.tank)
            self._send(SensorPump, self.pump)
            echo = self._commands.counter
            self._send(
                DriveStatus1,
                DriveStatus1(
                    self.pump.pressure_pa, 0.0, self.drive_state, echo, *self.drive_limits
                ),
            )
        if index % 10 == 0:
            self._send(
                DriveStatus2,
                DriveStatus2(
                    self.drive_fault, 1000.0, 12.0, 40.0, 40.0, self.drive_warns, *(False,) * 3
                ),
            )
            for address, sender in self._beats.items() if Heartbeat not in self.silent else ():
                nan = float("nan")
                versions = self.panel_versions if address is Address.OPERATOR else self.versions
                beat = Heartbeat(
                    NodeState.OPERATIONAL, ResetCause.POWER_ON, 0.0, *versions, nan, nan
                )
                self.send(sender.frame(beat))
        if index % 20 == 0:
            self._send(OperatorCommand, self.order)
        frames = list(self.node.tick(self.now_ns))
        self.hear(frames)
        self._tick_index += 1
        self.now_ns += TICK_NS

    def hear(self, frames):
        """Take the node's frames as the drive and the panel would."""
        for frame in frames:
            self.sent.append(frame)
            if frame.can_id == self._commands.can_id:
                command = self._commands.accept(frame)
                assert command is not None
                self.commands.append((self.now_ns, command))
                if self.drive_follows:
                    assert command.control_word is not None
                    self.drive_state = _FOLLOWED.get(
                        command.control_word, DriveState.SWITCH_ON_DISABLED
                    )
            elif frame.can_id == self._statuses.can_id:
                self.status = self._statuses.accept(frame)

    def run(self, milliseconds):
        """Tick for so long."""
        for _ in range(round(milliseconds * MS / TICK_NS)):
            self.tick()

    def arm(self):
        """Have the operator arm the controller."""
        self.run(400)
        self.order_is(mode_request=Mode.ACTIVE, arm=True)
        self.run(200)
        assert self.node.mode is Mode.ACTIVE

    def drive_at(self, pressure_pa):
        """Have an armed controller command a pressure."""
        self.arm()
        self.law.answer_pa = pressure_pa
        self.run(200 + 1.1e3 * abs(pressure_pa) / LIMITS.rate_pa_s)
        assert self.pressure_pa == pressure_pa
