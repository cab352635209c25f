"""What the controller hears: frames checked, decoded and kept with the time they came.

A rejected frame changes nothing: no value, no time, no counter. Neither does a good frame whose
content is no measurement: not available, out of range, or declared bad by the sensor itself.
"""

import math

from utank_hil.canbus import (
    Address,
    AddressClaim,
    Catalogue,
    ControllerStatus,
    DriveFault,
    DriveState,
    DriveStatus1,
    DriveStatus2,
    Frame,
    Heartbeat,
    Mode,
    OperatorCommand,
    PumpCommand,
    Quality,
    SensorMotion,
    SensorPump,
    SensorTank,
    Switch,
)

NEVER_HEARD_NS = -(1 << 62)

# read once: in Python 3.11 a member costs eight times as much from its class as from here
_USABLE = (Quality.GOOD, Quality.DEGRADED)
_OPEN = Switch.OFF


class Inbox:
    """Latest trusted content of every message the controller listens to.

    Attributes
    ----------
    roll_rad, roll_rate_rad_s : float
        Of the last good motion sample, received at `motion_ns`.
    port_level_m, starboard_level_m : float
        Above still water, received at `tank_ns`.
    high_level : bool
        A high-level switch is closed or broken.
    pressure_pa : float
        Measured across the pump, received at `pump_ns`.
    drive_state, drive_fault : DriveState or None, DriveFault or None
        Received at `drive_ns`; the echo of a new command at `echo_ns`.
    power_w : float
        Electric power the drive takes.
    operator : OperatorCommand or None
        Last order, received at `panel_ns`.
    requested_mode : Mode
        Mode the operator wants; STANDBY as long as none was asked for.
    versions_match : bool
        Drive and sensors run the controller's catalogue and configuration.
    address_conflict : bool
        Somebody else sends with the controller's address.
    frames : int
        Frames heard so far, good and bad.
    """

    def __init__(self, catalogue: Catalogue, configuration_version: int) -> None:
        self._versions = (catalogue.version, configuration_version)
        self._motion = catalogue.receiver(SensorMotion)
        self._tank = catalogue.receiver(SensorTank)
        self._pump = catalogue.receiver(SensorPump)
        self._drive_1 = catalogue.receiver(DriveStatus1)
        self._drive_2 = catalogue.receiver(DriveStatus2)
        self._operator = catalogue.receiver(OperatorCommand)
        self._heartbeats = {
            address: catalogue.receiver(Heartbeat, address)
            for address in (Address.DRIVE, Address.SENSORS)
        }
        self._handlers = {
            self._motion.can_id: self._on_motion,
            self._tank.can_id: self._on_tank,
            self._pump.can_id: self._on_pump,
            self._drive_1.can_id: self._on_drive_1,
            self._drive_2.can_id: self._on_drive_2,
            self._operator.can_id: self._on_operator,
            **{receiver.can_id: self._on_heartbeat for receiver in self._heartbeats.values()},
        }
        own = (
            catalogue.transmitter(PumpCommand),
            catalogue.transmitter(ControllerStatus),
            catalogue.transmitter(Heartbeat, Address.CONTROLLER),
            catalogue.transmitter(AddressClaim, Address.CONTROLLER),
        )
        self._handlers.update({sender.can_id: self._on_own_identifier for sender in own})
        self._matching: dict[int, bool] = {
            receiver.can_id: False for receiver in self._heartbeats.values()
        }
        self._by_id = {receiver.can_id: receiver for receiver in self._heartbeats.values()}
        self.roll_rad = self.roll_rate_rad_s = 0.0
        self.port_level_m = self.starboard_level_m = 0.0
        self.pressure_pa = self.power_w = 0.0
        self.high_level = False
        self.drive_state: DriveState | None = None
        self.drive_fault: DriveFault | None = DriveFault.NONE
        self.operator: OperatorCommand | None = None
        self.requested_mode = Mode.STANDBY
        self.versions_match = False
        self.motion_ns = self.tank_ns = self.pump_ns = NEVER_HEARD_NS
        self.drive_ns = self.echo_ns = self.panel_ns = NEVER_HEARD_NS
        self._echo: int | None = None
        self.address_conflict = False
        self.frames = 0

    @property
    def level_m(self) -> float:
        """Tank level, starboard up: half the difference of the two gauges."""
        return (self.starboard_level_m - self.port_level_m) / 2

    @property
    def protection_valid(self) -> bool:
        """Whether the messages that control stands on keep arriving intact and in order."""
        return self._motion.valid and self._tank.valid and self._drive_1.valid

    def receive(self, frame: Frame, now_ns: int) -> None:
        """Take one frame from the bus."""
        self.frames += 1
        handler = self._handlers.get(frame.can_id)
        if handler is not None:
            handler(frame, now_ns)

    def _on_motion(self, frame: Frame, now_ns: int) -> None:
        motion = self._motion.accept(frame)
        if motion is None or motion.quality not in _USABLE:
            return
        # one test for both: the sum is NaN if either is not available
        if math.isfinite(motion.roll_rad + motion.roll_rate_rad_s):
            self.roll_rad, self.roll_rate_rad_s = motion.roll_rad, motion.roll_rate_rad_s
            self.motion_ns = now_ns

    def _on_tank(self, frame: Frame, now_ns: int) -> None:
        tank = self._tank.accept(frame)
        if tank is None:
            return
        # the switches count whatever the gauges say, and a broken switch counts as closed
        self.high_level = not (tank.port_high is _OPEN and tank.starboard_high is _OPEN)
        if tank.quality not in _USABLE:
            return
        if math.isfinite(tank.port_level_m + tank.starboard_level_m):
            self.port_level_m, self.starboard_level_m = tank.port_level_m, tank.starboard_level_m
            self.tank_ns = now_ns

    def _on_pump(self, frame: Frame, now_ns: int) -> None:
        pump = self._pump.accept(frame)
        if pump is None or pump.quality not in _USABLE:
            return
        if math.isfinite(pump.pressure_pa):
            self.pressure_pa = pump.pressure_pa
            self.pump_ns = now_ns

    def _on_drive_1(self, frame: Frame, now_ns: int) -> None:
        status = self._drive_1.accept(frame)
        if status is None:
            return
        self.drive_state = status.state
        self.drive_ns = now_ns
        if status.command_echo is not None and status.command_echo != self._echo:
            self._echo = status.command_echo
            self.echo_ns = now_ns

    def _on_drive_2(self, frame: Frame, now_ns: int) -> None:  # noqa: ARG002
        status = self._drive_2.accept(frame)
        if status is not None:
            self.drive_fault = status.fault
            self.power_w = status.bus_voltage_v * status.current_a

    def _on_operator(self, frame: Frame, now_ns: int) -> None:
        order = self._operator.accept(frame)
        if order is not None:
            self.operator = order
            asked = order.mode_request
            self.requested_mode = Mode.STANDBY if asked is None else asked
            self.panel_ns = now_ns

    def _on_heartbeat(self, frame: Frame, now_ns: int) -> None:  # noqa: ARG002
        beat = self._by_id[frame.can_id].accept(frame)
        if beat is not None:
            versions = (beat.catalogue_version, beat.configuration_version)
            self._matching[frame.can_id] = versions == self._versions
            self.versions_match = all(self._matching.values())

    def _on_own_identifier(self, frame: Frame, now_ns: int) -> None:  # noqa: ARG002
        self.address_conflict = True
