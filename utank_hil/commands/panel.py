"""``utank-hil panel``: a minimal operator panel at the keyboard."""

import os
import sys
import time
from contextlib import closing
from pathlib import Path
from typing import Annotated

import typer

from utank_hil.base.tick import TICK_NS
from utank_hil.canbus import Station, load_catalogue
from utank_hil.canbus.socketcan import SocketCanPort
from utank_hil.commands.keyboard import HELP, Keyboard
from utank_hil.commands.lines import printed_lines
from utank_hil.configuration.vessel import Vessel
from utank_hil.console.common import Bus, Duration, fail, load
from utank_hil.console.exit_codes import ExitCode
from utank_hil.nodes.panel import OperatorPanel
from utank_hil.runners import RealTimeLoop, stop_on_signals

LOOK_NS = 2 * TICK_NS  #: Time between two reads: a frame leaves within 50 ms of its button.


def panel(
    vessel: Annotated[Path, typer.Argument(help="Ship, tank and pump: a file of configs/ships.")],
    bus: Bus,
    duration: Duration = None,
    second: Annotated[
        bool, typer.Option("--second", help="Be the second station; it watches until it takes.")
    ] = False,
) -> None:
    """Operate the controller from the keyboard: type an action and Enter; Enter alone stops.

    Actions: standby, passive, arm, disarm, stop, reset, accept (the alarms), take (the command),
    help, quit; for retuning: retune, undo, forbid, permit. They may be piped in, one a line, and
    cut short. Alarms are shown with what happened and what to do. Leaving the panel silences it; a
    controller in charge then ramps down after five seconds.

    **Example:** utank-hil panel configs/ships/thesis_first.yaml --bus can0
    """
    version = load(vessel, Vessel).version
    station = Station.OPERATOR_2 if second else Station.OPERATOR
    node = OperatorPanel(
        load_catalogue(), configuration_version=version, station=station, period_ns=LOOK_NS
    )
    try:
        port = SocketCanPort(bus, can_ids=node.hears)
    except OSError as error:
        fail(error, ExitCode.NO_BUS)
    # A blocked terminal must not delay a stop.
    with closing(port), printed_lines() as lines, stop_on_signals() as signalled:
        lines.say(HELP)
        descriptor = os.open(os.devnull, os.O_RDONLY) if sys.stdin is None else sys.stdin.fileno()
        keyboard = Keyboard(node, descriptor, lines.say, terminal=os.isatty(descriptor))
        RealTimeLoop([node], port).run(
            lambda: keyboard.look(time.monotonic_ns(), signalled=signalled()),
            None if duration is None else round(duration * 1e9),
        )
