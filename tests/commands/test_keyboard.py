"""The keyboard of the panel: obeys at once, on a pipe too, and shows the controller in words."""

import contextlib
import errno
import json
import os
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

import pytest
from ports import QuietBus

from utank_hil.canbus import (
    Alarm,
    AlarmState,
    ControllerStatus,
    Fault,
    Mode,
    OperatorCommand,
    Station,
    load_catalogue,
)
from utank_hil.commands.panel import LEAVE_NS, Keyboard, panel
from utank_hil.nodes.panel import SILENT_NS, Action, OperatorPanel
from utank_hil.safety.faults import fault_text

CATALOGUE = load_catalogue()
STEP_NS = 100_000_000


@dataclass
class Table:
    """A panel with its keyboard on a pipe, and the controller that it hears."""

    terminal: bool = False
    station: Station = Station.OPERATOR
    said: list[str] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.reading, self.writing = os.pipe()
        self.node = OperatorPanel(CATALOGUE, configuration_version=9, station=self.station)
        self.keyboard = Keyboard(self.node, self.reading, self.said.append, terminal=self.terminal)
        self.now_ns = 10 * STEP_NS
        self.status = CATALOGUE.transmitter(ControllerStatus)
        self.alarm = CATALOGUE.transmitter(Alarm)

    def type(self, text: str) -> None:
        os.write(self.writing, text.encode())

    def look(self, *, signalled: bool = False) -> bool:
        """A look of the keyboard and a tick of the panel."""
        left = self.keyboard.look(self.now_ns, signalled=signalled)
        if not left:
            list(self.node.tick(self.now_ns))
        self.now_ns += STEP_NS
        return left

    def hear(self, mode: Mode, fault: Fault = Fault.NONE, station: Station | None = None) -> None:
        status = ControllerStatus(mode, fault, *(False,) * 5, 0.25, 3, 9, station=station)
        self.node.receive(self.status.frame(status), self.now_ns)

    def hear_alarm(self, code: Fault, state: AlarmState, alarms: int = 1) -> None:
        frame = self.alarm.frame(Alarm(state, code, 0, alarms, 1, 0.0))
        self.node.receive(frame, self.now_ns)

    @property
    def order(self) -> OperatorCommand:
        assert self.node._sent is not None
        return self.node._sent


@pytest.fixture
def table() -> Iterator[Table]:
    made = Table()
    yield made
    os.close(made.reading)
    if made.writing >= 0:
        os.close(made.writing)


def test_lines_that_come_together_are_all_obeyed_at_once(table: Table) -> None:
    table.hear(Mode.STANDBY)
    table.look()
    table.said.clear()
    table.type("arm\npassive\nforbid\nstop\n")
    table.look()
    assert table.order.stop
    assert not table.order.arm
    assert table.order.forbid_retuning
    assert table.said == ["arm", "passive", "forbid", "stop"]


def test_a_line_is_obeyed_when_it_is_whole_or_the_pipe_is_closed(table: Table) -> None:
    table.type("sto")
    table.look()
    assert table.said == []
    table.type("p")
    os.close(table.writing)
    table.writing = -1
    for _ in range(3):
        assert not table.look()  # a closed pipe only ends the typing
    assert table.order.stop
    assert table.said == ["stop", "the input has ended; what was asked for stays, Ctrl-C leaves"]


@pytest.mark.parametrize("signalled", [False, True])
@pytest.mark.parametrize("gone", [False, True])
def test_end_of_a_terminal_stops_and_leaves(
    gone: bool, signalled: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Ctrl-D, or a connection that was lost: a panel that hears nobody must not stay armed."""
    table = Table(terminal=True)
    table.hear(Mode.STANDBY)
    table.type("arm\n")
    table.look()
    table.hear(Mode.ACTIVE)
    table.look()
    assert table.order.arm
    if gone:

        def fail(*_: object) -> bytes:
            raise OSError(errno.EIO, "Input/output error")

        monkeypatch.setattr(os, "read", fail)
    os.close(table.writing)
    assert not table.look(signalled=signalled)
    assert table.order.stop
    assert not table.order.arm
    assert table.said[-1] == "stop"
    for _ in range(10):
        table.hear(Mode.STANDBY)
        if table.look(signalled=signalled):
            break
    else:
        raise AssertionError("it stays")


@pytest.mark.evidence("ctrl-d")
@pytest.mark.slow
@pytest.mark.parametrize("how", ["ctrl-d", "closed"])
def test_the_command_sends_its_stop_before_it_ends_with_its_terminal(how: str) -> None:
    """With the terminal comes SIGHUP, and the input ends."""
    script = Path(__file__).with_name("panel_on_a_terminal.py")
    done = subprocess.run(
        [sys.executable, script, how], capture_output=True, text=True, timeout=60, check=True
    )
    armed_frames, stops, mode, armed = done.stdout.split()
    assert int(armed_frames) > 0
    assert int(stops) > 0
    assert (mode, armed) == ("STANDBY", "False")


@pytest.mark.slow
def test_a_terminal_that_is_held_up_holds_no_stop_back() -> None:
    """Ctrl-S, and it shows nothing until Ctrl-Q: what is said of the stop would wait for that."""
    script = Path(__file__).with_name("panel_on_a_terminal.py")
    done = subprocess.run(
        [sys.executable, script, "held"], capture_output=True, text=True, timeout=60, check=True
    )
    assert done.stdout.split()[0] == "stopped"


def test_a_reset_that_is_refused_is_said_with_what_lasts(table: Table) -> None:
    for refused in (True, False):
        table.hear(Mode.FAULT, Fault.MOTION_SILENT)
        table.hear_alarm(Fault.MOTION_SILENT, AlarmState.ACTIVE_ACKNOWLEDGED)
        table.look()
        table.said.clear()
        table.type("reset\n")
        for _ in range(15):
            table.hear(Mode.FAULT if refused else Mode.STANDBY, Fault.MOTION_SILENT)
            table.hear_alarm(Fault.MOTION_SILENT, AlarmState.ACTIVE_ACKNOWLEDGED)
            table.look()
        said = [line for line in table.said if "REFUSED" in line]
        assert said == ["reset REFUSED while this lasts: MOTION_SILENT"] * refused


@pytest.mark.parametrize(
    ("typed", "said"),
    [
        ("d", "disarm"),
        ("  STANDBY ", "standby"),
        ("acc", "accept"),
        ("a", "'a' is arm or accept"),
        ("re", "'re' is reset or retune"),
        ("fly", "'fly' is no action; help lists them"),
        *((word, "stop") for word in ("s", "st", "sto", "stopp", "stop!", "stop now")),
        ("sta", "standby"),
    ],
)
def test_words_may_be_cut_short_where_that_is_clear(table: Table, typed: str, said: str) -> None:
    table.type(typed + "\n")
    table.look()
    assert table.said == [said]


def test_every_action_has_its_word_and_help_names_it(table: Table) -> None:
    table.type("help\n")
    table.look()
    (text,) = table.said
    assert all(action.value in text for action in Action)


@pytest.mark.parametrize("terminal", [False, True])
def test_enter_alone_stops_on_a_terminal_only(terminal: bool) -> None:
    table = Table(terminal=terminal)
    table.type("\n")
    table.look()
    assert table.order.stop == terminal


def test_who_leaves_after_a_stop_waits_for_its_answer(table: Table) -> None:
    table.type("stop\nquit\n")
    for _ in range(7):
        assert not table.look()
    table.hear(Mode.STANDBY)
    assert table.look()


def test_a_signal_leaves_at_once_and_after_a_stop_when_that_is_answered(table: Table) -> None:
    assert table.look(signalled=True)
    other = Table()
    other.type("stop\n")
    for _ in range(7):
        assert not other.look(signalled=True)
    assert other.order.stop
    other.hear(Mode.STANDBY)
    assert other.look(signalled=True)


@pytest.mark.parametrize("signalled", [False, True])
def test_who_leaves_does_not_wait_for_ever(table: Table, signalled: bool) -> None:
    table.type("stop\n" if signalled else "stop\nquit\n")
    begun_ns = table.now_ns
    while not table.look(signalled=signalled):
        assert table.now_ns - begun_ns <= LEAVE_NS + STEP_NS
    assert table.now_ns - begun_ns >= LEAVE_NS


def test_quit_alone_leaves_at_once_and_after_a_press_when_that_is_sent(table: Table) -> None:
    table.type("disarm\nquit\n")
    assert not table.look()
    assert table.order.mode_request is Mode.PASSIVE
    assert table.look()


def test_status_is_said_in_words_when_it_changes_and_silence_too(table: Table) -> None:
    for _ in range(3):
        table.hear(Mode.FAULT, Fault.LEVEL_LIMIT)
        table.look()
    assert table.said == [f"controller: FAULT, {fault_text(Fault.LEVEL_LIMIT)}"]
    for _ in range(SILENT_NS // STEP_NS + 1):
        table.look()
    assert table.said[1:] == ["controller: SILENT"]
    table.hear(Mode.STANDBY)
    table.look()
    assert table.said[2:] == ["controller: STANDBY"]


class InFault(QuietBus):
    """An interface on which a controller says that it is in FAULT, and why."""

    def receive(self):
        level = (Fault.LEVEL_LIMIT, *(False,) * 5, 0.25, 3, 9)
        status = CATALOGUE.transmitter(ControllerStatus).frame(ControllerStatus(Mode.FAULT, *level))
        alarm = Alarm(AlarmState.ACTIVE_UNACKNOWLEDGED, Fault.LEVEL_LIMIT, 0, 1, 1, 0.0)
        return [status, CATALOGUE.transmitter(Alarm).frame(alarm)]


def test_what_was_heard_last_is_one_json_object(monkeypatch, capsys):
    monkeypatch.setattr("utank_hil.commands.panel.SocketCanPort", InFault)
    monkeypatch.setattr(sys, "stdin", None)
    panel(Path("configs/ships/thesis_first.yaml"), "can0", 0.3, json_=True)
    assert json.loads(capsys.readouterr().out) == {
        "station": "OPERATOR",
        "mode": "FAULT",
        "fault": "LEVEL_LIMIT",
        "alarms": [{"code": "LEVEL_LIMIT", "state": "ACTIVE_UNACKNOWLEDGED"}],
    }


def test_controller_that_was_never_heard_is_silent(table: Table) -> None:
    for _ in range(2 * SILENT_NS // STEP_NS):
        table.look()
    assert table.said == ["controller: SILENT"]


def test_pipe_that_is_never_empty_holds_nothing_up(table: Table) -> None:
    os.set_blocking(table.writing, False)
    for look in range(100):
        with contextlib.suppress(BlockingIOError):
            while True:
                os.write(table.writing, b"x" * 4096)
        assert not table.look()
        assert len(table.keyboard._typed) < 1000, look
    table.hear(Mode.STANDBY)
    os.read(table.reading, 1 << 20)
    table.type("\nstop\n")
    table.look()
    assert table.order.stop


def test_alarms_are_said_with_words_and_remedy_and_when_they_are_over(table: Table) -> None:
    code = Fault.LEVEL_LIMIT
    for state in (
        AlarmState.ACTIVE_UNACKNOWLEDGED,
        AlarmState.ACTIVE_UNACKNOWLEDGED,
        AlarmState.RECTIFIED_UNACKNOWLEDGED,
    ):
        table.hear_alarm(code, state)
        table.look()
    table.hear_alarm(Fault.NONE, AlarmState.NORMAL, alarms=0)
    table.look()
    assert table.said == [
        f"ALARM {fault_text(code)} accept?",
        f"alarm, its cause gone, {fault_text(code)} accept?",
        f"alarm over: {code.name}",
    ]


def test_an_alarm_that_is_not_repeated_is_over(table: Table) -> None:
    table.hear_alarm(Fault.LEVEL_LIMIT, AlarmState.ACTIVE_ACKNOWLEDGED, alarms=2)
    table.hear_alarm(Fault.TANK_SILENT, AlarmState.ACTIVE_ACKNOWLEDGED, alarms=2)
    assert len(table.node.alarms) == 2
    for _ in range(20):
        table.now_ns += STEP_NS
        table.hear_alarm(Fault.TANK_SILENT, AlarmState.ACTIVE_ACKNOWLEDGED)
    assert [alarm.code for alarm in table.node.alarms] == [Fault.TANK_SILENT]


def test_arm_is_refused_in_words_while_no_controller_is_heard(table: Table) -> None:
    table.type("arm\n")
    table.look()
    table.hear(Mode.STANDBY)
    table.look()
    assert not table.order.arm
    assert "no controller" in table.said[0]
    table.type("arm\n")
    table.look()
    assert table.order.arm


def test_arm_is_refused_in_words_while_a_stop_is_not_answered(table: Table) -> None:
    table.hear(Mode.ACTIVE)
    table.type("stop\n")
    table.look()
    table.type("arm\n")
    table.look()
    assert "not answered the stop" in table.said[-1]


def test_a_station_without_the_command_may_stop_accept_and_forbid_retuning_and_nothing_else() -> (
    None
):
    table = Table(station=Station.OPERATOR_2)
    table.hear(Mode.ACTIVE, station=Station.OPERATOR)
    table.type("arm\n")
    table.look()
    assert not table.order.arm
    assert "take" in table.said[-1]
    table.type("accept\nstop\nforbid\n")
    table.look()
    assert table.order.stop
    assert table.order.acknowledge
    assert table.order.forbid_retuning
    table.type("permit\n")
    table.look()
    assert not table.order.forbid_retuning


@pytest.mark.parametrize(
    ("mode", "armed"), [(Mode.ACTIVE, True), (Mode.PASSIVE, False), (Mode.FAULT, False)]
)
def test_who_takes_the_command_goes_on_with_what_the_controller_does(
    mode: Mode, armed: bool
) -> None:
    table = Table(station=Station.OPERATOR_2)
    table.hear(mode, station=Station.OPERATOR)
    table.type("take\n")
    table.look()
    assert table.order.take_command
    assert table.order.arm == armed
    assert table.order.mode_request is (Mode.STANDBY if mode is Mode.FAULT else mode)
