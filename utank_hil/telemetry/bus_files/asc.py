"""Logs in ASC, the text format of Vector's programs."""

import re
from typing import Final

from utank_hil.telemetry.bus_files.frame import BusFrame, FrameKind, time_ns
from utank_hil.telemetry.bus_files.text_log import NotReadableError, NotUnderstoodError

LOOKS: Final = re.compile(r"(date\s+\S+\s|base\s+(hex|dec)\b|\s*-?[\d.,]+\s+(\d+|CANFD)\s)", re.I)
"""What a line of such a log looks like."""
_BASE: Final = re.compile(r"\s*base\s+(hex|dec)(?:\s+timestamps\s+(absolute|relative))?", re.I)
_STAMP: Final = re.compile(r"\s*(-?\d{1,10})[.,](\d{1,9})\s", re.A)
_FRAME_LIKE: Final = re.compile(
    r"\s*([-+.,\w]+)\s+(?:CANFD\s+)?\d+\s+(?!Statistic:|J1939TP|Start\b)\S", re.I
)
_CLASSIC: Final = re.compile(
    r"\s*(-?\d{1,10})[.,](\d{1,9})\s+(\d+)\s+(?:([0-9A-F]+)(x?)\s+(Rx|Tx)\s+"
    r"(?:(d)\s+([0-9A-F]+)((?:\s+[0-9A-F]{1,3})*)|r(?:\s+([0-9A-F]+))?)|(ErrorFrame))(?=\s|$).*\s*",
    re.I | re.A,
)
_FD: Final = re.compile(
    r"\s*(-?\d{1,10})[.,](\d{1,9})\s+CANFD\s+(\d+)\s+(Rx|Tx)\s+(?:([0-9A-F]+)(x?)\s+"
    r"(?:\S*[^\s\d]\S*\s+)?([01])\s+([01])\s+([0-9A-F])\s+(\d+)(.*)|(ErrorFrame)(?:\s.*)?)\s*",
    re.I | re.A,
)
_REMOTE_FLAG: Final = 0x10
_FD_FLAG: Final = 0x1000
"""Flags of a line of the kind CANFD, which may hold a frame without FD."""


class AscParser:
    """Parses the lines of one log: base and meaning of its stamps stand in its head."""

    def __init__(self) -> None:
        self._base = 16
        self._relative = False
        self._now_ns = 0

    def parse(self, line: str) -> BusFrame | None:
        """Return the frame of a line, None for an event of another kind (`TextLog`)."""
        stamp = _STAMP.match(line)
        if stamp is None:
            self._head(line)
            return None
        self._now_ns = time_ns(*stamp.groups()) + (self._now_ns if self._relative else 0)
        if self._base == 10 and not line.endswith("\n"):
            raise NotUnderstoodError("its last number may be cut")
        if found := _CLASSIC.fullmatch(line):
            return self._classic(*found.groups()[2:])
        if found := _FD.fullmatch(line):
            return self._of_fd(*found.groups()[2:])
        if not _FRAME_LIKE.match(line):
            return None
        raise NotUnderstoodError(_why(line.split()))

    def _head(self, line: str) -> None:
        if base := _BASE.match(line):
            self._base = 10 if base[1].lower() == "dec" else 16
            self._relative = (base[2] or "").lower() == "relative"
        elif (like := _FRAME_LIKE.match(line)) and re.search(r"\s(Rx|Tx)\s.*\n", line, re.I):
            raise NotReadableError(f"{like[1]!r} is no time in seconds")

    def _classic(
        self,
        channel: str,
        number: str,
        extended: str,
        mark: str,
        data_mark: str | None,
        length: str | None,
        text: str | None,
        asked: str | None,
        error: str | None,
    ) -> BusFrame:
        if error:
            return BusFrame(self._now_ns, channel, 0, False, FrameKind.ERROR, b"", 0)
        sent = mark.lower() == "tx"
        if data_mark is None:
            code = int(asked or "0", self._base)
            return self._frame(channel, number, extended, FrameKind.REMOTE, b"", code, sent)
        code = int(length or "0", self._base)
        data = self._bytes((text or "").split(), min(code, 8))
        return self._frame(channel, number, extended, FrameKind.DATA, data, code, sent)

    def _of_fd(
        self,
        channel: str,
        mark: str,
        number: str,
        extended: str,
        switched: str,
        indicator: str,
        code: str,
        size: str,
        rest: str,
        error: str | None,
    ) -> BusFrame:
        sent = mark.lower() == "tx"
        if error:
            return BusFrame(self._now_ns, channel, 0, False, FrameKind.ERROR, b"", 0, sent)
        count, words = int(size), rest.split()
        data = self._bytes(words, count)
        flags = int(words[count + 2], 16) if len(words) > count + 2 else _FD_FLAG
        kind = FrameKind.FD if count > 8 or flags & _FD_FLAG else FrameKind.DATA
        if kind is FrameKind.DATA and flags & _REMOTE_FLAG:
            kind = FrameKind.REMOTE
        speed = int(switched) + 2 * int(indicator)
        return self._frame(channel, number, extended, kind, data, int(code, 16), sent, speed)

    def _bytes(self, words: list[str], count: int) -> bytes:
        words = words[:count]
        try:
            if len(words) < count or (self._base == 16 and any(len(word) != 2 for word in words)):
                raise ValueError
            return bytes(int(word, self._base) for word in words)
        except ValueError:
            raise NotUnderstoodError(f"has not the {count} bytes that it names") from None

    def _frame(
        self,
        channel: str,
        number: str,
        extended: str,
        kind: FrameKind,
        data: bytes,
        code: int,
        sent: bool,
        speed: int = 0,
    ) -> BusFrame:
        try:
            value = int(number, self._base)
        except ValueError:
            value = -1
        if not 0 <= value <= (0x1FFFFFFF if extended else 0x7FF) or code > 15:
            raise NotUnderstoodError(f"{number}{extended} is no identifier of 11 or 29 bits")
        return BusFrame(self._now_ns, channel, value, bool(extended), kind, data, code, sent, speed)


def _why(words: list[str]) -> str:
    """Return why a line that looks like a frame is none."""
    if not {"rx", "tx"} & {word.lower() for word in words}:
        return "says neither Rx nor Tx"
    identifier = words[2 + 2 * (words[1].upper() == "CANFD")]
    if not re.fullmatch(r"[0-9A-F]+x?", identifier, re.I):
        return f"{identifier!r} is no identifier, such as 8FF1080x: log with numeric identifiers"
    return "is no frame, such as 0.5 1 8FF1080x Rx d 2 01 02"
