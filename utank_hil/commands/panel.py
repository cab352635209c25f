"""``utank-hil panel``: an operator panel at the keyboard, or in a browser."""

import os
import select
import socket
import sys
import time
from collections.abc import Callable
from contextlib import ExitStack, closing
from pathlib import Path
from typing import Annotated, Final

from utank_hil import canbus
from utank_hil.base.tick import TICK_NS
from utank_hil.canbus.ports import open_port
from utank_hil.canbus.socketcan import SocketCanPort
from utank_hil.commands.lines import printed_lines
from utank_hil.commands.web_panel.desk import LASTING, Desk, Instruments
from utank_hil.commands.web_panel.server import ServerProcess
from utank_hil.configuration.vessel import Vessel
from utank_hil.console import common
from utank_hil.console.exit_codes import ExitCode
from utank_hil.console.loops import opened
from utank_hil.nodes.panel import SILENT_NS, Action, OperatorPanel
from utank_hil.runners import Node, RealTimeLoop
from utank_hil.safety.faults import fault_text

ANSWER_NS: Final = 1_000_000_000
"""Time within which a reset is answered: 500 ms for the button, 100 ms for the status."""
LEAVE_NS: Final = 3_000_000_000  #: Time that a panel waits for the answer to a stop before it ends.
HELP: Final = """\
  arm, disarm          take charge; ramp to zero, pump enabled and passive
  stop                 zero at once, as what looks like it: s, stop!; on a terminal Enter alone
  standby, passive     pump off; pump enabled at zero pressure
  accept, reset        accept the alarms; leave FAULT when its cause is gone
  take                 take the command from the other station
  retune, undo         identify the ship and design anew; back to the law before
  forbid, permit       no retuning; retuning again, where no other station forbids it
  help, quit           Words may be cut short: d for disarm."""

_READ_BYTES: Final = 4096  #: Of a terminal's line.
_STOP: Final = Action.STOP.value
_LONGEST_LINE: Final = 256  #: Longer than any word.
_WORDS: Final = (*(action.value for action in Action), "help", "quit")
_UNACCEPTED: Final = (
    canbus.AlarmState.ACTIVE_UNACKNOWLEDGED,
    canbus.AlarmState.RECTIFIED_UNACKNOWLEDGED,
)


class Keyboard:
    """Reads words from a terminal or a pipe between two ticks, and shows changes.

    The end of a pipe only ends the input; that of a terminal stops the controller and ends the
    panel. `say` shows a line. If a person types (`terminal`), Enter alone stops, and a new alarm
    rings.
    """

    def __init__(
        self, node: OperatorPanel, descriptor: int, say: Callable[[str], None], *, terminal: bool
    ) -> None:
        self._node = node
        self._descriptor = descriptor
        self._say = say
        self._terminal = terminal
        self._open = True
        self._typed = b""
        self._shown = ""
        self._silent = True
        self._began_ns: int | None = None
        self._leave_ns: int | None = None
        self._now_ns = 0
        self._reset_ns: int | None = None
        self._alarms: dict[canbus.Fault | None, canbus.AlarmState | None] = {}

    def look(self, now_ns: int, *, signalled: bool = False) -> bool:
        """Execute new lines and show changes; return whether to leave.

        A signal (`signalled`) acts like ``quit``, so that the stop of a closed terminal, whose
        input has ended, is still sent.
        """
        was_open, self._now_ns = self._open, now_ns
        lines = self._lines()
        self._show(now_ns)
        for line in lines:
            if self._obey(line) and self._leave_ns is None:
                self._leave_ns = now_ns + LEAVE_NS
        if was_open and not self._open:
            if self._terminal:  # without input a panel must not stay armed
                self._press(Action.STOP)
                self._leave_ns = self._leave_ns or now_ns + LEAVE_NS
            elif self._leave_ns is None:
                self._say("the input has ended; what was asked for stays, Ctrl-C leaves")
        if signalled and self._leave_ns is None:
            self._leave_ns = now_ns + LEAVE_NS
        self._tell_of_reset(now_ns)
        # The last press must arrive: a stop is kept until it is answered.
        return self._leave_ns is not None and (not self._node.busy or now_ns >= self._leave_ns)

    def _lines(self) -> list[str]:
        """Return the complete lines so far; the end of a pipe completes one.

        Python's own buffer would hold a line back until more can be read. There is one read per
        look, so that a pipe that is never empty does not block the panel.
        """
        if self._open and select.select([self._descriptor], [], [], 0)[0]:
            try:
                data = os.read(self._descriptor, _READ_BYTES)
            except OSError:  # The terminal is gone.
                data = b""
            self._open = bool(data)
            self._typed += data
        *lines, begun = self._typed.split(b"\n")
        # A line longer than any word is cut to its beginning.
        self._typed = begun[:_LONGEST_LINE] if self._open else b""
        if begun and not self._open:
            lines.append(begun)
        return [line.decode(errors="replace").strip().lower() for line in lines]

    def _tell_of_reset(self, now_ns: int) -> None:
        """Report that a reset was refused: the controller is still in FAULT."""
        if self._reset_ns is None or now_ns - self._reset_ns < ANSWER_NS:
            return
        self._reset_ns = None
        status = self._node.status
        if status is not None and status.mode is canbus.Mode.FAULT and not self._silent:
            there = [a.code.name for a in self._node.alarms if a.code and a.state in LASTING]
            self._say(f"reset REFUSED while this lasts: {', '.join(there)}")

    def _obey(self, word: str) -> bool:
        if not word:
            if self._terminal:
                self._press(Action.STOP)
            return False
        found = [word] if word in _WORDS else [each for each in _WORDS if each.startswith(word)]
        if word.startswith(_STOP) or _STOP in found:  # hasty spellings stop: st, stopp, stop!
            self._press(Action.STOP)
        elif len(found) != 1:
            self._say(f"{word!r} is {' or '.join(found) or 'no action; help lists them'}")
        elif found[0] == "help":
            self._say(HELP)
        elif found[0] == "quit":
            return True
        else:
            self._press(Action(found[0]))
        return False

    def _press(self, action: Action) -> None:
        refusal = self._node.why_not(action, self._now_ns)
        self._say(refusal or action.value)
        if not refusal:
            self._node.press(action)
            if action is Action.RESET:
                self._reset_ns = self._now_ns

    def _show(self, now_ns: int) -> None:
        node, status = self._node, self._node.status
        if self._began_ns is None:
            self._began_ns = now_ns
        self._silent = node.silent(now_ns)
        if status is not None or now_ns - self._began_ns > SILENT_NS:
            said = "controller: SILENT"
            if status is not None and not self._silent:
                said = _status_text(status, node.station)
            if said != self._shown:
                self._say(said)
                self._shown = said
        alarms = {alarm.code: alarm.state for alarm in node.alarms}
        for code, state in alarms.items():
            if code is not None and state in _UNACCEPTED and self._alarms.get(code) is not state:
                there = state is canbus.AlarmState.ACTIVE_UNACKNOWLEDGED
                bell = "\a" if self._terminal and there else ""
                what = "ALARM" if there else "alarm, its cause gone,"
                self._say(f"{bell}{what} {fault_text(code)} accept?")
        for code in self._alarms.keys() - alarms.keys():
            if code is not None:
                self._say(f"alarm over: {code.name}")
        self._alarms = alarms


def _status_text(status: canbus.ControllerStatus, own: canbus.Station) -> str:
    parts = [f"controller: {'unknown mode' if status.mode is None else status.mode.name}"]
    if status.fault:
        parts.append(fault_text(status.fault))
    if status.degraded:
        parts.append("degraded")
    if status.retuning is not None:
        parts.append(f"retuning {status.retuning.name}")
    if status.station not in (None, own):
        parts.append("the other station has the command")
    return ", ".join(parts)


LOOK_NS = 2 * TICK_NS  #: Time between two reads: a frame leaves within 50 ms of its button.
LISTEN = "127.0.0.1:8047"  #: Where the page is, by default; no well-known service has the port.


def panel(
    vessel: Annotated[Path, common.argument("Ship, tank and pump: a file of configs/ships.")],
    bus: common.Bus,
    duration: common.Duration = None,
    second: Annotated[
        bool, common.option("Be the second station; it watches until it takes.", "--second")
    ] = False,
    web: Annotated[
        bool, common.option("Serve a page for a browser, on this machine alone.", "--web")
    ] = False,
    listen: Annotated[
        str, common.option("Where --web listens; port 0: a free one.", metavar="ADDRESS:PORT")
    ] = LISTEN,
    json_: common.Json = False,
) -> None:
    """Operate the controller from the keyboard: type an action and Enter; Enter alone stops.

    Actions: standby, passive, arm, disarm, stop, reset, accept (the alarms), take (the command),
    help, quit; for retuning: retune, undo, forbid, permit. They may be piped in, one a line, and
    cut short. Alarms are shown with what happened and what to do. Leaving the panel silences it; a
    controller in charge then ramps down after five seconds.

    With **--json** it prints at its end what it heard last: mode, fault and alarms.

    With **--web** it is a page in a browser too, whose address is printed; the panel is silent, but
    for a stop, while no page is open.

    **Example:** utank-hil panel configs/ships/thesis_first.yaml --bus can0 --web
    """
    loaded = common.load(vessel, Vessel)
    catalogue = canbus.load_catalogue()
    station = canbus.Station.OPERATOR_2 if second else canbus.Station.OPERATOR
    node = OperatorPanel(
        catalogue, configuration_version=loaded.version, station=station, period_ns=LOOK_NS
    )
    nodes: list[Node] = [node]
    with ExitStack() as stack:
        server = stack.enter_context(closing(_server(listen))) if web else None

        def port_of() -> canbus.Port:
            return open_port(bus, loaded.foreign) if web else SocketCanPort(bus, node.hears)

        heard, signalled = stack.enter_context(opened(port_of))
        # A blocked terminal must not delay a stop.
        lines = stack.enter_context(printed_lines())
        lines.say(HELP)
        descriptor = os.open(os.devnull, os.O_RDONLY) if sys.stdin is None else sys.stdin.fileno()
        keyboard = Keyboard(node, descriptor, lines.say, terminal=os.isatty(descriptor))
        desk = None
        if server is not None:
            instruments = Instruments(catalogue, loaded)
            nodes.append(instruments)
            desk = Desk(node, instruments, server.link, lines.say)
            lines.say(f"Open {server.url} in a browser; whoever knows this address may arm.")

        def look() -> bool:
            now_ns = time.monotonic_ns()
            ended = desk is not None and desk.look(now_ns)
            return keyboard.look(now_ns, signalled=signalled()) or ended

        RealTimeLoop(nodes, heard).run(look, None if duration is None else round(duration * 1e9))
    if json_:
        common.print_json(_as_json(node))
    if desk is not None and desk.ended:
        common.fail(
            "the process that serves the page has ended: start the panel again", ExitCode.SYSTEM
        )


def _as_json(node: OperatorPanel) -> dict[str, object]:
    status = node.status
    return {
        "station": node.station.name,
        "mode": None if status is None or status.mode is None else status.mode.name,
        "fault": status.fault.name if status is not None and status.fault else None,
        "alarms": [
            {"code": alarm.code.name, "state": None if alarm.state is None else alarm.state.name}
            for alarm in node.alarms
            if alarm.code is not None
        ],
    }


def _server(listen: str) -> ServerProcess:
    host, _, port = listen.rpartition(":")
    try:
        address = socket.gethostbyname(host)  # 0 is all addresses, too
    except (OSError, UnicodeError):  # no such name, or none that could be one
        address = ""
    if address in ("", "0.0.0.0") or not (port.isdecimal() and int(port) < 1 << 16):
        common.fail(f"--listen {listen}: name one address of this machine and a port, as {LISTEN}")
    try:
        return ServerProcess(address, int(port))
    except OSError as error:
        why = common.why(error)
        common.fail(f"--listen {listen}: {why}; port 0 takes a free one", ExitCode.SYSTEM)
