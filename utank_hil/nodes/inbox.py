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
    Fault,
    Frame,
    HardwiredInputs,
    Heartbeat,
    OperatorCommand,
    Receiver,
    SensorMotion,
    SensorPump,
    SensorTank,
    Switch,
    ValveFault,
    ValveState,
    ValveStatus,
)
from utank_hil.canbus.frame import OTHER_BUS, STANDARD
from utank_hil.canbus.measurements import Measurements
from utank_hil.canbus.profiles.acting import ProfiledPanel, ProfiledValve
from utank_hil.canbus.profiles.device import ProfiledDevice, hear
from utank_hil.canbus.profiles.device_plan import NO_FOREIGN_DEVICES, ForeignDevices
from utank_hil.nodes.canopen_drive import CanopenDrive, DriveReport
from utank_hil.nodes.canopen_setup import SensorSetup
from utank_hil.nodes.hardwired import HardwiredHeard
from utank_hil.nodes.plausibility import (
    MILLISECOND_NS,
    NEVER_HEARD_NS,
    USABLE,
    LevelGates,
    MotionSensor,
    SampleClock,
)
from utank_hil.nodes.redundancy import NO_REDUNDANCY, Redundancy
from utank_hil.nodes.stations import ADDRESSES, Stations
from utank_hil.safety.monitors.senders import Heard
from utank_hil.safety.monitors.thresholds import MonitorThresholds

# read once: in Python 3.11 a member costs eight times as much from its class as from here
_OPEN: Final = Switch.OFF
_ENABLED: Final = DriveState.OPERATION_ENABLED
_DRIVE_FAULT: Final = DriveState.FAULT
_DRIVE_BRAKES: Final = DriveState.FAULT_REACTION_ACTIVE
_NO_DRIVE_FAULT: Final = DriveFault.NONE
_VALVE_FOLLOWS: Final = ValveState.FOLLOWING
_VALVE_FAULT: Final = ValveState.FAULT
_NO_VALVE_FAULT: Final = ValveFault.NONE
_OWN_ADDRESS: Final = int(Address.CONTROLLER)
SOURCE_ADDRESS: Final = 0xFF
"""Part of an identifier that is the sender's address, by SAE J1939-21."""

LEVEL_MARGIN: Final = 1.1
"""Factor on full and empty beyond which a level is no measurement, for gauges and sloshing."""
SUM_SHARE: Final = 0.5
"""Share of a full reservoir beyond which the sum of both levels is none: the water stays."""
CONFLICT_NS: Final = 10_000_000_000
"""Silence after which a second sender of an address counts as gone."""
VERSION_NS: Final = 5_000_000_000
"""A version that was not confirmed for so long is not known any more: fifty heartbeats."""
STRANGE_NS: Final = 1_000_000_000
"""Silence after which a second motion sensor of another version counts as gone."""

_OF_SENSORS: Final = {
    Fault.MOTION_SILENT: SensorMotion, Fault.TANK_SILENT: SensorTank,
    Fault.PUMP_SENSOR_SILENT: SensorPump, Fault.VALVE_SILENT: ValveStatus,
    Fault.OPERATOR_SILENT: OperatorCommand,
}  # fmt: skip
_ABSENT_NS: Final = 1 << 62
"""Time of receipt of what is not on board: it is never late."""

_M = TypeVar("_M", bound=tuple[Any, ...])
_Accept = Callable[[Frame], tuple[Any, ...] | None]
_Handle = Callable[[Any, int], None]


class Inbox:
    """Latest trusted content of every message the controller listens to.

    Only the inbox writes its attributes; the others get the values of `snapshot`.

    `configuration_version` is compared with the other nodes'. `level_limit_m` is the level at which
    a reservoir is full or empty. `pump` and `valve` say whether there is one to be heard. Without
    `thresholds`, what no motion of ship and water exceeds, no sample is a spike. `drive` is that of
    `foreign`, the devices of other makers, as it is commanded; `key` is that of a panel of them.

    What `hardwired` says counts wherever it is heard. `frames` were heard so far, good and bad, of
    any kind; `foreign` are those of them that are none of the catalogue's.
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
        self._most_level_m = LEVEL_MARGIN * level_limit_m
        self._most_sum_m = SUM_SHARE * level_limit_m
        self._versions = (catalogue.version, configuration_version)
        self._known = catalogue.can_ids
        self.watched: list[Heard] = []  #: Counters of every message that is heard.
        self._subscriptions: dict[int, tuple[_Accept, _Handle]] = {}
        self._foreign = foreign
        self._devices: dict[int, Callable[[Frame, int], None]] = {}
        self._foreigners: list[ProfiledDevice[Any]] = []
        self._setups: list[SensorSetup] = []
        # a second sensor that is silent is missed but not waited for
        senders = [Address.SENSORS, Address.SENSORS_2][: 1 + redundancy.second_motion_sensor]
        sources = [
            catalogue.receiver(SensorMotion, sender) if plan is None else ProfiledDevice(plan)
            for sender, plan in zip(senders, foreign.motions, strict=False)
        ]
        self.motions = tuple(MotionSensor(source, thresholds) for source in sources)
        for sensor in self.motions:
            self._hear(sensor.receiver, sensor.take)
        self.gates = None if thresholds is None else LevelGates(thresholds)
        levels, pump_sensor = foreign.levels, foreign.pump_sensor
        self._tank = catalogue.receiver(SensorTank) if levels is None else ProfiledDevice(levels)
        self._tank_clock = SampleClock(self._tank)
        self._hear(self._tank, self._on_tank)
        self._drive: Receiver[DriveStatus1] | None = None
        matched = []
        if foreign.motions[0] is None or levels is None or (pump and pump_sensor is None):
            matched.append(Address.SENSORS)
        if pump:
            pressure = catalogue.receiver(SensorPump)
            self._hear(
                pressure if pump_sensor is None else ProfiledDevice(pump_sensor), self._on_pump
            )
        if drive is None and foreign.pump is not None:
            drive = CanopenDrive(foreign.pump, hears_only=True)
        self.canopen_drive = drive
        if pump and self.canopen_drive is not None:
            self.canopen_drive.deliver = self._on_drive_report
            self._devices |= self.canopen_drive.takes
            self.watched += self.canopen_drive.watched
        elif pump:
            matched.append(Address.DRIVE)
            self._drive = self._subscribe(catalogue.receiver(DriveStatus1), self._on_drive_1)
            self._subscribe(catalogue.receiver(DriveStatus2), self._on_drive_2)
        if valve and foreign.valve is not None:
            self._hear(ProfiledValve(foreign.valve), self._on_valve)
        elif valve:
            matched.append(Address.VALVE)
            self._subscribe(catalogue.receiver(ValveStatus), self._on_valve)
        self._hardwired_declared = redundancy.hardwired_inputs
        if redundancy.hardwired_inputs:
            matched.append(Address.HARDWIRED)
        self.hardwired = hardwired = HardwiredHeard(catalogue.receiver(HardwiredInputs))
        self._subscriptions[hardwired.receiver.can_id] = hardwired.accept, hardwired.take
        self.watched.append(hardwired.receiver)
        self.panel = panel = None if foreign.panel is None else ProfiledPanel(foreign.panel, key)
        second = redundancy.second_station
        self.stations = Stations(catalogue, self._versions, second=second, panel=panel)
        for orders in self.stations.orders.values():
            if isinstance(orders.receiver, ProfiledPanel):
                self._hear(orders.receiver, orders.receiver.deliver)
                continue
            self._subscriptions[orders.receiver.can_id] = orders.accept, orders.obey
            self.watched.append(orders.receiver)
        if len(senders) == 2 and foreign.motions[1] is None:
            matched.append(Address.SENSORS_2)
        self._matched_ns: dict[int, int] = {}
        self._second_beat = 0
        self._strange_ns = NEVER_HEARD_NS
        for address in matched:
            heartbeat = catalogue.receiver(Heartbeat, address)
            self._matched_ns[heartbeat.can_id] = NEVER_HEARD_NS
            if address is Address.SENSORS_2:
                self._second_beat = heartbeat.can_id
                self._matched_ns[heartbeat.can_id] = _ABSENT_NS
            self._subscribe(heartbeat, partial(self._on_heartbeat, heartbeat.can_id))
        slow = () if self._drive is None else (catalogue.codec(DriveStatus2).can_id,)
        #: Identifiers of messages whose silence is not judged by their age.
        self.expected = frozenset((*slow, *self._matched_ns))
        for station, address in ADDRESSES.items():
            if isinstance(self.stations.orders[station].receiver, ProfiledPanel):
                continue
            beats = catalogue.receiver(Heartbeat, address)
            self._subscribe(beats, partial(self.stations.beat, station))
        self._names: dict[int, int | None] = {}
        for address in (*matched, *ADDRESSES.values()):
            claims = catalogue.receiver(AddressClaim, address)
            on_claim = partial(self._on_claim, address, claims.can_id)
            self._subscriptions[claims.can_id] = claims.accept, on_claim
        self._port_level_m = self._starboard_level_m = 0.0
        self._pressure_pa = self._power_w = 0.0
        self._drive_held_back = self._drive_warns = False
        self._high_level = False
        self._valve_opening = 1.0  # open, before it is known and where there is none
        self._valve_state: ValveState | None = None
        self._valve_fault: ValveFault | None = ValveFault.NONE
        self._valve_echo_ns = self._valve_heard_ns = NEVER_HEARD_NS
        self._valve_echo: int | None = None
        self._drive_state = None if pump else _ENABLED
        self._drive_fault: DriveFault | None = DriveFault.NONE
        self._drive_2_heard = self._drive is None
        self._drive_echo: int | None = None
        self._tank_ns = NEVER_HEARD_NS
        self._pump_ns = self._drive_ns = NEVER_HEARD_NS if pump else _ABSENT_NS
        self._drive_echo_ns = self._drive_ns
        self._tank_cycles = self._cycles = self._tank_lost = 0
        self._tank_due_ns = NEVER_HEARD_NS  # when the last frame was due by its counter
        self._tank_patience_ns = self._tank.cycle_ns * 3 // 2
        self._conflict_ns = self._claimed_twice_ns = NEVER_HEARD_NS
        self._link_lost_until_ns = NEVER_HEARD_NS
        self.frames = self.foreign = 0
        self._received: dict[Fault, str] = {}

    def snapshot(self, now_ns: int) -> Measurements:
        """What is known at a tick; takes the operators' edges, which come once."""
        stations, gates, hardwired, drive = self.stations, self.gates, self.hardwired, self._drive
        wishes = stations.take(now_ns)  # first of all: who is in command may change
        motions = tuple([sensor.sample(now_ns) for sensor in self.motions])
        port_m, starboard_m = self._port_level_m, self._starboard_level_m
        drive_state, valve_state = self._drive_state, self._valve_state
        hardwired_age_ms = 0.0
        if self._hardwired_declared:
            hardwired_age_ms = (now_ns - hardwired.heard_ns) / MILLISECOND_NS
        drive_ns = self._drive_ns if self._drive_2_heard else NEVER_HEARD_NS
        matched_ns = min(self._matched_ns.values(), default=_ABSENT_NS)
        return Measurements(
            *wishes,
            now_ns,
            stations.requested_mode,
            (now_ns - stations.heard_ns) / MILLISECOND_NS,
            stations.matches,
            motions,
            port_m,
            starboard_m,
            (starboard_m - port_m) / 2,
            self._tank_ns,
            self._tank_cycles,
            (now_ns - self._tank_ns) / MILLISECOND_NS,
            0 if gates is None else gates.discarded,
            self._high_level or hardwired.high_level,
            self._pressure_pa,
            (now_ns - self._pump_ns) / MILLISECOND_NS,
            drive_state,
            (now_ns - drive_ns) / MILLISECOND_NS,
            self._drive_echo_ns,
            self._drive_echo,
            drive_state is _DRIVE_FAULT
            or drive_state is _DRIVE_BRAKES
            or self._drive_fault is not _NO_DRIVE_FAULT,
            self._drive_warns,
            self._drive_held_back,
            self._power_w,
            self._valve_opening,
            valve_state is _VALVE_FOLLOWS,
            valve_state is _VALVE_FAULT or self._valve_fault is not _NO_VALVE_FAULT,
            self._valve_echo_ns,
            self._valve_echo,
            self._valve_heard_ns,
            hardwired.take_stop(),
            hardwired_age_ms,
            now_ns - matched_ns <= VERSION_NS and now_ns - self._strange_ns > STRANGE_NS,
            self._tank.valid and (drive is None or drive.valid),
            now_ns - self._conflict_ns <= CONFLICT_NS,
            now_ns - self._claimed_twice_ns <= CONFLICT_NS,
            now_ns <= self._link_lost_until_ns,
            self.frames,
            self.foreign,
        )

    @property
    def discarded(self) -> int:
        """Samples so far of motion sensors and gauges that were discarded as spikes."""
        levels = 0 if self.gates is None else self.gates.discarded
        return levels + sum(sensor.discarded for sensor in self.motions)

    def _subscribe(self, receiver: Receiver[_M], handle: Callable[[_M, int], None]) -> Receiver[_M]:
        """Hand the accepted messages of a receiver to `handle`, with the time they came."""
        self._subscriptions[receiver.can_id] = receiver.accept, handle
        self.watched.append(receiver)
        return receiver

    def _hear(
        self, source: Receiver[_M] | ProfiledDevice[_M], handle: Callable[[_M, int], None]
    ) -> None:
        """Hand on what a node, or a device of another maker, has measured."""
        if isinstance(source, Receiver):
            self._subscribe(source, handle)
            return
        source.deliver = handle
        self._foreigners.append(source)
        if source.plan.steps:
            self._setups.append(SensorSetup(source))
        for can_id, take in source.takes.items():
            hear(self._devices, can_id, take)
        self.watched += source.watched

    def setups(self, now_ns: int) -> list[Frame]:
        """What CANopen sensors are configured with in this tick."""
        frames: list[Frame] = []
        for each in self._setups:
            frames += each.frames(now_ns)
        return frames

    def wakes(self, now_ns: int) -> list[Frame]:
        """What is to be sent to devices of other makers that are silent."""
        frames = (device.wake(now_ns) for device in self._foreigners)
        return [frame for frame in frames if frame is not None]

    @property
    def tank_cycle_ns(self) -> int:
        """Time from one measurement of the levels to the next."""
        return self._tank.cycle_ns

    def link_error(self, now_ns: int, period_ns: int, reason: str = "") -> None:
        """Take note that the bus could not be read or written; it counts as lost for a period."""
        self._link_lost_until_ns = now_ns + period_ns
        self._received[Fault.BUS_LOST] = reason

    def received(self, code: Fault) -> str:
        """Node, message and value that a fault was last judged by, in words."""
        if code in _OF_SENSORS:
            kind, each = _OF_SENSORS[code], self._setups
            return "; ".join([one.words for one in each if one.kind is kind and one.words])
        if code in (Fault.DRIVE_FAULT, Fault.DRIVE_SILENT):
            if self.canopen_drive is not None:
                return self.canopen_drive.words
            if self._drive is not None:
                return (
                    f"drive: state {_said(self._drive_state)} in DRIVE_STATUS_1, fault "
                    f"{_said(self._drive_fault)} in DRIVE_STATUS_2"
                )
        return self._received.get(code, "")

    def other_frames(self, count: int) -> None:
        """Take note of frames of other kinds on the bus."""
        self.frames += count
        self.foreign += count

    def receive(self, frame: Frame, now_ns: int) -> None:
        """Take one frame from the bus; load and foreign frames are those of the own bus alone."""
        can_id = frame.can_id
        self.frames += can_id < OTHER_BUS
        subscription = self._subscriptions.get(can_id)
        if subscription is not None:
            accept, handle = subscription
            message = accept(frame)
            if message is not None:
                handle(message, now_ns)
            return
        take = self._devices.get(can_id)
        if take is not None:
            take(frame, now_ns)
        elif can_id & SOURCE_ADDRESS == _OWN_ADDRESS and can_id < STANDARD:
            self._conflict_ns = now_ns
            self._received[Fault.ADDRESS_CONFLICT] = f"identifier 0x{can_id:08X}"
        elif can_id < OTHER_BUS and can_id not in self._known and not self._foreign.knows(can_id):
            self.foreign += 1

    def _on_tank(self, tank: SensorTank, now_ns: int) -> None:
        self._count_cycles(now_ns)
        time_ns = self._tank_clock.time_ns(now_ns)
        # the switches count whatever the gauges say, and a broken switch counts as closed
        self._high_level = not (tank.port_high is _OPEN and tank.starboard_high is _OPEN)
        if tank.quality not in USABLE:
            return
        port_m, starboard_m = tank.port_level_m, tank.starboard_level_m
        # written so that NaN, not available, fails too; a reservoir fills as the other one empties
        if (
            abs(port_m - starboard_m) <= 2 * self._most_level_m
            and abs(port_m + starboard_m) <= self._most_sum_m
            and (self.gates is None or self.gates.passes(port_m, starboard_m, time_ns))
        ):
            self._port_level_m, self._starboard_level_m = port_m, starboard_m
            self._tank_ns, self._tank_cycles = now_ns, self._cycles

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
        if pump.quality in USABLE and math.isfinite(pump.pressure_pa):
            self._pressure_pa = pump.pressure_pa
            self._pump_ns = now_ns

    def _on_drive_1(self, status: DriveStatus1, now_ns: int) -> None:
        if status.state is None:  # as if the frame had not come
            return
        self._drive_state = status.state
        self._drive_held_back = status.power_limited or status.speed_limited
        self._drive_ns = now_ns
        if status.command_echo != self._drive_echo:
            self._drive_echo_ns, self._drive_echo = now_ns, status.command_echo

    def _on_drive_2(self, status: DriveStatus2, now_ns: int) -> None:  # noqa: ARG002
        self._drive_fault, self._drive_2_heard = status.fault, True
        self._drive_warns = (
            status.temperature_warning
            or status.voltage_warning
            or status.command_warning
            or status.sensor_warning
        )
        self._power_w = status.bus_voltage_v * status.current_a

    def _on_drive_report(self, report: DriveReport | None, now_ns: int) -> None:
        if report is None:  # configured, or refused
            assert self.canopen_drive is not None
            refused = bool(self.canopen_drive.setup.problem)
        else:
            self._drive_state, refused, self._drive_held_back, warns, self._power_w = report
            self._drive_warns = warns
            self._drive_ns = now_ns
        self._drive_fault = DriveFault.INTERNAL if refused else _NO_DRIVE_FAULT

    def _on_valve(self, status: ValveStatus, now_ns: int) -> None:
        self._valve_state = status.state
        self._valve_fault = status.fault
        if math.isfinite(status.opening):
            self._valve_opening, self._valve_heard_ns = status.opening, now_ns
        if status.command_echo != self._valve_echo:
            self._valve_echo_ns, self._valve_echo = now_ns, status.command_echo

    def _on_heartbeat(self, can_id: int, beat: Heartbeat, now_ns: int) -> None:
        versions = (beat.catalogue_version, beat.configuration_version)
        matches = versions == self._versions
        if not matches:
            self._received[Fault.VERSION_MISMATCH] = (
                f"{Address(can_id & SOURCE_ADDRESS).name.lower()}: heartbeat 0x{can_id:08X}, "
                f"catalogue {versions[0]} and ship {versions[1]}, here {self._versions[0]} and "
                f"{self._versions[1]}"
            )
        if can_id == self._second_beat:  # silent, it is not waited for
            self._strange_ns = NEVER_HEARD_NS if matches else now_ns
            return
        self._matched_ns[can_id] = now_ns if matches else NEVER_HEARD_NS

    def _on_claim(self, address: int, can_id: int, claim: AddressClaim, now_ns: int) -> None:
        self.stations.started(address)
        if self._names.setdefault(can_id, claim.name) != claim.name:
            self._claimed_twice_ns = now_ns
            was = self._names[can_id]
            self._received[Fault.FOREIGN_SENDER] = (
                f"{Address(address).name.lower()}: address claim 0x{can_id:08X}, name "
                f"{claim.name} after {was}"
            )
            self._names[can_id] = claim.name  # of a device that was replaced


def _said(value: DriveState | DriveFault | None) -> str:
    return "not available" if value is None else f"{value:d} ({value.name})"
