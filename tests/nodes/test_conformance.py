"""Devices put through their profiles: emulated sensors, a drive that canopen plays, the bench's."""

import math
import re

import pytest

from firmware_sim.canopen_drive import CanopenPumpDrive
from firmware_sim.sensors import ForeignFrames
from tests.firmware_sim.drive_bench import VESSEL, calm_plant
from tests.nodes.canopen_peers import PROFILE, PUMP, Line
from utank_hil.base.tick import TICK_NS
from utank_hil.canbus import Frame, Quality, SensorMotion, load_catalogue
from utank_hil.canbus.frame import STANDARD
from utank_hil.canbus.profiles.drive_plan import NetworkState, Place
from utank_hil.configuration.device_sections import DriveSection
from utank_hil.configuration.devices import DevicesSection
from utank_hil.nodes.commissioning.checks import stopped_ms
from utank_hil.nodes.commissioning.conformance import DriveTrial, SensorTrial

SBG = {"profile": "sbg_ellipse", "accept_unprotected": True}


def failed(trial):
    assert trial.done
    return {each.name for each in trial.checks if not each.passed}


def heel_rad(asked, since_s):
    """Heel to starboard by 0.1 rad within two seconds of the first request."""
    return 0.05 * (1 - math.cos(math.pi * min(since_s / 2, 1))) if asked else 0.0


def sensor_trial(sign=1, rate_sign=1, every=1, repeats=False, silent=False, late=False):
    """A trial of an emulated inertial sensor whose person takes three seconds a step."""
    plan = DevicesSection(motion=SBG).foreign().motions[0]
    catalogue, asked = load_catalogue(), []
    device = ForeignFrames(plan, catalogue.transmitter(SensorMotion), catalogue.codec(SensorMotion))

    def ask(what):
        asked.append(now_ns)
        return lambda: now_ns - asked[-1] > 3_000_000_000

    trial, now_ns, tick, held = SensorTrial(plan, ask, 2.0), 0, 0, []
    while not trial.done:
        assert tick < 6000
        since_s = (now_ns - asked[0]) * 1e-9 if asked else 0.0
        off = len(asked) == 2 and not repeats
        if not (silent or off or tick % every):
            before, after = (heel_rad(asked, max(since_s + d, 0)) for d in (-5e-3, 5e-3))
            roll, rate = heel_rad(asked, since_s), (after - before) * 100
            values = SensorMotion(sign * roll, rate_sign * rate, Quality.GOOD)
            held += device.frames(values, now_ns, tick)
            if not (late and tick % 50):  # each half a second they come together
                for frame in held:
                    trial.receive(frame, now_ns + 1_000_000)
                held = []
        now_ns += TICK_NS
        tick += 1
        trial.tick(now_ns)
    return trial


@pytest.mark.parametrize(
    ("changes", "wrong"),
    [
        ({}, set()),
        ({"sign": -1, "rate_sign": -1}, {"roll_rad_sign"}),
        ({"rate_sign": -1}, {"roll_rate"}),
        ({"repeats": True}, {"silence"}),
        ({"every": 2}, {"rate", "jitter"}),
        ({"silent": True}, {"heard"}),
        (
            {"late": True, "sign": 0},
            {"late", "rate", "jitter", "gap", "roll_rad_sign", "roll_rate"},
        ),
    ],
)
def test_a_sensor_conforms_or_what_is_wrong_is_named(changes, wrong):
    assert failed(sensor_trial(**changes)) == wrong


def test_a_sensor_that_nobody_moved_is_not_said_to_be_turned_round():
    (check,) = [each for each in sensor_trial(sign=0).checks if each.name == "roll_rad_sign"]
    assert (check.passed, check.what) == (False, "roll_rad moved by 0 rad")
    assert "has to move by 0.0175 rad" in check.remedy


def test_a_sensor_whose_measurements_come_all_at_once_has_no_rate():
    trial = sensor_trial()
    trial._heard, trial.checks = [trial._heard[0]] * 3, []
    trial._judge_pace()
    assert [each.measured for each in trial.checks if each.name == "rate"] == [0.0]


class TrialLine(Line):
    """canopen's node, whose rotor turns as its target says and stops in 40 ms."""

    def __init__(self, changes=(), tweak=lambda _: None):
        super().__init__(changes, tweak)
        self.drive = self.trial = DriveTrial(self.plan, PUMP, lambda what: lambda: True)
        self.drive.takers = self.trial._drive.takers
        self.controller_ns, self.watches, self.stops = 0, True, True
        self.speed = 0.0

    def run(self):
        trial = self.trial
        while not trial.done:
            assert self.now_ns < 60_000_000_000
            for frame in trial.tick(self.now_ns):
                if frame.can_id & 0x7FF == 0x77F:
                    self.controller_ns = self.now_ns
                self._to_the_drive(frame)
            self._turn()
            if self.now_ns // TICK_NS % 5 == 0:
                state = {"OPERATIONAL": 5, "PRE-OPERATIONAL": 127, "STOPPED": 4}
                self.wire.said.append((0x705, bytes([state.get(self.node.nmt.state, 127)])))
            for can_id, data in self.wire.said:
                trial.receive(Frame(can_id | STANDARD, data), self.now_ns + TICK_NS // 2)
            self.wire.said.clear()
            self.now_ns += TICK_NS
        for frame in trial.stop(self.now_ns):
            self._to_the_drive(frame)
        return trial

    def _turn(self):
        node = self.node
        enabled = node.sdo[0x6041].raw == 0x237
        if self.watches and enabled and self.now_ns - self.controller_ns > 50_000_000:
            node.sdo[0x6041].raw, enabled = 0x0250, False
            node.nmt.state = "PRE-OPERATIONAL"  # 1029h as delivered: no PDO from now on
        target = node.sdo[0x6071].raw if enabled else 0
        if enabled or self.stops:
            self.speed += (target * 10 - self.speed) * 0.5
        node.set_data(0x606C, 0, (round(self.speed) & 0xFFFFFFFF).to_bytes(4, "little"))


def test_a_drive_of_another_stack_conforms_and_is_left_stopped():
    line = TrialLine()
    assert failed(line.run()) == set()
    assert line.node.nmt.state == "STOPPED"
    times_ms = {each.name: each.measured for each in line.trial.checks if each.unit == "ms"}
    assert 20 <= times_ms["quick_stop_ms"] <= 60
    assert 70 <= times_ms["lost_controller_ms"] <= 130


def test_no_pump_turns_before_somebody_has_said_so():
    """Not after hours either: who was asked may have gone."""
    trial = DriveTrial(DriveSection(**PROFILE).plan(0, PUMP), PUMP, lambda what: lambda: False)
    for hour in range(24):
        trial.tick(hour * 3600 * 10**9)
    assert (trial.done, trial.checks) == (False, [])


def test_a_drive_that_runs_on_is_found():
    line = TrialLine()
    line.watches = line.stops = False
    assert failed(line.run()) == {"quick_stop_ms", "lost_controller_ms", "lost_controller_off"}


def test_a_drive_that_stops_by_itself_has_no_time_to_stop():
    """As one does whose controller's heartbeat is late; its speed then falls before the stop."""
    line = TrialLine()
    turn = line._turn

    def trips():
        if line.speed > 500:
            line.node.sdo[0x6041].raw = 0x0250
        turn()

    line._turn = trips
    assert failed(line.run()) == {"quick_stop_stays", "lost_controller_stays"}
    (check, _) = [each for each in line.trial.checks if not each.passed]
    assert "status word 0x0250" in check.remedy
    assert "raise heartbeat_ms" in check.remedy


def at(can_id, change):
    return lambda frame: change(frame) if frame.can_id & 0x7FF == can_id else [(0, frame)]


def of(length):
    """Cut to a length."""
    return lambda frame: [(0, frame._replace(data=frame.data[:length]))]


def stands(frame):
    return [(0, frame._replace(data=frame.data[:2].ljust(len(frame.data), b"\0")))]


def elsewhere(frame):
    return [(0, frame._replace(can_id=frame.can_id + 1))]


def later(milliseconds):
    return lambda frame: [(milliseconds * 1_000_000, frame)]


@pytest.mark.parametrize(
    ("spoil", "name", "words"),
    [
        (at(0x185, stands), "echo_ms", "another echo"),
        (at(0x185, later(200)), "echo_ms", "what delays or loses PDOs"),
        (at(0x185, of(-1)), "tpdo1", "50 came, 50 of them not of 6 bytes"),
        (at(0x285, of(5)), "tpdo2", r"not of 7 bytes: compare COB-ID \(1801h:1\)"),
        (at(0x185, elsewhere), "tpdo1", "0 came"),
        (at(0x285, elsewhere), "tpdo2", "0 came"),
        (at(0x705, of(0)), "heartbeat", "no controller arms: look at 1017h"),
        (at(0x585, elsewhere), "set_up", "1000h:0 can't be read .*node number"),
        (at(0x585, of(5)), "set_up", "1000h:0 can't be read"),
        (at(0x585, later(400)), "set_up", "what loses or delays frames"),
    ],
)
def test_a_drive_that_answers_wrongly_is_refused_by_what_it_says(spoil, name, words):
    line = TrialLine()
    receive, held = line.trial.receive, []

    def spoiled(frame, now_ns):
        held.extend((now_ns + late_ns, frame) for late_ns, frame in spoil(frame))
        due = [each for each in held if each[0] <= now_ns]
        held[:] = [each for each in held if each[0] > now_ns]
        for _, frame in due:
            receive(frame, now_ns)

    line.trial.receive = spoiled
    assert name in failed(line.run())
    first = next(each for each in line.trial.checks if not each.passed)
    assert first.name == name
    assert re.search(words, first.remedy)


def test_a_drive_whose_identity_can_be_written_is_found():
    line = TrialLine(tweak=lambda od: setattr(od[0x1018][1], "access_type", "rw"))
    assert "read_only" in failed(line.run())


def test_a_drive_without_heartbeat_consumer_ends_the_trial():
    trial = TrialLine(tweak=lambda od: od.indices.pop(0x1016)).run()
    assert failed(trial) == {"set_up"}
    assert "another drive" in trial.checks[0].remedy


def emulated(mode, look=lambda pushes, pressure_pa: None, **entries):
    """The trial of the bench's drive; `entries` do not keep what is written."""
    plan = DriveSection(**(PROFILE | {"mode": mode})).plan(0, VESSEL.pump)
    drive = CanopenPumpDrive(calm_plant(), VESSEL.pump, plan)
    trial, now_ns = DriveTrial(plan, VESSEL.pump, lambda what: lambda: True), 0
    while not trial.done:
        assert now_ns < 60_000_000_000
        for frame in trial.tick(now_ns):
            drive.receive(frame, now_ns)
        for key, value in entries.items():
            if drive.state is NetworkState.OPERATIONAL:
                drive.entries[Place(int(key[1:], 16))].value = value
        for frame in drive.tick(now_ns):
            trial.receive(frame, now_ns)
        look(trial._pushes, drive._plant.pressure_pa)
        now_ns += TICK_NS
    return trial


@pytest.mark.parametrize("mode", ["torque", "velocity"])
def test_the_drive_of_the_bench_conforms(mode):
    assert failed(emulated(mode)) == set()


def test_one_that_does_nothing_when_the_controller_dies_is_found():
    assert failed(emulated("torque", x6007=0)) == {"lost_controller_ms", "lost_controller_off"}


@pytest.mark.parametrize("mode", ["torque", "velocity"])
def test_its_times_are_those_of_the_pumps_pressure(mode):
    pressures_pa = []
    checks = emulated(mode, look=lambda *each: pressures_pa.append(each)).checks
    measured_ms = [each.measured for each in checks if each.name.endswith(("stop_ms", "er_ms"))]
    ends = [k for k in range(1, len(pressures_pa)) if pressures_pa[k - 1][0] > pressures_pa[k][0]]
    assert len(measured_ms) == len(ends) == 2
    for time_ms, end in zip(measured_ms, ends, strict=True):
        before_pa = pressures_pa[end - 1][1]
        stopped = next(k for k in range(end, end + 50) if pressures_pa[k][1] < 0.1 * before_pa)
        assert abs(time_ms - 10 * (stopped - end)) <= 30  # a PDO, and a speed of it, late


def test_a_pump_that_swings_after_its_stop_has_no_time_of_it():
    assert stopped_ms([1.0, 0.5, *[0.0] * 48]) == 20.0
    swings = [0.5 * (-1) ** k for k in range(51)]
    assert math.isnan(stopped_ms(swings))
    assert math.isnan(stopped_ms([*swings, 0.0]))  # at rest for a tick alone
    # half of the speed the other way is no stop, the water's share of it is one
    assert stopped_ms([1.0, *[-0.51] * 9, *[0.0] * 40]) == 100.0
    assert stopped_ms([1.0, *[-0.5] * 9, *[0.0] * 40]) == 10.0
    assert stopped_ms([1.0, *[0.1] * 9, *[0.0] * 40]) == 10.0
    assert stopped_ms([1.0, *[0.11] * 9, *[0.0] * 40]) == 100.0
    assert stopped_ms([*[1.0] * 5, *[0.5] * 5]) == 50.0
    assert math.isnan(stopped_ms([*[1.0] * 5, *[0.51] * 5]))
    assert math.isnan(stopped_ms([*[1.0] * 5, *[-0.51] * 5]))
    assert stopped_ms([*[0.0] * 5]) == 0.0
    assert math.isnan(stopped_ms([0.0] * 4))
    assert math.isnan(stopped_ms([]))
