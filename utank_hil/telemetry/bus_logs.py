"""Logs of the bus in other programs' formats, as what a controller on it received and sent.

They hold frames and their times on the bus, but not which tick received them. Ticks are therefore
placed on a grid that starts at the controller's first frame, or at the log's if it is silent.
"""

from collections import Counter, deque
from collections.abc import Iterable, Iterator
from typing import Final

from utank_hil import canbus
from utank_hil.base.tick import TICK_NS
from utank_hil.canbus.codec import FRAME_BYTES
from utank_hil.canbus.frame import BUS_SHIFT, LONGEST_ID, STANDARD
from utank_hil.telemetry.bus_files.frame import BusFrame, BusLogError, FrameKind
from utank_hil.telemetry.bus_files.log import BusLog
from utank_hil.telemetry.frame_log import Kind
from utank_hil.telemetry.replay import Entry

_EARLY_NS: Final = TICK_NS // 5
"""Largest lead of a frame in its tick over the controller's first frame in its own."""


_MOST: Final = 1 << 18
"""Most frames that are held for a tick: stamps in whole seconds have some 5000 of a full bus."""


class LoggedController:
    """A controller on a logged bus; the log is read once here, and again by `entries`.

    A frame is the controller's by its identifier. Where those that are marked as transmitted all
    have such identifiers, one of them that is not marked came from somebody else. What was found in
    the log is appended to `notes`. `starts` says whether the first frame that the controller sent
    is its address claim. BusLogError is raised as by `BusLog.frames`; also if the log holds several
    channels or no frame of the catalogue.
    """

    def __init__(self, log: BusLog, notes: list[str] | None = None) -> None:
        catalogue = canbus.load_catalogue()
        self._log, self._own_ids = log, catalogue.ids_sent_by(canbus.Address.CONTROLLER)
        status = catalogue.codec(canbus.ControllerStatus)
        channels: Counter[str] = Counter()
        own: dict[bool, list[BusFrame]] = {}  # first and last frame of the controller, by mark
        known, foreign_mark, said = False, False, None
        begin_ns, self._last_ns = None, 0
        for frame in log.frames(notes):
            channels[frame.channel] += 1
            begin_ns = frame.time_ns if begin_ns is None else begin_ns
            self._last_ns = max(self._last_ns, frame.time_ns)
            if frame.kind is not FrameKind.DATA or not frame.extended:
                continue
            known = known or frame.number in catalogue.can_ids
            if frame.number not in self._own_ids:
                foreign_mark = foreign_mark or bool(frame.sent)
                continue
            own.setdefault(bool(frame.sent), [frame])[1:] = [frame]
            if said is None and frame.number == status.can_id and len(frame.data) == FRAME_BYTES:
                said = status.decode(frame.data)
        if len(channels) > 1:
            names = ", ".join(f"{name} ({count} frames)" for name, count in channels.items())
            raise BusLogError(f"{log.path}: holds several channels, {names}: choose by --channel")
        if not known:
            raise BusLogError(
                f"{log.path}: no frame in it is one of the catalogue's (docs/can-catalogue.md)"
            )
        self._marked = True in own and not foreign_mark
        sent = own[True] if self._marked else [frame for each in own.values() for frame in each]
        times_ns = [frame.time_ns for frame in sent]
        self._begin_ns = min(times_ns, default=begin_ns or 0)
        self._last_own = (max(times_ns, default=self._begin_ns) - self._begin_ns) + _EARLY_NS
        self._real_time = said is None or not said.not_realtime
        claim = catalogue.codec(canbus.AddressClaim, canbus.Address.CONTROLLER).can_id
        self.starts = bool(sent) and min(sent, key=lambda each: each.time_ns).number == claim

    def entries(self) -> Iterator[Entry]:
        """Yield what the controller received and sent, with its ticks; frames follow their tick.

        What it sent in the last tick, the first after the last frame, may not be in the log.
        """
        yield Entry(0, bytes([self._real_time]), Kind.STARTED, self._begin_ns)
        tick, last = 0, -((self._begin_ns - self._last_ns) // TICK_NS)
        received: deque[Entry] = deque()
        sent: list[canbus.Frame] = []
        for frame in self._log.frames():
            while self._begin_ns + (tick + 1) * TICK_NS - _EARLY_NS <= frame.time_ns:
                yield from self._tick(tick, received, sent)
                tick, sent = tick + 1, []
            if frame.kind is FrameKind.ERROR:
                continue  # What the controller's own interface met is not in such a log.
            number = frame.number | (0 if frame.extended else STANDARD)
            if frame.kind is not FrameKind.DATA:
                received.append(Entry(1, b"", Kind.OTHERS, frame.time_ns))
            elif number in self._own_ids and (bool(frame.sent) or not self._marked):
                sent.append(canbus.Frame(number, frame.data))
            else:
                received.append(Entry(number, frame.data, Kind.RECEIVED, frame.time_ns))
            if len(received) + len(sent) > _MOST:
                raise BusLogError(
                    f"{self._log.path}: more than {_MOST} frames within one tick of 10 ms: its "
                    "stamps are no times"
                )
            while received and frame.time_ns <= self._begin_ns:  # The log may begin days before.
                yield received.popleft()
        for rest in range(tick, max(tick, last) + 1):
            yield from self._tick(rest, received, sent)
            sent = []

    def _tick(self, tick: int, received: deque[Entry], sent: list[canbus.Frame]) -> Iterator[Entry]:
        now_ns = self._begin_ns + tick * TICK_NS
        while received and received[0].time_ns <= now_ns:
            yield received.popleft()
        # The last frames may be those that a controller sends after its last tick.
        leaves = tick == self._last_own // TICK_NS and _only_stops(sent)
        yield Entry(0, b"", Kind.STOP if leaves else Kind.TICK, now_ns)
        for frame in sent:
            yield Entry(*frame, Kind.SENT, now_ns)


def frames_of(entries: Iterable[Entry], notes: list[str] | None = None) -> Iterator[BusFrame]:
    """Yield the frames of a recording, the controller's as transmitted, since its first record.

    The number of frames of other kinds, which a recording only counts, is appended to `notes`.
    """
    begin_ns, others = None, 0
    for number, data, kind, time_ns in entries:
        begin_ns = time_ns if begin_ns is None else begin_ns
        if kind in (Kind.RECEIVED, Kind.SENT):
            after_ns, sent = max(0, time_ns - begin_ns), kind == Kind.SENT
            bus, extended = str(1 + (number >> BUS_SHIFT)), not number & STANDARD
            number &= LONGEST_ID
            yield BusFrame(after_ns, bus, number, extended, FrameKind.DATA, data, len(data), sent)
        elif kind == Kind.OTHERS:
            others += number
    if others and notes is not None:
        notes.append(
            f"{others} frames of other kinds (remote, error, longer) are only counted in the "
            "recording and not in the copy"
        )


def _only_stops(frames: list[canbus.Frame]) -> bool:
    """Whether frames are only the last commands, quick stop, of a controller that ends."""
    catalogue = canbus.load_catalogue()
    last = {catalogue.codec(kind).can_id for kind in (canbus.PumpCommand, canbus.ValveCommand)}
    words = [catalogue.decoded(frame) for frame in frames]
    return {frame.can_id for frame in frames} <= last and any(
        isinstance(word, canbus.PumpCommand) and word.control_word is canbus.ControlWord.QUICK_STOP
        for word in words
    )
