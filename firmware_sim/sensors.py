"""Sensor node: motion sensor, level gauges, high-level switches, pump pressure."""

import math
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from typing import TYPE_CHECKING, Any, Final, TypeVar

import numpy as np

from firmware_sim.canopen_node import CanopenSensor
from firmware_sim.scenario_sections import SensorErrors
from utank_hil.base.tick import TICK_NS
from utank_hil.canbus import (
    Address,
    Catalogue,
    Frame,
    Mode,
    OperatorCommand,
    Quality,
    SensorMotion,
    SensorPump,
    SensorTank,
    Switch,
    Transmitter,
    ValveStatus,
)
from utank_hil.canbus.codec import Codec
from utank_hil.canbus.frame import BUS_SHIFT, STANDARD
from utank_hil.canbus.line_names import LINES
from utank_hil.canbus.profiles.device_plan import (
    NO_FOREIGN_DEVICES,
    DevicePlan,
    ForeignDevices,
    MessageEncoder,
)
from utank_hil.canbus.profiles.drive_plan import HEARTBEAT
from utank_hil.canbus.sentences import SentenceReader, sentence
from utank_hil.nodes.housekeeping import Housekeeping

if TYPE_CHECKING:
    from firmware_sim.plant import Plant  # compiled: a scenario is read without it


def _said(message: tuple[Any, ...]) -> tuple[float, ...]:
    """What a message says by `FIELDS`, in their order."""
    if isinstance(message, ValveStatus):
        return message.opening, float(message.open_limit), float(message.shut_limit)
    if isinstance(message, OperatorCommand):
        passive = message.mode_request is Mode.PASSIVE
        pressed = message.arm, message.stop, message.acknowledge, message.reset, passive
        return tuple(map(float, pressed))
    if message[-1] is Quality.BAD:  # a device has no such word: it has no value
        return (math.nan,) * len(message)
    return tuple(math.nan if value is None else float(value) for value in message)


class ForeignFrames:
    """Encodes what a device of the plan sends, but for the heartbeat that its node sends itself.

    On a `line` of sentences the frames are those that the controller reads in these. Each leaves
    with the first tick at which it is due, so a cycle must not be shorter than a tick.
    """

    def __init__(
        self,
        plan: DevicePlan[Any],
        native: Transmitter[Any],
        codec: Codec[Any],
        *,
        line: bool = False,
    ) -> None:
        self.plan = plan
        self.server = CanopenSensor(plan) if plan.steps else None
        self.hears = frozenset[int]() if self.server is None else self.server.hears
        self._claim, self._claims = plan.name_id, True
        if plan.name_id is not None and plan.wake is not None:
            self.hears |= {plan.wake.can_id}
        #: Faults of what it measures: they spoil its message as the catalogue's node would send it.
        self.spoiled: list[Any] = []
        self._native, self._codec = native, codec
        self._kept: tuple[Any, ...] | None = None
        self._reader = SentenceReader() if line else None
        own = STANDARD | HEARTBEAT + (plan.node or 0)  # a CANopen node sends it by itself
        self._encoders = [
            MessageEncoder(each)
            for each in plan.messages
            if not plan.steps or each.can_ids[0] != own | plan.bus << BUS_SHIFT
        ]
        sent: dict[int, list[int]] = {}
        for encoder in self._encoders:
            if encoder.plan.counts_all:
                encoder.sent = sent.setdefault(encoder.plan.can_ids[0], encoder.sent)

    def receive(self, frame: Frame, now_ns: int) -> None:
        """Take what is asked of a CANopen node, or a request of its address claim."""
        if self.server is not None:
            self.server.receive(frame, now_ns)
        self._claims |= self.plan.wake is not None and frame.can_id == self.plan.wake.can_id

    def tick(self, now_ns: int) -> list[Frame]:
        """What a CANopen node sends by itself, and an address claim at its start and on request."""
        frames = [] if self.server is None else self.server.tick(now_ns)
        if self._claims and self._claim is not None:
            frames.append(Frame(self._claim[0], self._claim[1].to_bytes(8, "little")))
        self._claims = False
        return frames

    @property
    def measures(self) -> bool:
        """Whether it sends what it measures."""
        return self.server is None or self.server.measures

    def frames(self, message: tuple[Any, ...], now_ns: int, tick: int) -> list[Frame]:
        """The frames that are due in this tick."""
        frames: list[Frame] = []
        if self.spoiled:
            if _due(tick, self.plan.cycle_ns):
                self._kept = self._spoil(message, now_ns)
            if self._kept is None:
                return frames
            message = self._kept
        values = _said(message)
        measured = [signal.place for each in self.plan.messages for signal in each.signals]
        missing = any(math.isnan(values[place]) for place in measured)
        for each in self._encoders:
            if _due(tick, each.plan.cycle_ns):
                frame = each.frame(values, now_ns, missing=missing)
                frames += [frame] if self._reader is None else self._read(frame)
        return frames

    def _read(self, frame: Frame) -> list[Frame]:
        assert self._reader is not None
        tag = self.plan.bus << BUS_SHIFT
        said = sentence(Frame(frame.can_id - tag, frame.data))
        return [Frame(tag | each.can_id, each.data) for each in self._reader.take(said)]

    def _spoil(self, message: tuple[Any, ...], now_ns: int) -> tuple[Any, ...] | None:
        """What is left of a measurement by the faults; None if nothing is."""
        native = [self._native.frame(message)]
        for each in self.spoiled:
            native = [out for frame in native for out in each.frames(frame, now_ns)]
        return self._codec.decode(native[-1].data) if native else None


def _due(tick: int, cycle_ns: int) -> bool:
    return tick * TICK_NS // cycle_ns != (tick - 1) * TICK_NS // cycle_ns


NOISE_BLOCK = 4096  #: Number of random values drawn at once. Chosen; no study.
MOST_FLOW_M3_S = 30.0  #: Range of SENSOR_PUMP; a larger flow is not available, and not cut to it.

# bound once: in Python 3.11 class access to an enum member is eight times slower
_GOOD = Quality.GOOD
_CLOSED, _OPEN = Switch.ON, Switch.OFF
_new: Final = tuple.__new__  # a NamedTuple's own constructor takes twice the time

_M = TypeVar("_M", bound=tuple[Any, ...])


def standard_normal(seed: int) -> Iterator[float]:
    """Yield standard normal numbers, drawn in blocks because single draws are slow."""
    generator = np.random.Generator(np.random.PCG64(seed))
    while True:
        yield from reversed(generator.standard_normal(NOISE_BLOCK).tolist())


class SensorNode:
    """Node that measures the plant and sends the measurements in the cycles of the catalogue.

    A `second` motion sensor measures nothing else and has no bias. `foreign` are devices of other
    makers, in whose frames the node sends what they measure. The heartbeat has
    `configuration_version`.
    """

    period_ns = TICK_NS

    def __init__(
        self,
        plant: "Plant",
        errors: SensorErrors,
        catalogue: Catalogue,
        *,
        configuration_version: int,
        seed: int,
        second: bool = False,
        foreign: ForeignDevices = NO_FOREIGN_DEVICES,
    ) -> None:
        self.name = "sensors_2" if second else "sensors"
        address = Address.SENSORS_2 if second else Address.SENSORS
        self.hears: frozenset[int] = frozenset()
        self._plant = plant
        self._catalogue = catalogue
        #: Devices of other makers, by the identifier of the message that each stands for.
        self.devices: dict[int, ForeignFrames] = {}
        self._errors = errors
        self._draw = standard_normal(seed).__next__
        delay_ticks = round(errors.motion_delay_ms * 1e6 / TICK_NS)
        self._motion: deque[tuple[float, float]] = deque(maxlen=delay_ticks + 1)
        self._messages: list[tuple[int, Callable[[Any], Frame], Callable[[], Any]]] = []
        # the noise is drawn in this order: append a new message at the end
        motion = catalogue.transmitter(SensorMotion, address)
        self._foreign: list[tuple[ForeignFrames, Callable[[], tuple[Any, ...]]]] = []
        self._buses = foreign.buses
        self._send(motion, self._measure_motion, foreign.motions[second])
        if not second:
            self._send(catalogue.transmitter(SensorTank), self._measure_tank, foreign.levels)
            self._send(catalogue.transmitter(SensorPump), self._measure_pump, foreign.pump_sensor)
        self._bias_rad = 0.0 if second else errors.roll_bias_rad
        self._housekeeping = Housekeeping(address, catalogue, configuration_version)
        self._ticks = 0

    def _send(
        self, transmitter: Transmitter[_M], measure: Callable[[], _M], plan: DevicePlan[_M] | None
    ) -> None:
        """Send what is measured as the node of the catalogue, or as the device of a plan."""
        if plan is None:
            ticks = transmitter.cycle_ns // self.period_ns
            self._messages.append((ticks, transmitter.frame, measure))
            return
        codec = self._catalogue.codec(plan.kind, Address(transmitter.can_id & 0xFF))
        line = self._buses[plan.bus].startswith(LINES)
        device = ForeignFrames(plan, transmitter, codec, line=line)
        self.devices[codec.can_id] = device
        self.hears |= device.hears
        self._foreign.append((device, measure))

    @property
    def canopen(self) -> list[CanopenSensor]:
        """Its CANopen sensors."""
        return [each.server for each, _ in self._foreign if each.server is not None]

    def receive(self, frame: Frame, now_ns: int) -> None:
        """Take what is asked of a CANopen sensor."""
        for device, _ in self._foreign:
            device.receive(frame, now_ns)

    def tick(self, now_ns: int) -> Iterable[Frame]:
        """Measure, and send the messages that are due."""
        plant = self._plant
        plant.advance(now_ns)
        self._motion.append((plant.roll_rad, plant.roll_rate_rad_s))
        frames: list[Frame] = []
        for ticks, frame, measure in self._messages:
            if self._ticks % ticks == 0:
                frames.append(frame(measure()))
        for device, measured in self._foreign:
            frames += device.tick(now_ns)
            if device.measures:
                frames += device.frames(measured(), now_ns, self._ticks)
        if self._messages:  # else no node of the catalogue is on board
            frames.extend(self._housekeeping.frames(now_ns))
        self._ticks += 1
        return frames

    def _measure_motion(self) -> SensorMotion:
        errors, draw = self._errors, self._draw
        roll_rad, rate_rad_s = self._motion[0]
        measured = (
            roll_rad + self._bias_rad + errors.roll_noise_rad * draw(),
            rate_rad_s + errors.roll_rate_noise_rad_s * draw(),
            _GOOD,
        )
        return _new(SensorMotion, measured)

    def _measure_tank(self) -> SensorTank:
        level_m, draw = self._plant.level_m, self._draw
        noise_m, limit_m = self._errors.level_noise_m, self._errors.high_level_m
        measured = (
            -level_m + noise_m * draw(),
            level_m + noise_m * draw(),
            _CLOSED if -level_m > limit_m else _OPEN,
            _CLOSED if level_m > limit_m else _OPEN,
            _GOOD,
        )
        return _new(SensorTank, measured)

    def _measure_pump(self) -> SensorPump:
        plant = self._plant
        noise_pa = self._errors.pressure_noise_pa * self._draw()
        flow_m3_s = plant.flow_m3_s if abs(plant.flow_m3_s) <= MOST_FLOW_M3_S else math.nan
        return _new(SensorPump, (plant.pressure_pa + noise_pa, flow_m3_s, _GOOD))
