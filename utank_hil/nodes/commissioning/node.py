"""The commissioning as a node: a controller node whose law gives pulses, and what looks on."""

import math
from collections.abc import Callable, Iterable
from dataclasses import replace
from enum import Enum
from typing import Final

import numpy as np

from utank_hil.base.arrays import FloatArray
from utank_hil.base.tick import TICK_NS
from utank_hil.canbus import Frame, Mode, OperatorCommand, Station
from utank_hil.canbus.profiles.device import ProfiledDevice
from utank_hil.control.interface import PRESSURE, VALVE, DesignPlant
from utank_hil.dynamics.pump import Pump
from utank_hil.nodes.commissioning.checks import (
    PRESSED,
    SETTLED_S,
    Check,
    judge_pulses,
    judge_rest,
    judge_valve,
    stopped_ms,
)
from utank_hil.nodes.commissioning.drive_speed import SPEED, judge_speed
from utank_hil.nodes.commissioning.precision import Record, noise_of, times_needed
from utank_hil.nodes.commissioning.pulses import ROW_S, ROW_TICKS, PulseLaw, PulsePlan, ValveStroke
from utank_hil.nodes.controller import ControllerNode
from utank_hil.safety.faults import fault_text

REST_S: Final = 20.0
SETTLE_S: Final = 1.0
"""From ACTIVE to the first pulse."""
PUSH_S: Final = 1.0
"""Before the stop that is timed: the water hardly moves in it."""
_STOP: Final = OperatorCommand(Mode.STANDBY, arm=False, stop=True, reset=False, acknowledge=False)
STALE_MS: Final = 100.0
"""A motion sensor that is silent for longer is not commissioned."""
MOST_OVER_PLAN: Final = 3.0
"""A level so many times the plan's ends the pulses."""

_Get = Callable[[ControllerNode], float]
_SINGLE: Final[dict[str, _Get]] = {
    # each sensor by itself, whichever is in use
    "roll_rad": lambda node: node.measured.motions[0].roll_rad,
    "roll_rate_rad_s": lambda node: node.measured.motions[0].roll_rate_rad_s,
    "port_level_m": lambda node: node.measured.port_level_m,
    "starboard_level_m": lambda node: node.measured.starboard_level_m,
    "high_level": lambda node: node.measured.high_level,
    "pressure_pa": lambda node: node.measured.pressure_pa,
    "command_pa": lambda node: node.command_pa,
    "valve_opening": lambda node: node.measured.valve_opening,
}
_PAIR: Final = _SINGLE | {
    "roll_2_rad": lambda node: node.measured.motions[1].roll_rad,
    "roll_rate_2_rad_s": lambda node: node.measured.motions[1].roll_rate_rad_s,
}


class Stage(Enum):
    """Where a commissioning stands, with what the operator is to know of it."""

    WAITING = "Waiting until the controller is ready."
    REST = "Measuring the zeros. Keep the ship still."
    ARM = "The zeros are right. Arm at the panel: pump and valve will move a little."
    MOVING = "Pump and valve move a little. Stop or disarm at the panel ends it."
    STOPPING = "The pump is stopped, and its time is measured."
    DONE = "Done."


class CommissioningNode:
    """Leads through a commissioning; on the bus it is the controller.

    `node` has the law of the pulses in it. `plan` and `pump` are None without a pump, `stroke`
    without a valve.
    `volume_m` is the sum of both levels at which the volume's monitor speaks, `stop_within_ms` the
    time that the pump may take to stop.
    """

    name = "controller"
    period_ns = TICK_NS

    def __init__(
        self,
        node: ControllerNode,
        law: PulseLaw,
        plant: DesignPlant,
        *,
        plan: PulsePlan | None,
        stroke: ValveStroke | None,
        pump: Pump | None,
        volume_m: float,
        stop_within_ms: float,
    ) -> None:
        self.node = node
        self.receive, self.other_frames = node.receive, node.other_frames
        self.link_error, self.stop = node.link_error, node.stop
        self._law = law
        self._plant = plant
        self._stroke = stroke
        self._pump = pump
        self._volume_m, self._stop_within_ms = volume_m, stop_within_ms
        self._take(plan)
        self._pushed: list[float] = []  # pressure of each tick before the stop, and after it
        self._stopping: list[float] = []
        self._sources = dict(_PAIR if len(node.inbox.motions) == 2 else _SINGLE)
        if (drive := node.actuators.drive) is not None:
            self._sources[SPEED] = lambda _: drive.speed_rad_s
        self._oldest_ms = [0.0] * len(node.inbox.motions)  # ages of each sensor's motion
        self.ended = ""  #: Why it ended before its time, in words; else empty.
        #: rest, moved: what was recorded at rest, and from ACTIVE on; empty before.
        self.rest: Record = {}
        self.moved: Record = {}
        self._enter(Stage.WAITING, 0)

    def _take(self, plan: PulsePlan | None) -> None:
        stroke_s = 0.0 if self._stroke is None else self._stroke.duration_s
        self._plan = plan
        self._pulses_s = 0.0 if plan is None else plan.duration_s
        self._push_s = self._pulses_s + stroke_s
        self._moving_s = self._push_s + (0.0 if plan is None else PUSH_S)

    def checks(self) -> list[Check]:
        """Judge what was recorded; takes tens of milliseconds, so not while the loop runs."""
        if not self.rest:
            return []
        checks = judge_rest(self.rest, self._plant, self._plan, self._volume_m)
        whole = bool(self.moved) and not self.ended
        begin = round(SETTLE_S / ROW_S)
        end = begin + round(self._pulses_s / ROW_S)
        record, plan, stroke = self.moved, self._plan, self._stroke
        rows = len(record.get("roll_rad", ()))
        if plan is not None and (whole or rows >= end):  # a part of them shows wrong scales
            pulses = {name: column[begin:end] for name, column in record.items()}
            derived = self._of_derived()
            checks += judge_pulses(self.rest, pulses, self._plant, plan, ROW_S, derived)
            if SPEED in pulses and self._pump is not None:
                checks.append(judge_speed(self.rest, pulses, self._plant, plan, self._pump, ROW_S))
        if stroke is not None and (whole or rows >= end + stroke.duration_s / ROW_S - 1):
            there = end + round(stroke.duration_s / ROW_S)
            checks += judge_valve(record["valve_opening"][end:there], stroke, ROW_S)
        if plan is not None and whole:
            checks.append(self._stop_check(plan))
        return checks

    def _of_derived(self) -> list[str]:
        """What to do about each sensor's rate if it is derived of the roll; else empty."""
        return [
            "It is the slope of the roll by the times at which its frames came, up to "
            f"{oldest_ms:.0f} ms after one another where {source.cycle_ns * 1e-6:g} was promised. "
            "Mend what holds them up on the bus or this machine, and commission again."
            if isinstance(source, ProfiledDevice) and source.plan.derived
            else ""
            for source, oldest_ms in zip(
                [sensor.receiver for sensor in self.node.inbox.motions],
                self._oldest_ms,
                strict=True,
            )
        ]

    def _stop_check(self, plan: PulsePlan) -> Check:
        """The time from the stop to a fifth of the pressure, each the mean of three ticks or more.

        So many that a third of that fifth is the noise of their mean, and half of those of a tick
        to come.
        """
        zero_pa = float(self.rest["pressure_pa"].mean())
        before_pa = float(np.mean(self._pushed or [math.nan])) - zero_pa
        noise = noise_of(self.rest["pressure_pa"]) / (plan.push_pa * PRESSED / 3)
        half = max(math.ceil(noise * noise * ROW_TICKS / 2), 1)
        pressures = [before_pa] * (half + 1) + [each - zero_pa for each in self._stopping]
        mean = np.full(2 * half + 1, 1 / (2 * half + 1))
        smooth: list[float] = np.convolve(pressures, mean, "valid").tolist()
        pressed = abs(before_pa) > plan.push_pa / 2  # its sign is the pulses' business
        shares = [each / before_pa if pressed else 1.0 for each in smooth]
        remedy = (
            "Shorten the drive's quick stop ramp and its way through the bus, or set stop_within_ms"
            " of devices.pump in the ship's file to what is safe."
        )
        return Check(
            "stop_ms", "pump: a stop to a fifth of its pressure", stopped_ms(shares, PRESSED),
            0.0, self._stop_within_ms, "ms", remedy,
        )  # fmt: skip

    @property
    def duration_s(self) -> float:
        """Time that it takes at least, without waiting and arming."""
        return REST_S + SETTLE_S + self._moving_s

    @property
    def length_s(self) -> float:
        """Length of the stage that it is in, where it has one."""
        if self.stage is Stage.STOPPING:
            return SETTLED_S
        return REST_S if self.stage is Stage.REST else SETTLE_S + self._moving_s

    def tick(self, now_ns: int) -> Iterable[Frame]:
        """Let the controller do its tick, and look at what came of it."""
        # whoever arms sooner would have the pump move without having been asked to
        self.node.commissioned = self.stage in (Stage.ARM, Stage.MOVING)
        frames = self.node.tick(now_ns)
        if self.stage in (Stage.REST, Stage.MOVING):
            self._note(now_ns)
        if self.stage is Stage.STOPPING:
            self._stopping.append(self.node.measured.pressure_pa)
        if self.stage is not Stage.DONE:
            self._go_on(now_ns)
        return frames

    @property
    def missing(self) -> str:
        """What is not heard that the controller could do without, in words; else empty."""
        motions = self.node.measured.motions
        if len(motions) == 1 or max(sample.age_ms for sample in motions) <= STALE_MS:
            return ""
        return "A motion sensor is silent. Check the supply and bus connection of both."

    def _note(self, now_ns: int) -> None:
        self._sum += [get(self.node) for get in self._sources.values()]
        self._ticks += 1
        # a loop held up for more than two rows lost the echo of drive or valve, and begins anew
        missing = (now_ns - self._since_ns) // (ROW_TICKS * TICK_NS) - len(self._rows)
        if missing > 0:
            self._rows += [self._sum / self._ticks] * missing
            self._begin_row()

    def _begin_row(self) -> None:
        self._sum, self._ticks = np.zeros(len(self._sources)), 0

    def _enter(self, stage: Stage, now_ns: int) -> None:
        self.stage, self._since_ns = stage, now_ns
        self._rows: list[FloatArray] = []
        self._begin_row()

    def _record(self) -> Record:
        rows = np.array(self._rows).reshape(-1, len(self._sources))
        return dict(zip(self._sources, rows.T, strict=True))

    def _go_on(self, now_ns: int) -> None:
        mode = self.node.mode
        passed_s = (now_ns - self._since_ns) * 1e-9
        if self.stage is Stage.STOPPING:
            if passed_s >= SETTLED_S:
                self._enter(Stage.DONE, now_ns)
        elif self.stage is Stage.MOVING:
            self._move(passed_s - SETTLE_S, now_ns)
        elif self.stage is Stage.ARM and mode is Mode.ACTIVE:
            self._enter(Stage.MOVING, now_ns)  # whatever fell silent now ends it as under way
        elif mode in (Mode.INIT, Mode.FAULT) or self.missing:
            if self.stage is not Stage.WAITING:
                self._enter(Stage.WAITING, now_ns)
        elif self.stage is Stage.WAITING:
            self._enter(Stage.REST, now_ns)
        elif self.stage is Stage.REST and passed_s >= REST_S:
            self.rest = self._record()
            zeros = judge_rest(self.rest, self._plant, self._plan, self._volume_m)
            passed = all(check.passed for check in zeros)
            if passed and (plan := self._plan) is not None:
                times = math.ceil(times_needed(self.rest, plan.of_noise))
                self._take(replace(plan, times=max(times, 1)))
            self._enter(Stage.ARM if passed else Stage.DONE, now_ns)

    def _move(self, time_s: float, now_ns: int) -> None:
        """Command what is due, and end when all is done or something is wrong."""
        node, plan, rest = self.node, self._plan, self.rest
        at_rest_m = float(rest["starboard_level_m"].mean() - rest["port_level_m"].mean()) / 2
        if node.mode is not Mode.ACTIVE:
            self.ended = (
                fault_text(node.fault) if node.mode is Mode.FAULT else "Disarmed before the end."
            )
        elif self.missing:
            self.ended = self.missing
        elif plan and abs(node.measured.level_m - at_rest_m) > MOST_OVER_PLAN * plan.level_m:
            self.ended = (
                f"The level went {MOST_OVER_PLAN:g} times as far as planned. Check the gauges' "
                "scaling, the pump's limits and the ship's file."
            )
        if self.ended or time_s >= self._moving_s:
            self._law.reset()
            self.moved = self._record()
            stops = plan is not None and not self.ended
            self._enter(Stage.STOPPING if stops else Stage.DONE, now_ns)
            if stops:  # by the way of a panel's: the next tick hears it
                node.inbox.stations.orders[Station.OPERATOR].overhear(_STOP)
        elif time_s >= 0:
            self._oldest_ms = list(
                map(max, self._oldest_ms, (each.age_ms for each in node.measured.motions))
            )
            pushes = plan is not None and time_s >= self._push_s
            if pushes and time_s >= self._push_s + PUSH_S / 2:
                self._pushed.append(node.measured.pressure_pa)
            pressure_pa = 0.0 if plan is None else plan.pressure_at(time_s)
            self._law.set(
                {
                    PRESSURE: plan.push_pa if plan is not None and pushes else pressure_pa,
                    VALVE: 0.0
                    if self._stroke is None
                    else self._stroke.loss_at(time_s - self._pulses_s),
                }
            )
