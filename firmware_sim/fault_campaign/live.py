"""The live rows: faults of processes and of a CAN interface, with the deployed programs."""

import math
import signal
import socket
import struct
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from functools import partial
from pathlib import Path
from typing import Any, Final

from firmware_sim.fault_campaign.campaign import LiveRow
from utank_hil.canbus import (
    ControllerStatus,
    DriveState,
    DriveStatus1,
    Mode,
    PortError,
    SocketCanPort,
    load_catalogue,
)
from utank_hil.commands.common import CONFIGS

STORM: Final = CONFIGS / "scenarios" / "storm.yaml"
CONTROLLER: Final = CONFIGS / "controllers" / "gpc.yaml"
START_S: Final = 180.0
"""In an emulated kernel imports take long."""
STARTS: Final = 3
"""A machine that holds processes up may end the run before there is a fault to be tried."""
DRIVEN_PA: Final = 5e3
WATCHED_S: Final = 3.0
RESTED_S: Final = 1.0
_RECENT_S: Final = 0.5
_LOOK_S: Final = 0.002
_BUS_OFF: Final = struct.pack("=IB3x8s", 0x20000040, 8, bytes(8))
"""An error frame that says bus-off, as a kernel's driver hands it on."""


Later = tuple[float, Callable[[], None]] | None
"""What is still to be done so many s after the fault."""


class LiveError(Exception):
    """The programs did not come to where a fault can be tried."""


class LiveBench:
    """Ship and controller as processes on an interface, and a listener.

    Parameters
    ----------
    bus : str
        SocketCAN interface.
    folder : Path
        For the controller's files.
    """

    def __init__(self, bus: str, folder: Path) -> None:
        self.bus = bus
        catalogue = load_catalogue()
        self._status = catalogue.receiver(ControllerStatus)
        self._drive = catalogue.receiver(DriveStatus1)
        self._port = SocketCanPort(bus, [self._status.can_id, self._drive.can_id])
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
        """End both."""
        for process in (self.controller, self.ship):
            if process.poll() is None:
                process.send_signal(signal.SIGCONT)
                process.kill()
            process.wait()
        self._port.close()

    def look(self) -> None:
        """Hear what came."""
        time.sleep(_LOOK_S)
        try:
            frames = self._port.receive()
        except PortError:
            return
        for frame in frames:
            if frame.can_id == self._status.can_id:
                status = self._status.accept(frame)
                if status is not None:
                    self.mode, self._status_s = status.mode, time.monotonic()
                    self.fault = "" if status.fault is None else status.fault.name
            elif (drive := self._drive.accept(frame)) is not None:
                self.state, self.pressure_pa = drive.state, drive.pressure_pa

    def wait_in_charge(self) -> None:
        """Wait until the pump gives pressure.

        Raises
        ------
        LiveError
            If it does not.
        """
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
        """Whether the controller says so at present."""
        return self.mode is Mode.ACTIVE and time.monotonic() - self._status_s < _RECENT_S

    def watch(self, later: Later = None) -> tuple[float | None, float | None]:
        """Look on; ms until the controller faults, and until the drive no longer is enabled."""
        began_s = time.monotonic()
        found: float | None = None
        zero: float | None = None
        while (since_s := time.monotonic() - began_s) < WATCHED_S:
            self.look()
            if later is not None and since_s >= later[0]:
                later[1]()
                later = None
            if found is None and self.mode is Mode.FAULT:
                found = round(1e3 * since_s, 1)
            if zero is None and self.state is not DriveState.OPERATION_ENABLED:
                zero = round(1e3 * since_s, 1)
        return found, zero


def controller_killed(bench: LiveBench) -> Later:
    """SIGKILL the controller."""
    bench.controller.kill()
    return None


def controller_stopped(bench: LiveBench) -> Later:
    """SIGSTOP the controller."""
    bench.controller.send_signal(signal.SIGSTOP)
    return None


def controller_stopped_for_a_second(bench: LiveBench) -> Later:
    """SIGSTOP the controller, and SIGCONT when its drive has long been off."""
    bench.controller.send_signal(signal.SIGSTOP)
    return RESTED_S, partial(bench.controller.send_signal, signal.SIGCONT)


def controller_hung_up(bench: LiveBench) -> Later:
    """SIGHUP the controller."""
    bench.controller.send_signal(signal.SIGHUP)
    return None


def controller_terminated(bench: LiveBench) -> Later:
    """SIGTERM the controller, as a service manager does."""
    bench.controller.terminate()
    return None


def ship_killed(bench: LiveBench) -> Later:
    """SIGKILL the ship's side, sensors and drive with it."""
    bench.ship.kill()
    return None


def ship_stopped_for_a_second(bench: LiveBench) -> Later:
    """SIGSTOP the ship's side, and SIGCONT when the controller has long faulted."""
    bench.ship.send_signal(signal.SIGSTOP)
    return RESTED_S, partial(bench.ship.send_signal, signal.SIGCONT)


def bus_off(bench: LiveBench) -> Later:
    """Send an error frame that says bus-off."""
    with socket.socket(socket.AF_CAN, socket.SOCK_RAW, socket.CAN_RAW) as raw:
        raw.bind((bench.bus,))
        raw.send(_BUS_OFF)
    return None


ACTIONS: Final[dict[str, Callable[[LiveBench], Later]]] = {
    each.__name__: each
    for each in (
        controller_killed,
        controller_stopped,
        controller_stopped_for_a_second,
        controller_hung_up,
        controller_terminated,
        ship_killed,
        ship_stopped_for_a_second,
        bus_off,
    )
}


@contextmanager
def _bench(bus: str) -> Iterator[LiveBench]:
    with ExitStack() as stack:
        folder = Path(stack.enter_context(tempfile.TemporaryDirectory()))
        bench = LiveBench(bus, folder)
        stack.callback(bench.close)
        yield bench


@contextmanager
def _in_charge(bus: str) -> Iterator[LiveBench]:
    """A bench whose controller is in charge, if need be not the first one.

    Raises
    ------
    LiveError
        If none came so far.
    """
    for start in range(1, STARTS + 1):
        with _bench(bus) as bench:
            try:
                bench.wait_in_charge()
            except LiveError:
                if start == STARTS:
                    raise
            else:
                yield bench
                return


def run_live(row: LiveRow, bus: str, requirement: str) -> dict[str, Any]:
    """Do a live row and judge it; as `Result.as_json` gives it.

    Raises
    ------
    OSError
        If the interface can't be used.
    """
    problems = []
    found: float | None = None
    zero: float | None = None
    code = ""
    mode: Mode | None = None
    state: DriveState | None = None
    try:
        with _in_charge(bus) as bench:
            found, zero = bench.watch(ACTIONS[row.does](bench))
            code, mode, state = bench.fault, bench.mode, bench.state
            if bench.in_charge:
                problems.append("in charge again in the end")
    except LiveError as error:
        problems.append(str(error))
    judged = found if row.judged == "found" else zero
    if not problems and judged is None:
        problems.append("was not found" if row.judged == "found" else "the drive went on")
    elif judged is not None and row.within_ms is not None and judged > row.within_ms:
        problems.append(f"after {judged:.0f} ms, {row.within_ms:.0f} allowed")
    return {
        "id": row.id,
        "meets": list(row.meets),
        "requirement": requirement,
        "reaction": row.judged,
        "found_ms": found,
        "zero_ms": zero,
        "limit_ms": row.within_ms,
        "verdict": "fail" if problems else "pass",
        "problems": problems,
        "codes": [code] if code and code != "NONE" else [],
        "wire": f"at the end {mode!r}, drive {state!r}",
        "roll_ratio": None,
        "recording": None,
    }
