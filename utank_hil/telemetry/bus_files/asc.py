"""Logs in ASC, the text format of Vector's programs."""

import re
from typing import Final

from utank_hil.telemetry.bus_files.frame import (
    BusFrame,
    FrameKind,
    NotReadableError,
    NotUnderstoodError,
    time_ns,
)

LOOKS: Final = re.compile(r"(date\s+\S+\s|base\s+(hex|dec)\b|\s*-?[\d.,]+\s+(\d+|CANFD)\s)", re.I)
"""What a line of such a log looks like."""
_BASE: Final = re.compile(r"\s*base\s+(hex|dec)(?:\s+timestamps\s+(absolute|relative))?", re.I)
_STAMP: Final = re.compile(r"\s*(-?\d{1,10})[.,](\d{1,9})\s", re.A)
_FRAME_LIKE: Final = re.compile(
    r"\s*([-+.,\w]+)\s+(?:CANFD\s+)?\d+\s+(?!Statistic:|J1939TP|Start\b)\S", re.I
)
_CLASSIC: Final = re.compile(
    r"\s*-?\d{1,10}[.,]\d{1,9}\s+(?P<channel>\d+)\s+"
    r"(?:(?P<number>[0-9A-F]+)(?P<extended>x?)\s+(?P<mark>Rx|Tx)\s+"
    r"(?:d\s+(?P<code>[0-9A-F]+)(?P<data>(?:\s+[0-9A-F]{1,3})*)|"
    r"(?P<remote>r)(?:\s+(?P<asked>[0-9A-F]+))?)|(?P<error>ErrorFrame))(?=\s|$).*\s*",
    re.I | re.A,
)
_FD: Final = re.compile(
    r"\s*-?\d{1,10}[.,]\d{1,9}\s+CANFD\s+(?P<channel>\d+)\s+(?P<mark>Rx|Tx)\s+"
    r"(?:(?P<number>[0-9A-F]+)(?P<extended>x?)\s+(?:\S*[^\s\d]\S*\s+)?(?P<switched>[01])\s+"
    r"(?P<indicator>[01])\s+(?P<code>[0-9A-F])\s+(?P<size>\d+)(?P<data>.*)|"
    r"(?P<error>ErrorFrame)(?:\s.*)?)\s*",
    re.I | re.A,
)
_REMOTE_FLAG: Final = 0x10
_FD_FLAG: Final = 0x1000  #: Flags of a line of the kind CANFD, which may hold a frame without FD.


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
        if found := _CLASSIC.fullmatch(line) or _FD.fullmatch(line):
            return self._frame(found.groupdict(default=""))
        if not _FRAME_LIKE.match(line):
            return None
        raise NotUnderstoodError(_why(line.split()))

    def _head(self, line: str) -> None:
        if base := _BASE.match(line):
            self._base = 10 if base[1].lower() == "dec" else 16
            self._relative = (base[2] or "").lower() == "relative"
        elif (like := _FRAME_LIKE.match(line)) and re.search(r"\s(Rx|Tx)\s.*\n", line, re.I):
            raise NotReadableError(f"{like[1]!r} is no time in seconds")

    def _bytes(self, words: list[str], count: int) -> bytes:
        words = words[:count]
        try:
            if len(words) < count or (self._base == 16 and any(len(word) != 2 for word in words)):
                raise ValueError
            return bytes(int(word, self._base) for word in words)
        except ValueError:
            raise NotUnderstoodError(f"has not the {count} bytes that it names") from None

    def _frame(self, cells: dict[str, str]) -> BusFrame:
        channel, words = cells["channel"], cells.get("data", "").split()
        sent = cells["mark"].lower() == "tx" if cells["mark"] else None
        if cells["error"]:
            return BusFrame(self._now_ns, channel, 0, False, FrameKind.ERROR, b"", 0, sent)
        is_fd = "size" in cells
        value, extended = _whole(cells["number"], self._base), bool(cells["extended"])
        code = _whole(cells["code"] or cells["asked"] or "0", 16 if is_fd else self._base)
        if not 0 <= value <= (0x1FFFFFFF if extended else 0x7FF) or not 0 <= code <= 15:
            name = cells["number"] + cells["extended"]
            raise NotUnderstoodError(f"{name} is no identifier of 11 or 29 bits")
        if is_fd:
            size, speed = int(cells["size"]), int(cells["switched"]) + 2 * int(cells["indicator"])
            data = self._bytes(words, size)
            flags = _whole(words[size + 2], 16) if len(words) > size + 2 else _FD_FLAG
            kind = FrameKind.REMOTE if flags & _REMOTE_FLAG else FrameKind.DATA
            kind = FrameKind.FD if size > 8 or flags & _FD_FLAG else kind
            return BusFrame(self._now_ns, channel, value, extended, kind, data, code, sent, speed)
        if cells["remote"]:
            kind, data = FrameKind.REMOTE, b""
        else:
            kind, data = FrameKind.DATA, self._bytes(words, min(code, 8))
        return BusFrame(self._now_ns, channel, value, extended, kind, data, code, sent)


def _whole(text: str, base: int) -> int:
    try:
        return int(text, base)
    except ValueError:
        return -1


def _why(words: list[str]) -> str:
    if not {"rx", "tx"} & {word.lower() for word in words}:
        return "says neither Rx nor Tx"
    at = 2 + 2 * (words[1].upper() == "CANFD")
    if len(words) <= at:
        return "ends before its identifier"
    identifier = words[at]
    if not re.fullmatch(r"[0-9A-F]+x?", identifier, re.I):
        return f"{identifier!r} is no identifier, such as 8FF1080x: log with numeric identifiers"
    return "is no frame, such as 0.5 1 8FF1080x Rx d 2 01 02"
