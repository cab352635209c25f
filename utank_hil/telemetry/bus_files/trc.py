"""Traces of PEAK's programs (``.trc``), versions 1.0 to 2.1; times count from the trace's start."""

import re
from typing import Final

from utank_hil.telemetry.bus_files.frame import FD_LENGTHS, BusFrame, FrameKind, NotUnderstoodError

LOOKS: Final = re.compile(r";\$FILEVERSION=|;#{20}|\s*\d+\)\s+\d")
"""Look of a line of such a log."""
_VERSION_1: Final = re.compile(
    r"\s*\d+\)\s+(?P<O>\d+(?:\.\d+)?)\s+(?:(?P<B>\d{1,2})\s+)?(?:(?P<d>Rx|Tx|Warng|Error)\s+)?"
    r"(?P<I>[0-9A-F]{7,8}|[0-9A-F]{4})\s+(?:-\s+)?(?P<L>\d)(?:\s+(?P<D>.*))?",
    re.I | re.A,
)
_COLUMNS: Final = re.compile(r";\$COLUMNS=([A-Za-z,]+)")
_SPEEDS: Final = {"FD": 0, "FB": 1, "FE": 3, "BI": 2}
"""Types of frames of CAN FD: bit rate switched 1, error state indicator 2."""
_TYPES: Final = {
    "DT": FrameKind.DATA,
    "RR": FrameKind.REMOTE,
    **dict.fromkeys(_SPEEDS, FrameKind.FD),
}
_NO_FRAMES: Final = ("ST", "ER", "EC", "EV")


class TrcParser:
    """Parses the lines of one trace, whose head may name its columns."""

    def __init__(self) -> None:
        self._columns: list[str] = []

    def parse(self, line: str) -> BusFrame | None:
        """Return the frame of a line, None for comments, states and errors (`TextLog`)."""
        if named := _COLUMNS.match(line):
            self._columns = named[1].split(",")
        if not line.strip() or line.startswith(";"):
            return None
        if self._columns:
            words = line.split(maxsplit=len(self._columns) - 1)
            cells = dict(zip(self._columns, words, strict=False))
        elif found := _VERSION_1.fullmatch(line.rstrip()):
            cells = found.groupdict()
        else:
            raise NotUnderstoodError("is no frame as PCAN-View writes it")
        if (cells.get("d") or "").lower() in ("warng", "error") or cells.get("T") in _NO_FRAMES:
            return None
        if cells.get("I") == "FFFFFFFF":
            return None
        try:
            return _frame(cells)
        except (LookupError, ValueError) as error:
            raise NotUnderstoodError(
                f"is no frame with the columns of this trace: {error}"
            ) from None


def _frame(cells: dict[str, str]) -> BusFrame:
    number, text = cells["I"], (cells.get("D") or "").strip()
    kind = _TYPES[cells.get("T") or "DT"]
    if text.startswith("RTR"):
        kind = FrameKind.REMOTE
    if not 0 <= int(cells.get("l") or cells["L"]) <= FD_LENGTHS[-1]:
        raise ValueError("its length")
    size = int(cells["l"]) if "l" in cells else FD_LENGTHS[int(cells["L"])]
    code = FD_LENGTHS.index(size) if "l" in cells else int(cells["L"])
    if kind is not FrameKind.FD:
        size = min(size, 8)
    data = b"" if kind is FrameKind.REMOTE else bytes.fromhex(" ".join(text.split()[:size]))
    if kind is not FrameKind.REMOTE and len(data) != size:
        raise ValueError(f"{len(data)} of {size} bytes")
    extended = len(number) in (7, 8)  # python-can writes seven digits where they do.
    if not (extended or len(number) == 4) or int(number, 16) > (0x1FFFFFFF if extended else 0x7FF):
        raise ValueError(f"{number} is no identifier of 11 or 29 bits")
    milliseconds, _, rest = cells["O"].partition(".")
    if not (cells["O"].isascii() and milliseconds.isdecimal() and (rest or "0").isdecimal()):
        raise ValueError(f"{cells['O']} is no time in ms")
    now_ns, bus = int(milliseconds + rest.ljust(6, "0")[:6]), cells.get("B") or "1"
    mark, speed = cells.get("d"), _SPEEDS.get(cells.get("T") or "", 0)
    sent = None if mark is None else mark.lower() == "tx"
    return BusFrame(now_ns, bus, int(number, 16), extended, kind, data, code, sent, speed)
