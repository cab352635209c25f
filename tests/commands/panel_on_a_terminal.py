"""Run `utank-hil panel` on a terminal, arm, and end: by Ctrl-D, or with the terminal closed.

    python panel_on_a_terminal.py ctrl-d | closed | held

Prints what the panel had sent at its end: how many frames with the arm bit, how many with stop, and
what the last one asked for. `held`: prints `stopped` first if a stop came from a terminal that is
held up, before it was released.
"""

import os
import pty
import select
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
WAIT_S = 5.0


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
            if order.stop and how == "held":
                os.write(STOPPED, b"stopped")

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
        armed = sum(order.arm for order in self.heard)
        asked = last.mode_request
        os.write(RESULT, f"{armed} {stops} {asked and asked.name} {last.arm}".encode())


def wait_for(words: str, times: int = 1) -> None:
    """Until the panel has shown them."""
    shown = ""
    while shown.count(words) < times:
        shown += os.read(terminal, 1000).decode(errors="replace")


how = sys.argv[1]
reading, RESULT = os.pipe()
hearing, STOPPED = os.pipe()
child, terminal = pty.fork()
if child == 0:
    panel.SocketCanPort = Controller  # type: ignore[attr-defined]
    try:
        panel.panel(SHIP, "can0", 20.0)
    finally:
        os._exit(0)
os.close(RESULT)
wait_for("controller: ACTIVE")
os.write(terminal, b"arm\n")
wait_for("arm", times=2)  # the terminal's echo is the first
time.sleep(0.1)  # a frame with it has left
if how == "closed":
    os.close(terminal)
elif how == "held":
    os.write(terminal, b"\x13help\nstop\n")
    if select.select([hearing], [], [], WAIT_S)[0]:
        print(os.read(hearing, 7).decode())
    os.write(terminal, b"\x11quit\n")
else:
    os.write(terminal, b"\x04")
print(os.read(reading, 1000).decode())
os.waitpid(child, 0)
