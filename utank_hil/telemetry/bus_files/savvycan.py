"""Logs of SavvyCAN (GVRET): a table of frames, whose times are microseconds."""

import re
from typing import Final

from utank_hil.telemetry.bus_files.frame import FD_LENGTHS, BusFrame, FrameKind, NotUnderstoodError

LOOKS: Final = re.compile(r"Time Stamp,\s*ID,\s*Extended,", re.I)  #: Look of the first line.
_LINE: Final = re.compile(
    r"\s*(-?\d{1,18}),([0-9A-F]{1,8}),(true|false|[01]),(?:(Rx|Tx),)?(\d{1,3}),(\d{1,2})"
    r"((?:,[0-9A-F]{2})*),*\s*",
    re.I | re.A,
)


def parse(line: str) -> BusFrame | None:
    """Return the frame of a line, None for the head (`TextLog`)."""
    if LOOKS.match(line) or not line.strip():
        return None
    found = _LINE.fullmatch(line)
    if found is None:
        raise NotUnderstoodError("is no frame as SavvyCAN writes it")
    microseconds, number, extended, mark, channel, size, text = found.groups()
    value, is_extended = int(number, 16), extended.lower() in ("true", "1")
    data = bytes.fromhex(text.replace(",", ""))[: int(size)]
    if len(data) != int(size) or len(data) not in FD_LENGTHS:
        raise NotUnderstoodError(f"has not the {size} bytes that it names")
    if value > (0x1FFFFFFF if is_extended else 0x7FF):
        raise NotUnderstoodError(f"{number} is no identifier of 11 or 29 bits")
    kind, code = FrameKind.FD if len(data) > 8 else FrameKind.DATA, FD_LENGTHS.index(len(data))
    sent = None if mark is None else mark.lower() == "tx"
    return BusFrame(int(microseconds) * 1000, channel, value, is_extended, kind, data, code, sent)
