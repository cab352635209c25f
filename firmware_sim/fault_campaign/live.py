"""Live rows: faults of processes and of a CAN interface, with the deployed programs."""

import math
import signal
import socket
import struct
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import closing, contextmanager, suppress
from functools import partial
from pathlib import Path
from typing import Any, Final, Literal

import can
from can.interfaces.socketcan import SocketcanBus

from firmware_sim.fault_campaign.campaign import LiveRow
from firmware_sim.fault_campaign.live_log import HELD_UP_S, LiveLog, LiveTimes, Stream, times_of
from utank_hil.base.shipped import CONFIGS
from utank_hil.canbus import (
    ControllerStatus,
    DriveState,
    DriveStatus1,
    Frame,
    Mode,
    PumpCommand,
    SensorMotion,
    load_catalogue,
)
from utank_hil.canbus.socketcan import SocketCanPort

STORM: Final = CONFIGS / "scenarios" / "storm.yaml"
CONTROLLER: Final = CONFIGS / "controllers" / "gpc.yaml"
START_S: Final = 180.0
"""Longest time in s until the controller is in charge: imports are slow in an emulated kernel."""
STARTS: Final = 3
"""Most starts: a machine that delays processes may end a run before its fault is injected, the only
cause of a new start."""
ATTEMPTS: Final = 3  #: Most attempts at a row: such a machine may also spoil what is judged.
DRIVEN_PA: Final = 5e3
"""Pressure above which the pump works: a tenth of the limit of the storm's ship."""
RESTED_S: Final = 1.0
"""Pause of a stopped program in s: longer than every timeout of the other side but the panel's."""
WATCHED_S: Final = 3.0
"""Time in s for which the bus is watched after the fault: two seconds more than the pause."""
_RECENT_S: Final = 0.5
"""Largest age in s of the last CTRL_STATUS of a controller in charge: five cycles."""
_LOOK_S: Final = 0.002  # Polling interval in s: a fifth of the shortest message cycle.
_EXTENDED_MASK: Final = 0x1FFFFFFF
_BUS_OFF: Final = struct.pack("=IB3x8s", 0x20000040, 8, bytes(8))
"""Error frame that reports bus-off, in the form of a kernel driver."""


Later = tuple[float, Callable[[], None]] | None
"""Time in s after the fault, and the action to be done then."""


class LiveError(Exception):
    """Error for programs that did not reach the state in which a fault can be injected."""


class LiveBench:
    """Ship and controller as processes on an interface, with a listener."""

    def __init__(self, bus: str, folder: Path) -> None:
        SocketCanPort(bus).close()  # fails with the reason and the remedy
        self.bus = bus
        catalogue = load_catalogue()
        self._status = catalogue.receiver(ControllerStatus)
        self._drive = catalogue.receiver(DriveStatus1)
        self.log = LiveLog()
        self._streams = {
            catalogue.codec(PumpCommand).can_id: self.log.commands,
            catalogue.codec(SensorMotion).can_id: self.log.motions,
        }
        heard = (self._status.can_id, self._drive.can_id, *self._streams)
        # python-can directly, because our port drops the kernel's time of a frame
        self._bus = SocketcanBus(
            bus,
            can_filters=[{"can_id": each, "can_mask": _EXTENDED_MASK, "extended": True}
                         for each in heard],
        )  # fmt: skip
        self.start = 1  #: Ordinal number of this bench among the starts.
        self.mode: Mode | None = None
        self.fault = ""
        self._status_s = -math.inf
        self.state: DriveState | None = None
        self.pressure_pa = 0.0
        programs = Path(sys.executable).parent
        self._folder = folder
        self.ship = self._start(programs / "firmware-sim", STORM, "--bus", bus)
        self.controller = self._start(
            programs / "utank-hil", "run", CONTROLLER, "--bus", bus, "--out", folder / "run"
        )

    def _start(self, *command: object) -> subprocess.Popen[bytes]:
        with (self._folder / f"{Path(str(command[0])).name}.err").open("wb") as errors:
            return subprocess.Popen(
                [str(word) for word in command], stdout=subprocess.DEVNULL, stderr=errors
            )

    def close(self) -> None:
        """End both processes."""
        for process in (self.controller, self.ship):
            if process.poll() is None:
                process.send_signal(signal.SIGCONT)
                process.kill()
            process.wait()
        self._bus.shutdown()

    def look(self) -> None:
        """Read the pending frames."""
        time.sleep(_LOOK_S)
        for message in self._heard():
            time_s = message.timestamp
            frame = Frame(message.arbitration_id, bytes(message.data))
            if frame.can_id in self._streams:
                self._streams[frame.can_id].append(time_s)
            elif frame.can_id == self._status.can_id:
                status = self._status.accept(frame)
                if status is not None:
                    self.mode, self._status_s = status.mode, time_s
                    self.fault = "" if status.fault is None else status.fault.name
                    self.log.modes.append((time_s, status.mode))
            elif (drive := self._drive.accept(frame)) is not None:
                self.state, self.pressure_pa = drive.state, drive.pressure_pa
                self.log.states.append((time_s, drive.state))

    def _heard(self) -> Iterator[can.Message]:
        """Yield messages since the last call; none while the interface is down."""
        with suppress(can.CanError, OSError):
            while (message := self._bus.recv(0)) is not None:
                if not message.is_error_frame:
                    yield message

    def wait_in_charge(self) -> None:
        """Wait until the pump gives pressure; raise `LiveError` if it does not."""
        end_s = time.monotonic() + START_S
        while self.mode is not Mode.ACTIVE or abs(self.pressure_pa) < DRIVEN_PA:
            for name, process in (("firmware-sim", self.ship), ("utank-hil", self.controller)):
                if process.poll() is not None:
                    told = (self._folder / f"{name}.err").read_text(encoding="utf-8").strip()
                    raise LiveError(f"{name} ended with {process.returncode}: {told[-300:]}")
            if time.monotonic() > end_s:
                mode = "silent" if self.mode is None else self.mode.name
                raise LiveError(f"not in charge on {self.bus}: {mode}, fault {self.fault}")
            if self.mode is Mode.FAULT:
                raise LiveError(f"{self.fault} before there was a fault")
            self.look()
        if self.state is not DriveState.OPERATION_ENABLED:
            raise LiveError(f"the drive went off by itself: {self.state!r}, fault {self.fault}")

    @property
    def in_charge(self) -> bool:
        """Whether the controller currently reports that it is in charge."""
        return self.mode is Mode.ACTIVE and time.time() - self._status_s < _RECENT_S

    def watch(self, later: Later = None) -> float:
        """Watch the bus after the fault; return the time at the end."""
        began_s = time.monotonic()
        while (since_s := time.monotonic() - began_s) < WATCHED_S:
            self.look()
            if later is not None and since_s >= later[0]:
                later[1]()
                later = None
        return time.time()


Act = Callable[[LiveBench], Later]


def _sent(program: Literal["controller", "ship"], number: int, *, rested: bool = False) -> Act:
    """Return an action that sends a signal; `rested` adds SIGCONT after the timeouts."""

    def act(bench: LiveBench) -> Later:
        process = bench.controller if program == "controller" else bench.ship
        process.send_signal(number)
        return (RESTED_S, partial(process.send_signal, signal.SIGCONT)) if rested else None

    return act


def bus_off(bench: LiveBench) -> Later:
    """Send an error frame that reports bus-off."""
    with socket.socket(socket.AF_CAN, socket.SOCK_RAW, socket.CAN_RAW) as raw:
        raw.bind((bench.bus,))
        raw.send(_BUS_OFF)
    return None


ACTIONS: Final[dict[str, tuple[Act, Stream | None]]] = {
    "controller_killed": (_sent("controller", signal.SIGKILL), "commands"),
    "controller_stopped": (_sent("controller", signal.SIGSTOP), "commands"),
    "controller_stopped_for_a_second": (
        _sent("controller", signal.SIGSTOP, rested=True), "commands"
    ),
    "controller_hung_up": (_sent("controller", signal.SIGHUP), None),
    "controller_terminated": (_sent("controller", signal.SIGTERM), None),
    "ship_killed": (_sent("ship", signal.SIGKILL), "motions"),
    "ship_stopped_for_a_second": (_sent("ship", signal.SIGSTOP, rested=True), "motions"),
    "bus_off": (bus_off, None),
}  # fmt: skip
"""Actions by name, and the stream that each ends."""


@contextmanager
def _in_charge(bus: str) -> Iterator[LiveBench]:
    """Yield a bench with its controller in charge, after several starts if needed.

    Raises `LiveError` if no start succeeded.
    """
    for start in range(1, STARTS + 1):
        with (
            tempfile.TemporaryDirectory() as folder,
            closing(LiveBench(bus, Path(folder))) as bench,
        ):
            try:
                bench.wait_in_charge()
            except LiveError:
                ended = any(each.poll() is not None for each in (bench.controller, bench.ship))
                if start == STARTS or ended or bench.log.held_up_s <= HELD_UP_S:
                    raise
            else:
                bench.start = start
                yield bench
                return


def run_live(row: LiveRow, bus: str, requirement: str) -> dict[str, Any]:
    """Run and judge a live row; return the form of `Result.as_json`.

    Raises `OSError` if the interface cannot be used.
    """
    for attempt in range(1, ATTEMPTS + 1):
        told, held_up_ms = _attempt(row, bus)
        if not told["problems"] or held_up_ms <= 1e3 * HELD_UP_S:
            break
        held_up = f"the machine held processes up for {held_up_ms:.0f} ms, attempt {attempt}"
        told["problems"].append(held_up)
    return {
        "id": row.id,
        "meets": list(row.meets),
        "requirement": requirement,
        "reaction": row.judged,
        "limit_ms": row.within_ms,
        "verdict": "fail" if told["problems"] else "pass",
        "roll_ratio": None,
        "recording": None,
        **told,
    }


def _attempt(row: LiveRow, bus: str) -> tuple[dict[str, Any], float]:
    """Run a live row once; return its result, and the ms for which processes were delayed."""
    problems = []
    times = LiveTimes(None, None, 0.0)
    code = ""
    mode: Mode | None = None
    state: DriveState | None = None
    start = 0
    act, silences = ACTIONS[row.does]
    try:
        with _in_charge(bus) as bench:
            fault_s = time.time()
            end_s = bench.watch(act(bench))
            times = times_of(bench.log, fault_s, end_s, silences=silences, judged=row.judged)
            code, mode, state, start = bench.fault, bench.mode, bench.state, bench.start
            if bench.in_charge:
                problems.append("in charge again in the end")
    except LiveError as error:
        problems.append(str(error))
    judged = times.found_ms if row.judged == "found" else times.zero_ms
    if not problems and judged is None:
        problems.append("was not found" if row.judged == "found" else "the drive went on")
    elif judged is not None and row.within_ms is not None and judged > row.within_ms:
        problems.append(f"after {judged:.0f} ms, {row.within_ms:.0f} allowed")
    told = {
        "found_ms": times.found_ms,
        "zero_ms": times.zero_ms,
        "problems": problems,
        "codes": [code] if code and code != "NONE" else [],
        "wire": f"start {start}; at the end {mode!r}, drive {state!r}",
    }
    return told, times.held_up_ms
