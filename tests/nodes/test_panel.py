from itertools import pairwise

import pytest
from controller_bench import CATALOGUE

from utank_hil.canbus import ControllerStatus, Fault, Frame, Mode, OperatorCommand
from utank_hil.nodes.panel import Action, OperatorPanel, TimedAction

MS = 1_000_000
START_NS = 11_000_000_007


class Table:
    """A panel and a listener."""

    def __init__(self, script=()):
        self.panel = OperatorPanel(CATALOGUE, configuration_version=9, script=script)
        self._receiver = CATALOGUE.receiver(OperatorCommand)
        self._controller = CATALOGUE.transmitter(ControllerStatus)
        self.now_ns = START_NS
        self.heard: list[tuple[float, OperatorCommand]] = []

    @property
    def last(self):
        return self.heard[-1][1]

    def hear(self, mode):
        """A status of the controller."""
        status = ControllerStatus(mode, Fault.NONE, *(False,) * 5, 0.25, 3, 9)
        self.panel.receive(self._controller.frame(status), self.now_ns)

    def tick(self):
        for frame in self.panel.tick(self.now_ns):
            if frame.can_id == self._receiver.can_id:
                command = self._receiver.accept(frame)
                assert command is not None
                self.heard.append(((self.now_ns - START_NS) / MS, command))
        self.now_ns += self.panel.period_ns

    def run(self, ticks):
        for _ in range(ticks):
            self.tick()


def test_starts_disarmed_in_standby_and_repeats_every_200_ms():
    table = Table()
    table.run(21)
    assert {command for _, command in table.heard} == {
        OperatorCommand(Mode.STANDBY, False, False, False, False)
    }
    assert [time_ms for time_ms, _ in table.heard] == list(range(0, 2001, 200))


@pytest.mark.parametrize("ticks", [4, 5])
def test_change_is_sent_with_the_next_tick(ticks):
    table = Table()
    table.run(ticks)
    table.panel.press(Action.ARM)
    pressed_ms = (table.now_ns - START_NS) / MS
    table.tick()
    assert table.heard[-1] == (pressed_ms, OperatorCommand(Mode.ACTIVE, True, False, False, False))
    table.run(20)
    times = [time_ms for time_ms, _ in table.heard]
    assert max(later - earlier for earlier, later in pairwise(times)) <= 200


@pytest.mark.parametrize(
    ("action", "mode", "armed"),
    [
        (Action.STANDBY, Mode.STANDBY, False),
        (Action.PASSIVE, Mode.PASSIVE, False),
        (Action.DISARM, Mode.PASSIVE, False),
        (Action.STOP, Mode.STANDBY, False),
        (Action.RESET, Mode.ACTIVE, True),
        (Action.ARM, Mode.ACTIVE, True),
    ],
)
def test_buttons_of_an_armed_panel(action, mode, armed):
    table = Table()
    table.panel.press(Action.ARM)
    table.tick()
    table.hear(Mode.ACTIVE)
    table.panel.press(action)
    table.tick()
    assert (table.last.mode_request, table.last.arm) == (mode, armed)
    assert table.last.stop == (action is Action.STOP)
    assert table.last.reset == (action is Action.RESET)


def test_edge_button_is_held_for_half_a_second_and_then_let_go():
    table = Table()
    table.run(3)
    table.panel.press(Action.RESET)
    pressed_ms = (table.now_ns - START_NS) / MS
    table.run(20)
    held = [time_ms for time_ms, command in table.heard if command.reset]
    assert held[0] == pressed_ms
    assert held[-1] - pressed_ms < 500
    assert len(held) >= 3  # so that two may be lost
    let_go = next(time_ms for time_ms, command in table.heard if time_ms > held[-1])
    assert let_go - pressed_ms <= 500


@pytest.mark.parametrize("mode", [Mode.STANDBY, Mode.FAULT, Mode.INIT])
def test_stop_is_held_until_the_controller_answers_it(mode):
    table = Table()
    table.panel.press(Action.ARM)
    table.run(3)
    table.panel.press(Action.STOP)
    table.run(1)
    table.hear(mode)  # sent before the stop was heard
    table.run(100)
    assert table.last.stop
    for unanswered in (Mode.ACTIVE, Mode.PASSIVE):
        table.hear(unanswered)
        table.run(2)
        assert table.last.stop
    table.hear(mode)
    table.run(1)
    assert not table.last.stop


@pytest.mark.parametrize(("mode", "ticks"), [(Mode.STANDBY, 5), (Mode.INIT, 5), (Mode.FAULT, 11)])
def test_stop_is_held_for_half_a_second_though_it_is_answered(mode, ticks):
    """And as long as the ramp of a fault may take, which a stop cuts."""
    table = Table()
    table.run(1)
    table.panel.press(Action.STOP)
    for _ in range(ticks):
        table.tick()
        table.hear(mode)
        assert table.last.stop
    table.hear(mode)
    table.tick()
    assert not table.last.stop


def test_arm_is_refused_while_stop_is_held():
    table = Table()
    table.panel.press(Action.STOP)
    table.run(3)
    table.panel.press(Action.ARM)
    table.run(20)
    table.hear(Mode.STANDBY)
    table.run(20)
    assert not any(command.arm for _, command in table.heard)
    table.panel.press(Action.ARM)
    table.run(1)
    assert table.last.arm


@pytest.mark.parametrize("late_ticks", [0, 7])
def test_script_presses_in_order_from_when_the_controller_is_ready(late_ticks):
    table = Table(
        [TimedAction(1.05, Action.DISARM), TimedAction(0.0, Action.PASSIVE),
         TimedAction(0.5, Action.ARM)]
    )  # fmt: skip
    for _ in range(late_ticks):
        table.hear(Mode.INIT)
        table.tick()
    ready_ms = (table.now_ns - START_NS) / MS
    table.hear(Mode.STANDBY)
    table.run(20)
    changes = [table.heard[0], *(b for a, b in pairwise(table.heard) if a[1] != b[1])]
    assert [
        (time_ms - ready_ms, command.mode_request, command.arm)
        for time_ms, command in changes
        if command.mode_request is not Mode.STANDBY
    ] == [(0, Mode.PASSIVE, False), (500, Mode.ACTIVE, True), (1100, Mode.PASSIVE, False)]


def test_presses_of_one_time_come_in_the_order_given():
    for actions, armed in (
        ((Action.PASSIVE, Action.ARM), True),
        ((Action.ARM, Action.PASSIVE), False),
    ):
        table = Table([TimedAction(0.0, action) for action in actions])
        table.hear(Mode.STANDBY)
        table.run(2)
        assert table.last.arm == armed


def test_script_waits_for_ever_for_a_controller_that_is_not_there():
    table = Table([TimedAction(0.0, Action.ARM)])
    table.run(100)
    assert not table.last.arm


def test_controllers_status_is_kept_and_a_damaged_one_is_not():
    table = Table()
    sender = CATALOGUE.transmitter(ControllerStatus)
    status = ControllerStatus(Mode.ACTIVE, Fault.NONE, True, False, False, False, False, 0.25, 3, 9)
    frame = sender.frame(status)
    table.panel.receive(frame, START_NS)
    assert table.panel.status == status
    table.panel.receive(Frame(frame.can_id, bytes(8)), START_NS)
    table.panel.receive(Frame(frame.can_id + 1, frame.data), START_NS)
    assert table.panel.status == status


def test_arming_again_after_a_fault_is_another_rising_edge_in_any_two_of_three_frames():
    table = Table()
    table.panel.press(Action.ARM)
    for mode in (Mode.STANDBY, Mode.ACTIVE, Mode.FAULT, Mode.STANDBY):
        table.hear(mode)
        table.run(5)
        assert table.last.arm
    again_ms = (table.now_ns - START_NS) / MS
    table.panel.press(Action.ARM)
    table.run(10)
    arms = [(time_ms - again_ms, sent.arm) for time_ms, sent in table.heard if time_ms >= again_ms]
    low = [time_ms for time_ms, arm in arms if not arm]
    assert len(low) >= 3
    assert [arm for _, arm in arms] == sorted(arm for _, arm in arms)
    assert table.last == OperatorCommand(Mode.ACTIVE, True, False, False, False)


def test_arm_pressed_while_active_does_not_disarm():
    table = Table()
    for _ in range(2):
        table.panel.press(Action.ARM)
        table.hear(Mode.ACTIVE)
        table.run(10)
    assert all(sent.arm for _, sent in table.heard)


@pytest.mark.parametrize(("age_ms", "arm"), [(300, True), (301, False)])
def test_who_takes_the_command_adopts_only_a_mode_of_now(age_ms, arm):
    table = Table()
    table.hear(Mode.ACTIVE)
    table.now_ns += age_ms * MS
    table.panel.press(Action.TAKE)
    table.tick()
    assert table.last.arm is arm


@pytest.mark.parametrize("found", [Mode.STANDBY, Mode.INIT, Mode.FAULT])
def test_passive_is_asked_for_again_by_a_change_where_the_controller_has_left_it(found):
    table = Table()
    table.panel.press(Action.PASSIVE)
    table.run(10)
    table.hear(Mode.PASSIVE)
    table.panel.press(Action.PASSIVE)  # it is there
    table.run(10)
    assert {command.mode_request for _, command in table.heard} == {Mode.PASSIVE}
    table.hear(found)
    table.panel.press(Action.DISARM)  # nor does that switch the drive on again
    table.run(10)
    assert table.last.mode_request is Mode.PASSIVE
    pressed_ms = (table.now_ns - START_NS) / MS
    table.panel.press(Action.PASSIVE)
    table.run(10)
    asked = [each for each in table.heard if each[0] >= pressed_ms]
    assert {command.mode_request for at, command in asked if at < pressed_ms + 500} == {
        Mode.STANDBY
    }
    table.run(10)
    assert table.last.mode_request is Mode.PASSIVE
    # who arms meanwhile is not made to wait
    table.panel.press(Action.PASSIVE)
    table.tick()
    table.panel.press(Action.ARM)
    table.tick()
    assert (table.last.mode_request, table.last.arm) == (Mode.ACTIVE, True)
