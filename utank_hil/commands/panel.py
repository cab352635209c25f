"""``utank-hil panel``: an operator panel at the keyboard, or in a browser."""

import os
import sys
import time
from contextlib import ExitStack, closing
from pathlib import Path
from typing import Annotated

import typer

from utank_hil.base.tick import TICK_NS
from utank_hil.canbus import Station, load_catalogue
from utank_hil.canbus.ports import open_port
from utank_hil.canbus.socketcan import SocketCanPort
from utank_hil.commands.keyboard import HELP, Keyboard
from utank_hil.commands.lines import printed_lines
from utank_hil.commands.web_panel.desk import Desk
from utank_hil.commands.web_panel.instruments import Instruments
from utank_hil.commands.web_panel.server import ServerProcess
from utank_hil.configuration.vessel import Vessel
from utank_hil.console.common import Bus, Duration, fail, load, why
from utank_hil.console.exit_codes import ExitCode
from utank_hil.nodes.panel import OperatorPanel
from utank_hil.runners import Node, RealTimeLoop, stop_on_signals

LOOK_NS = 2 * TICK_NS  #: Time between two reads: a frame leaves within 50 ms of its button.
LISTEN = "127.0.0.1:8047"  #: Where the page is, by default; no well-known service has the port.


def panel(
    vessel: Annotated[Path, typer.Argument(help="Ship, tank and pump: a file of configs/ships.")],
    bus: Bus,
    duration: Duration = None,
    second: Annotated[
        bool, typer.Option("--second", help="Be the second station; it watches until it takes.")
    ] = False,
    web: Annotated[
        bool, typer.Option("--web", help="Serve a page for a browser, on this machine alone.")
    ] = False,
    listen: Annotated[
        str, typer.Option(metavar="ADDRESS:PORT", help="Where --web listens; port 0: a free one.")
    ] = LISTEN,
) -> None:
    """Operate the controller from the keyboard: type an action and Enter; Enter alone stops.

    Actions: standby, passive, arm, disarm, stop, reset, accept (the alarms), take (the command),
    help, quit; for retuning: retune, undo, forbid, permit. They may be piped in, one a line, and
    cut short. Alarms are shown with what happened and what to do. Leaving the panel silences it; a
    controller in charge then ramps down after five seconds.

    With **--web** it is a page in a browser too, whose address is printed; the panel is silent, but
    for a stop, while no page is open.

    **Example:** utank-hil panel configs/ships/thesis_first.yaml --bus can0 --web
    """
    loaded = load(vessel, Vessel)
    catalogue = load_catalogue()
    station = Station.OPERATOR_2 if second else Station.OPERATOR
    node = OperatorPanel(
        catalogue, configuration_version=loaded.version, station=station, period_ns=LOOK_NS
    )
    nodes: list[Node] = [node]
    with ExitStack() as stack:
        server = stack.enter_context(closing(_server(listen))) if web else None
        try:
            heard = open_port(bus, loaded.foreign) if web else SocketCanPort(bus, node.hears)
        except OSError as error:
            fail(error, ExitCode.NO_BUS)
        stack.enter_context(closing(heard))
        # A blocked terminal must not delay a stop.
        lines = stack.enter_context(printed_lines())
        signalled = stack.enter_context(stop_on_signals())
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
    if desk is not None and desk.ended:
        fail("the process that serves the page has ended: start the panel again", ExitCode.SYSTEM)


def _server(listen: str) -> ServerProcess:
    """Start the page's server, or end with the reason why there is none."""
    host, _, port = listen.rpartition(":")
    if not (host and port.isdecimal() and int(port) < 1 << 16) or host in ("0.0.0.0", "*"):
        fail(f"--listen {listen}: name one address of this machine and a port, as {LISTEN}")
    try:
        return ServerProcess(host, int(port))
    except OSError as error:
        fail(f"--listen {listen}: {why(error)}; port 0 takes a free one", ExitCode.SYSTEM)
