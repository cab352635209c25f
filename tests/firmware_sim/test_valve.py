"""The emulated valve: what it obeys, what it judges on its own, and how it moves."""

import math
from dataclasses import replace
from pathlib import Path

import pytest

from firmware_sim.valve import MISCODED_COMMANDS_TO_TRIP, ValveNode
from utank_hil.base.tick import TICK_NS
from utank_hil.canbus import (
    Address,
    FailPosition,
    Frame,
    Heartbeat,
    NodeState,
    ValveCommand,
    ValveControl,
    ValveFault,
    ValveState,
    ValveStatus,
    load_catalogue,
)
from utank_hil.configuration import Vessel, load_config
from utank_hil.dynamics.tank import Tank
from utank_hil.dynamics.valves import Valve

VESSEL = load_config(Path("configs/ships/thesis_first_valve.yaml"), Vessel)
CATALOGUE = load_catalogue()
VALVE = Valve("duct", opening_time_s=0.5, leakage=0.1)
FAIL, FOLLOW, RESET = ValveControl.FAIL_POSITION, ValveControl.FOLLOW, ValveControl.RESET


class PlantOfLosses:
    """A plant that keeps the loss it is given."""

    loss = math.nan

    def advance(self, now_ns: int) -> None:
        """Let time pass."""

    def set_valve_loss(self, loss_pa_per_m2_s2: float) -> None:
        self.loss = loss_pa_per_m2_s2


class ValveBench:
    """Time, commander and listener around one valve."""

    def __init__(self, valve: Valve = VALVE) -> None:
        self.plant = PlantOfLosses()
        self.tank: Tank = VESSEL.tank
        self.node = ValveNode(
            self.plant,  # type: ignore[arg-type]  # what it needs of a plant
            self.tank, valve, CATALOGUE, configuration_version=7,
        )  # fmt: skip
        self.now_ns = 0
        self.commands = CATALOGUE.transmitter(ValveCommand)
        self._status = CATALOGUE.receiver(ValveStatus)
        self.status: ValveStatus | None = None
        self.frames: list[Frame] = []

    @property
    def told(self) -> ValveStatus:
        assert self.status is not None
        return self.status

    def command(
        self,
        opening: float = 1.0,
        control: ValveControl | None = FOLLOW,
        timeout_s: float = 0.05,
    ) -> None:
        frame = self.commands.frame(ValveCommand(opening, control, timeout_s))
        self.node.receive(frame, self.now_ns)

    def ticks(self, count: int) -> None:
        for _ in range(count):
            self.frames = list(self.node.tick(self.now_ns))
            for frame in self.frames:
                if frame.can_id == self._status.can_id:
                    self.status = self._status.accept(frame) or self.status
            self.now_ns += TICK_NS

    def hold(self, opening: float, seconds: float, control: ValveControl = FOLLOW) -> None:
        """Command an opening every 20 ms for so long."""
        for _ in range(round(seconds * 50)):
            self.command(opening, control)
            self.ticks(2)


def following(valve: Valve = VALVE) -> ValveBench:
    bench = ValveBench(valve)
    bench.hold(1.0, 0.1, FAIL)
    bench.hold(1.0, 0.1)
    assert bench.told.state is ValveState.FOLLOWING
    return bench


def test_it_moves_with_its_opening_time_and_the_plant_gets_its_loss() -> None:
    bench = following()
    bench.hold(0.0, 0.26)
    assert bench.node.opening == pytest.approx(0.5, abs=0.05)
    assert bench.told.moving
    assert bench.plant.loss == VALVE.loss(bench.tank, bench.node.opening)
    bench.hold(0.0, 0.3)
    assert bench.node.opening == 0
    assert bench.told.shut_limit
    assert not bench.told.moving
    assert bench.plant.loss == VALVE.loss(bench.tank, 0.0)
    bench.hold(0.7, 0.5)
    assert bench.told.opening == pytest.approx(0.7, abs=1e-4)
    assert not bench.told.open_limit
    assert not bench.told.shut_limit


def test_without_commands_it_goes_to_its_fail_position_and_stays_until_reset() -> None:
    bench = following()
    bench.hold(0.0, 0.6)
    bench.ticks(4)  # 40 ms after the last command
    assert bench.told.state is ValveState.FOLLOWING
    bench.ticks(54)
    assert bench.told.fault is ValveFault.COMMAND_TIMEOUT
    assert bench.node.opening == 1.0
    bench.hold(0.0, 0.6)
    assert bench.told.state is ValveState.FAULT
    assert bench.node.opening == 1.0
    bench.hold(1.0, 0.1, RESET)
    assert bench.told.state is ValveState.FAIL_POSITION
    bench.hold(0.0, 0.1)  # nor does a reset make it follow
    assert bench.told.state is ValveState.FAIL_POSITION
    bench.hold(1.0, 0.1, FAIL)
    bench.hold(0.0, 0.6)
    assert bench.node.opening == 0.0


def test_a_reset_that_is_held_clears_one_fault_only() -> None:
    bench = following()
    bench.ticks(20)
    bench.hold(1.0, 0.1, RESET)
    assert bench.told.fault is ValveFault.NONE
    bench.node.stuck = True
    bench.node.opening = 0.0
    bench.hold(1.0, 0.5, RESET)
    assert bench.told.fault is ValveFault.STUCK


@pytest.mark.parametrize("position", ["open", "shut"])
def test_told_its_fail_position_it_goes_there_at_once_whatever_else_the_command_says(
    position: str,
) -> None:
    bench = following(replace(VALVE, fail_position=position))
    bench.hold(0.5, 0.5)
    bench.command(math.nan, FAIL, math.nan)
    bench.ticks(60)
    assert bench.node.opening == (1.0 if position == "open" else 0.0)
    assert bench.told.state is ValveState.FAIL_POSITION
    assert bench.told.fail_position is FailPosition[position.upper()]


def test_its_fail_position_is_obeyed_out_of_sequence_and_nothing_else_is() -> None:
    bench = following()
    bench.hold(0.0, 0.6)
    for _ in range(6):  # lost on the way
        bench.commands.frame(ValveCommand(0.0, FOLLOW, 0.05))
    bench.command(0.8)
    bench.ticks(2)
    assert bench.told.state is ValveState.FOLLOWING
    assert bench.node.opening == 0.0
    bench.command(0.0, FAIL)
    bench.ticks(2)
    assert bench.told.state is ValveState.FAIL_POSITION


def test_power_that_returns_leaves_it_at_its_fail_position() -> None:
    bench = following()
    bench.hold(0.0, 0.6)
    bench.node.powered = False
    for _ in range(30):
        bench.command(0.0)
        bench.ticks(2)
        assert bench.frames == []
    assert bench.node.opening == 1.0
    bench.node.powered = True
    bench.hold(0.0, 0.6)
    assert bench.told.state is ValveState.FAIL_POSITION
    assert bench.node.opening == 1.0
    bench.hold(1.0, 0.1, FAIL)
    bench.hold(0.0, 0.6)
    assert bench.node.opening == 0.0


def test_stuck_it_says_so_within_a_third_of_a_second() -> None:
    bench = following()
    bench.node.stuck = True
    bench.hold(0.0, 0.3)
    assert bench.told.fault is ValveFault.STUCK
    assert bench.node.opening == 1.0


@pytest.mark.parametrize(
    "wrong",
    [
        {"opening": math.nan},
        {"control": None},
        {"timeout_s": 0.2},
        {"timeout_s": 0.0},
        {"timeout_s": math.nan},
    ],
    ids=str,
)
def test_commands_that_can_not_be_followed_change_nothing_and_trip_it_in_the_end(
    wrong: dict[str, object],
) -> None:
    bench = following()
    bench.hold(0.3, 0.5)
    echo = bench.told.command_echo
    for number in range(1, MISCODED_COMMANDS_TO_TRIP + 1):
        bench.command(**{"opening": 0.9, **wrong})  # type: ignore[arg-type]
        assert bench.node.refused == number
    bench.ticks(2)
    assert bench.told.command_echo == echo
    assert bench.told.fault is ValveFault.COMMAND_REFUSED


def test_a_damaged_or_foreign_frame_is_no_command() -> None:
    bench = following()
    frame = bench.commands.frame(ValveCommand(0.0, FOLLOW, 0.05))
    bench.node.receive(Frame(frame.can_id, bytes([frame.data[0] ^ 1]) + frame.data[1:]), 0)
    bench.node.receive(Frame(frame.can_id ^ 0x100, frame.data), 0)
    bench.ticks(2)
    assert bench.node.opening == 1.0
    assert bench.node.refused == 0


def test_it_beats_and_reports_in_the_cycles_of_the_catalogue() -> None:
    bench = ValveBench()
    beats = CATALOGUE.receiver(Heartbeat, Address.VALVE)
    status_id = CATALOGUE.codec(ValveStatus).can_id
    found: list[Heartbeat] = []
    statuses = 0
    for _ in range(100):
        bench.ticks(1)
        statuses += sum(frame.can_id == status_id for frame in bench.frames)
        heard = [beats.accept(frame) for frame in bench.frames if frame.can_id == beats.can_id]
        found += [beat for beat in heard if beat is not None]
    assert (len(found), statuses) == (10, 50)
    assert found[0].state is NodeState.OPERATIONAL
    assert (found[0].catalogue_version, found[0].configuration_version) == (CATALOGUE.version, 7)
