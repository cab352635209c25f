"""What the controller hears: frames checked, decoded and kept with the time they came.

A rejected frame changes nothing: no value, no time, no counter. Neither does a good frame whose
content is no measurement: not available, out of range, or declared bad by the sensor itself.
"""

import math
from collections.abc import Callable
from functools import partial
from typing import Any, Final, TypeVar

from utank_hil.canbus import (
    Address,
    AddressClaim,
    Catalogue,
    DriveFault,
    DriveState,
    DriveStatus1,
    DriveStatus2,
    Frame,
    HardwiredInputs,
    Heartbeat,
    Quality,
    Receiver,
    SensorMotion,
    SensorPump,
    SensorTank,
    Station,
    Switch,
    ValveFault,
    ValveState,
    ValveStatus,
)
from utank_hil.nodes.command_echo import CommandEcho
from utank_hil.nodes.hardwired import HardwiredHeard
from utank_hil.nodes.motion_sensors import MotionSensor, MotionSensors
from utank_hil.nodes.orders import NEVER_HEARD_NS
from utank_hil.nodes.redundancy import NO_REDUNDANCY, Redundancy
from utank_hil.nodes.stations import ADDRESSES, Stations
from utank_hil.safety.monitors.spikes import MotionGate, SpikeGates

MEASURED: Final = ("roll_rad", "roll_rate_rad_s", "level_m")
"""Attributes of the inbox that a law may measure."""

# read once: in Python 3.11 a member costs eight times as much from its class as from here
_USABLE = (Quality.GOOD, Quality.DEGRADED)
_OPEN = Switch.OFF
_ENABLED = DriveState.OPERATION_ENABLED
_OWN_ADDRESS: Final = int(Address.CONTROLLER)
SOURCE_ADDRESS: Final = 0xFF
"""Of an identifier, by SAE J1939-21."""

LEVEL_MARGIN: Final = 1.1
"""A level farther beyond full or empty than that, for gauges and sloshing, is no measurement."""
SUM_SHARE: Final = 0.5
"""Nor are levels whose sum is more than this share of a full reservoir: the water stays."""

_ABSENT_NS: Final = 1 << 62
"""Time at which what is not on board was last heard: it is never late."""

_M = TypeVar("_M", bound=tuple[Any, ...])
_Accept = Callable[[Frame], tuple[Any, ...] | None]
_Handle = Callable[[Any, int], None]


class Inbox:
    """Latest trusted content of every message the controller listens to.

    Parameters
    ----------
    catalogue : Catalogue
    configuration_version : int
        Of the controller, to compare with the others'.
    level_limit_m : float
        Level at which a reservoir is full or empty; infinite if it is not known.
    pump, valve : bool
        Whether the ship has a pump, and a valve, to be heard.
    gates : SpikeGates, optional
        Through which samples of motion sensor and gauges pass.
    redundancy : Redundancy
        What else the ship has.

    Attributes
    ----------
    roll_rad, roll_rate_rad_s : float
        Of the last good motion sample, received at `motion_ns`.
    motions : MotionSensors or None
        Where there are two motion sensors: both. The attributes above are those of the one in use.
    hardwired : HardwiredHeard or None
        Where there are hard-wired inputs.
    port_level_m, starboard_level_m : float
        Above still water, received at `tank_ns`, `tank_cycles` of the message after the first.
    high_level : bool
        A high-level switch is closed or broken.
    pressure_pa : float
        Measured across the pump, received at `pump_ns`.
    drive_state, drive_fault : DriveState or None, DriveFault or None
        Received at `drive_ns`. Without a pump the drive counts as enabled and is never late.
    pump_echo, valve_echo : CommandEcho
        Whether drive and valve get the commands in time.
    drive_warns : bool
        A warning bit was set in the last DRIVE_STATUS_2.
    drive_held_back : bool
        The drive says that its power or its speed is at the limit.
    power_w : float
        Electric power the drive takes.
    valve_opening : float
        As the valve last measured it, at `valve_ns`; 1, open, before and where there is none.
    valve_state, valve_fault : ValveState or None, ValveFault or None
        As the valve last reported.
    stations : Stations
        What the operators want.
    second_strange_ns : int
        When a second motion sensor of another version was last heard.
    versions_match : bool
        Drive, sensors and valve run the controller's catalogue and configuration.
    conflict_ns : int
        When somebody else last sent with the controller's address.
    claimed_twice_ns : int
        When a node last claimed another one's address: by another name than it was claimed before.
    frames, foreign : int
        Frames heard so far, good and bad, of any kind, and those that are none of the catalogue's.
    watched : list of Receiver
        Of every message that is heard.
    expected : frozenset of int
        Identifiers of those whose silence is not judged by their age.
    """

    def __init__(
        self,
        catalogue: Catalogue,
        configuration_version: int,
        level_limit_m: float = math.inf,
        *,
        pump: bool = True,
        valve: bool = False,
        gates: SpikeGates | None = None,
        redundancy: Redundancy = NO_REDUNDANCY,
    ) -> None:
        self._most_level_m = LEVEL_MARGIN * level_limit_m
        self._most_sum_m = SUM_SHARE * level_limit_m
        self._versions = (catalogue.version, configuration_version)
        self._gates = gates
        self._known = catalogue.can_ids
        self.watched: list[Receiver[Any]] = []
        self._subscriptions: dict[int, tuple[_Accept, _Handle]] = {}
        self._motion = catalogue.receiver(SensorMotion)
        self.motions: MotionSensors | None = None
        if redundancy.second_motion_sensor:
            second = catalogue.receiver(SensorMotion, Address.SENSORS_2)
            self.motions = motions = MotionSensors(self._motion, second)
            for index, sensor in enumerate((motions.first, motions.second)):
                gate = None if gates is None else gates.motions[index]
                on_motion = partial(self._on_either_motion, motions, sensor, gate)
                self._subscribe(sensor.receiver, on_motion)
        else:
            self._subscribe(self._motion, self._on_motion)
        self._tank = self._subscribe(catalogue.receiver(SensorTank), self._on_tank)
        self._drive_1: Receiver[DriveStatus1] | None = None
        matched = [Address.SENSORS]
        if pump:
            matched.append(Address.DRIVE)
            self._subscribe(catalogue.receiver(SensorPump), self._on_pump)
            self._drive_1 = self._subscribe(catalogue.receiver(DriveStatus1), self._on_drive_1)
            self._subscribe(catalogue.receiver(DriveStatus2), self._on_drive_2)
        if valve:
            matched.append(Address.VALVE)
            self._subscribe(catalogue.receiver(ValveStatus), self._on_valve)
        self.hardwired: HardwiredHeard | None = None
        if redundancy.hardwired_inputs:
            matched.append(Address.HARDWIRED)
            self.hardwired = hardwired = HardwiredHeard(catalogue.receiver(HardwiredInputs))
            self._subscriptions[hardwired.receiver.can_id] = hardwired.accept, hardwired.take
            self.watched.append(hardwired.receiver)
        self.stations = Stations(catalogue)
        for orders in self.stations.orders.values():
            self._subscriptions[orders.can_id] = orders.accept, orders.obey
            self.watched.append(orders.receiver)
        if self.motions is not None:
            matched.append(Address.SENSORS_2)
        self._matching: dict[int, bool] = {}
        self._second_beat = 0
        self.second_strange_ns = NEVER_HEARD_NS
        for address in matched:
            heartbeat = catalogue.receiver(Heartbeat, address)
            self._matching[heartbeat.can_id] = False
            if address is Address.SENSORS_2:  # silent, it is missed but not waited for
                self._second_beat = heartbeat.can_id
                self._matching[heartbeat.can_id] = True
            self._subscribe(heartbeat, partial(self._on_heartbeat, heartbeat.can_id))
        self.expected = frozenset((catalogue.codec(DriveStatus2).can_id, *self._matching))
        self._panels_match = dict.fromkeys(ADDRESSES, False)
        for station, address in ADDRESSES.items():
            beats = catalogue.receiver(Heartbeat, address)
            self._subscribe(beats, partial(self._on_panel_heartbeat, station))
        self._names: dict[int, int | None] = {}
        for address in (*matched, *ADDRESSES.values()):
            claims = catalogue.receiver(AddressClaim, address)
            on_claim = partial(self._on_claim, address, claims.can_id)
            self._subscriptions[claims.can_id] = claims.accept, on_claim
        self.roll_rad = self.roll_rate_rad_s = 0.0
        self.port_level_m = self.starboard_level_m = 0.0
        self.pressure_pa = self.power_w = 0.0
        self.drive_held_back = self.drive_warns = False
        self.high_level = False
        self.valve_opening = 1.0
        self.valve_state: ValveState | None = None
        self.valve_fault: ValveFault | None = ValveFault.NONE
        self.valve_ns = NEVER_HEARD_NS
        self.valve_echo = CommandEcho()
        self.drive_state = None if pump else _ENABLED
        self.drive_fault: DriveFault | None = DriveFault.NONE
        self.versions_match = False
        self.motion_ns = self.tank_ns = NEVER_HEARD_NS
        self.pump_ns = self.drive_ns = NEVER_HEARD_NS if pump else _ABSENT_NS
        self.pump_echo = CommandEcho(self.pump_ns)
        self.tank_cycles = self._cycles = self._tank_lost = 0
        self._tank_due_ns = NEVER_HEARD_NS  # when the last frame was due by its counter
        self._tank_patience_ns = self._tank.cycle_ns * 3 // 2
        self.conflict_ns = self.claimed_twice_ns = NEVER_HEARD_NS
        self.frames = self.foreign = 0

    @property
    def level_m(self) -> float:
        """Tank level, starboard up: half the difference of the two gauges."""
        return (self.starboard_level_m - self.port_level_m) / 2

    @property
    def panel_matches(self) -> bool:
        """Whether the station in command runs the controller's catalogue and configuration."""
        return self._panels_match[self.stations.in_command]

    @property
    def protection_valid(self) -> bool:
        """Whether the messages that control stands on keep arriving intact and in order."""
        drive_valid = self._drive_1 is None or self._drive_1.valid
        motions = self.motions
        motion_valid = self._motion.valid if motions is None else motions.used.receiver.valid
        return motion_valid and self._tank.valid and drive_valid

    def _subscribe(self, receiver: Receiver[_M], handle: Callable[[_M, int], None]) -> Receiver[_M]:
        """Hand the accepted messages of a receiver to `handle`, with the time they came."""
        self._subscriptions[receiver.can_id] = receiver.accept, handle
        self.watched.append(receiver)
        return receiver

    def receive(self, frame: Frame, now_ns: int) -> None:
        """Take one frame from the bus."""
        self.frames += 1
        subscription = self._subscriptions.get(frame.can_id)
        if subscription is not None:
            accept, handle = subscription
            message = accept(frame)
            if message is not None:
                handle(message, now_ns)
        elif frame.can_id & SOURCE_ADDRESS == _OWN_ADDRESS:
            self.conflict_ns = now_ns
        elif frame.can_id not in self._known:
            self.foreign += 1

    def _on_motion(self, motion: SensorMotion, now_ns: int) -> None:
        if motion.quality not in _USABLE:
            return
        # one test for both: the sum is NaN if either is not available
        if math.isfinite(motion.roll_rad + motion.roll_rate_rad_s) and (
            self._gates is None
            or self._gates.motions[0].passes(motion.roll_rad, motion.roll_rate_rad_s, now_ns)
        ):
            self.roll_rad, self.roll_rate_rad_s = motion.roll_rad, motion.roll_rate_rad_s
            self.motion_ns = now_ns

    def _on_either_motion(
        self,
        motions: MotionSensors,
        sensor: MotionSensor,
        gate: MotionGate | None,
        motion: SensorMotion,
        now_ns: int,
    ) -> None:
        if motion.quality not in _USABLE:
            return
        if math.isfinite(motion.roll_rad + motion.roll_rate_rad_s) and (
            gate is None or gate.passes(motion.roll_rad, motion.roll_rate_rad_s, now_ns)
        ):
            sensor.roll_rad, sensor.roll_rate_rad_s = motion.roll_rad, motion.roll_rate_rad_s
            sensor.heard_ns = now_ns
            if sensor is motions.used:
                self._show_motion(sensor)

    def _show_motion(self, sensor: MotionSensor) -> None:
        self.roll_rad, self.roll_rate_rad_s = sensor.roll_rad, sensor.roll_rate_rad_s
        self.motion_ns = sensor.heard_ns

    def exchange_motion(self, motions: MotionSensors) -> None:
        """Use the other of the two motion sensors from now on."""
        motions.exchange()
        self._show_motion(motions.used)

    def _on_tank(self, tank: SensorTank, now_ns: int) -> None:
        self._count_cycles(now_ns)
        # the switches count whatever the gauges say, and a broken switch counts as closed
        self.high_level = not (tank.port_high is _OPEN and tank.starboard_high is _OPEN)
        if tank.quality not in _USABLE:
            return
        port_m, starboard_m = tank.port_level_m, tank.starboard_level_m
        # written so that NaN, not available, fails too; a reservoir fills as the other one empties
        if (
            abs(port_m - starboard_m) <= 2 * self._most_level_m
            and abs(port_m + starboard_m) <= self._most_sum_m
            and (self._gates is None or self._gates.levels_pass(port_m, starboard_m, now_ns))
        ):
            self.port_level_m, self.starboard_level_m = port_m, starboard_m
            self.tank_ns, self.tank_cycles = now_ns, self._cycles

    def _count_cycles(self, now_ns: int) -> None:
        """Count the cycles since the last frame; by its counter, since time of receipt jitters.

        A counter that falls behind the time is that of a long gap, or of a node that is too slow.
        """
        lost, cycle_ns = self._tank.lost, self._tank.cycle_ns
        cycles = 1 + lost - self._tank_lost
        self._tank_lost = lost
        due_ns = self._tank_due_ns + cycles * cycle_ns
        behind_ns = now_ns - due_ns
        if behind_ns > self._tank_patience_ns:
            missed = round(behind_ns / cycle_ns)
            cycles += missed
            due_ns += missed * cycle_ns
        self._cycles += cycles
        self._tank_due_ns = min(due_ns, now_ns)

    def _on_pump(self, pump: SensorPump, now_ns: int) -> None:
        if pump.quality in _USABLE and math.isfinite(pump.pressure_pa):
            self.pressure_pa = pump.pressure_pa
            self.pump_ns = now_ns

    def _on_drive_1(self, status: DriveStatus1, now_ns: int) -> None:
        if status.state is None:  # as if the frame had not come
            return
        self.drive_state = status.state
        self.drive_held_back = status.power_limited or status.speed_limited
        self.drive_ns = now_ns
        self.pump_echo.heard(status.command_echo, now_ns)

    def _on_drive_2(self, status: DriveStatus2, now_ns: int) -> None:  # noqa: ARG002
        self.drive_fault = status.fault
        self.drive_warns = (
            status.temperature_warning
            or status.voltage_warning
            or status.command_warning
            or status.sensor_warning
        )
        self.power_w = status.bus_voltage_v * status.current_a

    def _on_valve(self, status: ValveStatus, now_ns: int) -> None:
        self.valve_state = status.state
        self.valve_fault = status.fault
        if math.isfinite(status.opening):
            self.valve_opening, self.valve_ns = status.opening, now_ns
        self.valve_echo.heard(status.command_echo, now_ns)

    def _on_heartbeat(self, can_id: int, beat: Heartbeat, now_ns: int) -> None:
        versions = (beat.catalogue_version, beat.configuration_version)
        matches = versions == self._versions
        if can_id == self._second_beat:  # silent, it is not waited for
            self.second_strange_ns = NEVER_HEARD_NS if matches else now_ns
            return
        self._matching[can_id] = matches
        self.versions_match = all(self._matching.values())

    def _on_claim(self, address: int, can_id: int, claim: AddressClaim, now_ns: int) -> None:
        self.stations.started(address)
        if self._names.setdefault(can_id, claim.name) != claim.name:
            self.claimed_twice_ns = now_ns
            self._names[can_id] = claim.name  # of a device that was replaced

    def _on_panel_heartbeat(
        self,
        station: Station,
        beat: Heartbeat,
        now_ns: int,  # noqa: ARG002
    ) -> None:
        versions = (beat.catalogue_version, beat.configuration_version)
        self._panels_match[station] = versions == self._versions
