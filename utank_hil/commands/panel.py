"""``utank-hil panel``: a minimal operator panel at the keyboard."""

import select
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Annotated

import typer

from utank_hil.canbus import SocketCanPort, load_catalogue
from utank_hil.commands.common import Duration, fail, load, notes
from utank_hil.commands.exit_codes import ExitCode
from utank_hil.configuration.vessel import Vessel
from utank_hil.runtime import RealTimeLoop, stop_on_signals
from utank_hil.runtime.panel import Action, OperatorPanel


def panel(
    vessel: Annotated[Path, typer.Argument(help="Ship, tank and pump: a file of configs/ships.")],
    bus: Annotated[str, typer.Option(help="SocketCAN interface, for example can0.")],
    duration: Duration = None,
) -> None:
    """Operate the controller from the keyboard: type an action and Enter.

    Actions: standby, passive, arm, disarm, stop, reset, quit; for retuning: retune, undo, forbid,
    permit. Leaving the panel silences it; a controller in charge then ramps down after five
    seconds.

    [bold]Example:[/bold] utank-hil panel configs/ships/thesis_first.yaml --bus can0
    """
    version = load(vessel, Vessel).version
    node = OperatorPanel(load_catalogue(), configuration_version=version)
    try:
        port = SocketCanPort(bus)
    except OSError as error:
        fail(error, ExitCode.NO_BUS)
    notes.print("actions: " + ", ".join(action.value for action in Action) + ", quit")
    try:
        with stop_on_signals() as signalled:
            keyboard = _Keyboard(node, signalled)
            RealTimeLoop([node], port).run(
                keyboard.ended, None if duration is None else round(duration * 1e9)
            )
    finally:
        port.close()


class _Keyboard:
    """Reads actions between two ticks and shows what the controller says of itself."""

    def __init__(self, node: OperatorPanel, signalled: Callable[[], bool]) -> None:
        self._node = node
        self._signalled = signalled
        self._open = True
        self._shown = ""

    def ended(self) -> bool:
        """Whether the user wants to leave; asked before every tick."""
        status = self._node.status
        if status is not None and status.mode is not None and status.fault is not None:
            said = f"controller: {status.mode.name}, fault {status.fault.name}"
            if status.retuning is not None:
                said += f", retuning {status.retuning.name}"
            if said != self._shown:
                notes.print(said)
                self._shown = said
        if self._open and select.select([sys.stdin], [], [], 0)[0]:
            line = sys.stdin.readline()
            self._open = bool(line)  # a closed standard input only ends the typing
            word = line.strip().lower()
            if word == "quit":
                return True
            if word in {action.value for action in Action}:
                self._node.press(Action(word))
            elif word:
                notes.print(f"unknown action {word!r}", markup=False)
        return self._signalled()
