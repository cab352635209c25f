"""Logs of candump: as it writes files (``-l``, ``-L``), and as it shows frames with their times."""

import re
from typing import Final

from utank_hil.telemetry.bus_files.frame import (
    FD_LENGTHS,
    BusFrame,
    FrameKind,
    NotReadableError,
    NotUnderstoodError,
    time_ns,
)

LOOKS: Final = re.compile(
    r"\s*\([^)]*\)\s+\S+\s+(\S+#|.*[\[{]\d)|\s*\S+\s+([0-9A-F]{3}|[0-9A-F]{8})\s+\[\d+\]", re.I
)  #: What a line of such a log looks like.
_STAMP: Final = r"\s*\((\d{1,10})\.(\d{1,9})\)\s+(\S+)\s+"
_NUMBER: Final = r"([0-9A-F]{3}|[0-9A-F]{8})"
_LOGGED: Final = re.compile(
    _STAMP + _NUMBER + r"#(?:(R)([0-8]?)|(?:#([0-9A-F]))?((?:\.?[0-9A-F]{2})*))(?:_([9A-F]))?"
    r"(?:\s+([RT]))?\s*",
    re.I | re.A,
)
_SHOWN: Final = re.compile(
    _STAMP + r"(?:(RX|TX) [B-] [E-]\s+)?" + _NUMBER + r"\s+(?:\[(\d+)\]|\{([0-9A-F])\})"
    r"(?:\s+(remote request)|((?:\s[\s]*[0-9A-F]{2})*))(?=\s|$).*\s*",
    re.I | re.A,
)
_TIMELESS: Final = re.compile(r"\s*\S+\s+([0-9A-F]{3}|[0-9A-F]{8})\s+\[\d+\]", re.I)
_STAMPED: Final = re.compile(r"\s*\(([^)]*)\)\s")
_ERROR: Final = 0x20000000
_MASK: Final = 0x1FFFFFFF


def parse(line: str) -> BusFrame | None:
    """Return the frame of a line, None for a comment (`TextLog`)."""
    if found := _LOGGED.fullmatch(line):
        seconds, fraction, channel, number, remote, asked, speed, text, raw, mark = found.groups()
        data = bytes.fromhex(text.replace(".", "") if "." in text else text) if text else b""
        code = int(raw, 16) if raw else int(asked or 0) if remote else len(data)
        is_fd, sent = speed is not None, None if mark is None else mark in "Tt"
    elif found := _SHOWN.fullmatch(line):
        seconds, fraction, channel, mark, number, size, raw, remote, text = found.groups()
        is_fd, sent, speed = len(size or "") > 1, None if mark is None else mark in "TXtx", None
        code = int(raw, 16) if raw else int(size)
        data = bytes.fromhex(text or "")[: min(code, 8) if raw else code]
        if not remote and len(data) < (8 if raw else code):
            raise NotUnderstoodError(f"has {len(data)} of {code} bytes")
    else:
        if line.strip() and not line.lstrip().startswith(("#", "//", ";")):
            raise _explained(line)
        return None
    value = int(number, 16)
    if value > (_ERROR | _MASK if len(number) == 8 else 0x7FF):
        raise NotUnderstoodError(f"{number} is no identifier of 11 or 29 bits")
    kind = FrameKind.DATA
    if len(number) == 8 and value & _ERROR:
        kind = FrameKind.ERROR
    elif remote:
        kind = FrameKind.REMOTE
    elif is_fd:
        kind = FrameKind.FD
        if len(data) not in FD_LENGTHS:
            raise NotUnderstoodError(f"a frame of CAN FD can't have {len(data)} bytes")
        code = FD_LENGTHS.index(len(data))
    if kind is not FrameKind.FD and (len(data) > 8 or (raw and len(data) != 8 and not remote)):
        raise NotUnderstoodError(f"a frame can't have {len(data)} bytes")
    now_ns, extended = time_ns(seconds, fraction), len(number) == 8
    flags = int(speed or "0", 16) & 3
    return BusFrame(now_ns, channel, value & _MASK, extended, kind, data, code, sent, flags)


def _explained(line: str) -> ValueError:
    if _TIMELESS.match(line):
        return NotReadableError("has no times: log with candump -l, or show them by candump -ta")
    stamp = _STAMPED.match(line)
    if stamp and line.endswith("\n") and not re.fullmatch(r"\d{1,10}\.\d{1,9}", stamp[1], re.A):
        return NotReadableError(
            f"{stamp[1]!r} is no time in seconds: log with candump -l, or show it by candump -ta"
        )
    return NotUnderstoodError("is no frame as candump writes it, such as (1.5) can0 08FF1080#0102")
