"""Ship and controller as processes on a CAN interface, with a listener.

Times are the kernel's of each frame: the machine may delay the listener, but not these. The streams
of ship and controller show whether one of them was delayed, so that late reactions can't be judged.
"""

import math
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import dataclass, field
from itertools import pairwise
from pathlib import Path
from typing import Final, Literal

import can
from can.interfaces.socketcan import SocketcanBus

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

Stream = Literal["commands", "motions"]
"""Stream of the controller's commands, or of the ship's motions."""
CYCLES_S: Final[dict[Stream, float]] = {"commands": 0.02, "motions": 0.01}
HELD_UP_S: Final = 0.03
"""Delay of a node in s above which reactions that depend on it cannot be judged. Chosen; no
study."""
SIGNALLED_S: Final = 0.005
"""Time in s after a signal in which frames sent before it may still arrive. Chosen; no study."""


@dataclass(slots=True)
class LiveLog:
    """Times of frames in s of the system's clock, and their content."""

    commands: list[float] = field(default_factory=list)
    motions: list[float] = field(default_factory=list)
    modes: list[tuple[float, Mode | None]] = field(default_factory=list)
    states: list[tuple[float, DriveState | None]] = field(default_factory=list)

    def stream(self, name: Stream) -> list[float]:
        """Times of one of the streams."""
        return self.commands if name == "commands" else self.motions

    def held_up_s(
        self, begin_s: float = -math.inf, end_s: float = math.inf, silences: Stream | None = None
    ) -> float:
        """Longest gap in s beyond its cycle, overlapping a span, of a stream that goes on."""
        return max(
            max((b - a for a, b in pairwise(self.stream(name)) if b > begin_s and a < end_s),
                default=0.0) - cycle_s
            for name, cycle_s in CYCLES_S.items()
            if name != silences
        )  # fmt: skip


@dataclass(frozen=True, slots=True)
class LiveTimes:
    """Reaction times of a fault."""

    #: found_ms, zero_ms: times from the fault to the controller's FAULT, and to the drive's being
    #: disabled.
    found_ms: float | None
    zero_ms: float | None
    #: Longest delay by the machine of the side that had to detect the fault or to act.
    held_up_ms: float


def times_of(
    log: LiveLog,
    fault_s: float,
    end_s: float,
    *,
    silences: Stream | None,
    judged: Literal["found", "zero"],
) -> LiveTimes:
    """Return the times from a fault on.

    They count from `fault_s`, or from the last frame of the stream `silences` that the fault ends.
    Listening ended at `end_s`.
    """
    begin_s = fault_s
    if silences is not None:
        begin_s = max(each for each in log.stream(silences) if each <= fault_s + SIGNALLED_S)
    found_s = next((t for t, mode in log.modes if t > fault_s and mode is Mode.FAULT), None)
    zero_s = next(
        (t for t, state in log.states
         if t > fault_s and state is not DriveState.OPERATION_ENABLED), None,
    )  # fmt: skip
    judged_s = found_s if judged == "found" else zero_s
    held_up_s = log.held_up_s(begin_s, end_s if judged_s is None else judged_s, silences)
    found_ms, zero_ms = (
        None if time_s is None else round(1e3 * (time_s - begin_s), 1)
        for time_s in (found_s, zero_s)
    )
    return LiveTimes(found_ms, zero_ms, round(1e3 * held_up_s, 1))


STORM: Final = CONFIGS / "scenarios" / "storm.yaml"
CONTROLLER: Final = CONFIGS / "controllers" / "gpc.yaml"
START_S: Final = 180.0
"""Longest time in s until the controller is in charge: imports are slow in an emulated kernel."""
DRIVEN_PA: Final = 5e3
"""Pressure above which the pump works: a tenth of the limit of the storm's ship."""
WATCHED_S: Final = 3.0
"""Time in s for which the bus is watched after the fault: two seconds more than the pause."""
_RECENT_S: Final = 0.5
"""Largest age in s of the last CTRL_STATUS of a controller in charge: five cycles."""
_LOOK_S: Final = 0.002  # Polling interval in s: a fifth of the shortest message cycle.
_EXTENDED_MASK: Final = 0x1FFFFFFF
_CATALOGUE: Final = load_catalogue()


Later = tuple[float, Callable[[], None]] | None
"""Time in s after the fault, and the action to be done then."""


class LiveError(Exception):
    """Error for programs that did not reach the state in which a fault can be injected."""


class LiveBench:
    """Ship and controller as processes on an interface, with a listener."""

    def __init__(self, bus: str, folder: Path) -> None:
        SocketCanPort(bus).close()  # fails with the reason and the remedy
        self.bus = bus
        self.log = LiveLog()
        kinds = (ControllerStatus, DriveStatus1, PumpCommand, SensorMotion)
        # python-can directly, because our port drops the kernel's time of a frame
        self._bus = SocketcanBus(
            bus,
            can_filters=[{"can_id": _CATALOGUE.codec(kind).can_id, "can_mask": _EXTENDED_MASK,
                          "extended": True} for kind in kinds],
        )  # fmt: skip
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
        for heard in self._heard():
            time_s = heard.timestamp
            message = _CATALOGUE.decoded(Frame(heard.arbitration_id, bytes(heard.data)))
            if isinstance(message, PumpCommand):
                self.log.commands.append(time_s)
            elif isinstance(message, SensorMotion):
                self.log.motions.append(time_s)
            elif isinstance(message, ControllerStatus):
                self.mode, self._status_s = message.mode, time_s
                self.fault = "" if message.fault is None else message.fault.name
                self.log.modes.append((time_s, message.mode))
            elif isinstance(message, DriveStatus1):
                self.state, self.pressure_pa = message.state, message.pressure_pa
                self.log.states.append((time_s, message.state))

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
