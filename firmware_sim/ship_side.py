"""Ship's side of the bus, built from a scenario.

Where real hardware takes the place of drive or valve, an external node makes the plant follow the
hardware's reports, and sends nothing. A report acts from the tick after its receipt until the next
one, for `STALE_NS` at most. A frame with a wrong CRC or counter, or whose value is not available,
is ignored.
"""

import math
from collections.abc import Callable, Collection, Iterable
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Final

from firmware_sim.canopen_drive import CanopenPumpDrive
from firmware_sim.drive import PumpDrive
from firmware_sim.guard.parameters import guard_parameters
from firmware_sim.guard.reference import GuardNode
from firmware_sim.plant import Plant
from firmware_sim.preview_station import PreviewStation
from firmware_sim.scenario import Scenario
from firmware_sim.sensors import ForeignFrames, SensorNode
from firmware_sim.valve import ForeignValve, ValveNode
from utank_hil.base.tick import TICK_NS
from utank_hil.canbus import (
    Address,
    Catalogue,
    DriveStatus1,
    Frame,
    HardwiredInputs,
    OperatorCommand,
    Quality,
    Switch,
    ValveStatus,
    load_catalogue,
)
from utank_hil.canbus.cmac import cmac, read_key
from utank_hil.canbus.frame import BUS_SHIFT, STANDARD
from utank_hil.canbus.profiles.acting import PROOF
from utank_hil.canbus.profiles.device_plan import DevicePlan
from utank_hil.canbus.profiles.drive_plan import SENT_2, DrivePlan
from utank_hil.canbus.profiles.field import Field
from utank_hil.configuration import ControllerConfig, Vessel
from utank_hil.dynamics.pump import Pump
from utank_hil.dynamics.tank import Tank, negligible
from utank_hil.dynamics.valves import Valve
from utank_hil.nodes.housekeeping import Housekeeping
from utank_hil.nodes.panel import Action, OperatorPanel, TimedAction
from utank_hil.runners import Node

STALE_NS: Final = 60_000_000
"""Three cycles of the reports: the controller's own limit for a silent drive or valve."""
EXTERNAL_DRIVE: Final = "external drive"


class ExternalNode:
    """Node that hands what the hardware reports on to the plant; None without a report.

    `read` gives the value in a frame of the identifier, NaN if there is none.
    """

    period_ns = TICK_NS

    def __init__(
        self,
        name: str,
        plant: Plant,
        can_id: int,
        read: Callable[[Frame], float],
        act: Callable[[float | None], None],
    ) -> None:
        self.name = name
        self._plant, self._can_id, self._read, self._act = plant, can_id, read, act
        self.hears = frozenset([can_id])  # see `Selective`
        self._value = math.nan
        self._reported_ns = -STALE_NS - 1
        self._ticks = self._fresh_ticks = 0

    @property
    def reported_share(self) -> float:
        """Share of the ticks so far with a report no older than `STALE_NS`."""
        return self._fresh_ticks / max(self._ticks, 1)

    def receive(self, frame: Frame, now_ns: int) -> None:
        """Store the report."""
        if frame.can_id == self._can_id and math.isfinite(value := self._read(frame)):
            self._value, self._reported_ns = value, now_ns

    def tick(self, now_ns: int) -> Iterable[Frame]:
        """Advance the plant, and apply the report from now on."""
        self._plant.advance(now_ns)
        fresh = now_ns - self._reported_ns <= STALE_NS
        self._ticks += 1
        self._fresh_ticks += fresh
        self._act(self._value if fresh else None)
        return ()


def _torque_report(plan: DrivePlan, pump: Pump) -> tuple[int, Callable[[Frame], float]]:
    """Return identifier and reader of the torque 6077h of a CiA 402 drive, as pressure.

    ValueError is raised if the drive is led by its speed: the unit of its torque is not known then.
    """
    if not plan.mode.torque:
        raise ValueError("devices.pump: without the emulated drive a torque mode is needed")
    length = sum(bits for _, bits in plan.measured) // 8
    per_unit = 1 / (plan.units_per_si * pump.pitch_m * pump.duct_area_m2)
    field = Field(32, 16, length, signed=True, scale=per_unit)
    can_id = plan.bus << BUS_SHIFT | STANDARD | SENT_2 + plan.node
    return can_id, lambda frame: field.value(frame.data) if len(frame.data) == length else math.nan


def external_drive(plant: Plant, vessel: Vessel | None = None) -> ExternalNode:
    """Node that imposes DRIVE_STATUS_1's pressure or a drive's torque; free without a report."""

    def act(pressure_pa: float | None) -> None:
        if pressure_pa is None:
            plant.drive_pump(0.0, enabled=False)
        else:
            plant.impose_pressure(pressure_pa)

    if vessel is not None and vessel.foreign.pump is not None and vessel.pump is not None:
        can_id, read = _torque_report(vessel.foreign.pump, vessel.pump)
        return ExternalNode(EXTERNAL_DRIVE, plant, can_id, read, act)
    receiver = load_catalogue().receiver(DriveStatus1)
    accept = receiver.accept
    return ExternalNode(
        EXTERNAL_DRIVE, plant, receiver.can_id,
        lambda frame: getattr(accept(frame), "pressure_pa", math.nan), act,
    )  # fmt: skip


def external_valve(plant: Plant, tank: Tank, valve: Valve) -> ExternalNode:
    """Node that sets the loss of VALVE_STATUS's opening; without a report the fail position's."""

    def act(opening: float | None) -> None:
        plant.set_valve_loss(valve.loss(tank, valve.fail_opening if opening is None else opening))

    receiver = load_catalogue().receiver(ValveStatus)
    accept = receiver.accept
    return ExternalNode(
        "external valve", plant, receiver.can_id,
        lambda frame: getattr(accept(frame), "opening", math.nan), act,
    )  # fmt: skip


class HardwiredNode:
    """Node that sends the state of the wires.

    A reservoir's switch closes at `high_level_m` above still water. The stop cuts the drive.
    """

    name = "hardwired"
    period_ns = TICK_NS
    hears: frozenset[int] = frozenset()

    def __init__(
        self, plant: Plant, high_level_m: float, catalogue: Catalogue, *, configuration_version: int
    ) -> None:
        self._plant = plant
        self._high_level_m = high_level_m
        self._transmitter = catalogue.transmitter(HardwiredInputs)
        self._cycle_ticks = self._transmitter.cycle_ns // self.period_ns
        self._housekeeping = Housekeeping(Address.HARDWIRED, catalogue, configuration_version)
        self._ticks = 0
        self._was_open = False
        self.stop_pressed = False  #: Whether the hard-wired stop is pressed, which opens its loop.

    def receive(self, frame: Frame, now_ns: int) -> None:
        """Ignore the frame."""

    def tick(self, now_ns: int) -> Iterable[Frame]:
        """Read the inputs, and send them when due."""
        self._plant.advance(now_ns)
        self._plant.cut_power(self.name, cut=self.stop_pressed)
        frames: list[Frame] = []
        is_open = self.stop_pressed
        if self._ticks % self._cycle_ticks == 0 or is_open is not self._was_open:
            self._was_open = is_open
            level_m, limit_m = self._plant.level_m, self._high_level_m
            inputs = HardwiredInputs(
                _switch(-level_m > limit_m),
                _switch(level_m > limit_m),
                _switch(is_open),
                Quality.GOOD,
            )
            frames.append(self._transmitter.frame(inputs))
        frames.extend(self._housekeeping.frames(now_ns))
        self._ticks += 1
        return frames


class ForeignPanel(OperatorPanel):
    """Operator station of another maker: the same buttons, in the frames of its plan."""

    def __init__(
        self,
        plan: DevicePlan[OperatorCommand],
        catalogue: Catalogue,
        script: Iterable[TimedAction] = (),
    ) -> None:
        super().__init__(catalogue, configuration_version=0, script=script, period_ns=TICK_NS)
        self._frames = ForeignFrames(plan, self._sender, catalogue.codec(OperatorCommand))
        self.hears |= self._frames.hears
        #: What it sends, by the identifier of the message that it stands for.
        self.devices = {self._sender.can_id: self._frames}
        self.canopen = () if self._frames.server is None else (self._frames.server,)
        self._proves = plan.authentication
        self._challenge = b""
        if self._proves is not None:
            self._key = read_key(Path(self._proves.key))
            self.hears |= {self._proves.challenge_id}

    def receive(self, frame: Frame, now_ns: int) -> None:
        """Take the controller's status, and what is asked of a CANopen node."""
        super().receive(frame, now_ns)
        if self._proves is not None and frame.can_id == self._proves.challenge_id:
            self._challenge = frame.data
        self._frames.receive(frame, now_ns)

    def tick(self, now_ns: int) -> Iterable[Frame]:
        """Send what is pressed, and that it lives."""
        super().tick(now_ns)
        frames = self._frames.tick(now_ns)
        if self._sent is not None and self._spoke and self._frames.measures:
            orders = self._frames.frames(self._sent, now_ns, self._ticks)
            frames += orders
            if self._proves is not None and self._sent.arm and self._challenge and orders:
                proof = cmac(self._key, self._challenge + orders[0].data)[:PROOF]
                frames.append(Frame(self._proves.proof_ids[-1], proof))
        return frames


def _switch(on: bool) -> Switch:
    return Switch.ON if on else Switch.OFF


NODE_NAMES: Final = ("sensors", "sensors_2", "hardwired", "preview", "drive", "valve", "panel")
"""Names of the emulated nodes, in the order of their ticks; hardware may replace each.

Only a ship with a pump has a drive, and only one with a valve has that node; the second motion
sensor and the hard-wired inputs exist if the vessel's section `redundancy` lists them, the preview
station if there is a section `preview`."""


# at zero pressure an enabled pump does not affect the tank; switched off, its rotor turns with the
# water and changes the tank
def passive_script(vessel: Vessel) -> tuple[TimedAction, ...]:
    """Operator of the run without a law; a panel without `passive` arms a law of zero pressure."""
    panel = vessel.devices and vessel.devices.panel
    told = not panel or panel.native or "passive" in panel.signals
    return (TimedAction(1.0, Action.PASSIVE if told else Action.ARM),)


@dataclass(frozen=True, slots=True)
class ShipSide:
    """All nodes on the bus except the controller."""

    vessel: Vessel
    plant: Plant
    sensors: SensorNode
    drive: PumpDrive | CanopenPumpDrive | None
    panel: OperatorPanel
    valve: ValveNode | None = None
    second_motion: SensorNode | None = None
    hardwired: HardwiredNode | None = None
    guard: GuardNode | None = None
    preview: PreviewStation | None = None

    @property
    def nodes(self) -> tuple[Node, ...]:
        """Nodes in the order of their ticks."""
        optional: tuple[Node | None, ...] = (
            self.second_motion, self.hardwired, self.guard, self.preview, self.drive, self.valve,
        )  # fmt: skip
        return self.sensors, *(node for node in optional if node is not None), self.panel

    @property
    def refused_commands(self) -> int:
        """Number of commands that drive and valve rejected or found outside their limits."""
        return sum(node.refused for node in (self.drive, self.valve) if node is not None)

    def without(self, names: Collection[str]) -> list[Node]:
        """Return the nodes that remain when hardware replaces some of `NODE_NAMES`.

        Without the emulated drive an `external_drive` moves the plant's pump, without the emulated
        valve an `external_valve` its valve. Raises `ValueError` if the ship does not have a node of
        this name.
        """
        known = [node.name for node in self.nodes]
        for name in names:
            if name not in known:
                raise ValueError(f"no node {name!r} to leave out; there are {', '.join(known)}")
        nodes: list[Node] = [node for node in self.nodes if node.name not in names]
        if "drive" in names:
            nodes.append(external_drive(self.plant, self.vessel))
        if "valve" in names and self.vessel.foreign.valve is not None:
            raise ValueError("devices.valve can't be left out: its position does not move the ship")
        if "valve" in names and self.vessel.valve is not None:
            nodes.append(external_valve(self.plant, self.vessel.tank, self.vessel.valve))
        return nodes


def bare_plant(scenario: Scenario, seed: int) -> Plant:
    """Ship of the scenario without its tank, in the waves of a seed."""
    return _plant(scenario, seed, negligible(scenario.vessel.tank), None)


def plant_of(scenario: Scenario, seed: int) -> Plant:
    """Ship of the scenario with tank and pump, in the waves of a seed."""
    vessel = scenario.vessel
    if scenario.fmu is not None:
        from firmware_sim.fmu_plant import FmuPlant  # Few scenarios need this import.

        ship = scenario.ship_at(0.0)
        return FmuPlant(scenario.fmu, ship, vessel.tank, vessel.pump, scenario.waves(seed))
    return _plant(scenario, seed, vessel.tank, vessel.pump)


def _plant(scenario: Scenario, seed: int, tank: Tank, pump: Pump | None) -> Plant:
    return Plant(
        scenario.ship_at,
        tank,
        pump,
        scenario.waves(seed),
        linear=scenario.plant == "linear",
        hull=scenario.lateral_hull,
        six=scenario.six,
        turning=scenario.turning,
    )


def load_compiled_code(scenario: Scenario, seed: int) -> None:
    """Sail two ticks with a ship of its own, so that no tick of a run waits for a compiler."""
    plant = build_ship_side(scenario, seed, ()).plant
    for now_ns in (0, TICK_NS):
        plant.advance(now_ns)


def build_ship_side(
    scenario: Scenario,
    seed: int,
    script: tuple[TimedAction, ...],
    controller: ControllerConfig | None = None,
) -> ShipSide:
    """Build ship and nodes; the guard has the limits of `controller`, by default the first."""
    vessel, catalogue = scenario.vessel, load_catalogue()
    plant = plant_of(scenario, seed)
    version = vessel.version
    foreign = vessel.foreign
    drive: PumpDrive | CanopenPumpDrive | None = None
    valve: ValveNode | None = None
    if vessel.pump is not None and foreign.pump is not None:
        drive = CanopenPumpDrive(plant, vessel.pump, foreign.pump)
    elif vessel.pump is not None:
        drive = PumpDrive(plant, scenario.drive, catalogue, configuration_version=version)
    if vessel.valve is not None and foreign.valve is not None:
        valve = ForeignValve(plant, vessel.tank, vessel.valve, foreign.valve, catalogue)
    elif vessel.valve is not None:
        valve = ValveNode(
            plant, vessel.tank, vessel.valve, catalogue, configuration_version=version
        )
    sensors = partial(
        SensorNode,
        plant,
        scenario.sensors,
        catalogue,
        configuration_version=version,
        foreign=foreign,
    )
    second_motion = hardwired = None
    if vessel.redundancy.second_motion_sensor:
        second_motion = sensors(seed=seed + 2, second=True)
    if vessel.redundancy.hardwired_inputs:
        hardwired = HardwiredNode(
            plant, scenario.sensors.high_level_m, catalogue, configuration_version=version
        )
    panel = OperatorPanel(catalogue, configuration_version=version, script=script)
    if foreign.panel is not None:
        panel = ForeignPanel(foreign.panel, catalogue, script)
    guard = None
    if scenario.guard:
        controller = controller or next(iter(scenario.controllers.values()))
        guard = GuardNode(guard_parameters(controller), plant)
    return ShipSide(
        vessel,
        plant,
        sensors(seed=seed + 1),
        drive,
        panel,
        valve,
        second_motion,
        hardwired,
        guard,
        None if vessel.preview is None else PreviewStation(scenario, seed, catalogue),
    )
