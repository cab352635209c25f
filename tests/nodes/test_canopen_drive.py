"""A drive that canopen plays: configured, commanded, heard; what it lacks is said by name."""

import math
import re
from itertools import pairwise
from types import SimpleNamespace

import pytest

from tests.nodes.canopen_peers import PROFILE, PUMP, Line
from utank_hil.canbus import ControlWord, DriveState, Frame
from utank_hil.canbus.frame import STANDARD
from utank_hil.canbus.profiles.device import CalledTaker, hear
from utank_hil.configuration.device_sections import DriveSection
from utank_hil.control.pressure_loop import PressureLoop
from utank_hil.dynamics.pump_curve import pump_pressure
from utank_hil.nodes.actuators_heard import DriveHeard
from utank_hil.nodes.canopen_drive import CanopenDrive, DriveReport, state_of

MS = 1_000_000


def test_it_is_configured_and_led_to_operation():
    line = Line().run(400)
    assert line.drive.setup.done, line.drive.words
    sdo = line.node.sdo
    assert [sdo[0x1600][n].raw for n in range(3)] == [2, 0x60400010, 0x60710010]
    assert [sdo[0x1A00][n].raw for n in range(4)] == [3, 0x60410010, 0x60400010, 0x60710010]
    assert [sdo[0x1800][n].raw & 0xBFFFFFFF for n in (1, 2, 3, 5)] == [0x185, 1, 0, 0]
    assert sdo[0x1802][1].raw >> 31
    assert sdo[0x1016][1].raw == 127 << 16 | 50
    assert [sdo[index].raw for index in (0x1017, 0x6007, 0x605A, 0x605E, 0x6060)] == [
        50, 3, 2, 2, 4
    ]  # fmt: skip
    for word in (ControlWord.SHUTDOWN, ControlWord.SWITCH_ON, ControlWord.ENABLE_OPERATION):
        line.run(4, word, 1000.0)
    assert line.reports[-1][1].state is DriveState.OPERATION_ENABLED
    target = line.node.sdo[0x6071].raw
    assert target * 80.0 * 0.4 * 6.22 == pytest.approx(1000.0, abs=3 * 80 * 0.4 * 6.22)
    line.run(6, ControlWord.QUICK_STOP)
    assert line.reports[-1][1].state is DriveState.SWITCH_ON_DISABLED


@pytest.mark.parametrize(
    ("tweak", "words"),
    [
        # canopen's node takes any mapping: it would send no speed
        (lambda od: od.pop(0x606C), r"606Ch:0 can't be read \(.*no object\): 32 bits of it are to"),
        (lambda od: od.indices.pop(0x1016), "1016h:1 .*no object.*heartbeat.*another drive"),
        (lambda od: setattr(od[0x1018][2], "default", 0x23), "1018h:2 is 0x23, not 0x22.*product"),
        (lambda od: setattr(od[0x1000], "default", 0x191), "1000h:0 is 0x191, not 0x192"),
        (lambda od: setattr(od[0x6502], "default", 4), "6502h:0 is 0x4.*mode 4"),
        (lambda od: od.indices.pop(0x6007), "6007h:0 .*no object.*null"),
        (lambda od: setattr(od[0x605A], "access_type", "ro"),
         "605Ah:0 is 0x0, not 0x2, and writing it gave .*read only"),
        (lambda od: setattr(od[0x1A00][2], "access_type", "ro"), "1A00h:2 .*choose another echo"),
        (lambda od: setattr(od[0x6071], "data_type", 7), "6071h:0 has 4 bytes.*16 bits"),
    ],
)  # fmt: skip
def test_what_is_wrong_is_refused_by_name(tweak, words):
    line = Line(tweak=tweak).run(400)
    assert not line.drive.setup.done
    assert re.search(rf"node 5: {words}", line.drive.words), line.drive.words
    assert [report for _, report in line.reports] == [None]  # once
    assert line.node.nmt.state != "OPERATIONAL"


def test_what_reads_back_otherwise_is_refused():
    line = Line()
    line.node.add_read_callback(lambda index, **_: 1 if index == 0x605E else None)
    assert "605Eh:0 is 0x1, not 0x2: set require" in line.run(400).drive.words


def test_a_drive_that_was_mended_is_started_again():
    line = Line(tweak=lambda od: setattr(od[0x605E], "access_type", "ro")).run(400)
    assert line.drive.setup.problem
    line.node.object_dictionary[0x605E].access_type = "rw"
    line.run(500)
    assert line.drive.setup.done
    assert line.reports[-1][1].state is DriveState.SWITCH_ON_DISABLED


def longest_echo(line, ticks, word=ControlWord.ENABLE_OPERATION):
    """Greatest age of an echo in milliseconds, at the ends of the ticks."""
    ages = []
    for k in range(ticks):
        line.run(1, word, 3e3 + 10 * k)
        ages.append((line.now_ns - line.drive.echo_ns) / MS)
    return max(ages)


def test_four_of_five_lost_commands_are_found_within_100_ms():
    line = Line().run(400)
    assert longest_echo(line, 100) <= 50
    lost_ns, first = [], line.sent + 1

    def passes(number):
        lost_ns.append(line.now_ns)
        return (number - first) % 5 == 4

    line.passes = passes
    while (line.now_ns - line.drive.echo_ns) / MS <= 100:  # the limit echo_age_ms
        line.run(1, ControlWord.ENABLE_OPERATION, 3e3)
        assert line.now_ns - lost_ns[0] <= 100 * MS


@pytest.mark.parametrize("target", [0.0, 3e3])
def test_a_drive_that_hangs_on_an_old_command_has_no_echo(target):
    line = Line().run(400).run(10, ControlWord.ENABLE_OPERATION, target)
    line.passes = lambda _: False
    line.run(100, ControlWord.ENABLE_OPERATION, target)
    assert (line.now_ns - line.drive.echo_ns) / MS > 100


def test_an_altered_control_word_is_no_echo():
    line = Line().run(400)
    line.node.add_write_callback(
        lambda index, **_: setattr(line, "wrong", index) if index == 0x6040 else None
    )
    line.node.add_read_callback(lambda index, **_: 0x1F if index == 0x6040 else None)
    assert longest_echo(line, 30) > 100


def test_without_heartbeat_its_status_does_not_count():
    line = Line().run(400)
    line.beats = False
    last_ns = line.now_ns
    line.run(60)
    assert last_ns < line.reports[-1][0] <= last_ns + 100 * MS


def test_who_only_hears_a_drive_gets_its_reports():
    line = Line().run(400, ControlWord.SHUTDOWN)
    panel = CanopenDrive(line.plan, hears_only=True)
    reports = []
    panel.deliver = lambda report, now_ns: reports.append(report)
    takers = dict(line.drive.takers)
    for can_id, taker in panel.takers.items():
        hear(takers, can_id, taker)
    line.drive.takers = takers
    line.run(20, ControlWord.SHUTDOWN)
    assert reports[-1].state is DriveState.READY_TO_SWITCH_ON


def test_the_controller_beats_with_each_command_and_stops_the_node():
    line = Line()
    (beat,) = line.drive.follow(0.0, ControlWord.SHUTDOWN)  # of a drive that is not configured yet
    assert beat.can_id & 0x7FF == 0x77F
    frames = line.run(400).drive.follow(0.0, ControlWord.SHUTDOWN)
    assert [each.can_id & 0x7FF for each in frames] == [0x77F, 0x80, 0x205]
    assert len(frames[-1].data) == 4  # control word and target torque
    *_, last = line.drive.stop()
    assert last.data == bytes((2, 5))


def test_marks_change_the_target_by_three_counts_at_most():
    line = Line().run(400).run(40, ControlWord.ENABLE_OPERATION, 50e3)
    counts = [int.from_bytes(data[2:], "little", signed=True) for data in line.commands[-10:]]
    exact = 50e3 / (80 * 0.4 * 6.22)
    assert all(abs(each - exact) < 3 for each in counts)
    assert all((b - a) % 4 == 1 for a, b in pairwise(counts))


def test_a_target_beyond_what_its_bits_hold_is_the_greatest_of_its_sign():
    line = Line().run(400)
    for side in (1, -1) * 4:
        data = line.drive.follow(side * 1e9, ControlWord.ENABLE_OPERATION)[-1].data
        counts = side * int.from_bytes(data[2:], "little", signed=True)
        assert 0x7FFF - 7 <= counts <= 0x7FFF


# mask and value of each state, IEC 61800-7-201 (CiA 402), status word
STATES = {
    DriveState.NOT_READY_TO_SWITCH_ON: (0x4F, 0x00),
    DriveState.SWITCH_ON_DISABLED: (0x4F, 0x40),
    DriveState.READY_TO_SWITCH_ON: (0x6F, 0x21),
    DriveState.SWITCHED_ON: (0x6F, 0x23),
    DriveState.OPERATION_ENABLED: (0x6F, 0x27),
    DriveState.QUICK_STOP_ACTIVE: (0x6F, 0x07),
    DriveState.FAULT_REACTION_ACTIVE: (0x4F, 0x0F),
    DriveState.FAULT: (0x4F, 0x08),
}


def test_states_are_those_of_the_status_word():
    for word in range(0x400):
        states = [state for state, (mask, value) in STATES.items() if word & mask == value]
        assert state_of(word) is (states[0] if states else None)


def powered_anew(line):
    """Forget all that was written, as a drive whose power was off."""
    fresh = Line().node
    line.node.object_dictionary = fresh.object_dictionary
    line.node.data_store.clear()
    line.node.nmt.state = "PRE-OPERATIONAL"
    line.node.sdo[0x6041].raw = 0x250


@pytest.mark.parametrize("said", [True, False])
def test_a_drive_that_was_off_is_configured_anew_whether_its_start_was_heard_or_not(said):
    line = Line().run(400)
    powered_anew(line)
    if said:
        line.wire.said.append((0x705, b"\0"))
    before = len(line.reports)
    line.run(900)
    assert line.node.sdo[0x1017].raw == 50, line.drive.words
    assert line.drive.setup.done
    assert line.reports[before:]
    assert line.reports[-1][0] > line.now_ns - 60 * MS


def test_a_drive_whose_power_went_while_it_ran_is_configured_anew():
    """What it said last is no reason to stop its node again and again: then it has no SDO."""
    line = Line().run(400)
    for word in (ControlWord.SHUTDOWN, ControlWord.SWITCH_ON, ControlWord.ENABLE_OPERATION):
        line.run(4, word)
    assert line.drive.state is DriveState.OPERATION_ENABLED
    powered_anew(line)
    line.wire.said.append((0x705, b"\0"))
    follow = line.drive.follow

    def commanded(target, word):
        line.drive.follow = follow
        frames = line.drive.command(target, word, None, 0.0)
        line.drive.follow = commanded
        return frames

    line.drive.follow = commanded
    line.run(400, ControlWord.DISABLE_VOLTAGE)
    assert line.node.nmt.state == "OPERATIONAL", line.drive.words
    assert line.reports[-1][1].state is DriveState.SWITCH_ON_DISABLED


def test_the_loop_sets_the_target_while_it_is_enabled_and_begins_anew_after():
    asked, resets = [], []
    loop = SimpleNamespace(most_speed_rad_s=28.0, step=lambda *given: asked.append(given) or 2e3,
                           reset=lambda: resets.append(len(asked)))  # fmt: skip
    line, targets = Line(loop=loop).run(400), []
    line.drive.follow = lambda target, word: targets.append(target) or []
    for age_ms in (100.0, 101.0):  # the last pressure may have ended long ago
        measured = SimpleNamespace(pump_age_ms=age_ms, pressure_pa=7e3)
        line.drive.command(5e3, ControlWord.ENABLE_OPERATION, measured, 0.5)
    assert asked == [
        (5e3, 7e3, 17.1 * 0.5, 0.0),
        (5e3, pytest.approx(math.nan, nan_ok=True), 8.55, 0),
    ]
    assert (targets, resets) == ([2e3, 2e3], [])
    for word in set(ControlWord) - {ControlWord.ENABLE_OPERATION}:
        line.drive.command(5e3, word, measured, 0.5)
    assert resets == [2] * len(targets[2:])
    line.drive.stop()
    assert set(targets[2:]) == {0.0}


def test_a_drive_that_runs_on_after_stops_has_its_node_stopped():
    line = Line().run(400)
    line.node.sdo[0x6041].raw = 0x237
    line.run(2, ControlWord.ENABLE_OPERATION)
    assert line.drive.state is DriveState.OPERATION_ENABLED

    def told_the_node(word):
        return [frame.data for _ in range(6)
                for frame in line.drive.command(0.0, word, None, 0.0)
                if frame.can_id & 0x7FF == 0]  # fmt: skip

    assert told_the_node(ControlWord.ENABLE_OPERATION) == []
    assert told_the_node(ControlWord.QUICK_STOP) == [bytes((2, 5))] * 3


def reports_of(line, beat, status):
    """Reports after a heartbeat and a status word, in which nothing was commanded."""
    before = len(line.reports)
    for can_id, data in ((0x705, bytes((beat,))), (0x185, status.to_bytes(6, "little"))):
        line.drive.takers[can_id | STANDARD].take(Frame(can_id | STANDARD, data), line.now_ns)
    return [report for _, report in line.reports[before:]]


def test_what_is_no_state_of_a_node_in_operation_that_was_configured_does_not_count():
    assert reports_of(Line(), 5, 0x0637) == []
    line = Line().run(400)
    assert reports_of(line, 5, 0x0661) == []
    assert reports_of(line, 127, 0x0637) == []
    assert [each.state for each in reports_of(line, 5, 0x0637)] == [DriveState.OPERATION_ENABLED]
    assert line.drive.setup.done
    assert reports_of(line, 0, 0x0637) == []  # it boots up: all that it was told is gone
    assert not line.drive.setup.done


@pytest.mark.parametrize(
    ("bit", "says"), [(7, (False, True)), (11, (True, False)), (9, (False,) * 2)]
)
def test_bits_of_the_status_word_say_that_it_is_at_a_limit_or_warns(bit, says):
    (report,) = reports_of(Line().run(400), 5, 0x0037 | 1 << bit)
    assert (report.held_back, report.warns) == says


def at_limit(line, limited=True):
    """What is heard of a drive whose status word has, or lacks, the bit of a limit."""
    heard = DriveHeard(SimpleNamespace(takers={}, watched=()), None, pump=True, canopen=line.drive)
    status = 0x0037 | limited << 11
    for can_id, data in ((0x705, b"\x05"), (0x185, status.to_bytes(6, "little"))):
        line.drive.takers[can_id | STANDARD].take(Frame(can_id | STANDARD, data), line.now_ns)
    return heard.held_back, heard.at_speed


@pytest.mark.parametrize(
    ("share", "limited", "at_speed"),
    [(0.8, True, False), (-0.8, True, False), (0.95, True, True), (-0.95, True, True),
     (0.95, False, False)],
)  # fmt: skip
def test_its_limit_is_one_of_speed_where_the_rotor_turns_as_fast(share, limited, at_speed):
    """One bit of the status word is for all limits."""
    line = Line(loop=PressureLoop(PUMP, 0.02, 0.05, torque=True)).run(400)
    counts = round(share * PUMP.max_speed_rad_s / PROFILE["speed_rad_s_per_unit"])
    data = counts.to_bytes(4, "little", signed=True) + bytes(2) + bytes((4,))
    line.drive.takers[0x285 | STANDARD].take(Frame(0x285 | STANDARD, data), line.now_ns)
    assert at_limit(line, limited) == (limited, at_speed)


@pytest.mark.parametrize("flow_m3_s", [80.0, -80.0])
@pytest.mark.parametrize(
    ("share", "at_speed"), [(0.85, False), (0.95, True), (-0.95, False), (None, False)]
)
def test_a_speed_that_is_not_told_is_that_of_the_pressure_at_the_flow(share, at_speed, flow_m3_s):
    """Water outruns the rotor that turns its way; a reversed pump is told by its pressure."""
    line = Line(loop=PressureLoop(PUMP, 0.02, 0.05, torque=True)).run(400)
    pressure_pa = 0.0
    if share is not None:
        speed = math.copysign(share * PUMP.max_speed_rad_s, share * flow_m3_s)
        pressure_pa = pump_pressure(speed, flow_m3_s, PUMP.coefficients)
        assert (pressure_pa * flow_m3_s < 0) is True  # so at any of these speeds: outrun
    age_ms = 0.0 if share is not None else math.inf  # of a sensor that is silent nothing is known
    seen = SimpleNamespace(pump_age_ms=age_ms, pressure_pa=pressure_pa)
    line.now_ns += 200 * MS  # its second PDO is late
    line.drive.command(10e3, ControlWord.ENABLE_OPERATION, seen, flow_m3_s / 17.1)
    line.drive._speed_rad_s = math.nan
    assert at_limit(line) == (True, at_speed)


def test_a_measured_pdo_that_is_cut_short_is_damage():
    """Else nobody would know that speed, torque and mode are no longer told."""
    line = Line().run(400)
    heard = DriveHeard(SimpleNamespace(takers={}, watched=()), None, pump=True, canopen=line.drive)
    assert heard.valid
    for _ in range(5):
        line.drive.takers[0x285 | STANDARD].take(Frame(0x285 | STANDARD, bytes(6)), line.now_ns)
    assert not heard.valid


def test_who_hears_it_takes_its_frames_and_watches_both_its_messages():
    """No age tells of the silence of the second one."""
    line, routing = Line(), SimpleNamespace(takers={}, watched=("another",))
    heard = DriveHeard(routing, None, pump=True, canopen=line.drive)
    assert set(routing.takers) == set(line.drive.takers)
    assert heard.watched == line.drive.watched
    assert routing.watched == ("another", *line.drive.watched)
    assert heard.slow == (0x285 | STANDARD,)
    assert heard.words == line.drive.words == "node 5: is being configured"
    nobody = DriveHeard(SimpleNamespace(takers={}, watched=()), None, pump=False, canopen=None)
    assert (nobody.watched, nobody.slow, nobody.native, nobody.words) == ((), (), False, "")


def test_a_drive_in_another_mode_or_refused_is_at_fault():
    line = Line()
    heard = DriveHeard(SimpleNamespace(takers={}, watched=()), None, pump=True, canopen=line.drive)
    for refused in (True, False):
        report = DriveReport(DriveState.SWITCHED_ON, refused, False, False, 7.0)
        line.drive.deliver(report, 5 + refused)
        assert (heard.faulty, heard.heard_ns, heard.power_w) == (refused, 5 + refused, 7.0)
    for problem in ("node 5: another drive", ""):
        line.drive.setup.problem = problem
        line.drive.deliver(None, 9)
        assert (heard.faulty, heard.heard_ns) == (bool(problem), 5)


def test_an_echo_is_as_old_as_the_command_that_comes_back():
    line = Line().run(400)  # a command each 20 ms; what SYNC asks for is of the one before
    assert line.drive.echo_ns == 3960 * MS
    newest = line.drive.follow(0.0, ControlWord.SHUTDOWN)[-1]
    line.drive._heard(int.from_bytes(newest.data, "little"))
    assert line.drive.echo_ns == 3990 * MS  # the tick before


@pytest.mark.parametrize("longer", [-1, 1])
def test_a_frame_of_another_length_says_nothing(longer):
    line = Line().run(400)
    drive, reports = line.drive, len(line.reports)
    # status word of operation enabled, a speed, a boot-up
    for can_id, data in ((0x185, b"\x37\x06\0\0\0\0"), (0x285, bytes(range(7))), (0x705, b"\0")):
        data = data[:longer] if longer < 0 else data + b"\0"
        drive.takers[can_id | STANDARD].take(Frame(can_id | STANDARD, data), line.now_ns)
    assert (drive.state, drive.speed_rad_s) == (DriveState.SWITCH_ON_DISABLED, 0.0)
    assert len(line.reports) == reports
    assert drive.setup.done


def test_a_speed_that_came_long_ago_is_none():
    line = Line().run(400)
    assert line.drive.speed_rad_s == 0.0
    line.node.set_data(0x606C, 0, (500).to_bytes(4, "little"))
    line.node.set_data(0x6077, 0, (10).to_bytes(2, "little"))
    line.run(6)
    assert line.drive.speed_rad_s == 0.5
    assert line.reports[-1][1].power_w == pytest.approx(0.5 * 10 * 80 * 0.4 * 6.22)
    line.node.tpdo[2].enabled = False
    line.run(30)
    assert line.reports[-1][0] > line.now_ns - 60 * MS
    assert math.isnan(line.drive.speed_rad_s)


def test_a_drive_that_falls_out_of_operation_counts_no_longer_and_is_started_again():
    line = Line().run(400)
    line.node.nmt.state = "PRE-OPERATIONAL"
    line.run(8)
    last_ns = line.reports[-1][0]
    line.run(20)
    assert line.reports[-1][0] == last_ns
    line.run(400)
    assert line.node.nmt.state == "OPERATIONAL"
    assert line.reports[-1][0] > line.now_ns - 60 * MS


def test_an_emergency_of_the_drive_is_in_its_words_until_it_is_over():
    line = Line().run(400)
    assert "emergency" not in line.drive.words
    line.node.emcy.send(0x2310, 0x02)  # continuous over current, as canopen sends it
    line.run(2)
    assert line.drive.words.endswith("emergency 2310h (current), register 0x02")
    line.node.emcy.reset()
    line.run(2)
    assert "emergency" not in line.drive.words


def test_its_words_are_its_status_and_a_mode_that_it_was_not_put_in():
    line = Line().run(400)
    assert line.drive.words == "node 5: status word 0x0250"
    assert not line.reports[-1][1].refused
    line.node.set_data(0x6061, 0, bytes((3,)))
    line.run(4)
    assert line.drive.words == "node 5: status word 0x0250, mode 3 and not 4"
    assert line.reports[-1][1].refused


def test_a_drive_that_does_not_answer_and_one_on_its_way_are_said_to_be_so():
    line, no_answer = (
        Line(),
        "node 5: 1000h:0 can't be read .*no answer in time.*: look at its supp",
    )
    takes = line.drive.takers[STANDARD | 0x585]
    line.drive.takers[STANDARD | 0x585] = CalledTaker(lambda *_: None)
    assert re.match(no_answer, line.run(100).drive.words)
    assert {report for _, report in line.reports} <= {None}
    line.drive.takers[STANDARD | 0x585] = takes
    line.wire.said.append((0x705, b"\0"))  # boot-up
    assert line.run(4).drive.words == "node 5: is being configured"
    assert line.run(400).drive.words == "node 5: status word 0x0250"


def test_an_answer_that_is_lost_on_the_way_does_not_speak_against_the_device():
    line, seen = Line(), []
    takes = line.drive.takers[STANDARD | 0x585]

    def loses(frame, now_ns):
        seen.append(frame)
        if len(seen) % 3:
            takes.take(frame, now_ns)

    line.drive.takers[STANDARD | 0x585] = CalledTaker(loses)
    said = line.run(60).drive.words
    assert re.match("node 5: 1018h:. can't be read .*: look at .*what loses or delays frames", said)


def test_an_emergency_while_it_is_configured_is_in_its_words_until_it_is_started():
    line = Line().run(2)
    line.node.emcy.send(0x2310, 0x02)
    assert line.run(2).drive.words.endswith("emergency 2310h (current), register 0x02")
    assert not line.drive.setup.done
    assert "emergency" not in line.run(400).drive.words


class Told:
    """A configured drive of a plan, by hand-made frames."""

    def __init__(self, **changes):
        plan = DriveSection(**(PROFILE | changes)).plan(0, PUMP)
        self.drive, self.power_w = CanopenDrive(plan), math.nan
        self.drive.setup.done = True
        self.drive.deliver = lambda report, _: setattr(self, "power_w", report[-1])

    def take(self, cob, data, now_ns):
        self.drive.takers[cob | STANDARD].take(Frame(cob | STANDARD, data), now_ns)

    def command(self, target, now_ns):
        self.take(0x705, b"\x05", now_ns)
        self.drive.frames(now_ns)
        return self.drive.follow(target, ControlWord.ENABLE_OPERATION)[-1].data[2:]

    def echo_ns(self, status, demand, now_ns):
        self.take(0x185, status.to_bytes(2, "little") + demand, now_ns)
        return self.drive.echo_ns


@pytest.mark.parametrize("mode", ["torque", "velocity"])
@pytest.mark.parametrize(("synchronous", "older_ms"), [(True, 0), (False, 10)])
def test_an_echo_by_the_demand_is_as_old_as_the_command_and_the_phase(mode, synchronous, older_ms):
    """Without SYNC nobody knows when in its cycle of 20 ms the drive took the demand."""
    told = Told(mode=mode, echo="demand", synchronous=synchronous)
    first, second = told.command(2e3, 100 * MS), told.command(3e3, 120 * MS)
    assert first != second
    enabled, switched_on, now_ns = 0x0637, 0x0633, 130 * MS
    assert told.echo_ns(enabled, first, now_ns) == (100 - older_ms) * MS
    assert told.echo_ns(enabled, second, now_ns) == (120 - older_ms) * MS
    # what was never commanded, or is held on, is no newer echo
    for demand in (bytes(len(second)), second):
        assert told.echo_ns(enabled, demand, now_ns + 90 * MS) == (120 - older_ms) * MS
    # off it has no demand, and need not have one
    assert told.echo_ns(switched_on, bytes(len(second)), now_ns + 99 * MS) == now_ns + 99 * MS


@pytest.mark.parametrize(("mode", "known"), [("torque", True), ("velocity", False)])
def test_the_power_is_known_where_the_torque_is_in_newton_metres(mode, known):
    told = Told(mode=mode, echo="demand")
    demand = told.command(0.0, 0)
    told.take(0x285, (500).to_bytes(4, "little") + b"\x0a\0" + b"\x04", 0)
    told.echo_ns(0x0637, demand, 1)
    assert math.isfinite(told.power_w) is known
