"""Logs of the bus in other programs' formats: candump (.log), ASC (.asc) and BLF (.blf).

They hold frames and their times on the bus, but not which tick received them. Ticks are therefore
placed on a grid that starts at the controller's first frame, or at the log's if it is silent.
"""

import math
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from utank_hil.base.tick import TICK_NS
from utank_hil.base.whole_file import left_whole
from utank_hil.canbus import (
    Address,
    AddressClaim,
    ControllerStatus,
    ControlWord,
    Frame,
    PumpCommand,
    ValveCommand,
    load_catalogue,
)
from utank_hil.telemetry.bus_records import Kind
from utank_hil.telemetry.replay import Entry

if TYPE_CHECKING:
    import can

BUS_SUFFIXES: Final = (".log", ".asc", ".blf")
_EARLY_NS: Final = TICK_NS // 5
"""Largest lead of a frame in its tick over the controller's first frame in its own."""


class BusLogError(ValueError):
    """The file is no log of its kind, or lacks what is needed; the message says why."""


def write_bus_log(path: Path, entries: Iterable[Entry]) -> int:
    """Write the frames of a recording and return their number; times count from its first record.

    Parameters
    ----------
    path : Path
        File to overwrite; its suffix, one of `BUS_SUFFIXES`, selects the format. Times of candump
        and ASC are rounded to a microsecond.
    entries : iterable of Entry
        Records; frames of the controller are marked as transmitted.
    """
    from can import Message

    suffix, count, begin_ns = path.suffix.lower(), 0, None
    mode = "wb" if suffix == ".blf" else "w"
    with left_whole(path), path.open(mode) as content, _writer(content, suffix) as writer:
        for number, data, kind, time_ns in entries:
            begin_ns = time_ns if begin_ns is None else begin_ns
            if kind not in (Kind.RECEIVED, Kind.SENT):
                continue
            count += 1
            message = Message(
                timestamp=max(0, time_ns - begin_ns) * 1e-9,
                arbitration_id=number,
                is_extended_id=True,
                data=data,
                is_rx=kind == Kind.RECEIVED,
            )
            writer.on_message_received(message)
    return count


def read_bus_log(path: Path) -> list[Entry]:
    """Read a log as the inputs and answers of a controller on that bus.

    Raises
    ------
    BusLogError
        If it can't be read to its end, or holds no frame of the catalogue.
    OSError
        If there is no such file.
    """
    catalogue = load_catalogue()
    own_ids = catalogue.ids_sent_by(Address.CONTROLLER)
    messages = list(_messages(path))
    if not any(message.arbitration_id in catalogue.can_ids for message in messages):
        raise BusLogError(
            f"{path}: no frame in it is one of the catalogue's (docs/can-catalogue.md)"
        )
    # Frames that the logging program sent are marked, if it was the controller.
    marked = any(not m.is_rx and m.arbitration_id in own_ids for m in messages)
    begin_s = messages[0].timestamp
    received: list[Entry] = []
    sent: list[tuple[int, Frame]] = []
    for message in messages:
        time_ns = round((message.timestamp - begin_s) * 1e6) * 1000
        frame = Frame(message.arbitration_id, bytes(message.data))
        if not message.is_extended_id or message.is_remote_frame or message.is_error_frame:
            received.append(Entry(1, b"", Kind.OTHERS, time_ns))
        elif not message.is_rx if marked else frame.can_id in own_ids:
            sent.append((time_ns, frame))
        else:
            received.append(Entry(*frame, Kind.RECEIVED, time_ns))
    return list(_in_ticks(received, sent))


def begins_with_the_controller(entries: Iterable[Entry]) -> bool:
    """Whether the first frame that the controller sent is its address claim."""
    claim = load_catalogue().codec(AddressClaim, Address.CONTROLLER).can_id
    first = next((entry for entry in entries if entry.kind == Kind.SENT), None)
    return first is not None and first.number == claim


def _in_ticks(received: list[Entry], sent: list[tuple[int, Frame]]) -> Iterator[Entry]:
    """Return entries with the ticks between them; a tick's own frames follow it."""
    begin_ns = sent[0][0] if sent else received[0].time_ns
    by_tick: dict[int, list[Frame]] = {}
    for time_ns, frame in sent:
        by_tick.setdefault((time_ns - begin_ns + _EARLY_NS) // TICK_NS, []).append(frame)
    status = load_catalogue().codec(ControllerStatus)
    said = next((status.decode(f.data) for _, f in sent if f.can_id == status.can_id), None)
    real_time = said is None or not said.not_realtime
    yield Entry(0, bytes([real_time]), Kind.STARTED, begin_ns)
    last_ns = max(received[-1].time_ns if received else 0, sent[-1][0] if sent else 0)
    last_own = max(by_tick, default=-1)
    waiting = iter(received)
    entry = next(waiting, None)
    for tick in range(math.ceil((last_ns - begin_ns) / TICK_NS) + 1):
        now_ns = begin_ns + tick * TICK_NS
        while entry is not None and entry.time_ns <= now_ns:
            yield entry
            entry = next(waiting, None)
        # The last frames may be those that a controller sends after its last tick.
        leaves = tick == last_own and _only_stops(by_tick[tick])
        yield Entry(0, b"", Kind.STOP if leaves else Kind.TICK, now_ns)
        for frame in by_tick.get(tick, ()):
            yield Entry(*frame, Kind.SENT, now_ns)


def _only_stops(frames: list[Frame]) -> bool:
    """Whether frames are only the last commands, quick stop, of a controller that ends."""
    pump, valve = load_catalogue().codec(PumpCommand), load_catalogue().codec(ValveCommand)
    words = [pump.decode(frame.data) for frame in frames if frame.can_id == pump.can_id]
    return {frame.can_id for frame in frames} <= {pump.can_id, valve.can_id} and any(
        word is not None and word.control_word is ControlWord.QUICK_STOP for word in words
    )


def _messages(path: Path) -> Iterator["can.Message"]:
    """Yield the messages of a log."""
    from can import ASCReader, BLFReader, CanutilsLogReader

    readers: dict[str, Callable[[Any], Any]] = {
        ".log": CanutilsLogReader,
        ".asc": ASCReader,
        ".blf": BLFReader,
    }
    suffix, count = path.suffix.lower(), 0
    with path.open("rb") if suffix == ".blf" else path.open(errors="replace") as content:
        try:
            for message in readers[suffix](content):
                yield message
                count += 1
        except Exception as error:  # The readers raise many kinds of exception at damaged bytes.
            raise BusLogError(
                f"{path}: can't be read as {suffix[1:]} after {count} frames"
            ) from error
    if not count:
        raise BusLogError(f"{path}: no frames in it")


def _writer(content: Any, suffix: str) -> Any:
    from can import ASCWriter, BLFWriter, CanutilsLogWriter

    if suffix == ".log":
        return CanutilsLogWriter(content, channel="can0")
    return (ASCWriter if suffix == ".asc" else BLFWriter)(content)
