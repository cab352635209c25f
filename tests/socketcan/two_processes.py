"""Ship and controller as processes of their own on vcan0, with candump as a third listener."""

import fcntl
import json
import re
import signal
import socket
import struct
import subprocess
import sys
import time
from contextlib import closing, contextmanager
from pathlib import Path
from typing import NamedTuple

import cantools
import yaml
from busy_machine import Timekeeping, judged_by

from utank_hil.canbus import ControllerStatus, DriveStatus1, Mode, PortError, load_catalogue
from utank_hil.canbus.socketcan import SocketCanPort
from utank_hil.console.exit_codes import ExitCode

CHANNEL = "vcan0"
LOG_BUFFER_BYTES = 8 << 20
BIN = Path(sys.executable).parent
CONFIGS = Path("configs").resolve()
DBC = Path("utank_hil/canbus/utank.dbc")
VALVE_LIMITS = (
    "valve_age_ms", "valve_echo_age_ms", "valve_follows_within_ms", "valve_off_within_ms",
)  # fmt: skip
START_S = 180.0  # imports take long in a user-mode kernel
LINE = re.compile(r"\((?P<s>\d+)\.(?P<us>\d{6})\) \S+ (?P<id>[0-9A-F]{8})#(?P<data>[0-9A-F]*)")

_GET_FLAGS, _SET_FLAGS, _UP = 0x8913, 0x8914, 0x1  # ioctl of <linux/sockios.h>, IFF_UP


@contextmanager
def link_down():
    """The interface is down, and up again however that ends."""
    _set_link(up=False)
    try:
        yield
    finally:
        _set_link(up=True)


def _set_link(*, up):
    """Take the interface up or down without starting a process, which would make ticks late."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as channel:
        request = struct.pack("16sH14x", CHANNEL.encode(), 0)
        (flags,) = struct.unpack_from("16xH", fcntl.ioctl(channel, _GET_FLAGS, request))
        flags = flags | _UP if up else flags & ~_UP
        fcntl.ioctl(channel, _SET_FLAGS, struct.pack("16sH14x", CHANNEL.encode(), flags))


def patient_controller(folder, command_timeout_ms=50.0, controller="gpc", ship="thesis_first"):
    """A shipped controller with thresholds for a busy machine: function is judged, not timing.

    A user-mode kernel shares its one processor with whatever the machine does besides; its ticks
    come late, by tens of milliseconds at times, which the shipped thresholds rightly punish.
    """
    content = yaml.safe_load((CONFIGS / "controllers" / f"{controller}.yaml").read_text())
    content["vessel"] = str(CONFIGS / "ships" / f"{ship}.yaml")
    content["command_timeout_ms"] = command_timeout_ms
    content["safety"] = {
        "overruns_in_ten": None,
        "long_overrun_ms": 1000,
        "motion_age_ms": 500,
        "tank_degraded_age_ms": 500,
        "drive_age_ms": 500,
        "echo_age_ms": 500,
        "drive_enabled_within_ms": 500,
        **dict.fromkeys(VALVE_LIMITS, 500),
    }
    path = folder / "patient.yaml"
    path.write_text(yaml.safe_dump(content))
    return path


class Logged(NamedTuple):
    """One frame of candump's log, decoded by cantools and nothing of ours."""

    time_s: float
    name: str
    signals: dict[str, object]


class Candump:
    """candump on the bus from now on, its log in a file."""

    def __init__(self, folder):
        self._file = folder / "candump.log"
        self._output = self._file.open("wb")
        # a buffer of many seconds: what a busy machine keeps it from reading is not lost to the log
        log = ["candump", "-L", "-r", str(LOG_BUFFER_BYTES), CHANNEL]
        self._process = subprocess.Popen(log, stdout=self._output)

    def close(self):
        """End it; idempotent."""
        if self._process.poll() is None:
            self._process.send_signal(signal.SIGINT)  # on which it writes out what it holds
            self._process.wait(30)
            self._output.close()

    def stop(self, *names):
        """End it and read its log: all messages, or those of these names.

        A process in a user-mode kernel that grows beyond 250 MB is killed (docs/vcan.md): of many
        minutes read only what is needed.
        """
        self.close()
        database = cantools.database.load_file(DBC, strict=True)
        assert isinstance(database, cantools.database.Database)
        log = []
        with self._file.open() as lines:
            for line in lines:
                parts = LINE.fullmatch(line.rstrip("\n"))
                assert parts, f"candump wrote {line!r}"
                message = database.get_message_by_frame_id(int(parts["id"], 16))
                if names and message.name not in names:
                    continue
                signals = message.decode(bytes.fromhex(parts["data"]), decode_choices=False)
                assert isinstance(signals, dict)
                time_s = int(parts["s"]) + int(parts["us"]) * 1e-6
                log.append(Logged(time_s, message.name, dict(signals)))
        return log


class Watcher:
    """What controller and drive say of themselves at present."""

    def __init__(self):
        catalogue = load_catalogue()
        self._controller = catalogue.receiver(ControllerStatus)
        self._drive = catalogue.receiver(DriveStatus1)
        self._port = SocketCanPort(CHANNEL, can_ids=[self._controller.can_id, self._drive.can_id])
        self.status: ControllerStatus | None = None
        self.drive: DriveStatus1 | None = None
        self.statuses = 0
        self.machine = Timekeeping()

    def close(self):
        self._port.close()

    def look(self):
        """Hear what came since the last look."""
        try:
            frames = self._port.receive()
        except PortError:
            return
        for frame in frames:
            if frame.can_id == self._controller.can_id:
                self.status = self._controller.accept(frame) or self.status
                self.statuses += 1
            else:
                self.drive = self._drive.accept(frame) or self.drive

    def wait(self, until, timeout_s=START_S):
        """Look until something is so."""
        deadline = time.monotonic() + timeout_s
        while not until(self):
            assert time.monotonic() < deadline, f"controller {self.status}, drive {self.drive}"
            self.machine.nap()
            self.look()

    @property
    def mode(self):
        """Mode of the controller."""
        return None if self.status is None else self.status.mode

    def wait_in_charge(self, pressure_pa=0.0):
        """Look until the controller is active and the pump gives so much pressure."""
        self.wait(lambda watcher: watcher.mode is not None)
        self.machine.begin_anew()

        def done(watcher):
            drive = watcher.drive
            assert watcher.mode is not Mode.FAULT, f"controller {watcher.status}, drive {drive}"
            driven = drive is not None and abs(drive.pressure_pa) >= pressure_pa
            return driven and watcher.mode is Mode.ACTIVE

        self.wait(done)

    def watch(self, seconds):
        """Look for so long."""
        deadline = time.monotonic() + seconds
        while time.monotonic() < deadline:
            self.machine.nap()
            self.look()

    def forget(self):
        """Believe nothing that was said before."""
        self.look()
        self.status = self.drive = None
        self.statuses = 0


class Program:
    """One of our commands, running."""

    def __init__(self, folder, *command):
        self._errors = (folder / f"{command[0]}.err").open("w+")
        self._output = (folder / f"{command[0]}.out").open("w+")
        self._process = subprocess.Popen(
            [BIN / str(command[0]), *map(str, command[1:])],
            stdout=self._output,
            stderr=self._errors,
        )

    @property
    def code(self):
        """Exit code, None while it runs."""
        return self._process.poll()

    def signal(self, number):
        self._process.send_signal(number)

    def end(self, *codes, interrupt=True, timeout_s=60.0):
        """Interrupt it as Ctrl-C does, or wait for it; what it printed as JSON, and its notes.

        It must end with one of `codes`, without any with OK.
        """
        if interrupt and self._process.poll() is None:
            self._process.send_signal(signal.SIGINT)
        self._process.wait(timeout_s)
        self._output.seek(0)
        self._errors.seek(0)
        output, errors = self._output.read(), self._errors.read()
        assert self._process.returncode in (codes or (ExitCode.OK,)), errors
        assert "Traceback" not in errors
        return json.loads(output), errors

    def close(self):
        if self._process.poll() is None:
            self._process.kill()
            self._process.wait(30)
        self._output.close()
        self._errors.close()


@contextmanager
def watched():
    """Someone who watches; what is asserted meanwhile fails only where the machine kept time."""
    with closing(Watcher()) as watcher, judged_by(watcher.machine.failure):
        yield watcher


def run_ship(folder, scenario, *words, duration_s=1200):
    """The ship's side, for the time of a test at most."""
    words = ("firmware-sim", scenario, "--bus", CHANNEL, "--duration", duration_s, *words)
    return closing(Program(folder, *words, "--json"))


def run_controller(folder, config, *words):
    """The controller, for the time of a test at most."""
    return closing(Program(folder, "utank-hil", "run", config, "--bus", CHANNEL, *words, "--json"))
