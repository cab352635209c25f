"""A log of the bus in any format, seen from its content, with its times on one clock.

A log goes on where its clock is set: back, or ahead by more than a day. A jump ahead by less may be
silence and stays. A few stamps off the others are moved to the frame before. All of it is reported.
"""

import re
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from utank_hil.base.between import ALWAYS, Between
from utank_hil.base.text_files import open_content, open_text
from utank_hil.telemetry.bus_files import asc, binary, candump, savvycan, trc
from utank_hil.telemetry.bus_files.frame import (
    LIMIT_BYTES,
    BusFrame,
    BusLogError,
    FrameSource,
    LineParser,
    TextLog,
)

_TICK_NS: Final = 10_000_000  #: Largest step back that is left as it is; the controller's tick.
_NEAR_NS: Final = 20_000_000  #: Largest step ahead that is not looked at: a cycle of most sensors.
_BURST_NS: Final = 1_000_000_000  #: Largest lag of frames written late, as of a second channel.
_SILENCE_NS: Final = 10_000_000_000  #: Shortest silence that is reported.
_UNUSUAL: Final = 20  #: Its length in mean steps from frame to frame; a sparse log has many.
_DAY_NS: Final = 86_400_000_000_000
_MINUTE_NS: Final = 60_000_000_000
_STRAY: Final = 16  #: Most stamps in a row that are wrong if later ones go on as before.
_STEPS: Final = 100  #: Number of steps from which the times of a log can't be trusted.
_SHOWN: Final = 3  #: Number of steps that are reported one by one.


class OneClock:
    """Frames of a log of this name with times on one clock, in the order of the file.

    `place` returns the place of the last frame; `notes` are complete after it. The iteration raises
    BusLogError if the times can't be trusted.
    """

    def __init__(self, name: str, source: Iterable[BusFrame], place: Callable[[], str]) -> None:
        self.notes: list[str] = []
        self._name, self._source, self._where = name, source, place
        self._offset_ns = self._begin_ns = self._last_ns = self._longest_ns = 0
        self._steps = self._late = self._count = self._silences = 0
        self._waiting: list[BusFrame] = []
        self._place = self._longest_at = ""

    def __iter__(self) -> Iterator[BusFrame]:
        for frame in self._source:
            if not self._count:
                self._begin_ns = self._last_ns = frame.time_ns
            self._count += 1
            waiting = self._waiting
            while True:
                step_ns = frame.time_ns + self._offset_ns - self._last_ns
                passed_ns = _NEAR_NS + waiting[-1].time_ns - waiting[0].time_ns if waiting else 0
                if -_TICK_NS <= step_ns <= passed_ns + _NEAR_NS:
                    if waiting:
                        back_ns = waiting[-1].time_ns - frame.time_ns
                        ahead = waiting[0].time_ns + self._offset_ns > self._last_ns
                        stray = (back_ns if ahead else -back_ns) > _TICK_NS
                        yield from self._strays() if stray else self._next_base()
                    yield self._shifted(frame)
                elif not waiting:
                    waiting.append(frame)
                    self._place = self._where()
                elif len(waiting) < _STRAY and (
                    -_TICK_NS <= frame.time_ns - waiting[-1].time_ns <= _NEAR_NS
                ):
                    waiting.append(frame)
                else:
                    yield from self._next_base()
                    continue
                break
        yield from self._next_base()
        self._conclude()

    def _shifted(self, frame: BusFrame) -> BusFrame:
        time_ns = frame.time_ns + self._offset_ns
        if time_ns < self._last_ns:
            self._late += 1
        else:
            self._last_ns = time_ns
        return BusFrame(time_ns, *frame[1:]) if self._offset_ns else frame

    def _strays(self) -> Iterator[BusFrame]:
        """Take waiting frames as of the frame before; those written a little late as they are."""
        frames, off_ns = tuple(self._waiting), self._waiting[0].time_ns + self._offset_ns
        off_ns -= self._last_ns
        self._waiting.clear()
        if -_BURST_NS <= off_ns < 0:
            yield from map(self._shifted, frames)
            return
        stamps = "1 stamp is" if len(frames) == 1 else f"{len(frames)} stamps are"
        self._step(f"{stamps} {off_ns * 1e-9:+.6f} s off those around, taken as the one before")
        for frame in frames:
            yield BusFrame(self._last_ns, *frame[1:])

    def _next_base(self) -> Iterator[BusFrame]:
        """Go on with waiting frames, whose stamps stand apart from those before."""
        if not self._waiting:
            return
        frames, step_ns = tuple(self._waiting), self._waiting[0].time_ns + self._offset_ns
        step_ns -= self._last_ns
        self._waiting.clear()
        if abs(step_ns + _DAY_NS) < _MINUTE_NS:
            self._offset_ns += _DAY_NS
            self._step("stamps step back by a day, taken for midnight")
        elif step_ns < -_TICK_NS or step_ns > _DAY_NS:
            self._offset_ns -= step_ns
            how = "back" if step_ns < 0 else "ahead"
            self._step(
                f"stamps step {how} by {abs(step_ns) * 1e-9:.6f} s, as where a clock is set or "
                "measurements are joined; taken as going on at once"
            )
        elif step_ns > _SILENCE_NS:
            self._silences += 1
            if step_ns > self._longest_ns:
                self._longest_ns, self._longest_at = step_ns, self._place
        yield from map(self._shifted, frames)

    def _step(self, text: str) -> None:
        self._steps += 1
        if self._steps > _STEPS:
            raise BusLogError(
                f"{self._name}: {self._place}: {text}; with more than {_STEPS} such steps its "
                "times can't be trusted: log with candump -l, or choose one channel by --channel"
            )
        if self._steps <= _SHOWN:
            self.notes.append(f"{self._name}: {self._place}: {text}")

    def _conclude(self) -> None:
        if self._late > 10 and self._late > self._count // 4:
            raise BusLogError(
                f"{self._name}: {self._late} of {self._count} stamps lie before the one before: if "
                "they count from the frame before (candump -td), log with candump -l; if channels "
                "are mixed, choose one by --channel"
            )
        if self._steps > _SHOWN:
            self.notes.append(f"{self._name}: {self._steps} steps and wrong stamps in all")
        usual_ns = (self._last_ns - self._begin_ns) / max(1, self._count)
        if self._longest_ns > _UNUSUAL * usual_ns:
            self.notes.append(
                f"{self._name}: {self._longest_at}: no frame for {self._longest_ns * 1e-9:.6f} s, "
                f"the longest of {self._silences} such gaps; if the clock was set there, use the "
                "parts by --from and --until"
            )


READ: Final = "candump, ASC, BLF, MF4, PEAK's .trc and SavvyCAN's .csv"  #: Formats that are read.
_BINARY: Final = {binary.BLF_MARK: binary.BlfLog, binary.MF4_MARK: binary.Mf4Log}
# What a line looks like, a new parser of lines, and whether they are `counted`.
_TEXT: Final[list[tuple[re.Pattern[str], Callable[[], LineParser], bool]]] = [
    (savvycan.LOOKS, lambda: savvycan.parse, True),
    (trc.LOOKS, lambda: trc.TrcParser().parse, True),
    (candump.LOOKS, lambda: candump.parse, False),
    (asc.LOOKS, lambda: asc.AscParser().parse, True),
]
_LOOKED_AT: Final = 1 << 16  #: Characters at the begin of a file that show its format.


def source_of(path: Path) -> FrameSource | None:
    """Return a reader of a log, by its content; None if it looks like none."""
    # A cut is ignored here: the reading itself reports it.
    with open_content(path, LIMIT_BYTES, lambda _: None) as content:
        mark = content.read(4)
    if mark in _BINARY:
        return _BINARY[mark](path)
    for line in _begin(path):
        for looks, parser, counted in _TEXT:
            if looks.match(line):
                return TextLog(path, parser(), counted)
    return None


@dataclass(frozen=True, slots=True)
class BusLog:
    """Frames of a log, compressed with gzip or not; read anew by every call of `frames`.

    Without a `channel` all are read; `between_s` counts from the first frame.
    """

    path: Path
    channel: str | None = None
    between_s: Between = ALWAYS

    def frames(self, notes: list[str] | None = None) -> Iterator[BusFrame]:
        """Yield the frames in the order of the file, on one clock; `notes` gets what was found.

        BusLogError is raised if it is no log, has no such frames, or its times can't be trusted.
        """
        source = source_of(self.path)
        if source is None:
            begin = next(iter(_begin(self.path)), "")
            what = f"it begins with {begin[:20]!r}" if begin else "it is empty"
            if self.path.suffix.lower() in (".xlsx", ".xls", ".ods"):
                what = "it is a spreadsheet: save it as .csv"
            elif self.path.suffix == ".frames":
                what = "it is a frame log: utank-hil export makes a .log of it"
            raise BusLogError(
                f"{self.path}: is no log of the bus, such as {READ}: {what}; a recording is .rrd "
                "or .frames, a table .csv or .parquet"
            )
        others: set[str] = set()
        clock = OneClock(self.path.name, self._of_channel(source, others), lambda: source.place)
        begin_ns, found = None, False
        for frame in clock:
            begin_ns = frame.time_ns if begin_ns is None else begin_ns
            after_s = (frame.time_ns - begin_ns) * 1e-9
            if after_s > self.between_s[1] + 1.0:  # A burst may be written late.
                break
            if after_s < self.between_s[0] or after_s > self.between_s[1]:
                continue
            found = True
            yield frame
        if begin_ns is None:
            raise BusLogError(
                f"{self.path}: no frames of channel {self.channel} in it; it has "
                f"{', '.join(sorted(others))}"
            )
        if not found:
            raise BusLogError(
                f"{self.path}: no frames between --from and --until; the last is at {after_s:g} s"
            )
        if notes is not None:
            notes += [*source.notes, *clock.notes]

    def _of_channel(self, source: FrameSource, others: set[str]) -> Iterator[BusFrame]:
        for frame in source:
            if self.channel is None or frame.channel == self.channel:
                yield frame
            else:
                others.add(frame.channel)


def _begin(path: Path) -> list[str]:
    with open_text(path, LIMIT_BYTES, lambda _: None, errors="replace") as text:
        return [line for line in text.read(_LOOKED_AT).splitlines() if line.strip()]
