"""The panel's side of its page: takes orders from the server's process, and hands it the state."""

import json
import math
import socket
from collections import deque
from collections.abc import Callable, Sequence
from typing import Any, Final

from utank_hil import canbus
from utank_hil.base.finite import finite
from utank_hil.base.tick import TICK_NS
from utank_hil.configuration.vessel import Vessel
from utank_hil.nodes.inbox import Inbox
from utank_hil.nodes.panel import Action, OperatorPanel
from utank_hil.safety.faults import fault_words

STALE_MS: Final = 500.0
"""Age beyond which a figure is not shown: five of the slowest cycle, and half of what an eye takes
for now."""
_ESTIMATE_MS: Final = 5000.0  #: The same of the ship's estimate, which comes once a second.
_HEEL_S: Final = 60.0  #: Time over which roll is averaged to heel, as for HEEL_LIMIT.
_SENT: Final = (canbus.PumpCommand, canbus.PassiveTwin, canbus.ShipEstimate)
LASTING: Final = (canbus.AlarmState.ACTIVE_UNACKNOWLEDGED, canbus.AlarmState.ACTIVE_ACKNOWLEDGED)


class Instruments:
    """Listens to a ship's bus for a panel, and sends nothing."""

    name = "instruments"
    period_ns = 2 * TICK_NS

    def __init__(self, catalogue: canbus.Catalogue, vessel: Vessel) -> None:
        self._vessel = vessel
        self._inbox = Inbox(
            catalogue,
            vessel.version,
            pump=vessel.pump is not None,
            valve=vessel.valve is not None,
            redundancy=vessel.redundancy,
            foreign=vessel.foreign,
        )
        receivers = [catalogue.receiver(kind) for kind in _SENT]
        self._receivers: dict[int, canbus.Receiver[Any]] = {each.can_id: each for each in receivers}
        self._sent: dict[type[Any], tuple[Any, int]] = {}
        self._heel_rad = math.nan
        self._heeled_s = 0.0

    def receive(self, frame: canbus.Frame, now_ns: int) -> None:
        """Take what sensors, drive, valve and controller send."""
        receiver = self._receivers.get(frame.can_id)
        if receiver is None:
            self._inbox.receive(frame, now_ns)
        elif (message := receiver.accept(frame)) is not None:
            self._sent[type(message)] = message, now_ns

    def tick(self, now_ns: int) -> Sequence[canbus.Frame]:
        """Average the roll."""
        motion = self._inbox.motions[0].sample(now_ns)
        if motion.age_ms > STALE_MS:
            self._heel_rad, self._heeled_s = math.nan, 0.0
            return ()
        step_s = self.period_ns * 1e-9
        if self._heeled_s == 0.0:
            self._heel_rad = 0.0
        self._heeled_s = min(self._heeled_s + step_s, _HEEL_S)
        self._heel_rad += (motion.roll_rad - self._heel_rad) * step_s / self._heeled_s
        return ()

    def figures(self, now_ns: int) -> dict[str, float | str | bool | None]:
        """What is measured now; NaN for what is not, or is too old."""
        measured, vessel = self._inbox.snapshot(now_ns), self._vessel
        motion = min(measured.motions, key=lambda each: each.age_ms)
        twin = self._latest(canbus.PassiveTwin, now_ns)
        usable = twin is not None and twin.quality is canbus.Quality.GOOD
        ship = self._latest(canbus.ShipEstimate, now_ns, _ESTIMATE_MS)
        known = ship is not None and ship.verdict is canbus.Verdict.GOOD
        command = self._latest(canbus.PumpCommand, now_ns)
        pump, tank_ms = vessel.pump, measured.tank_age_ms
        drive_ms = measured.drive_age_ms if pump else math.inf
        given_ms = measured.pump_age_ms if pump else math.inf
        heard_ns = measured.valve_heard_ns
        valve_ms = (now_ns - heard_ns) * 1e-6 if vessel.valve else math.inf
        most_w = pump.max_power_w if pump else math.inf
        return {
            "roll_deg": math.degrees(_fresh(motion.roll_rad, motion.age_ms)),
            "heel_deg": math.degrees(self._heel_rad),
            "heeled_s": self._heeled_s,
            "roll_rms_deg": math.degrees(twin.roll_rms_rad) if twin and usable else math.nan,
            "passive_rms_deg": math.degrees(twin.twin_rms_rad) if twin and usable else math.nan,
            "port_m": _fresh(measured.port_level_m, tank_ms),
            "starboard_m": _fresh(measured.starboard_level_m, tank_ms),
            "high_level": measured.high_level or (False if tank_ms <= STALE_MS else None),
            "asked_kpa": command.pressure_pa * 1e-3 if command and pump else math.nan,
            "given_kpa": _fresh(measured.pressure_pa * 1e-3, given_ms),
            "power_kw": _fresh(measured.power_w * 1e-3, drive_ms),
            "load": _fresh(abs(measured.power_w) / most_w, drive_ms),
            "pump_limited": measured.drive_held_back and drive_ms <= STALE_MS,
            "drive": state.name
            if (state := measured.drive_state) and drive_ms <= STALE_MS
            else None,
            "valve": _fresh(measured.valve_opening, valve_ms),
            "gm_m": ship.gm_m if ship and known else math.nan,
            "roll_period_s": ship.roll_period_s if ship and known else math.nan,
        }

    def scales(self) -> dict[str, Any]:
        """Name and limits of the ship, by its file."""
        vessel = self._vessel
        limits, safety = vessel.default_limits, vessel.default_safety
        return {
            "name": vessel.name,
            "roll_deg": math.degrees(safety["roll_limit_rad"]),
            "heel_deg": math.degrees(safety["heel_limit_rad"]),
            "level_m": limits["level_m"],
            "full_m": vessel.tank.level_limit_m,
            "pressure_kpa": limits.get("pressure_pa", 0.0) * 1e-3,
            "least_gm_m": vessel.least_gm_m,
        }

    def _latest(self, kind: type[Any], now_ns: int, most_ms: float = STALE_MS) -> Any:
        message, heard_ns = self._sent.get(kind, (None, now_ns))
        return message if now_ns - heard_ns <= most_ms * 1e6 else None


def _fresh(value: float, age_ms: float) -> float:
    return value if age_ms <= STALE_MS else math.nan


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
        line = refusal or action.value
        self._count += 1
        self._said.append(line)
        self._say(f"page: {line}")

    def _show(self, now_ns: int) -> None:
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
                    "lasts": alarm.state in LASTING,
                    "accepted": alarm.state is canbus.AlarmState.ACTIVE_ACKNOWLEDGED,
                    "words": fault_words(alarm.code),
                    "age_s": alarm.age_s,
                    "times": alarm.times_raised,
                }
                for alarm in node.alarms
                if alarm.code is not None
            ],
        }
