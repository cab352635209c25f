"""Hardware in the place of emulated nodes: another maker's nodes on a lockstep bus."""

from collections.abc import Iterable
from functools import partial
from itertools import chain, combinations
from pathlib import Path

import numpy as np
import pytest
from foreign_nodes import (
    DATABASE,
    ForeignDrive,
    ForeignNode,
    ForeignPanel,
    ForeignSensors,
)

from firmware_sim.scenario import Scenario
from firmware_sim.ship_side import EXTERNAL_DRIVE, STALE_NS, build_ship_side, external_drive
from firmware_sim.truth import TRUTH, MemoryLog, TruthRecorder
from utank_hil.assembly import build_controller_node
from utank_hil.base.tick import TICK_NS
from utank_hil.canbus import Fault, Frame, Mode, load_catalogue
from utank_hil.canbus.frame import STANDARD
from utank_hil.configuration import load_config
from utank_hil.configuration.devices import DevicesSection
from utank_hil.nodes.panel import Action, TimedAction
from utank_hil.runners import Lockstep

STORM = load_config(Path("configs/scenarios/storm.yaml"), Scenario)
RESOLUTION_PA = 8.0
SENT = {
    "sensors": {"SENSOR_MOTION", "SENSOR_TANK", "SENSOR_PUMP", "HEARTBEAT_SENSORS"},
    "drive": {"DRIVE_STATUS_1", "DRIVE_STATUS_2", "HEARTBEAT_DRIVE"},
    "panel": {"OPERATOR_CMD", "HEARTBEAT_OPERATOR"},
}
SOME = list(chain.from_iterable(combinations(SENT, n) for n in (1, 2, 3)))


class Bench:
    """A controller, the emulated ship without some nodes, and another maker's in their place."""

    def __init__(self, without: tuple[str, ...]) -> None:
        self.ship = build_ship_side(STORM, 1, (TimedAction(1.0, Action.ARM),))
        self.kept = self.ship.without(without)
        self.controller = build_controller_node(STORM.controllers["gpc"], commissioned=True)
        # the panel's node is OPERATOR in the DBC
        foreign = {
            "sensors": ForeignSensors("sensors"),
            "drive": ForeignDrive("drive"),
            "panel": ForeignPanel("operator"),
        }
        self.foreign: dict[str, ForeignNode] = {name: foreign[name] for name in without}
        for node in self.foreign.values():
            node.versions = (load_catalogue().version, STORM.vessel.version)
        self.table = MemoryLog(len(TRUTH), 10_000)
        truth = TruthRecorder(self.ship.plant, self.table, TICK_NS)
        nodes = [*self.kept, *self.foreign.values(), self.controller, truth]
        self.sent: set[tuple[str, str]] = set()
        self.lockstep = Lockstep(nodes, trace=self.trace)

    def trace(self, now_ns: int, sender: str, frame: Frame) -> None:
        self.sent.add((sender, DATABASE.get_message_by_frame_id(frame.can_id).name))

    def run(self, seconds: float) -> None:
        self.lockstep.run_until(self.lockstep.now_ns + round(seconds * 1e9))

    def truth(self, name: str) -> np.ndarray:
        return self.table.rows[:, TRUTH.index(name)]


@pytest.fixture(scope="module")
def replaced_drive() -> Bench:
    bench = Bench(("drive",))
    bench.run(40.0)
    return bench


@pytest.mark.slow
@pytest.mark.parametrize("without", SOME, ids="-".join)
def test_controller_is_active_with_the_nodes_of_another_maker(without: tuple[str, ...]) -> None:
    bench = Bench(without)
    bench.run(8.0)
    assert (bench.controller.mode, bench.controller.fault) == (Mode.ACTIVE, Fault.NONE)
    for name, messages in SENT.items():
        sender = bench.foreign[name].name if name in without else name
        for message in messages:
            assert {who for who, what in bench.sent if what == message} == {sender}
    # whoever sends, the emulated ship moves in its waves, and the truth of it is kept
    assert len(bench.table.rows) == 800
    assert np.abs(bench.truth("true_roll_rad")).max() > 0.01


def test_emulated_pump_gives_the_pressure_that_the_real_drive_reports(
    replaced_drive: Bench,
) -> None:
    drive = replaced_drive.foreign["drive"]
    assert isinstance(drive, ForeignDrive)
    truth = dict(zip(np.round(replaced_drive.truth("time_s"), 3).tolist(),
                     replaced_drive.truth("true_pressure_pa").tolist(), strict=True))  # fmt: skip
    largest = 0.0
    for reported_ns, pressure_pa in drive.reported[:-2]:
        # heard in the next tick, it acts from there until the next report is heard
        for late_ns in (2 * TICK_NS, 3 * TICK_NS):
            found = truth[round((reported_ns + late_ns) * 1e-9, 3)]
            assert found == pytest.approx(pressure_pa, abs=RESOLUTION_PA)
        largest = max(largest, abs(pressure_pa))
    assert largest > 10e3


@pytest.mark.evidence
def test_emulated_ship_rolls_less_with_the_real_drive_than_without_pressure(
    replaced_drive: Bench,
) -> None:
    passive = Bench(("drive",))
    drive = passive.foreign["drive"]
    assert isinstance(drive, ForeignDrive)
    drive.share = 0.0
    passive.run(40.0)
    roll, free = (
        np.std(bench.truth("true_roll_rad")[1500:]) for bench in (replaced_drive, passive)
    )
    print(f"roll {roll:.4f} rad with the drive, {free:.4f} rad at zero pressure")
    assert roll < 0.9 * free


@pytest.mark.parametrize("why", ["silent", "unavailable"])
def test_a_drive_that_reports_nothing_lets_the_emulated_rotor_turn_freely(why: str) -> None:
    bench = Bench(("drive",))
    drive = bench.foreign["drive"]
    assert isinstance(drive, ForeignDrive)
    bench.run(8.0)
    for _ in range(400):
        bench.run(0.05)
        if abs(drive.pressure_pa) > 20e3:
            break
    assert abs(drive.pressure_pa) > 20e3
    (external,) = (node for node in bench.kept if node.name == EXTERNAL_DRIVE)
    assert external.reported_share > 0.99
    before = len(bench.table.rows)
    setattr(drive, why, True)
    bench.run(1.0)
    pressure = np.abs(bench.truth("true_pressure_pa")[before:])
    held = STALE_NS // TICK_NS
    assert (pressure[: held - 2] > 18e3).all()
    # the rotor's inertia lags behind water that was pressed hard
    assert (pressure[held + 2 :] < 15e3).all()
    assert pressure[-1] < 2e3
    assert 0.8 < external.reported_share < 0.95
    if why == "silent":
        assert (bench.controller.mode, bench.controller.fault) == (Mode.FAULT, Fault.DRIVE_SILENT)


def test_damaged_and_foreign_frames_do_not_move_the_pump() -> None:
    ship = build_ship_side(STORM, 1, ())
    external, drive = external_drive(ship.plant), ForeignDrive("drive")
    external.receive(drive.report(5e3, 0), 0)
    frame = drive.report(40e3, 0)
    for bit in range(64):
        data = bytearray(frame.data)
        data[bit // 8] ^= 1 << bit % 8
        external.receive(Frame(frame.can_id, bytes(data)), 0)
        external.receive(Frame(frame.can_id ^ 1 << 8, frame.data), 0)
    for tick in range(3):
        external.tick(tick * TICK_NS)
    assert ship.plant.pressure_pa == pytest.approx(5e3, abs=RESOLUTION_PA)
    external.receive(frame, 2 * TICK_NS)  # and the good one is taken
    for tick in range(2, 4):
        external.tick(tick * TICK_NS)
    assert ship.plant.pressure_pa == pytest.approx(40e3, abs=RESOLUTION_PA)


def test_without_all_nodes_nothing_is_sent_and_the_truth_is_recorded() -> None:
    ship = build_ship_side(STORM, 1, STORM.operator)
    sent: list[Frame] = []
    log = MemoryLog(len(TRUTH), 1000)
    nodes = [*ship.without(tuple(SENT)), TruthRecorder(ship.plant, log, TICK_NS)]
    Lockstep(nodes, trace=lambda now_ns, sender, frame: sent.append(frame)).run_until(500 * TICK_NS)
    assert sent == []
    assert len(log.rows) == 500
    assert np.abs(log.rows[:, TRUTH.index("true_roll_rad")]).max() > 0.005


def test_without_nothing_is_the_whole_ship_and_an_unknown_node_is_refused() -> None:
    ship = build_ship_side(STORM, 1, ())
    assert ship.without(()) == list(ship.nodes)
    assert tuple(node.name for node in ship.nodes) == tuple(SENT)
    with pytest.raises(ValueError, match="no node 'motor' to leave out; there are sensors, drive"):
        ship.without(("sensors", "motor"))


class ForeignValve(ForeignNode):
    """A valve that goes nearly to where it is told, in the time of the ship file."""

    silent = False

    def __init__(self, name: str) -> None:
        super().__init__(name)
        self.reported = 1.0

    def tick(self, now_ns: int) -> Iterable[Frame]:
        frames = self.life(now_ns)
        command = self.heard.get("VALVE_CMD", {"counter": 255, "opening": 1, "control": 0})
        if self.due("VALVE_STATUS", now_ns) and not self.silent:
            following = command["control"] == 1
            target = 0.9 * command["opening"] if following else 1.0
            self.reported += min(max(target - self.reported, -0.04), 0.04)
            frames.append(self.frame(
                "VALVE_STATUS", opening=self.reported, state=int(following), fault=0,
                command_echo=int(command["counter"]), fail_position=0, moving=0, open_limit=0,
                shut_limit=0,
            ))  # fmt: skip
        return frames


def test_a_valve_of_another_maker_throttles_the_emulated_tank() -> None:
    scenario = load_config(Path("configs/scenarios/semi_active.yaml"), Scenario)
    ship = build_ship_side(scenario, 1, (TimedAction(2.0, Action.ARM),))
    losses: list[float] = []
    throttle = ship.plant.set_valve_loss

    def noted(loss: float) -> None:
        losses.append(loss)
        throttle(loss)

    ship.plant.set_valve_loss = noted  # type: ignore[method-assign]
    foreign = ForeignValve("valve")
    foreign.versions = (load_catalogue().version, scenario.vessel.version)
    controller = build_controller_node(scenario.controllers["on_off"], commissioned=True)
    lockstep = Lockstep([*ship.without(("valve",)), foreign, controller])
    loss_at = partial(scenario.vessel.valve.loss, scenario.vessel.tank)
    openings = set()
    for _ in range(1500):
        heard = foreign.reported
        lockstep.run_until(lockstep.now_ns + 2 * TICK_NS)
        if controller.mode is Mode.ACTIVE and foreign.reported == heard:
            openings.add(round(heard, 3))
            assert losses[-1] == pytest.approx(loss_at(heard), rel=1e-3)
    assert openings >= {0.0, 0.9}
    foreign.silent = True
    lockstep.run_until(lockstep.now_ns + 10 * TICK_NS)
    assert losses[-1] == loss_at(1.0)
    assert controller.fault is Fault.VALVE_SILENT


def test_a_real_cia_402_drive_moves_the_emulated_ship_by_its_torque() -> None:
    drive = {"profile": "cia402", "node": 5, "mode": "torque", "pressure_pa_per_unit": 80.0,
             "speed_rad_s_per_unit": 1e-3}  # fmt: skip
    section = DevicesSection.model_validate({"pump": drive})
    scenario = STORM.model_copy(
        update={"vessel": STORM.vessel.model_copy(update={"devices": section})}
    )
    ship = build_ship_side(scenario, 1, ())
    node = ship.without(["drive"])[-1]
    report = (1234).to_bytes(4, "little") + (-50).to_bytes(2, "little", signed=True) + b"\x04"
    node.receive(Frame(0x285 | STANDARD, report), 0)
    list(node.tick(0))
    ship.plant.advance(10 * TICK_NS)
    assert ship.plant.pressure_pa == pytest.approx(-50 * 80.0)
    node.receive(Frame(0x285 | STANDARD, report[:6]), 20 * TICK_NS)  # another length
    list(node.tick(20 * TICK_NS))
    ship.plant.advance(30 * TICK_NS)
    assert abs(ship.plant.pressure_pa) < 1000.0  # nothing drives it
    by_speed = DevicesSection.model_validate({"pump": drive | {"mode": "velocity"}})
    vessel = STORM.vessel.model_copy(update={"devices": by_speed})
    other = build_ship_side(STORM.model_copy(update={"vessel": vessel}), 1, ())
    with pytest.raises(ValueError, match="a torque mode is needed"):
        other.without(["drive"])
