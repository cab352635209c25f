"""A port with a light ship and controller behind it, for a panel's page where there is no CAN.

    python ship_of_a_page.py SECONDS

runs `utank-hil panel --web` on it and prints the page's address, for a look by eye.
"""

import math
import sys
import threading
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path

from utank_hil.canbus import (
    Alarm,
    AlarmState,
    ControllerStatus,
    DriveState,
    DriveStatus1,
    DriveStatus2,
    Fault,
    Frame,
    Mode,
    OperatorCommand,
    PassiveTwin,
    PumpCommand,
    Quality,
    SensorMotion,
    SensorPump,
    SensorTank,
    ShipEstimate,
    Station,
    Switch,
    Verdict,
    load_catalogue,
)
from utank_hil.commands.web_panel.desk import Desk, Instruments
from utank_hil.commands.web_panel.server import ServerProcess
from utank_hil.configuration import load_config
from utank_hil.configuration.vessel import Vessel
from utank_hil.nodes.panel import OperatorPanel
from utank_hil.runners import RealTimeLoop

SHIP = Path("configs/ships/thesis_first.yaml")
CATALOGUE = load_catalogue()
VESSEL = load_config(SHIP, Vessel)
CYCLE_NS = 20_000_000


class LightShip:
    """A ship that rolls by a sine, and a controller that arms, stops and has alarms."""

    others = 0

    def __init__(self) -> None:
        self.mode = Mode.STANDBY
        self.fault = Fault.NONE
        self.station = Station.OPERATOR
        self.alarms: dict[Fault, AlarmState] = {}
        self.roll_rad = 0.06
        self.mute = False  #: No node of the ship sends.
        self.heard: list[tuple[int, OperatorCommand]] = []
        self.frames: list[tuple[int, int]] = []  #: Time and identifier of what the panel sends.
        self._orders = CATALOGUE.receiver(OperatorCommand)
        self._transmitters = {
            kind: CATALOGUE.transmitter(kind)
            for kind in (
                ControllerStatus, Alarm, PumpCommand, DriveStatus1, DriveStatus2, SensorMotion,
                SensorTank, SensorPump, PassiveTwin, ShipEstimate,
            )
        }  # fmt: skip
        self._due_ns = time.monotonic_ns()
        self._cycles = 0

    def send(self, frame: Frame) -> None:
        self.frames.append((time.monotonic_ns(), frame.can_id))
        order = self._orders.accept(frame) if frame.can_id == self._orders.can_id else None
        if order is None:
            return
        arms = order.arm and not (self.heard and self.heard[-1][1].arm)
        self.heard.append((time.monotonic_ns(), order))
        if order.stop or (self.mode is Mode.ACTIVE and order.mode_request is Mode.STANDBY):
            self.mode = Mode.STANDBY
        elif self.mode is Mode.ACTIVE and order.mode_request is Mode.PASSIVE:
            self.mode = Mode.PASSIVE
        elif arms and self.mode in (Mode.STANDBY, Mode.PASSIVE):
            self.mode = Mode.ACTIVE
        if order.acknowledge:
            self.alarms = {
                code: AlarmState.ACTIVE_ACKNOWLEDGED
                for code, state in self.alarms.items()
                if state is not AlarmState.RECTIFIED_UNACKNOWLEDGED
            }

    def receive(self) -> Sequence[Frame]:
        now_ns = time.monotonic_ns()
        if now_ns < self._due_ns:
            return ()
        self._due_ns = max(self._due_ns + CYCLE_NS, now_ns - CYCLE_NS)
        if self.mute:
            return ()
        self._cycles += 1
        sent: list[object] = []
        phase = 2 * math.pi * now_ns * 1e-9 / 12.6
        roll_rad, level_m = self.roll_rad * math.sin(phase), 1.2 * math.cos(phase)
        asked_pa = 31e3 * math.cos(phase) if self.mode is Mode.ACTIVE else 0.0
        given_pa = 28e3 * math.cos(phase - 0.2) if self.mode is Mode.ACTIVE else 0.0
        on = DriveState.OPERATION_ENABLED if self.mode is Mode.ACTIVE else (
            DriveState.SWITCH_ON_DISABLED
        )  # fmt: skip
        sent += [
            SensorMotion(roll_rad, 0.0, Quality.GOOD),
            SensorTank(-level_m, level_m, Switch.OFF, Switch.OFF, Quality.GOOD),
            SensorPump(given_pa, math.nan, Quality.GOOD),
            PumpCommand(asked_pa, None, 0.05),
            DriveStatus1(given_pa, 0.0, on, 0, False, False, False, False),
        ]
        if self._cycles % 5 == 0:
            current_a = 0.02 * abs(given_pa)
            status = ControllerStatus(
                self.mode, self.fault, self.mode is Mode.ACTIVE, bool(self.alarms), False, False,
                False, 0.21, CATALOGUE.version, VESSEL.version, station=self.station,
            )  # fmt: skip
            sent += [
                status,
                DriveStatus2(None, 700.0, current_a, 60.0, 40.0, *(False,) * 4),
                PassiveTwin(Quality.GOOD, 2 * roll_rad, 0.042, 0.027),
                ShipEstimate(Verdict.GOOD, 12.6, 0.1, 1.62, 0.05, 20.0),
            ]
            place = self._cycles // 5 % max(len(self.alarms), 1)
            for code, state in list(self.alarms.items())[place : place + 1]:
                sent.append(Alarm(state, code, place, len(self.alarms), 1, 12.0))
            if not self.alarms:
                sent.append(Alarm(AlarmState.NORMAL, Fault.NONE, 0, 0, 0, 0.0))
        return [self._transmitters[type(each)].frame(each) for each in sent]

    def close(self) -> None:
        pass


@dataclass
class Bench:
    """A panel with its page on the light ship, in a thread."""

    ship: LightShip = field(default_factory=LightShip)
    node: OperatorPanel = field(
        default_factory=lambda: OperatorPanel(
            CATALOGUE, configuration_version=VESSEL.version, period_ns=CYCLE_NS
        )
    )
    said: list[str] = field(default_factory=list)
    held: threading.Event = field(default_factory=threading.Event)  #: The loop stands while set.
    over: threading.Event = field(default_factory=threading.Event)

    def run(self, server: ServerProcess) -> None:
        instruments = Instruments(CATALOGUE, VESSEL)
        self.desk = Desk(self.node, instruments, server.link, self.said.append)

        def look() -> bool:
            while self.held.is_set():
                time.sleep(0.01)
            return self.desk.look(time.monotonic_ns()) or self.over.is_set()

        RealTimeLoop([self.node, instruments], self.ship).run(look)

    def wait(self, what: str, within_s: float = 10.0) -> None:
        """Until an expression in `ship`, `node` and `said` is true."""
        deadline = time.monotonic() + within_s
        while not eval(what, {"Mode": Mode, **vars(self)}):
            assert time.monotonic() < deadline, what
            time.sleep(0.01)


@contextmanager
def bench(port: int = 0) -> Iterator[tuple[Bench, str]]:
    """A bench that runs, and the address of its page."""
    made, server = Bench(), ServerProcess("127.0.0.1", port)
    thread = threading.Thread(target=made.run, args=(server,), daemon=True)
    thread.start()
    try:
        yield made, server.url
    finally:
        made.held.clear()
        made.over.set()
        thread.join(5.0)
        server.close()


if __name__ == "__main__":
    with bench() as (_, url):
        print(url, flush=True)
        time.sleep(float(sys.argv[1]))
