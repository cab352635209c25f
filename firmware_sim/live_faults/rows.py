"""Live rows: what is done to the deployed programs, and how soon they must react."""

import signal
import socket
import struct
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import closing, contextmanager
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any, Final, Literal

from firmware_sim.live_faults.bench import (
    HELD_UP_S,
    Later,
    LiveBench,
    LiveError,
    LiveTimes,
    Stream,
    times_of,
)

STARTS: Final = 3
"""Most starts: a machine that delays processes may end a run before its fault is injected, the only
cause of a new start."""
ATTEMPTS: Final = 3  #: Most attempts at a row: such a machine may also spoil what is judged.
RESTED_S: Final = 1.0
"""Pause of a stopped program in s: longer than every timeout of the other side but the panel's."""
_BUS_OFF: Final = struct.pack("=IB3x8s", 0x20000040, 8, bytes(8))
"""Error frame that reports bus-off, in the form of a kernel driver."""

Act = Callable[[LiveBench], Later]


@dataclass(frozen=True, slots=True)
class LiveRow:
    """A fault, and the latest reaction to it."""

    act: Act
    within_ms: float
    silences: Stream | None = None  #: Stream that the fault ends.
    #: Whether the controller's fault or the drive's stop is judged.
    judged: Literal["found", "zero"] = "zero"


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


ROWS: Final = {
    "live-controller-killed": LiveRow(_sent("controller", signal.SIGKILL), 120, "commands"),
    "live-controller-stopped": LiveRow(_sent("controller", signal.SIGSTOP), 120, "commands"),
    "live-controller-stopped-for-a-second": LiveRow(
        _sent("controller", signal.SIGSTOP, rested=True), 120, "commands"
    ),
    "live-controller-terminated": LiveRow(_sent("controller", signal.SIGTERM), 500),
    "live-controller-hung-up": LiveRow(_sent("controller", signal.SIGHUP), 500),
    "live-ship-killed": LiveRow(_sent("ship", signal.SIGKILL), 250, "motions", "found"),
    "live-ship-stopped-for-a-second": LiveRow(
        _sent("ship", signal.SIGSTOP, rested=True), 250, "motions", "found"
    ),
    "live-bus-off": LiveRow(bus_off, 250, judged="found"),
}


@contextmanager
def in_charge(bus: str) -> Iterator[LiveBench]:
    """Yield a bench with its controller in charge, or `LiveError` after several starts."""
    for start in range(1, STARTS + 1):
        with (
            tempfile.TemporaryDirectory() as folder,
            closing(LiveBench(bus, Path(folder))) as bench,
        ):
            try:
                bench.wait_in_charge()
            except LiveError:
                ended = any(each.poll() is not None for each in (bench.controller, bench.ship))
                if start == STARTS or ended or bench.log.held_up_s() <= HELD_UP_S:
                    raise
            else:
                yield bench
                return


def run_live(row: LiveRow, bus: str) -> tuple[list[str], LiveTimes]:
    """Run a row on an interface; return its problems, none where it passed, and the times."""
    for attempt in range(1, ATTEMPTS + 1):
        problems, times = attempted(row, bus)
        if not problems or times.held_up_ms <= 1e3 * HELD_UP_S:
            break
        held_up = f"the machine held processes up for {times.held_up_ms:.0f} ms, attempt {attempt}"
        problems.append(held_up)
    return problems, times


def attempted(row: LiveRow, bus: str) -> tuple[list[str], LiveTimes]:
    """Run a row once; return its problems, and the times."""
    try:
        with in_charge(bus) as bench:
            fault_s = time.time()
            end_s = bench.watch(row.act(bench))
            times = times_of(bench.log, fault_s, end_s, silences=row.silences, judged=row.judged)
            problems = ["in charge again in the end"] if bench.in_charge else []
    except LiveError as error:
        return [str(error)], LiveTimes(None, None, 0.0)
    found, zero = (times.found_ms, "FAULT"), (times.zero_ms, "the drive stopped")
    (judged_ms, _), (other_ms, other) = (found, zero) if row.judged == "found" else (zero, found)
    mode, state = ("silent" if each is None else each.name for each in (bench.mode, bench.state))
    end = f"; at the end {mode}, {bench.fault or 'no fault'}, the drive {state}"
    if judged_ms is None and not problems:
        instead = "" if other_ms is None else f"; instead: {other} after {other_ms:.0f} ms"
        lacking = "was not found" if row.judged == "found" else "the drive went on"
        problems.append(f"{lacking}{instead}{end}")
    elif judged_ms is not None and judged_ms > row.within_ms:
        problems.append(f"after {judged_ms:.0f} ms, {row.within_ms:.0f} allowed{end}")
    return problems, times


def as_json(name: str, row: LiveRow, bus: str) -> dict[str, Any]:
    """Run a row; return its result for `json.dumps`, with the keys of a lockstep row."""
    problems, times = run_live(row, bus)
    return {
        "id": name,
        "found_ms": times.found_ms,
        "zero_ms": times.zero_ms,
        "limit_ms": row.within_ms if row.judged == "found" else None,
        "zero_limit_ms": row.within_ms if row.judged == "zero" else None,
        "verdict": "fail" if problems else "pass",
        "problems": problems,
    }
