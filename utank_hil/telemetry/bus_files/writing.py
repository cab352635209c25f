"""Copies of a log of the bus: candump, ASC and BLF, with every frame's time, kind and length."""

from abc import abstractmethod
from collections import Counter
from collections.abc import Callable, Iterable
from datetime import UTC, datetime
from itertools import chain, islice
from pathlib import Path
from typing import Any, Final

from utank_hil.base.closing import Closing
from utank_hil.base.whole_file import left_whole
from utank_hil.telemetry.bus_files.frame import FD_LENGTHS, BusFrame, FrameKind

SUFFIXES: Final = (".log", ".asc", ".blf")  #: Formats that are written.
_WALL_CLOCK_NS: Final = 631_152_000 * 10**9
"""Times from here on, 1990, count from 1970, others from the log's start, as BLF has it."""


def write_frames(path: Path, frames: Iterable[BusFrame], notes: list[str] | None = None) -> int:
    """Write frames to a file, overwriting it, and return their number.

    The suffix, of `SUFFIXES`, says the format; what it can't hold is appended to `notes`. Times are
    kept to a microsecond: in candump as they are; in ASC from the millisecond of the first frame
    where they are times of the day; BLF notes that in its head.
    """
    suffix = path.suffix.lower()
    writers: dict[str, Callable[..., _Writer]] = {".log": _Candump, ".asc": _Asc, ".blf": _Blf}
    lost: Counter[str] = Counter()
    waiting = iter(frames)
    first = list(islice(waiting, 1))  # Before a file is overwritten, the log has been begun.
    mode, encoding = ("wb", None) if suffix == ".blf" else ("w", "utf-8")
    count = 0
    with (
        left_whole(path),
        path.open(mode, encoding=encoding) as content,
        writers[suffix](content, lost, first[0].time_ns if first else 0) as copy,
    ):
        for frame in chain(first, waiting):
            if frame.extended or frame.number < 1 << 11 or frame.kind is FrameKind.ERROR:
                copy.write(frame)
                count += 1
            else:
                lost["frames of 11 bits have a longer identifier and are left out"] += 1
    if notes is not None:
        notes += [f"{path.name}: {number} {what}" for what, number in lost.items()]
    return count


class _Writer(Closing):
    """Writes one format; `lost` counts what it can't hold, `first_ns` is the first time."""

    def __init__(self, content: Any, lost: Counter[str], first_ns: int) -> None:
        self._content, self._lost = content, lost
        self._channels: dict[str, int] = {}
        self._origin_ns = min(0, first_ns)

    def close(self) -> None:
        """End the file; most formats have no end."""

    @abstractmethod
    def write(self, frame: BusFrame) -> None:
        """Write one frame."""

    def _microseconds(self, time_ns: int) -> int:
        time_us = (time_ns - self._origin_ns + 500) // 1000
        if time_us < 0:
            self._lost["stamps are before the log's start and written as that"] += 1
        return max(0, time_us)

    def _number(self, channel: str) -> int:
        """Return the number of a channel from 1 on: 1 of ``can0``, and of ``1``."""
        if channel not in self._channels:
            digits = channel[len(channel.rstrip("0123456789")) :]
            wanted = int(digits or "0") + (digits != channel)
            taken = self._channels.values()
            if wanted in taken or not 0 < wanted < 1 << 16:
                wanted = max(taken, default=0) + 1
            self._channels[channel] = wanted
        return self._channels[channel]


class _Candump(_Writer):
    def write(self, frame: BusFrame) -> None:
        time_ns, channel, number, extended, kind, data, code, sent, speed = frame
        seconds, microseconds = divmod(self._microseconds(time_ns), 1_000_000)
        text = data.hex().upper()
        if kind is FrameKind.REMOTE:
            text = f"R{min(code, 8)}"
        elif kind is FrameKind.FD:
            text = f"#{speed:X}{text}"
        if kind is not FrameKind.FD and code > 8:
            text += f"_{code:X}"
        if kind is FrameKind.ERROR:
            name = f"{number | 0x20000000:08X}"
        else:
            name = f"{number:08X}" if extended else f"{number:03X}"
        bus = f"can{self._number(channel) - 1}" if channel.isdigit() else channel
        mark = "" if sent is None else " T" if sent else " R"
        self._content.write(f"({seconds:010d}.{microseconds:06d}) {bus} {name}#{text}{mark}\n")


class _Asc(_Writer):
    """Its head has the day where the times have it."""

    def __init__(self, content: Any, lost: Counter[str], first_ns: int) -> None:
        super().__init__(content, lost, first_ns)
        if first_ns >= _WALL_CLOCK_NS:
            self._origin_ns = first_ns // 1_000_000 * 1_000_000
        begin = datetime.fromtimestamp((self._origin_ns // 1_000_000) * 1e-3, UTC)
        day = f"{begin:%a %b %d %H:%M:%S}.{begin.microsecond // 1000:03d} {begin:%Y}"
        content.write(
            f"date {day}\nbase hex  timestamps absolute\ninternal events logged\n"
            f"Begin Triggerblock {day}\n 0.000000 Start of measurement\n"
        )

    def close(self) -> None:
        self._content.write("End TriggerBlock\n")

    def write(self, frame: BusFrame) -> None:
        time_ns, channel, number, extended, kind, data, code, sent, speed = frame
        seconds, microseconds = divmod(self._microseconds(time_ns), 1_000_000)
        stamp, bus = f"{seconds:4d}.{microseconds:06d}", self._number(channel)
        name, way = f"{number:X}{'x' if extended else ''}", "Tx" if sent else "Rx"
        text = data.hex(" ").upper()
        if kind is FrameKind.ERROR:
            line = f"{bus}  ErrorFrame"
            if number or data:
                self._lost["error frames are written without their class and data"] += 1
        elif kind is FrameKind.FD:
            flags = 0x1000 | (speed & 1) << 13 | (speed & 2) << 13
            line = (
                f"CANFD {bus:3d} {way}   {name:>9}                                   {speed & 1} "
                f"{speed >> 1} {code:x} {len(data):2d} {text}        0    0 {flags:8X}"
                "        0        0        0        0        0"
            )
        elif kind is FrameKind.REMOTE:
            line = f"{bus}  {name:<15} {way}   r {code:X}"
        else:
            line = f"{bus}  {name:<15} {way}   d {code:X} {text}"
        self._content.write(f"{stamp} {line}\n")


class _Blf(_Writer):
    def __init__(self, content: Any, lost: Counter[str], first_ns: int) -> None:
        from can import BLFWriter

        super().__init__(content, lost, first_ns)
        self._blf = BLFWriter(content)
        known = first_ns >= _WALL_CLOCK_NS
        self._blf.start_timestamp = float(first_ns // 10**9 - 1) if known else 0.0

    def close(self) -> None:
        self._blf.stop()

    def write(self, frame: BusFrame) -> None:
        from can import Message

        time_ns, channel, number, extended, kind, data, code, sent, speed = frame
        is_fd = kind is FrameKind.FD
        self._blf.on_message_received(
            Message(
                timestamp=self._microseconds(time_ns) * 1e-6,
                arbitration_id=number,
                is_extended_id=extended,
                is_remote_frame=kind is FrameKind.REMOTE,
                is_error_frame=kind is FrameKind.ERROR,
                is_fd=is_fd,
                bitrate_switch=bool(speed & 1),
                error_state_indicator=bool(speed & 2),
                is_rx=not sent,
                channel=self._number(channel) - 1,
                dlc=FD_LENGTHS[code] if is_fd else code,
                data=data,
            )
        )
