"""What the controller hears: frames checked, decoded and kept with the time they came.

A rejected frame changes nothing: no value, no time, no counter. Neither does a good frame whose
content is no measurement: not available, out of range, or declared bad by the sensor itself.
"""

import math
from collections.abc import Sequence
from functools import partial
from typing import Any, Final, TypeAlias

from utank_hil.canbus import (
    Address,
    Catalogue,
    Fault,
    Frame,
    HardwiredInputs,
    Heartbeat,
    Receiver,
    SensorMotion,
    SensorPump,
    SensorTank,
    ValveStatus,
)
from utank_hil.canbus.frame import BUS_SHIFT, OTHER_BUS, STANDARD
from utank_hil.canbus.measurements import Measurements
from utank_hil.canbus.profiles.acting import ProfiledPanel, ProfiledValve
from utank_hil.canbus.profiles.device import MessageHeard, ProfiledDevice
from utank_hil.canbus.profiles.device_plan import NO_FOREIGN_DEVICES, ForeignDevices
from utank_hil.nodes.actuators_heard import ABSENT_NS, DriveHeard, ValveHeard
from utank_hil.nodes.canopen_drive import CanopenDrive
from utank_hil.nodes.forecast_heard import ForecastHeard
from utank_hil.nodes.hardwired import HardwiredHeard
from utank_hil.nodes.levels_heard import LevelsHeard
from utank_hil.nodes.nodes_heard import NodesHeard
from utank_hil.nodes.plausibility import MILLISECOND_NS, NEVER_HEARD_NS, USABLE, MotionSensor
from utank_hil.nodes.redundancy import NO_REDUNDANCY, Redundancy
from utank_hil.nodes.routing import Routing
from utank_hil.nodes.stations import ADDRESSES, Stations
from utank_hil.safety.monitors.senders import Heard
from utank_hil.safety.monitors.thresholds import MonitorThresholds

_OF_DRIVE: Final = (Fault.DRIVE_FAULT, Fault.DRIVE_WARNING)

_Source: TypeAlias = Receiver[Any] | ProfiledDevice[Any]


class Inbox:
    """Latest trusted content of every message the controller listens to.

    Only the inbox writes its attributes; the others get the values of `snapshot`.

    `configuration_version` is compared with the other nodes'. `level_limit_m` is the level at which
    a reservoir is full or empty. `pump` and `valve` say whether there is one to be heard. Without
    `thresholds`, what no motion of ship and water exceeds, no sample is a spike. `drive` is that of
    `foreign`, the devices of other makers, as it is commanded; `key` is that of a panel of them.

    What `hardwired` says counts wherever it is heard. `frames` were heard so far, good and bad, of
    any kind; `foreign` are those of them that are none of the catalogue's. `watched` are counters
    of every message that is heard, `expected` those whose silence is not judged by their age.
    """

    def __init__(
        self,
        catalogue: Catalogue,
        configuration_version: int,
        level_limit_m: float = math.inf,
        *,
        pump: bool = True,
        valve: bool = False,
        thresholds: MonitorThresholds | None = None,
        redundancy: Redundancy = NO_REDUNDANCY,
        foreign: ForeignDevices = NO_FOREIGN_DEVICES,
        drive: CanopenDrive | None = None,
        key: bytes = b"",
    ) -> None:
        self._versions = (catalogue.version, configuration_version)
        self._known = catalogue.can_ids
        self._catalogue, self._foreign = catalogue, foreign
        self._sources: dict[Fault, _Source] = {}  # whose silence is which fault
        self._received: dict[Fault, str] = {}
        self._routing = routing = Routing()
        self._takers = routing.takers
        second = redundancy.second_motion_sensor
        self._hear_motions([Address.SENSORS, Address.SENSORS_2][: 1 + second], thresholds)
        self._hear_levels(level_limit_m, thresholds)
        self._pressure_pa = 0.0
        self._pressure_ns = NEVER_HEARD_NS if pump else ABSENT_NS
        if pump:
            self._hear_pressure()
        if drive is None and foreign.pump is not None:
            drive = CanopenDrive(foreign.pump, hears_only=True)
        if drive is not None:
            routing.emergencies.append(("pump", drive.setup.emergency))
        self._drive = DriveHeard(routing, catalogue, pump=pump, canopen=drive)
        self._valve = ValveHeard()
        if valve:
            self._hear_valve()
        self._hardwired_declared = redundancy.hardwired_inputs
        self.hardwired = hardwired = HardwiredHeard(catalogue.receiver(HardwiredInputs))
        routing.accept(hardwired.receiver.can_id, hardwired.accept, hardwired.take)
        routing.watched.append(hardwired.receiver)
        self.panel = None if foreign.panel is None else ProfiledPanel(foreign.panel, key)
        self.stations = Stations(
            catalogue, self._versions, second=redundancy.second_station, panel=self.panel
        )
        self._hear_orders()
        self._forecast: ForecastHeard | None = None
        if foreign.preview is not None:
            self._forecast = ForecastHeard(
                routing, catalogue, foreign.preview, self._versions, self._received
            )
        if foreign.preview != 0:
            self._known -= catalogue.ids_sent_by(Address.PREVIEW)
        self._nodes = NodesHeard(
            routing,
            catalogue,
            self._versions,
            self._native(pump=pump, valve=valve, second=second),
            self.stations,
            self._received,
        )
        self._hear_panels(catalogue)
        self.watched: list[Heard] = routing.watched
        self.expected = frozenset((*self._drive.slow, *self._nodes.beats))
        self._link_lost_until_ns = NEVER_HEARD_NS
        self.frames = self.foreign = 0

    def _hear_motions(self, senders: list[Address], thresholds: MonitorThresholds | None) -> None:
        """Subscribe to one or two motion sensors; a second one is missed, but not waited for."""
        sources = [
            self._catalogue.receiver(SensorMotion, sender) if plan is None else ProfiledDevice(plan)
            for sender, plan in zip(senders, self._foreign.motions, strict=False)
        ]
        self.motions = tuple(MotionSensor(source, thresholds) for source in sources)
        for sensor in self.motions:
            self._routing.hear(sensor.receiver, sensor.take)

    def _hear_levels(self, level_limit_m: float, thresholds: MonitorThresholds | None) -> None:
        plan = self._foreign.levels
        tank = self._catalogue.receiver(SensorTank) if plan is None else ProfiledDevice(plan)
        self._levels = LevelsHeard(tank, level_limit_m, thresholds)
        self._routing.hear(tank, self._levels.take)
        self._sources[Fault.TANK_SILENT] = tank

    def _hear_pressure(self) -> None:
        plan = self._foreign.pump_sensor
        source = self._catalogue.receiver(SensorPump) if plan is None else ProfiledDevice(plan)
        self._routing.hear(source, self._take_pressure)
        self._sources[Fault.PUMP_SENSOR_SILENT] = source

    def _hear_valve(self) -> None:
        plan = self._foreign.valve
        says: Receiver[ValveStatus] | ProfiledDevice[ValveStatus] = (
            self._catalogue.receiver(ValveStatus) if plan is None else ProfiledValve(plan)
        )
        self._routing.hear(says, self._valve.take)
        self._sources[Fault.VALVE_SILENT] = self._sources[Fault.VALVE_FAULT] = says

    def _native(self, *, pump: bool, valve: bool, second: bool) -> list[Address]:
        """Return the native nodes that the ship has, whose versions and heartbeats are judged."""
        foreign = self._foreign
        pressure = pump and foreign.pump_sensor is None
        native = {
            Address.SENSORS: foreign.motions[0] is None or foreign.levels is None or pressure,
            Address.DRIVE: self._drive.native,
            Address.VALVE: valve and foreign.valve is None,
            Address.HARDWIRED: self._hardwired_declared,
            Address.SENSORS_2: second and foreign.motions[1] is None,
        }
        return [address for address, here in native.items() if here]

    def _hear_orders(self) -> None:
        """Subscribe to what the operator stations order."""
        for orders in self.stations.orders.values():
            receiver = orders.receiver
            if isinstance(receiver, ProfiledPanel):
                self._routing.hear(receiver, receiver.deliver)
                continue
            self._routing.accept(receiver.can_id, orders.accept, orders.obey)
            self._routing.watched.append(receiver)

    def _hear_panels(self, catalogue: Catalogue) -> None:
        """Subscribe to the heartbeats of native operator stations."""
        for station, address in ADDRESSES.items():
            if not isinstance(self.stations.orders[station].receiver, ProfiledPanel):
                beat = partial(self.stations.beat, station)
                self._routing.subscribe(catalogue.receiver(Heartbeat, address), beat)

    def snapshot(self, now_ns: int) -> Measurements:
        """What is known at a tick; takes the operators' edges, which come once."""
        stations, hardwired, nodes = self.stations, self.hardwired, self._nodes
        levels, drive, valve = self._levels, self._drive, self._valve
        forecast = self._forecast
        # first of all: who is in command may change
        armed, stop, arm_edge, reset_edge, passive_edge = stations.take(now_ns)
        motions = tuple([sensor.sample(now_ns) for sensor in self.motions])
        hardwired_age_ms = 0.0
        if self._hardwired_declared:
            hardwired_age_ms = (now_ns - hardwired.heard_ns) / MILLISECOND_NS
        return Measurements(
            armed,
            stop,
            arm_edge,
            reset_edge,
            passive_edge,
            now_ns,
            stations.requested_mode,
            (now_ns - stations.heard_ns) / MILLISECOND_NS,
            stations.matches,
            motions,
            levels.port_m,
            levels.starboard_m,
            (levels.starboard_m - levels.port_m) / 2,
            levels.heard_ns,
            levels.cycles,
            (now_ns - levels.heard_ns) / MILLISECOND_NS,
            levels.discarded,
            levels.high or hardwired.high_level,
            self._pressure_pa,
            (now_ns - self._pressure_ns) / MILLISECOND_NS,
            drive.state,
            (now_ns - drive.heard_ns) / MILLISECOND_NS,
            drive.echo_ns,
            drive.echo,
            drive.faulty,
            drive.warns,
            drive.held_back,
            drive.at_speed,
            drive.power_w,
            valve.opening,
            valve.follows,
            valve.faulty,
            valve.echo_ns,
            valve.echo,
            valve.heard_ns,
            hardwired.take_stop(),
            hardwired_age_ms,
            nodes.matches(now_ns),
            levels.source.valid and drive.valid,
            nodes.own_address_used(now_ns),
            nodes.address_used_twice(now_ns),
            now_ns <= self._link_lost_until_ns,
            self.frames,
            self.foreign,
            self._routing.device_error,
            () if forecast is None else forecast.points,
            0.0 if forecast is None else (now_ns - forecast.heard_ns) / MILLISECOND_NS,
        )

    @property
    def discarded(self) -> int:
        """Samples so far of motion sensors and gauges that were discarded as spikes."""
        return self._levels.discarded + sum(sensor.discarded for sensor in self.motions)

    @property
    def tank_cycle_ns(self) -> int:
        """Time from one measurement of the levels to the next."""
        return self._levels.source.cycle_ns

    def setups(self, now_ns: int) -> list[Frame]:
        """What CANopen sensors are configured with in this tick."""
        return self._routing.configures(now_ns)

    @property
    def errors(self) -> list[str]:
        """Errors that devices of other makers report, in words."""
        return self._routing.errors

    def wakes(self, now_ns: int) -> list[Frame]:
        """What is to be sent to devices of other makers that are silent."""
        return self._routing.wakes(now_ns)

    def link_error(self, now_ns: int, period_ns: int, reason: str = "") -> None:
        """Take note that the bus could not be read or written; it counts as lost for a period."""
        self._link_lost_until_ns = now_ns + period_ns
        self._received[Fault.BUS_LOST] = reason

    def received(self, code: Fault, heard: Sequence[Heard] = ()) -> str:
        """Node, message and value that a fault was last judged by, in words.

        `heard` are messages of which the monitors have found something.
        """
        if code in _OF_DRIVE:
            return self._drive.words
        if code is Fault.DEVICE_ERROR:
            return "; ".join(self._routing.errors)
        source, parts = self._sources.get(code), [self._received.get(code, "")]
        if code is Fault.MOTION_SILENT:
            source = min(self.motions, key=lambda sensor: sensor.heard_ns).receiver
        elif code is Fault.OPERATOR_SILENT:
            source = self.stations.orders[self.stations.in_command].receiver
        elif code is Fault.DRIVE_SILENT:
            heard, parts = self._drive.watched, [self._drive.words]
        elif code is Fault.PROTECTION:
            heard = [each for each in self.watched if any(each.rejected.values())]
        if isinstance(source, ProfiledDevice):
            parts = [each.words for each in self._routing.setups if each.device is source]
            parts.append(source.words)
            heard = source.watched
        elif source is not None:
            heard = (source,)
        parts += [_message_words(each, self._catalogue, self._foreign) for each in heard]
        return "; ".join(filter(None, parts))

    def other_frames(self, count: int) -> None:
        """Take note of frames of other kinds on the bus."""
        self.frames += count
        self.foreign += count

    def receive(self, frame: Frame, now_ns: int) -> None:
        """Take one frame from the bus; load and foreign frames are those of the own bus alone."""
        fields: Any = frame  # by its name, or as a new object for the dictionary, it takes longer
        key: Any = fields[0]
        can_id: int = key
        self.frames += can_id < OTHER_BUS
        taker = self._takers.get(key)
        if taker is not None:
            taker.take(frame, now_ns)
            return
        if can_id < STANDARD and self._nodes.takes_own(can_id, now_ns):
            return
        if can_id < OTHER_BUS and can_id not in self._known and not self._foreign.knows(can_id):
            self.foreign += 1

    def _take_pressure(self, pump: SensorPump, now_ns: int) -> None:
        if pump.quality in USABLE and math.isfinite(pump.pressure_pa):
            self._pressure_pa = pump.pressure_pa
            self._pressure_ns = now_ns


def _message_words(heard: Heard, catalogue: Catalogue, foreign: ForeignDevices) -> str:
    """Who sends a message, its name, identifier and bus, and how often it was rejected, and why."""
    device, name, _ = foreign.said().get(heard.can_id, ("", "", False))
    if not device:
        known = catalogue.by_id[heard.can_id]
        device, name = known.source.name.lower(), known.codec.name
    bus, digits = foreign.buses[heard.can_id >> BUS_SHIFT], 3 if heard.can_id & STANDARD else 8
    number = f"0x{heard.can_id & STANDARD - 1:0{digits}X}"
    if isinstance(heard, MessageHeard):
        name = heard.name  # several may have one identifier
        if heard.of_group:
            number = f"PGN {heard.can_id >> 8 & 0x3FFFF} of 0x{heard.can_id & 0xFF:02X}"
    parts = [f"{device}: {name} {number}{bus and f' on {bus}'}"]
    parts += ["never heard"] * (not heard.heard)
    parts += [f"{count} with {why.value}" for why, count in heard.rejected.items() if count]
    if isinstance(heard, MessageHeard) and heard.unwell:
        parts.append(heard.unwell)
    return ", ".join(parts)
