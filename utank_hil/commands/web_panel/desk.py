"""The panel's side of its page: takes orders from the server's process, and hands it the state."""

import json
import socket
from collections import deque
from collections.abc import Callable
from typing import Any, Final

from utank_hil.base.finite import finite
from utank_hil.canbus import AlarmState
from utank_hil.commands.web_panel.instruments import Instruments
from utank_hil.nodes.panel import Action, OperatorPanel
from utank_hil.safety.faults import fault_words

SHOW_NS: Final = 100_000_000  #: Time between two states: the cycle of CTRL_STATUS.
PRESENT_NS: Final = 1_000_000_000
"""Time after which a page that does not answer is gone: five of its answers, and far below the five
seconds after which a controller ramps down."""
_MOST_ORDERS: Final = 64  #: Orders that are taken in one look: more are no person's.
_LONGEST: Final = 64  #: Bytes of the longest order.
PRESENT: Final = "present"  #: What the server says of a page that answers.


class Desk:
    """Presses the buttons of a panel that pages ask for, and tells them the state.

    `link` is one end of a pair of sockets that keep messages apart; the server, with the other one,
    sends the monotonic time and the button. `say` shows a line.
    """

    def __init__(
        self,
        node: OperatorPanel,
        instruments: Instruments,
        link: socket.socket,
        say: Callable[[str], None],
    ) -> None:
        self._node, self._instruments, self._link, self._say = node, instruments, link, say
        link.setblocking(False)
        self._scales = instruments.scales()
        self._present_ns: int | None = None
        self._show_ns = 0
        self._number = 0
        self._said: deque[str] = deque(maxlen=5)
        self._count = 0
        self.ended = False  #: Whether the server's process has ended.
        node.attended = False

    def look(self, now_ns: int) -> bool:
        """Obey orders, send the state when it is due; return whether the server has ended."""
        for _ in range(_MOST_ORDERS):
            try:
                order = self._link.recv(_LONGEST)
            except BlockingIOError:
                break
            except OSError:
                order = b""
            if not order:
                self.ended = True
                break
            self._obey(order, now_ns)
        here = self._present_ns is not None and now_ns - self._present_ns <= PRESENT_NS
        if here != self._node.attended:
            self._node.attended = here
            self._say("a page is open" if here else "no page answers: the panel is silent")
        if now_ns >= self._show_ns and not self.ended:
            self._show_ns = now_ns + SHOW_NS
            self._show(now_ns)
        return self.ended

    def _obey(self, order: bytes, now_ns: int) -> None:
        sent, button = order.decode().split()
        self._present_ns = int(sent)
        if button == PRESENT:
            return
        action = Action(button)
        refusal = self._node.why_not(action, now_ns)
        if now_ns - int(sent) > PRESENT_NS and action is not Action.STOP:
            refusal = f"{button} came too late"
        if not refusal:
            self._node.press(action)
        self._tell(refusal or action.value)

    def _tell(self, line: str) -> None:
        self._count += 1
        self._said.append(line)
        self._say(f"page: {line}")

    def _show(self, now_ns: int) -> None:
        """Send the state; a server that is behind gets the next one."""
        self._number += 1
        try:
            self._link.send(json.dumps(finite(self.state(now_ns)), allow_nan=False).encode())
        except BlockingIOError:
            pass
        except OSError:
            self.ended = True

    def state(self, now_ns: int) -> dict[str, Any]:
        """What a page shows."""
        node = self._node
        status = None if node.silent(now_ns) else node.status
        fault = status.fault if status is not None and status.fault else None
        return {
            "number": self._number,
            "said": {"count": self._count, "lines": list(self._said)},
            "ship": self._scales,
            "figures": self._instruments.figures(now_ns),
            "mode": status.mode.name if status is not None and status.mode is not None else None,
            "heard": status is not None,
            "fault": None if fault is None else (fault.name, *fault_words(fault)),
            "stopping": node.stopping,
            "in_command": status is None or status.station in (None, node.station),
            "station": node.station.name,
            "degraded": status is not None and status.degraded,
            "saturated": status is not None and status.saturated,
            "retuning": status.retuning.name if status is not None and status.retuning else None,
            "bus_load": None if status is None else status.bus_load,
            "versions": None
            if status is None
            else [status.catalogue_version, status.configuration_version],
            "alarms": [
                {
                    "code": alarm.code.name,
                    "lasts": alarm.state
                    in (AlarmState.ACTIVE_UNACKNOWLEDGED, AlarmState.ACTIVE_ACKNOWLEDGED),
                    "accepted": alarm.state is AlarmState.ACTIVE_ACKNOWLEDGED,
                    "words": fault_words(alarm.code),
                    "age_s": alarm.age_s,
                    "times": alarm.times_raised,
                }
                for alarm in node.alarms
                if alarm.code is not None
            ],
        }
