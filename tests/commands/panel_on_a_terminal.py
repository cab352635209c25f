"""Run `utank-hil panel` on a terminal, arm, and end: by Ctrl-D, or with the terminal closed.

    python panel_on_a_terminal.py ctrl-d | closed

Prints what the panel had sent at its end: how many frames with stop, and the last frame.
"""

import os
import pty
import sys
import time
from collections.abc import Iterable, Sequence
from pathlib import Path

from utank_hil.canbus import (
    ControllerStatus,
    Fault,
    Frame,
    Mode,
    OperatorCommand,
    Station,
    load_catalogue,
)
from utank_hil.commands import panel

SHIP = Path("configs/ships/thesis_first.yaml")
CATALOGUE = load_catalogue()


class Controller:
    """In place of the CAN interface: a controller that is in charge until it hears a stop."""

    others = 0

    def __init__(self, channel: str, can_ids: Iterable[int] | None = None) -> None:
        self._orders = CATALOGUE.receiver(OperatorCommand)
        self._status = CATALOGUE.transmitter(ControllerStatus)
        self._reads = 0
        self.heard: list[OperatorCommand] = []

    def send(self, frame: Frame) -> None:
        order = self._orders.accept(frame) if frame.can_id == self._orders.can_id else None
        if order is not None:
            self.heard.append(order)

    def receive(self) -> Sequence[Frame]:
        self._reads += 1
        if self._reads % 5:
            return ()
        stopped = any(order.stop for order in self.heard)
        mode = Mode.STANDBY if stopped else Mode.ACTIVE
        status = ControllerStatus(
            mode, Fault.NONE, not stopped, *(False,) * 4, 0.2, 1, 1, station=Station.OPERATOR
        )
        return (self._status.frame(status),)

    def close(self) -> None:
        last = self.heard[-1]
        stops = sum(order.stop for order in self.heard)
        asked = last.mode_request
        os.write(RESULT, f"{stops} {asked and asked.name} {last.arm}".encode())


how = sys.argv[1]
reading, RESULT = os.pipe()
child, terminal = pty.fork()
if child == 0:
    panel.SocketCanPort = Controller  # type: ignore[attr-defined]
    try:
        panel.panel(SHIP, "can0", 20.0)
    finally:
        os._exit(0)
os.close(RESULT)
time.sleep(0.5)  # the first status has come
os.write(terminal, b"arm\n")
time.sleep(0.5)
if how == "closed":
    os.close(terminal)
else:
    os.write(terminal, b"\x04")
print(os.read(reading, 1000).decode())
os.waitpid(child, 0)
