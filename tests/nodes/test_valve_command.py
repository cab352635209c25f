"""The controller's side of the valve: what it tells it when, and what it finds wrong with it."""

import math
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from controller_bench import CATALOGUE, ControllerBench, ToyLaw, new_monitors
from hypothesis import given
from hypothesis import strategies as st
from values import changed

from utank_hil.base.arrays import FloatArray
from utank_hil.base.tick import TICK_S
from utank_hil.canbus import (
    Address,
    FailPosition,
    Fault,
    Frame,
    Heartbeat,
    Mode,
    Quality,
    SensorMotion,
    SensorPump,
    SensorTank,
    ValveCommand,
    ValveControl,
    ValveFault,
    ValveState,
    ValveStatus,
)
from utank_hil.configuration import Vessel, load_config
from utank_hil.configuration.devices import DevicesSection
from utank_hil.control.interface import PRESSURE, VALVE
from utank_hil.dynamics.valves import Valve
from utank_hil.nodes.actuators import ValveCommander

VESSEL = load_config(Path("configs/ships/thesis_first_valve.yaml"), Vessel)
TANK = VESSEL.tank
DUCT = Valve("duct", opening_time_s=0.5, leakage=0.1)
SHUT = DUCT.loss(TANK, 0.0)


@dataclass
class ToyValveLaw(ToyLaw):
    """Asks for a loss, and for a pressure."""

    loss: float = 0.0

    def step(self, y, reference=None):
        return np.array([self.loss, *super().step(y, reference)])


class ValveBench(ControllerBench):
    """A controller with a valve that does as it is told, unless a test says otherwise."""

    def __init__(self, valve=DUCT):
        self.valve = valve
        self.opening = valve.fail_opening
        self.state: ValveState | None = ValveState.FAIL_POSITION
        self.fault: ValveFault | None = ValveFault.NONE
        self.moves = self.reports = self.echoes = self.beats = self.hears = True
        self.told: list[ValveCommand] = []
        super().__init__(
            law=ToyValveLaw(),
            commands=(VALVE, PRESSURE),
            valve=ValveCommander(valve, TANK, CATALOGUE, 0.05),
        )
        self._valve_commands = CATALOGUE.receiver(ValveCommand)
        self._valve_status = CATALOGUE.transmitter(ValveStatus)
        self._valve_beat = CATALOGUE.transmitter(Heartbeat, Address.VALVE)
        self._echo: int | None = None

    @property
    def control(self):
        return self.told[-1].control

    def tick(self, late_ticks=0):
        if self.beats and self._tick_index % 10 == 0:
            self.send(self._valve_beat.frame(Heartbeat(None, None, 0.0, *self.versions, 0.0, 0.0)))
        if self.told and self.moves:
            following = self.control is ValveControl.FOLLOW
            target = self.told[-1].opening if following else self.valve.fail_opening
            step = (1 + late_ticks) * TICK_S / self.valve.opening_time_s
            self.opening += min(max(target - self.opening, -step), step)
        if self.reports and self._tick_index % 2 == 0:
            self._report()
        super().tick(late_ticks)

    def _report(self):
        status = ValveStatus(
            self.opening, self.state, self.fault, self._echo, FailPosition.OPEN, *(False,) * 3
        )
        self.send(self._valve_status.frame(status))

    def hear(self, frames):
        super().hear(frames)
        for frame in frames:
            if frame.can_id == self._valve_commands.can_id:
                command = self._valve_commands.accept(frame)
                assert command is not None
                self.told.append(command)
                if self.echoes:
                    self._echo = self._valve_commands.counter
                if self.fault is ValveFault.NONE and self.hears:
                    following = command.control is ValveControl.FOLLOW
                    self.state = ValveState.FOLLOWING if following else ValveState.FAIL_POSITION


def throttling(valve=DUCT):
    """A bench whose armed controller holds the valve shut."""
    bench = ValveBench(valve)
    bench.arm()
    bench.law.loss = SHUT
    bench.run(1000)
    return bench


def test_the_valve_is_told_to_follow_only_while_the_law_is_in_charge():
    bench = ValveBench()
    bench.law.loss = SHUT
    bench.run(500)
    assert {(told.opening, told.control) for told in bench.told} == {
        (1.0, ValveControl.FAIL_POSITION)
    }
    assert len(bench.told) == len(bench.commands) == 25  # every 20 ms
    bench.arm()
    bench.run(300)
    assert bench.control is ValveControl.FOLLOW
    assert bench.told[-1].opening == pytest.approx(0.0, abs=1e-4)
    assert bench.told[-1].timeout_s == 0.05
    bench.order_is(mode_request=Mode.PASSIVE, arm=False)
    bench.run(40)
    assert bench.node.mode is Mode.PASSIVE
    assert bench.told[-1][:2] == (1.0, ValveControl.FAIL_POSITION)


@pytest.mark.parametrize(("opening", "position"), [(0.3, "open"), (1.0, "shut")])
def test_an_opening_has_the_loss_that_the_law_asked_for(opening, position):
    valve = Valve("duct", 0.5, 0.1, fail_position=position)
    bench = throttling(valve)
    bench.law.loss = valve.loss(TANK, opening)
    bench.run(400)
    assert bench.told[-1].opening == pytest.approx(opening, abs=1e-4)


def test_the_law_is_told_the_loss_of_the_valve_as_it_stands_and_the_mean_pressure():
    bench = throttling()
    told: list[FloatArray] = []
    bench.law.applied = told.append
    bench.run(400)
    assert told[-1] == pytest.approx([SHUT, 0.0])
    bench.law.answer_pa = 4e3
    bench.moves, bench.opening = False, 0.1
    bench.run(800)
    assert told[-1] == pytest.approx([DUCT.loss(TANK, 0.1), 4e3], rel=1e-3)


@pytest.mark.parametrize(
    ("fault", "within_ms", "changes"),
    [
        (Fault.VALVE_SILENT, 90, {"reports": False}),
        (Fault.VALVE_SILENT, 90, {"opening": math.nan, "moves": False}),
        (Fault.VALVE_SILENT, 140, {"echoes": False}),
        (Fault.VALVE_FAULT, 40, {"state": ValveState.FAULT, "fault": ValveFault.STUCK}),
        (Fault.VALVE_FAULT, 40, {"state": ValveState.FAIL_POSITION, "fault": ValveFault.SUPPLY}),
        (Fault.VALVE_FAULT, 140, {"state": ValveState.FAIL_POSITION, "hears": False}),
        (Fault.VALVE_FAULT, 40, {"fault": ValveFault.POSITION_SENSOR}),
        (Fault.VALVE_FAULT, 40, {"fault": None}),
        (Fault.VALVE_NOT_FOLLOWING, 340, {"opening": 0.5, "moves": False}),
    ],
)
def test_a_valve_that_fails_ends_at_its_fail_position_and_at_zero_pressure(
    fault, within_ms, changes
):
    bench = throttling()
    bench.law.answer_pa = 4e3
    bench.run(400)
    for name, value in changes.items():
        setattr(bench, name, value)
    bench.run(within_ms)
    assert (bench.node.mode, bench.node.fault) == (Mode.FAULT, fault)
    bench.run(20)
    assert bench.control is ValveControl.FAIL_POSITION
    assert bench.pressure_pa == 0


def test_a_valve_that_has_not_been_heard_is_silent_and_not_at_fault():
    bench = ValveBench()
    bench.reports = False
    bench.run(500)
    assert not bench.node.measured.valve_fault
    assert bench.node.fault is Fault.VALVE_SILENT


def test_a_valve_that_has_never_sent_a_command_back_is_silent():
    bench = ValveBench()
    bench.echoes = False
    bench.run(500)
    assert (bench.node.mode, bench.node.fault) == (Mode.INIT, Fault.VALVE_SILENT)


def test_a_law_that_asks_for_less_than_no_loss_opens_the_valve():
    bench = throttling()
    bench.law.loss = -1.0
    bench.run(1000)
    assert bench.told[-1][:2] == (1.0, ValveControl.FOLLOW)


@pytest.mark.parametrize("silent", ["motion", "tank"])
def test_what_ramps_the_pump_down_sends_the_valve_to_its_fail_position_at_once(silent):
    bench = throttling()
    bench.law.answer_pa = 20e3
    bench.run(600)
    if silent == "motion":
        bench.motion = bench.motion._replace(roll_rad=math.nan)
    else:
        bench.tank = bench.tank._replace(port_level_m=math.nan)
    while bench.node.mode is Mode.ACTIVE:
        bench.tick()
    bench.run(20)
    assert bench.control is ValveControl.FAIL_POSITION
    assert bench.pressure_pa != 0  # the pump is still on its ramp


def test_without_the_valve_or_with_its_versions_wrong_nothing_is_armed():
    bench = ValveBench()
    bench.reports = False
    bench.run(400)
    assert (bench.node.mode, bench.node.fault) == (Mode.INIT, Fault.VALVE_SILENT)
    bench = ValveBench()
    bench.beats = False
    bench.run(400)
    assert (bench.node.mode, bench.node.fault) == (Mode.INIT, Fault.VERSION_MISMATCH)
    bench.beats = True
    bench.arm()


def test_a_faulty_valve_refuses_arming_and_is_reset_only_on_the_operator_s_order():
    bench = ValveBench()
    bench.state, bench.fault = ValveState.FAULT, ValveFault.COMMAND_TIMEOUT
    bench.run(400)
    bench.order_is(mode_request=Mode.ACTIVE, arm=True)
    bench.run(200)
    assert (bench.node.mode, bench.node.fault) == (Mode.STANDBY, Fault.VALVE_FAULT)
    assert ValveControl.RESET not in {told.control for told in bench.told}
    bench.order_is(mode_request=Mode.STANDBY, arm=False, reset=True)
    bench.run(40)
    assert bench.control is ValveControl.RESET
    bench.run(200)  # of no use; a later order is an edge again
    assert bench.control is ValveControl.FAIL_POSITION
    bench.order_is(reset=False)
    bench.order_is(reset=True)
    bench.run(40)
    assert bench.control is ValveControl.RESET
    bench.fault, bench.state = ValveFault.NONE, ValveState.FAIL_POSITION
    bench.run(60)
    assert bench.control is ValveControl.FAIL_POSITION
    # nothing of that order is left for its next fault
    bench.state, bench.fault = ValveState.FAULT, ValveFault.COMMAND_TIMEOUT
    heard = len(bench.told)
    bench.run(400)
    assert {told.control for told in bench.told[heard:]} == {ValveControl.FAIL_POSITION}


def test_armed_again_while_the_valve_is_still_on_its_way_it_is_not_called_stuck():
    bench = throttling(Valve("duct", opening_time_s=10.0, leakage=0.1))
    bench.run(9000)
    assert bench.opening == pytest.approx(0.0, abs=1e-3)
    bench.order_is(mode_request=Mode.STANDBY, arm=False)
    bench.run(2000)
    bench.law.loss = 0.0
    bench.order_is(mode_request=Mode.ACTIVE, arm=True)
    bench.run(1000)
    assert bench.node.mode is Mode.ACTIVE
    assert bench.opening < 0.5


def test_a_valve_is_not_ahead_of_a_loop_that_loses_two_of_eleven_ticks():
    """Which is a warning, and no more."""
    bench = ValveBench(Valve("duct", opening_time_s=5.0, leakage=0.1))
    bench.arm()
    bench.law.loss = SHUT
    for tick in range(440):
        bench.tick(late_ticks=2 if tick % 9 == 0 else 0)
    assert (bench.node.mode, bench.node.fault) == (Mode.ACTIVE, Fault.NONE)
    assert bench.opening == pytest.approx(0.0, abs=1e-3)


def test_a_valve_that_does_not_return_to_its_fail_position_refuses_arming():
    bench = throttling()
    bench.moves = False
    bench.order_is(mode_request=Mode.STANDBY, arm=False)
    bench.run(1000)
    assert bench.node.mode is Mode.STANDBY
    bench.order_is(mode_request=Mode.ACTIVE, arm=True)
    bench.run(200)
    assert (bench.node.mode, bench.node.fault) == (Mode.STANDBY, Fault.VALVE_NOT_FOLLOWING)
    bench.moves = True
    bench.run(1000)
    bench.order_is(arm=False)
    bench.arm()


EVENTS: dict[str, Callable[[ValveBench], object]] = {
    "arm": lambda bench: bench.order_is(mode_request=Mode.ACTIVE, arm=True, stop=False),
    "disarm": lambda bench: bench.order_is(mode_request=Mode.PASSIVE, arm=False),
    "stop": lambda bench: bench.order_is(mode_request=Mode.STANDBY, arm=False, stop=True),
    "reset": lambda bench: (bench.order_is(reset=False), bench.order_is(reset=True)),
    "valve silent": lambda bench: setattr(bench, "reports", False),
    "valve stuck": lambda bench: setattr(bench, "moves", False),
    "valve fault": lambda bench: (
        setattr(bench, "fault", ValveFault.SUPPLY), setattr(bench, "state", ValveState.FAULT)
    ),
    "valve well": lambda bench: (
        setattr(bench, "reports", True), setattr(bench, "moves", True),
        setattr(bench, "fault", ValveFault.NONE),
        setattr(bench, "state", ValveState.FAIL_POSITION),
    ),
    "no motion": lambda bench: setattr(bench, "motion", SensorMotion(math.nan, 0.0, None)),
    "motion": lambda bench: setattr(bench, "motion", SensorMotion(0.0, 0.0, Quality.GOOD)),
    "no loss": lambda bench: setattr(bench.law, "loss", math.nan),
    "loss": lambda bench: setattr(bench.law, "loss", SHUT),
    "pause": lambda bench: bench.run(300),
}  # fmt: skip


@pytest.mark.slow
@given(st.lists(st.tuples(st.sampled_from(sorted(EVENTS)), st.integers(1, 40)), max_size=25))
def test_whatever_comes_the_valve_is_told_to_follow_only_while_the_controller_is_active(events):
    bench = ValveBench()
    bench.law.loss = SHUT
    bench.arm()
    not_active_ticks = 0
    for event, ticks in events:
        EVENTS[event](bench)
        for _ in range(ticks):
            bench.tick()
            active = bench.node.mode is Mode.ACTIVE
            not_active_ticks = 0 if active else not_active_ticks + 1
            if not_active_ticks >= 2:  # a command leaves every other tick
                assert bench.control is not ValveControl.FOLLOW
                assert bench.told[-1].opening == DUCT.fail_opening
            assert 0 <= bench.told[-1].opening <= 1


def test_a_loss_that_is_no_number_ends_in_an_internal_fault():
    bench = throttling()
    bench.law.loss = math.nan
    bench.run(220)
    assert bench.node.fault is Fault.INTERNAL
    assert bench.node.law.error == "its answer is a valve loss of nan"
    assert bench.control is ValveControl.FAIL_POSITION


def test_the_last_frames_of_the_controller_send_the_valve_to_its_fail_position():
    bench = throttling()
    bench.hear(list(bench.node.stop(bench.now_ns)))
    assert bench.control is ValveControl.FAIL_POSITION
    assert bench.pressure_pa == 0


@pytest.mark.parametrize("rate_m_s", [-0.4, 0.01, 0.4])
def test_the_valve_holds_water_back_by_one_implicit_step_of_its_loss(rate_m_s):
    bench = throttling()
    commander = bench.node.actuators.valve
    assert commander is not None
    measured = bench.node.inbox.snapshot(bench.now_ns)
    # water of inertia m slowed by c |r0| r, from r0 for one gauge cycle, Euler backwards: r1
    inertia = TANK.density_kg_m3 * TANK.effective_length_m
    damping = commander.applied_loss(measured) * abs(rate_m_s)
    cycle_s = CATALOGUE.codec(SensorTank).cycle_ns * 1e-9
    after_m_s = rate_m_s / (1 + damping * cycle_s / inertia)
    taken_pa = (rate_m_s - after_m_s) * inertia / cycle_s
    assert commander.held_pa(measured, rate_m_s) == pytest.approx(taken_pa, rel=1e-9)
    assert abs(taken_pa) > 1.0


def test_the_level_is_observed_with_what_the_valve_holds_back(monkeypatch):
    bench = ValveBench()
    bench.pump = SensorPump(3e3, 0.0, Quality.GOOD)
    driven: list[float] = []
    monkeypatch.setattr(bench.node.actuators.valve, "held_pa", lambda *_: 2e3)
    monkeypatch.setattr(bench.level, "update", lambda level_m, pa, cycles: driven.append(pa))
    bench.run(100)
    assert set(driven) == {1e3}


def test_it_is_said_which_answer_was_no_number_and_of_several_the_first():
    bench = throttling()
    bench.law.answer_pa = math.inf
    bench.run(300)
    assert bench.node.fault is Fault.INTERNAL
    assert bench.node.law.error == "its answer is inf Pa"
    bench.law.answer_pa, bench.law.loss = 0.0, math.nan
    bench.run(300)
    assert bench.node.law.error == "its answer is inf Pa"


def test_the_monitors_are_told_what_the_valve_holds_back(monkeypatch):
    bench = ValveBench()
    monitors = new_monitors(VESSEL)
    held: list[float] = []
    monkeypatch.setattr(monitors, "update", lambda _, own, __: held.append(own.held_pa) or 0)
    bench.node.safety.monitors = monitors
    bench.opening, bench.moves = 0.2, False
    monkeypatch.setattr(bench.node, "_estimate_level", lambda _: None)
    bench.level.rate_m_s = 0.5
    bench.tick()
    commander = ValveCommander(DUCT, TANK, CATALOGUE, 0.05)
    assert held == [commander.held_pa(bench.node.measured, 0.5)]
    assert held[0] > 0.0


def test_a_valve_that_is_silent_is_not_one_that_does_not_follow():
    """Where it is by then nobody knows."""
    bench = ValveBench()
    bench.run(1000)
    valve, measured = bench.node.actuators.valve, bench.node.measured
    valve._told = 0.0  # as if it had been commanded to shut
    for late_ms in range(10, 2000, 10):
        report = valve.observe(
            changed(measured, now_ns=measured.valve_heard_ns + late_ms * 1_000_000)
        )
    assert report.age_ms > 1900
    assert report.off_ms == 0.0


@pytest.mark.parametrize("opening", [0.3, 0.6, 1.0])
def test_a_valve_that_stands_anywhere_when_the_controller_starts_is_no_fault(opening):
    bench = ValveBench()
    bench.now_ns = bench.start_ns = 1000 * 1_000_000_000  # the clock of the machine
    bench.opening = opening
    for _ in range(100):
        bench.tick()
        assert bench.node.safety.situation.own.valve.off_ms == 0.0
    assert bench.node.safety.alarms.codes == set()
    # nor is one that reports later
    bench = ValveBench()
    bench.now_ns = bench.start_ns = 1000 * 1_000_000_000
    bench.opening, bench.reports = opening, False
    bench.run(200)
    bench.opening, bench.reports = opening, True
    for _ in range(100):
        bench.tick()
        assert bench.node.safety.situation.own.valve.off_ms == 0.0
    # one that does not move is found
    bench = ValveBench()
    bench.opening, bench.moves = opening, False
    bench.run(1000)
    off = bench.node.safety.situation.own.valve.off_ms
    assert off == 0.0 if opening == 1.0 else off > 300


def test_with_a_drive_of_another_maker_the_last_frames_stop_both():
    bench = throttling()
    stops = Frame(0, bytes((2, 5)))
    actuators = bench.node.actuators
    actuators.command_pa = 5e3
    actuators.request_reset()  # of a fault that there is not
    actuators.drive = SimpleNamespace(stop=lambda: [stops])
    first, *rest = actuators.stop()
    assert first is stops
    assert len(rest) == 1
    bench.hear(rest)
    assert bench.control is ValveControl.FAIL_POSITION
    assert actuators.command_pa == 0


def test_a_valve_by_cia_401_is_told_open_or_shut_with_the_controllers_heartbeat():
    """It is open without power, and sends no command back: where it stands is what tells."""
    profile = {"profile": "cia401_valve", "node": 9, "age_ms": 700, "accept_unprotected": True}
    inverted = {"opening": {"sign": -1, "offset": -1}}
    plan = DevicesSection(valve=profile | {"commands": inverted}).foreign().valve
    commander = ValveCommander(DUCT, TANK, CATALOGUE, 0.05, plan)
    outputs = []
    for opening in (0.0, 0.3, 0.7, 1.0):
        commander.ask(DUCT.loss(TANK, opening))
        beat, told = commander.frames(0, faulted=False, follow=True)
        assert (beat.can_id & 0x7FF, beat.data) == (0x77F, b"\x05")
        assert told.can_id & 0x7FF == 0x209
        outputs.append(told.data[0])
    assert outputs == [1, 1, 0, 0]
    measured = ValveBench().node.inbox.snapshot(10**9)
    # a valve of one bit is expected where that bit sends it
    commander.ask(DUCT.loss(TANK, 0.3))
    commander.frames(0, faulted=False, follow=True)
    for seconds, opening in ((1, 1.0), (2, 0.0), (9, 0.0)):
        now_ns = seconds * 10**9
        heard = {"valve_heard_ns": now_ns, "valve_opening": opening, "valve_following": True}
        report = commander.observe(changed(measured, now_ns=now_ns, **heard))
    assert report.echo_age_ms < 0
    assert report.off_ms == 0.0


def test_a_valve_is_commanded_at_the_time_of_the_tick(monkeypatch):
    bench, times_ns = ValveBench(), []
    monkeypatch.setattr(
        bench.node.actuators.valve, "frames", lambda now_ns, **_: times_ns.append(now_ns) or []
    )
    bench.run(40)
    bench.node.stop(bench.now_ns)
    assert times_ns == [0, 20_000_000, 20_000_000]
