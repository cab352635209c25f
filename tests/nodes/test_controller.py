import math
from dataclasses import replace
from itertools import pairwise
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from controller_bench import (
    CATALOGUE,
    LIMITS,
    MS,
    VERSION,
    VESSEL,
    ControllerBench,
    PlanningLaw,
    ToyLaw,
    new_monitors,
)
from toy_nodes import FakeClock, ToyPort

from utank_hil.base.tick import TICK_NS
from utank_hil.canbus import (
    Address,
    AddressClaim,
    ControlWord,
    DriveFault,
    DriveState,
    DriveStatus1,
    DriveStatus2,
    Fault,
    Frame,
    Heartbeat,
    Mode,
    NodeState,
    PassiveTwin,
    Quality,
    RetuningState,
    SeaEstimate,
    SensorMotion,
    SensorPump,
    SensorTank,
    ShipEstimate,
    Switch,
)
from utank_hil.canbus.frame import STANDARD
from utank_hil.nodes.signals import SIGNALS
from utank_hil.retuning import EstimateFigures, RetuningEvent
from utank_hil.retuning.law_exchange import LawExchange
from utank_hil.runners import RealTimeLoop
from utank_hil.runners.statistics import LoopStatistics
from utank_hil.safety.monitors.finding import Finding
from utank_hil.safety.situation import Demand

START_NS = 7_000_000_123
LEVEL = 20e3  # a pressure away from every limit


def test_armed_controller_commands_the_laws_pressure_and_enables_the_drive_in_sequence():
    bench = ControllerBench(START_NS)
    bench.arm()
    words = [command.control_word for _, command in bench.commands]
    order = list(dict.fromkeys(words))
    assert order == [
        ControlWord.DISABLE_VOLTAGE,
        ControlWord.SHUTDOWN,
        ControlWord.SWITCH_ON,
        ControlWord.ENABLE_OPERATION,
    ]
    bench.law.answer_pa = LEVEL
    bench.run(600)
    assert bench.pressure_pa == LEVEL
    assert bench.status.armed
    assert bench.status.configuration_version == VERSION


def test_law_is_stepped_every_sample_time_with_the_newest_sample_armed_or_not():
    bench = ControllerBench(START_NS)
    for index in range(200):
        bench.motion = SensorMotion(index * 1e-3, 0.0, Quality.GOOD)
        bench.tank = bench.tank._replace(port_level_m=-index * 1e-3, starboard_level_m=index * 3e-3)
        bench.tick()
    stepped = np.array(bench.law.seen)
    assert stepped.shape == (10, 2)
    # steps at ticks 0, 20, 40, ...; the frames of that very tick are heard before
    np.testing.assert_allclose(stepped[:, 0], np.arange(0, 200, 20) * 1e-3, atol=1e-4)
    np.testing.assert_allclose(stepped[:, 1], np.arange(0, 200, 20) * 2e-3, atol=1e-3)


def test_lost_ticks_make_one_answer_late_and_do_not_stretch_the_sample_time():
    bench = ControllerBench(START_NS)
    rng = np.random.default_rng(5)
    stepped_ns, lost = [], 0
    for _ in range(600):
        lost_now = int(rng.choice([0, 0, 0, 0, 1, 3]))
        lost += lost_now
        answers = len(bench.law.seen)
        bench.tick(late_ticks=lost_now)
        if len(bench.law.seen) > answers:
            stepped_ns.append(bench.now_ns - TICK_NS - bench.node.start_ns)
    assert lost > 200
    # one answer for each of the sample's own points, at the first tick that follows it
    samples = np.array(stepped_ns) // (20 * TICK_NS)
    assert (np.diff(samples) == 1).all()
    assert max(np.array(stepped_ns) % (20 * TICK_NS)) <= 3 * TICK_NS
    commands = np.diff([time_ns for time_ns, _ in bench.commands]) / TICK_NS
    assert np.mean(commands) < 2.5


def test_law_is_told_the_mean_of_what_left_before_each_answer():
    bench = ControllerBench(START_NS)
    bench.arm()
    rng = np.random.default_rng(3)
    for _ in range(400):
        bench.law.answer_pa = float(rng.uniform(-60e3, 60e3))  # beyond the limit too
        bench.tick()
    bench.order_is(mode_request=Mode.PASSIVE, arm=False)
    bench.run(800)
    calls = bench.law.calls
    assert calls == ["step", *["applied", "step"] * (len(calls) // 2)]
    times = np.array([time_ns for time_ns, _ in bench.commands]) - START_NS
    pressures = np.array([command.pressure_pa for _, command in bench.commands])
    for number, told_pa in enumerate(bench.law.told, start=1):
        window = (times >= (number - 1) * 200 * MS) & (times < number * 200 * MS)
        assert window.sum() == 10
        # the limiter moves every tick, a command leaves every other: half a tick's ramp apart
        assert told_pa == pytest.approx(pressures[window].mean(), abs=LIMITS.rate_pa_s * 0.005 + 8)
    assert max(abs(told) for told in bench.law.told) > 20e3


def test_no_frame_is_early_and_cycles_are_those_of_the_catalogue():
    bench = ControllerBench(START_NS)
    bench.run(1000)
    times = [time_ns for time_ns, _ in bench.commands]
    assert {later - earlier for earlier, later in pairwise(times)} == {20 * MS}
    for sender, count in (
        (CATALOGUE.transmitter(Heartbeat, Address.CONTROLLER), 10),
        (CATALOGUE.transmitter(AddressClaim, Address.CONTROLLER), 1),
    ):
        assert [frame.can_id for frame in bench.sent].count(sender.can_id) == count


def test_last_words_are_zero_pressure_and_quick_stop():
    bench = ControllerBench(START_NS)
    bench.drive_at(LEVEL)
    bench.hear(bench.node.stop(bench.now_ns + 3 * MS))
    assert bench.pressure_pa == 0.0
    assert bench.word is ControlWord.QUICK_STOP


def test_operator_may_go_from_active_to_standby_only_down_the_ramp():
    bench = ControllerBench(START_NS)
    bench.drive_at(LIMITS.pressure_pa)
    bench.order_is(mode_request=Mode.STANDBY, arm=False)
    bench.run(1000)
    pressures = [command.pressure_pa for _, command in bench.commands]
    assert max(abs(b - a) for a, b in pairwise(pressures)) <= LIMITS.rate_pa_s * 0.02 + 8
    assert bench.node.mode is Mode.STANDBY
    assert bench.pressure_pa == 0.0
    assert bench.word is ControlWord.DISABLE_VOLTAGE


def test_drive_fault_is_reset_only_on_the_operators_order():
    bench = ControllerBench(START_NS)
    bench.drive_at(LEVEL)
    bench.drive_follows = False
    bench.drive_state, bench.drive_fault = DriveState.FAULT, DriveFault.STALL
    bench.run(1000)
    assert ControlWord.FAULT_RESET not in [command.control_word for _, command in bench.commands]
    bench.order_is(reset=True)
    bench.run(40)
    assert bench.word is ControlWord.FAULT_RESET
    bench.drive_follows, bench.drive_fault = True, DriveFault.NONE
    bench.drive_state = DriveState.SWITCH_ON_DISABLED
    bench.run(500)
    assert bench.node.mode is Mode.STANDBY
    assert bench.word is ControlWord.DISABLE_VOLTAGE


def test_telemetry_tells_what_was_heard_commanded_and_decided():
    statistics = LoopStatistics(overruns=4)
    statistics.lateness.add(2_000_000)
    statistics.duration.add(300_000)
    bench = ControllerBench(START_NS, statistics=statistics)
    bench.drive_at(LEVEL)
    bench.motion = SensorMotion(0.0123, -0.02, Quality.GOOD)
    bench.tank = bench.tank._replace(port_level_m=-0.25, starboard_level_m=0.5)
    bench.pump = SensorPump(16e3, 2.0, Quality.DEGRADED)
    bench.run(20)
    row = dict(zip(SIGNALS, bench.rows[-1], strict=True))
    assert row["time_s"] == pytest.approx((bench.now_ns - TICK_NS - START_NS) * 1e-9)
    assert row["roll_rad"] == pytest.approx(0.0123)
    assert row["roll_rate_rad_s"] == pytest.approx(-0.02)
    assert (row["port_level_m"], row["starboard_level_m"]) == (-0.25, 0.5)
    assert row["pressure_command_pa"] == LEVEL
    assert row["pressure_actual_pa"] == 16e3
    assert row["pump_power_w"] == pytest.approx(12e3)
    assert row["mode"] == Mode.ACTIVE
    assert row["fault"] == Fault.NONE
    assert row["bus_load"] > 0
    assert bench.column("wakeup_lateness_s")[0] == pytest.approx(2e-3)
    assert bench.column("tick_duration_s")[0] == pytest.approx(3e-4)
    assert (row["overruns"], row["retuning"]) == (4, RetuningState.IDLE)
    assert len(bench.rows) == round(bench.ms / 10)
    np.testing.assert_allclose(np.diff(bench.column("time_s")), 0.01, atol=1e-9)


def test_bus_load_is_what_was_heard_and_said_over_the_time_it_took():
    bench = ControllerBench(START_NS)
    bench.run(2000)
    # sent a second: 100 + 50 + 50 + 50 + 10 + 3 x 10 + 5 by the others, 50 + 3 x 10 by the node
    assert bench.column("bus_load")[-1] == pytest.approx(375 * 143 / 250e3, rel=0.02)
    # every other tick is lost to both: the others send half as often, the node still in time
    for _ in range(110):
        bench.tick(late_ticks=1)
    heard_and_said = 295 / 2 + 80
    assert bench.column("bus_load")[-1] == pytest.approx(heard_and_said * 143 / 250e3, rel=0.02)


def test_frames_of_other_kinds_load_the_bus():
    bench = ControllerBench(START_NS)
    port = ToyPort()
    loop = RealTimeLoop([bench.node], port, clock=FakeClock())

    def stop():
        port.others += 16  # 1600 a second
        port.receive_fails = loop.statistics.ticks % 2 == 1  # counted all the same
        return loop.statistics.ticks > 250

    loop.run(stop)
    assert bench.node.safety.situation.bus_load > 0.9
    assert loop.statistics.others_received == port.others - 16


@pytest.mark.parametrize(
    ("statistics", "told"),
    [(None, False), (LoopStatistics(real_time=True), False), (LoopStatistics(), True)],
)
def test_status_tells_of_a_loop_without_real_time_scheduling(statistics, told):
    bench = ControllerBench(statistics=statistics)
    bench.run(200)
    assert bench.status.not_realtime is told


ESTIMATED = SIGNALS[SIGNALS.index("significant_height_m") :]


@pytest.mark.parametrize("index", range(len(SIGNALS) - len(ESTIMATED)))
def test_every_signal_but_the_estimates_is_finite_from_the_first_row(index):
    bench = ControllerBench(monitors=new_monitors())
    bench.tick()
    # waves and ship are not told yet
    untold = SIGNALS.index("significant_height_m") <= index <= SIGNALS.index("ship_age_s")
    verdict = SIGNALS[index].endswith("_verdict")
    assert math.isfinite(bench.rows[0][index]) != (untold and not verdict)


def test_rows_follow_the_motion_in_every_tick_and_the_estimates_within_100_ms():
    bench = ControllerBench()
    changed_s = []
    for number in range(40):
        figures = bench.node.estimated
        figures.sea = figures.sea._replace(significant_height_m=float(number))
        bench.tick()
        row = dict(zip(SIGNALS, bench.rows[-1], strict=True))
        assert row["time_s"] == bench.node.time_s == pytest.approx(number * 0.01)
        assert 0 <= number - row["significant_height_m"] < 10
        if row["significant_height_m"] == number:
            changed_s.append(row["time_s"])
    np.testing.assert_allclose(np.diff(changed_s), 0.1)


def test_until_the_water_obeyed_the_pressure_is_a_quarter():
    monitors = new_monitors()
    bench = ControllerBench(START_NS, monitors=monitors)
    bench.arm()
    assert not monitors.confirmed
    bench.law.answer_pa = 2 * LIMITS.pressure_pa
    pressures = []
    for _ in range(60):
        bench.pump = SensorPump(bench.node.command_pa, 0.0, Quality.GOOD)  # it follows
        bench.tick()
        pressures.append(bench.node.command_pa)
    assert bench.node.mode is Mode.ACTIVE
    assert max(pressures) == pressures[-1] == 0.25 * LIMITS.pressure_pa
    monitors.confirmed = True
    bench.tick()
    assert bench.node.command_pa > pressures[-1]


@pytest.mark.parametrize("pump", [True, False])
def test_a_pressure_that_is_held_is_degraded_where_there_is_a_pump(pump):
    monitors = new_monitors()
    bench = ControllerBench(START_NS, monitors=monitors, pump=pump)
    bench.run(500)
    assert bench.status.degraded is False  # nothing is commanded
    bench.node.safety.supervisor.demand = Demand.CONTROL
    bench.node.safety.supervisor.update = lambda seen, standing: None
    bench.run(200)
    assert bench.status.degraded is pump


def test_the_status_says_when_drive_or_command_is_at_a_limit():
    bench = ControllerBench(START_NS)
    bench.drive_at(LEVEL)
    bench.law.answer_pa = 2 * LIMITS.pressure_pa
    bench.run(1000)
    assert bench.status.saturated is True
    bench = ControllerBench(START_NS)
    for limits, told in (((False,) * 4, False), ((True,) * 4, True), ((False,) * 4, False)):
        bench.drive_limits = limits
        bench.run(200)
        assert bench.status.saturated is told


def test_one_late_tick_is_an_alarm_and_no_more():
    bench = ControllerBench(START_NS)
    bench.drive_at(LEVEL)
    bench.run(200)
    assert bench.node.safety.alarms.codes == set()
    bench.tick(late_ticks=1)
    bench.run(100)
    assert bench.node.safety.alarms.codes == {Fault.OVERRUN}
    assert (bench.node.mode, bench.node.safety.supervisor.degraded) == (Mode.ACTIVE, False)
    bench.run(1000)
    assert bench.pressure_pa == LEVEL


def test_heartbeat_tells_the_fault():
    bench = ControllerBench(START_NS)
    beats = CATALOGUE.receiver(Heartbeat, Address.CONTROLLER)
    bench.drive_at(LEVEL)
    bench.node.link_error(bench.now_ns, "interface down")
    bench.run(200)
    heard = [beats.accept(frame) for frame in bench.sent if frame.can_id == beats.can_id]
    assert heard[-1] is not None
    assert heard[-1].state is NodeState.FAULT
    assert VESSEL.version == VERSION == heard[-1].configuration_version


@LawExchange.register
class NotedUpdates(ToyLaw):
    """A law that is retuned, with a retuning that does nothing."""

    state = RetuningState.IDLE
    excused = False
    events: tuple[RetuningEvent, ...] = ()

    def __init__(self):
        super().__init__()
        self.fresh: list[bool] = []
        self.engaged: list[bool] = []
        self.laws = SimpleNamespace(active=SimpleNamespace(found=None))

    def take_events(self):
        return []

    def update(self, now_ns, order, *, engaged, fresh, passive_roll_rad):
        self.fresh.append(fresh)
        self.engaged.append(engaged)


class NotedSamples:
    """An estimator that estimates nothing."""

    figures = EstimateFigures()

    def __init__(self):
        self.times_ns: list[int] = []
        self.fresh: list[bool] = []

    def sample(self, now_ns, motion, *, fresh):
        self.times_ns.append(now_ns)
        self.fresh.append(fresh)

    def take_news(self):
        return ()


@pytest.mark.parametrize("kind", [SensorMotion, SensorTank])
def test_a_sample_is_fresh_only_if_motion_and_levels_are(kind, monkeypatch):
    estimator: Any = NotedSamples()
    updates = NotedUpdates()
    bench = ControllerBench(START_NS, law=updates, estimator=estimator)
    bench.run(1000)
    for noted in (updates, estimator):
        assert all(noted.fresh[1:])
    bench.silent.add(kind)
    bench.run(400)
    for noted in (updates, estimator):
        assert not noted.fresh[-1]
    bench.silent.clear()
    bench.run(400)
    for noted in (updates, estimator):
        assert noted.fresh[-1]


@pytest.mark.parametrize("kind", [SensorMotion, SensorTank])
@pytest.mark.parametrize(("age_ms", "fresh"), [(40, True), (60, False)])
def test_a_measurement_is_a_gap_in_the_record_from_50_ms_on(kind, age_ms, fresh):
    estimator: Any = NotedSamples()
    bench = ControllerBench(START_NS, estimator=estimator)
    bench.run(1010 - age_ms)
    bench.silent.add(kind)
    bench.run(age_ms)
    assert estimator.times_ns[-1] == START_NS + 1000 * MS
    assert estimator.fresh[-1] is fresh


def test_the_motion_is_sampled_for_its_record_five_times_a_second():
    estimator: Any = NotedSamples()
    ControllerBench(START_NS, estimator=estimator).run(2000)
    assert np.diff(estimator.times_ns).tolist() == [200 * MS] * 9


def test_retuning_is_engaged_while_the_law_is_in_charge_and_not_on_the_ramp(monkeypatch):
    noted = NotedUpdates()
    bench = ControllerBench(START_NS, law=noted)
    bench.run(400)
    assert not any(noted.engaged)
    bench.drive_at(40e3)
    assert noted.engaged[-1]
    bench.law.answer_pa = 0.0
    monkeypatch.setattr(bench.node.actuators._limiter, "ramp_to_zero", lambda: 40e3)
    bench.order_is(arm=False)
    bench.run(400)
    assert bench.node.safety.supervisor.demand is Demand.RAMP
    assert not noted.engaged[-1]


@pytest.mark.parametrize("phase_ms", range(0, 200, 50))
def test_a_law_is_in_charge_from_the_first_answer_after_arming(phase_ms, monkeypatch):
    noted = NotedUpdates()
    bench = ControllerBench(START_NS, law=noted)
    bench.run(400 + phase_ms)
    bench.order_is(mode_request=Mode.ACTIVE, arm=True)
    while bench.node.mode is not Mode.ACTIVE:
        bench.tick()
    noted.engaged.clear()
    bench.run(600)
    assert all(noted.engaged)


@pytest.mark.parametrize("phase_ms", range(0, 200, 10))
def test_whoever_disarms_and_arms_between_two_answers_is_out_of_charge_for_one(
    phase_ms, monkeypatch
):
    """A retuning under way has to end, whenever that was."""
    noted = NotedUpdates()
    bench = ControllerBench(START_NS, law=noted)
    bench.drive_at(0.0)
    bench.run(400 + phase_ms)
    noted.engaged.clear()
    bench.order_is(arm=False)
    bench.run(20)
    assert bench.node.mode is Mode.PASSIVE
    bench.order_is(arm=True)
    bench.run(600)
    assert bench.node.mode is Mode.ACTIVE
    assert noted.engaged.count(False) in (1, 2)
    assert noted.engaged[-1]


@pytest.mark.parametrize("sign", [-1, 1])
def test_a_law_that_asks_for_anything_gets_the_limit_and_half_of_it_when_degraded(sign):
    bench = ControllerBench(START_NS)
    bench.arm()
    bench.law.answer_pa = sign * 1e12
    bench.run(600)
    most_pa = max(abs(command.pressure_pa) for _, command in bench.commands)
    assert most_pa == abs(bench.pressure_pa) == LIMITS.pressure_pa
    bench.silent.add(SensorPump)
    bench.run(600)
    assert bench.node.safety.supervisor.degraded
    assert bench.pressure_pa == sign * LIMITS.pressure_pa / 2


def test_degraded_is_what_she_stands_where_half_of_it_could_capsize_her(monkeypatch):
    monitors = new_monitors()
    monitors.thresholds = replace(monitors.thresholds, degraded_share=0.125)
    monitors.confirmed = True
    monkeypatch.setattr(monitors, "update", lambda *_: 0)
    bench = ControllerBench(START_NS, monitors=monitors)
    bench.run(10)
    supervisor = bench.node.safety.supervisor
    monkeypatch.setattr(supervisor, "update", lambda *_: None)
    for degraded, share in ((True, 0.125), (False, 1.0)):
        monkeypatch.setattr(supervisor, "degraded", degraded)
        bench.run(10)
        assert bench.node.law.share(bench.node.judgement) == share


def test_without_retuning_nothing_excuses_the_ship_from_her_twin(monkeypatch):
    monitors = new_monitors()
    excused: list[bool] = []
    monkeypatch.setattr(monitors.twin, "excuse", lambda: excused.append(True))
    ControllerBench(START_NS, monitors=monitors).run(300)
    assert not excused


@pytest.mark.parametrize("excused", [False, True])
def test_every_law_that_is_not_excused_is_judged_by_the_twin_of_its_own_ship(
    *, excused, monkeypatch
):
    monitors = new_monitors()
    noted = NotedUpdates()
    bench = ControllerBench(START_NS, law=noted, monitors=monitors)
    followed, excuses = [], []
    monkeypatch.setattr(monitors, "follow", followed.append)
    monkeypatch.setattr(monitors.twin, "excuse", lambda: excuses.append(True))
    noted.excused = excused
    noted.laws.active.found = object()
    bench.run(100)
    assert set(followed) == {noted.laws.active.found}
    assert bool(excuses) is excused


def monitored():
    """An armed controller with monitors, whose law asks for nothing."""
    bench = ControllerBench(START_NS, monitors=new_monitors())
    bench.arm()
    return bench


def test_a_spike_does_not_reach_the_law():
    bench = monitored()
    bench.motion = SensorMotion(0.3, 0.0, Quality.GOOD)
    bench.tick()
    assert bench.node.motion.roll_rad == 0.0


def test_a_second_sender_of_any_message_is_found():
    bench = monitored()
    bench.spoil = lambda kind, frame: (frame,) * (2 if kind is SensorMotion else 1)
    bench.run(1000)
    assert bench.node.fault is Fault.FOREIGN_SENDER


def test_a_message_that_is_expected_is_missed():
    bench = monitored()
    bench.run(1000)
    assert not bench.node.safety.supervisor.degraded
    bench.silent.add(DriveStatus2)
    bench.run(1500)
    assert Fault.NODE_SILENT in bench.node.safety.alarms.codes
    assert not bench.node.safety.supervisor.degraded


@pytest.mark.parametrize("more_ms", range(0, 200, 30))
def test_devices_that_start_after_the_controller_were_not_silent(more_ms):
    """They are found silent before they start, and until each stream is looked at again."""
    bench = ControllerBench(START_NS, monitors=new_monitors())
    bench.silent = {DriveStatus1, DriveStatus2}
    bench.run(2000 + more_ms)
    assert bench.node.safety.situation.found & Finding.NODE_SILENT
    bench.silent = set()
    bench.run(1000)
    assert bench.node.mode is Mode.STANDBY
    assert not bench.node.safety.alarms.codes


def test_frames_of_other_kinds_fill_the_bus_too():
    bench = monitored()
    for _ in range(200):
        bench.node.other_frames(3)
        bench.tick()
    assert bench.node.fault is Fault.UNKNOWN_IDENTIFIERS
    assert bench.node.inbox.foreign == 600
    assert bench.node.safety.situation.bus_load > 0.15


def test_plans_that_were_not_found_and_the_state_of_retuning_are_the_laws():
    assert ControllerBench(law=PlanningLaw()).node.law.fallbacks == 3
    bench = ControllerBench(START_NS)
    assert bench.node.law.fallbacks is None
    assert bench.node.retuning_state is RetuningState.IDLE
    noted = NotedUpdates()
    bench = ControllerBench(START_NS, law=noted)
    noted.state = RetuningState.TRIAL
    assert bench.node.retuning_state is RetuningState.TRIAL
    bench.run(200)
    assert bench.status.retuning is RetuningState.TRIAL


def test_without_a_pump_nothing_is_ever_commanded():
    bench = ControllerBench(START_NS, pump=False)
    bench.arm()
    bench.law.answer_pa = 30e3
    bench.run(300)
    assert bench.node.safety.supervisor.demand is Demand.CONTROL
    assert bench.node.command_pa == 0.0
    assert not bench.commands


def test_events_of_retuning_need_nobody_who_takes_them(monkeypatch):
    noted = NotedUpdates()
    bench = ControllerBench(START_NS, law=noted)
    event = RetuningEvent(START_NS, RetuningState.IDLE, ())
    monkeypatch.setattr(noted, "take_events", lambda: [event])
    bench.run(300)
    assert noted.fresh
    heard: list[object] = []
    monkeypatch.setattr(
        bench.node.telemetry, "_event_sink", lambda event, start_ns: heard.append(event)
    )
    bench.run(300)
    assert event in heard


def times_ms(bench, kind, ms):
    """When the node sends a message, over so many ms."""
    can_id, times = CATALOGUE.codec(kind).can_id, []
    for tick in range(ms // 10):
        bench.sent.clear()
        bench.tick()
        times += [10 * tick for frame in bench.sent if frame.can_id == can_id]
    return times


def test_what_is_estimated_is_said_in_its_cycle_and_only_where_it_is_estimated():
    monitors = new_monitors()
    estimator: Any = NotedSamples()
    for kind, more in (
        (SeaEstimate, {"estimator": estimator}),
        (ShipEstimate, {"estimator": estimator}),
        (PassiveTwin, {"monitors": monitors}),
    ):
        cycle_ms = CATALOGUE.codec(kind).cycle_ns // MS
        times = times_ms(ControllerBench(START_NS, **more), kind, 3 * cycle_ms)
        assert len(times) == 3
        assert np.diff(times).tolist() == [cycle_ms] * 2
        assert not times_ms(ControllerBench(START_NS), kind, 3 * cycle_ms)


def test_what_is_awaited_is_no_alarm_for_ten_seconds_unless_it_was_there_before():
    bench = ControllerBench(START_NS)
    bench.silent.add(SensorMotion)
    bench.run(9_900)
    assert Fault.MOTION_SILENT not in bench.node.safety.alarms.codes
    bench.run(400)
    assert Fault.MOTION_SILENT in bench.node.safety.alarms.codes
    bench = ControllerBench(START_NS)
    bench.run(1000)
    assert bench.node.mode is Mode.STANDBY
    bench.silent.add(SensorMotion)
    bench.run(300)
    assert bench.node.mode is Mode.INIT
    assert Fault.MOTION_SILENT in bench.node.safety.alarms.codes


def test_a_high_level_switch_is_an_alarm_from_the_start_however_short():
    bench = ControllerBench(START_NS)
    bench.silent.add(SensorMotion)
    bench.run(1000)
    bench.tank = bench.tank._replace(port_high=Switch.ON)
    bench.run(200)
    assert bench.node.mode is Mode.INIT
    assert bench.node.safety.alarms.codes == {Fault.LEVEL_LIMIT}
    bench.tank = bench.tank._replace(port_high=Switch.OFF)
    bench.run(3000)
    assert bench.node.safety.alarms.codes == {Fault.LEVEL_LIMIT}  # nobody has accepted it


@pytest.mark.parametrize("phase", range(10))
def test_what_halves_the_pressure_for_a_single_tick_is_an_alarm(phase):
    bench = ControllerBench(START_NS)
    bench.drive_at(20e3)
    bench.run(10 * phase)
    bench.silent.add(SensorTank)
    while not bench.node.safety.supervisor.degraded:
        bench.tick()
    bench.silent.clear()
    bench.run(300)
    assert not bench.node.safety.supervisor.degraded
    assert bench.node.safety.alarms.codes == {Fault.TANK_SILENT}


def test_a_refused_reset_is_an_event_and_its_end_is_none(monkeypatch):
    refused: list[Fault] = []
    bench = ControllerBench(START_NS)
    bench.arm()
    monkeypatch.setattr(
        bench.node.safety.alarms, "reset_refused", lambda code, mode, now_ns: refused.append(code)
    )
    bench.tank = bench.tank._replace(port_high=Switch.ON)
    bench.run(300)
    bench.order_is(arm=False, mode_request=Mode.STANDBY, reset=True)
    bench.run(1000)
    assert refused == [Fault.LEVEL_LIMIT]
    bench.tank = bench.tank._replace(port_high=Switch.OFF)
    bench.order_is(reset=False)
    bench.run(100)
    bench.order_is(reset=True)
    bench.run(1000)
    assert bench.node.mode is Mode.STANDBY
    assert refused == [Fault.LEVEL_LIMIT]


@pytest.mark.parametrize("every", [1, 4])
def test_telemetry_has_a_row_of_so_many_ticks(every):
    statistics = LoopStatistics()
    bench = ControllerBench(START_NS, statistics=statistics, sink_every=every)
    for tick in range(20):
        statistics.lateness.add(1000 * (20 - tick))  # the longest is never the latest of a row
        statistics.duration.add(1000 if tick % every else 5000)
        bench.run(10)
    assert np.diff(bench.column("time_s")) == pytest.approx([every * 0.01] * (20 // every - 1))
    # in each row the longest since the last one
    longest_us = [20, *range(19, 0, -every)][: 20 // every]
    assert 1e6 * bench.column("wakeup_lateness_s") == pytest.approx(longest_us)
    assert 1e6 * bench.column("tick_duration_s") == pytest.approx(5.0)


class PlayedDrive:
    """A drive of another maker, each kind of frame of it, and how it was commanded."""

    def __init__(self):
        self.echo_ns, self.asked = START_NS, []

    def frames(self, now_ns):
        return [Frame(0x601 | STANDARD, b"setup")]

    def command(self, *asked):
        self.asked.append(asked)
        return [Frame(0x201 | STANDARD, b"command")]

    def stop(self):
        return [Frame(0x201 | STANDARD, b"stop")]


def test_devices_of_other_makers_are_woken_configured_commanded_and_stopped(monkeypatch):
    bench = ControllerBench(START_NS)
    node, drive = bench.node, PlayedDrive()
    node.actuators.drive = drive
    wake, sensor = Frame(0 | STANDARD, b"wake"), Frame(0x602 | STANDARD, b"sensor")
    monkeypatch.setattr(node.inbox, "wakes", lambda _: [wake])
    monkeypatch.setattr(node.inbox, "setups", lambda _: [sensor])
    for tick in range(200):
        drive.echo_ns = bench.now_ns
        bench.tank = bench.tank._replace(port_level_m=-0.002 * tick, starboard_level_m=0.002 * tick)
        bench.tick()
    sent = [frame.data for frame in bench.sent if frame.can_id & STANDARD]
    assert {data: sent.count(data) for data in sent} == {
        b"wake": 2, b"sensor": 200, b"setup": 200, b"command": 100,  # each second, tick, cycle
    }  # fmt: skip
    pressure_pa, word, measured, rate_m_s = drive.asked[-1]
    assert (pressure_pa, word) == (0.0, ControlWord.DISABLE_VOLTAGE)
    assert measured.now_ns == bench.now_ns - 2 * TICK_NS
    assert rate_m_s == bench.level.rate_m_s > 0.1
    assert [frame.data for frame in node.stop(bench.now_ns)] == [b"stop"]


def test_a_drive_of_another_maker_that_echoes_no_command_is_silent():
    bench = ControllerBench(START_NS)
    drive = bench.node.actuators.drive = PlayedDrive()
    while bench.node.mode is not Mode.ACTIVE:
        drive.echo_ns = bench.now_ns
        bench.order_is(mode_request=Mode.ACTIVE, arm=bench.ms > 400)
        bench.drive_state = DriveState.OPERATION_ENABLED
        bench.tick()
    drive.echo_ns = bench.now_ns
    bench.run(100)
    assert bench.node.mode is Mode.ACTIVE
    bench.run(20)
    assert (bench.node.mode, bench.node.fault) == (Mode.FAULT, Fault.DRIVE_SILENT)


def test_a_drive_that_has_never_sent_a_command_back_is_silent(monkeypatch):
    bench = ControllerBench(START_NS)
    monkeypatch.setattr(bench, "hear", lambda _: None)
    bench.run(500)
    assert (bench.node.mode, bench.node.fault) == (Mode.INIT, Fault.DRIVE_SILENT)
