"""What a panel orders is heard: a stop from any intact frame, a request from accepted ones only."""

import pytest
from controller_bench import CATALOGUE, MS, ControllerBench
from hypothesis import given
from hypothesis import strategies as st

from utank_hil.canbus import Frame, Mode, OperatorCommand, RetuningOrder
from utank_hil.canbus.endpoints import MAX_LOST
from utank_hil.nodes.stations import Orders

QUIET = OperatorCommand(Mode.ACTIVE, True, False, False, False)


def corrupted(frame):
    return Frame(frame.can_id, frame.data[:-1] + bytes((frame.data[-1] ^ 1,)))


class Line:
    """A panel's transmitter and the orders that hear it."""

    def __init__(self):
        self.sender = CATALOGUE.transmitter(OperatorCommand)
        self.orders = Orders(CATALOGUE.receiver(OperatorCommand))
        self.now_ns = 0

    def say(self, *, lost=0, corrupt=False, **changes):
        """Send frames of which the last arrives, 200 ms apart."""
        for _ in range(lost + 1):
            frame = self.sender.frame(QUIET._replace(**changes))
            self.now_ns += 200 * MS
        order = self.orders.accept(corrupted(frame) if corrupt else frame)
        if order is not None:
            self.orders.obey(order, self.now_ns)


@pytest.mark.parametrize("lost", range(17))
def test_stop_and_disarm_are_heard_once_from_any_intact_frame(lost):
    line = Line()
    line.say()
    line.orders.take()
    line.say(lost=lost, stop=True, arm=False)
    wishes = line.orders.take()
    assert wishes.stop
    assert not wishes.armed
    if 3 < lost < 16:  # not accepted, so it counts once and is no state of the button
        wishes = line.orders.take()
        assert not wishes.stop
        assert wishes.armed


@pytest.mark.parametrize("mode", [*(mode for mode in Mode if mode is not Mode.ACTIVE), None])
@pytest.mark.parametrize("lost", [0, 5])
def test_another_mode_disarms_from_any_intact_frame(lost, mode):
    line = Line()
    line.say()
    assert line.orders.take().armed
    line.say(lost=lost, mode_request=mode)
    assert not line.orders.take().armed


def test_what_is_pressed_in_the_first_frame_is_no_edge():
    line = Line()
    line.say(arm=True, reset=True, retune=True, undo=True)
    wishes = line.orders.take()
    assert not wishes.arm_edge
    assert not wishes.reset_edge
    assert line.orders.take_retuning() == RetuningOrder()


@pytest.mark.parametrize("counters", range(16))
@pytest.mark.parametrize("claims", [False, True])
def test_a_panel_that_starts_anew_with_its_bits_set_presses_nothing(counters, claims):
    """However short it was away: within 400 ms its third frame is accepted, out of sequence."""
    line = Line()
    line.say(arm=False, mode_request=Mode.STANDBY)
    line.orders.take()
    line.now_ns -= 190 * MS
    line.sender = CATALOGUE.transmitter(OperatorCommand)
    first = line.sender.frame(QUIET).data[1] + 1
    for _ in range(counters):
        line.sender.frame(QUIET)
    if claims:
        line.orders.begin_anew()
    heard = line.orders.receiver.counter
    assert heard is not None
    in_sequence = (first + counters - heard - 1) % 16 <= MAX_LOST
    for _ in range(6):
        line.now_ns -= 195 * MS
        line.say(reset=True, take_command=True, mode_request=Mode.PASSIVE)
        if claims or not in_sequence:
            wishes = line.orders.take()
            assert not wishes.arm_edge
            assert not wishes.reset_edge
            assert not wishes.passive_edge
            assert not line.orders.takes_command
    line.say(arm=False)
    line.say()
    assert line.orders.take().arm_edge


@pytest.mark.parametrize(
    ("before", "bits", "armed", "edge"),
    [
        (False, [False, True], True, True),  # a frame of the cycle, and the press at once
        (False, [True, False], False, True),
        (False, [True, False, True], False, True),
        (True, [False, True], False, True),  # disarmed and armed again: disarmed
        (True, [True, False], False, False),
    ],
)
def test_a_frame_in_which_nothing_was_released_yet_takes_no_press_back(before, bits, armed, edge):
    line = Line()
    line.say(arm=False)
    line.say(arm=before)
    line.orders.take()
    for bit in bits:
        line.say(arm=bit)
    wishes = line.orders.take()
    assert (wishes.armed, wishes.arm_edge) == (armed, edge)


@pytest.mark.parametrize("asked", [Mode.STANDBY, Mode.ACTIVE, None])
def test_asking_for_passive_is_an_edge(asked):
    line = Line()
    line.say(mode_request=Mode.PASSIVE)
    assert not line.orders.take().passive_edge
    line.say(mode_request=asked)
    line.say(mode_request=Mode.ACTIVE)
    line.say(mode_request=asked)
    assert not line.orders.take().passive_edge
    line.say(mode_request=Mode.PASSIVE)
    assert line.orders.take().passive_edge
    line.say(mode_request=Mode.PASSIVE)
    assert not line.orders.take().passive_edge


def test_arm_and_stop_hold_from_frame_to_frame():
    line = Line()
    assert line.orders.take_retuning() == RetuningOrder()  # nothing was heard yet
    for bits in ({"arm": False}, {"stop": True}, {}):
        line.say(**bits)
        for _ in range(3):
            wishes = line.orders.take()
            assert wishes.armed == ("arm" not in bits)
            assert wishes.stop == ("stop" in bits)


def test_without_the_arm_bit_nothing_is_an_edge_of_it():
    line = Line()
    line.say(arm=False)
    line.say(arm=False)
    assert not line.orders.take().arm_edge


def test_an_alarm_is_accepted_once_a_press():
    line = Line()
    line.say(acknowledge=True, acknowledge_code=7)  # pressed nobody knows when
    assert line.orders.take_accepted() == []
    line.say(acknowledge=False)
    for _ in range(2):
        line.say(acknowledge=True, acknowledge_code=7)
        line.say(acknowledge=True, acknowledge_code=7)
        assert line.orders.take_accepted() == [7]
        line.say(acknowledge=False)
    assert line.orders.take_accepted() == []


@pytest.mark.parametrize(("late_ms", "edge"), [(0, True), (1, False)])
def test_an_edge_and_a_held_stop_count_for_four_cycles(late_ms, edge):
    line = Line()
    line.say(arm=False, stop=True)
    line.now_ns += late_ms * MS
    recent = line.orders.recent(line.now_ns + 800 * MS)
    assert (recent is not None and recent.stop) == edge
    line.say(lost=3, arm=True)
    assert line.orders.take().arm_edge == edge


def test_a_mode_that_is_none_is_standby():
    line = Line()
    line.say(mode_request=Mode.ACTIVE)
    line.say(mode_request=None)
    assert line.orders.requested_mode is Mode.STANDBY


def test_a_damaged_stop_is_not_heard():
    line = Line()
    line.say()
    line.say(corrupt=True, stop=True, arm=False)
    wishes = line.orders.take()
    assert wishes.armed
    assert not wishes.stop


def test_what_is_let_go_between_two_looks_is_heard():
    line = Line()
    for pressed in ({"arm": False}, {"stop": True}, {"reset": True}):
        line.say()
        line.orders.take()
        line.say(**pressed)
        line.say()
        wishes = line.orders.take()
        assert wishes.armed == ("arm" not in pressed)
        assert wishes.stop == ("stop" in pressed)
        assert wishes.reset_edge == ("reset" in pressed)
        assert wishes.arm_edge == ("arm" in pressed)


@pytest.mark.parametrize("frames_a_sample", [1, 2, 3, 10])
def test_every_press_for_the_retuning_is_heard_however_seldom_the_law_looks(frames_a_sample):
    line = Line()
    line.say()
    assert line.orders.take_retuning() == RetuningOrder()
    for button in ("retune", "undo", "forbid_retuning"):
        for at in range(frames_a_sample):
            heard = []
            for _ in range(2):
                for number in range(frames_a_sample):
                    line.say(**{button: number == at and not heard})
                    line.orders.take()  # the supervisor looks every tick
                heard.append(line.orders.take_retuning())
            name = "forbidden" if button == "forbid_retuning" else button
            assert heard == [RetuningOrder(**{name: True}), RetuningOrder()]


def test_retuning_stays_forbidden_while_the_button_is_down():
    line = Line()
    line.say(forbid_retuning=True)
    for _ in range(3):
        assert line.orders.take_retuning().forbidden
    line.say(lost=9, forbid_retuning=False)
    assert line.orders.take_retuning().forbidden


@given(st.integers(0, 40), st.booleans())
def test_what_was_pressed_in_a_gap_that_the_counter_does_not_bridge_is_no_edge(lost, reset):
    line = Line()
    line.say(arm=False)
    line.orders.take()
    line.say(lost=lost, arm=True, reset=reset)
    for _ in range(3):
        line.say(arm=True, reset=reset)
    wishes = line.orders.take()
    assert wishes.armed
    bridged = lost <= 3
    assert wishes.arm_edge == bridged
    assert wishes.reset_edge == (bridged and reset)


@pytest.mark.parametrize("lost", [0, 3, 4, 9, 20])
@pytest.mark.parametrize("restart", [False, True])
def test_stop_after_lost_frames_acts_with_the_first_that_arrives(lost, restart):
    bench = ControllerBench()
    bench.drive_at(40e3)
    bench.spoil = lambda kind, frame: () if kind is OperatorCommand else (frame,)
    bench.run(200 * lost)
    if restart:
        bench.restart_panel()
    bench.order_is(stop=True, arm=False, mode_request=Mode.STANDBY)  # lost, too
    bench.spoil = lambda kind, frame: (frame,)
    bench.send(bench.encode(bench.order))
    bench.tick()
    bench.tick()
    assert bench.pressure_pa == 0.0
    assert bench.node.mode is Mode.STANDBY


def test_disarming_out_of_sequence_ramps_down_and_the_old_arm_bit_does_not_arm_again():
    bench = ControllerBench()
    bench.drive_at(40e3)
    for _ in range(5):
        bench.encode(bench.order)  # lost
    bench.send(bench.encode(bench.order._replace(arm=False)))
    bench.tick()
    assert bench.node.mode is Mode.PASSIVE
    bench.run(1000)  # the arm bit is set in all that follows
    assert bench.node.mode is Mode.PASSIVE
    assert bench.pressure_pa == 0.0


def test_accepted_frames_that_say_something_new_are_counted():
    line = Line()
    for said, changes in (({}, 0), ({}, 0), ({"reset": True}, 1), ({"reset": True}, 1), ({}, 2)):
        line.say(**said)
        assert line.orders.receiver.changes == changes
    line.say(stop=True, corrupt=True)
    assert line.orders.receiver.changes == 2
