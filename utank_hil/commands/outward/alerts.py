"""The alarm list as alerts of IEC 61162-1: ALF on each change, ALC cyclically, ARC on commands.

An alert is acknowledged at a station alone: a command from outside is refused by ARC, but for Q,
which asks for the alert again.
"""

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from datetime import datetime
from itertools import chain
from typing import Final

from utank_hil.canbus import AlarmState, Fault
from utank_hil.canbus.events import AlarmEvent
from utank_hil.canbus.sentences import checksum
from utank_hil.safety.alarms import Gravity, gravest
from utank_hil.safety.faults import FAULTS

TALKER: Final = "U0"  #: User-configured talker; the standard has none for stabilising tanks.
SOURCE: Final = f"{TALKER}0001"  #: System function identifier of the first such equipment.
LONGEST: Final = 82  #: Characters of a sentence, from $ to line feed (IEC 61162-1).
TOKEN: Final = b"UdPbC\0"  #: Begins a datagram of sentences (IEC 61162-450).
_ENDS: Final = len("*hh\r\n")
_RESERVED: Final = re.compile(r"[$*,!\\^~\x00-\x1f\x7f]")
_SENTENCE: Final = re.compile(r"\$([^$*!\\\r\n]*)\*([0-9A-Fa-f]{2})")
_LINE: Final = re.compile(r"\\([^\\\r\n]*)\*([0-9A-Fa-f]{2})\\(.*)")


def sentence(formatter: str, fields: Sequence[str]) -> str:
    """Return a whole sentence; ValueError if it is longer than the standard allows."""
    body = ",".join((TALKER + formatter, *fields))
    whole = f"${body}*{checksum(body.encode())}\r\n"
    if len(whole) > LONGEST:
        raise ValueError(f"a sentence of {len(whole)} characters: {whole!r}")
    return whole


def room(formatter: str, fields: Sequence[str]) -> int:
    """Return how many characters another field may have."""
    return LONGEST - _ENDS - len(",".join(("$" + TALKER + formatter, *fields, "")))


def text_field(text: str, most: int) -> str:
    """Escape reserved characters, and end after the last word that fits into `most` characters."""
    words = ""
    for word in text.split():
        word = word.encode("ascii", errors="replace").decode()
        coded = _RESERVED.sub(lambda found: f"^{ord(found[0]):02X}", word)
        if len(words) + bool(words) + len(coded) > most:
            break
        words += f" {coded}" if words else coded
    return words


def alert_command(line: str) -> tuple[str, str, str, str] | None:
    """Return manufacturer, identifier, instance and command of an intact ACN with its flag C.

    The command is A (acknowledge), Q (repeat), O (take responsibility) or S (silence). Anything
    else is None.
    """
    found = _SENTENCE.fullmatch(line.strip())
    if found is None or checksum(found[1].encode()) != found[2].upper():
        return None
    fields = found[1].split(",")
    if len(fields) != 7 or fields[0][2:] != "ACN" or fields[6] != "C":
        return None
    return fields[2], fields[3], fields[4], fields[5]


class Framing:
    """Makes datagrams of messages, with the header of IEC 61162-450 or plain."""

    def __init__(self, header: bool) -> None:
        self._header = header
        self._line = self._group = 0

    def datagram(self, message: Sequence[str]) -> bytes:
        """Return the sentences of one message as one datagram."""
        if not self._header:
            return "".join(message).encode("ascii")
        self._group = self._group % 99 + 1
        lines = []
        for number, each in enumerate(message, 1):
            self._line = self._line % 999 + 1
            group = f"g:{number}-{len(message)}-{self._group}," if len(message) > 1 else ""
            block = f"{group}s:{SOURCE},n:{self._line}"
            lines.append(f"\\{block}*{checksum(block.encode())}\\{each}")
        return TOKEN + "".join(lines).encode("ascii")

    def lines(self, datagram: bytes) -> Iterator[str]:
        """Yield the sentences of a datagram; those with a damaged header or byte are left out."""
        if self._header != datagram.startswith(TOKEN):
            return
        text = datagram.removeprefix(TOKEN).decode("ascii", errors="replace")
        for line in text.splitlines():
            tagged = _LINE.fullmatch(line)
            if not line.isascii():  # damaged, and a checksum has none of such characters
                continue
            if tagged is None and not self._header:
                yield line
            elif tagged is not None and checksum(tagged[1].encode()) == tagged[2].upper():
                yield tagged[3]


FIRST_IDENTIFIER: Final = 10_000  #: Of an equipment's own alerts; the code of the fault is added.
PRIORITY: Final = {Gravity.ENDS: "A", Gravity.HALVES: "W", Gravity.NOTHING: "C"}
_CATEGORY: Final = "B"  #: Nothing beyond the alert's text is needed to judge it.
_INSTANCE: Final = "1"  #: A fault is in the list once.
_ENTRIES: Final = 5  #: Of a cyclic list that fit into one sentence, whatever their revision.
_TITLE: Final = 16  #: Characters of an alert's title.
_SHORT: Final = {
    Fault.UNKNOWN_IDENTIFIERS: "UNKNOWN FRAMES",
    Fault.DRIVE_NOT_FOLLOWING: "DRIVE NOT FOLLOW",
    Fault.VALVE_NOT_FOLLOWING: "VALVE NOT FOLLOW",
    Fault.PUMP_SENSOR_SILENT: "PUMP SENS SILENT",
}
_HAPPENED: Final = {row.code: row.happened for row in FAULTS}
_STATES: Final = {
    AlarmState.ACTIVE_UNACKNOWLEDGED: "V",
    AlarmState.ACTIVE_ACKNOWLEDGED: "A",
    AlarmState.RECTIFIED_UNACKNOWLEDGED: "U",
    AlarmState.NORMAL: "N",
}


def title(code: Fault) -> str:
    """Title of an alert, of 16 characters at most."""
    return _SHORT.get(code, code.name.replace("_", " "))


def alert_state(code: Fault, state: AlarmState) -> str:
    """State as ALF has it; a caution needs no acknowledgement, so it is active or normal."""
    if gravest(code) is Gravity.NOTHING:
        return "A" if state < AlarmState.RECTIFIED_UNACKNOWLEDGED else "N"
    return _STATES[state]


@dataclass(slots=True)
class _Alert:
    state: str
    changed: datetime
    revision: int


class Alerts:
    """The alerts of a run; each method returns the messages due, each of one or more sentences."""

    def __init__(self) -> None:
        self._alerts: dict[Fault, _Alert] = {}
        self._message = self._list = -1

    def take(self, event: AlarmEvent, utc: datetime) -> list[list[str]]:
        """Return the message of a change, none if the state stays or a reset was refused."""
        if event.state is None:
            return []
        state, alert = alert_state(event.code, event.state), self._alerts.get(event.code)
        if state != "V" and state == ("N" if alert is None else alert.state):
            return []
        revision = 1 if alert is None else alert.revision % 99 + 1
        self._alerts[event.code] = _Alert(state, utc, revision)
        return [self._alf(event.code)]

    def cyclic(self) -> list[str]:
        """Return the list of alerts that are not normal: ALC, whole entries in each sentence."""
        entries = [
            ("", str(FIRST_IDENTIFIER + code), _INSTANCE, str(alert.revision))
            for code, alert in self._alerts.items()
            if alert.state != "N"
        ]
        parts = [entries[at : at + _ENTRIES] for at in range(0, len(entries) or 1, _ENTRIES)]
        self._list = (self._list + 1) % 100
        return [
            sentence("ALC", (f"{len(parts):02}", f"{number:02}", f"{self._list:02}",
                             str(len(part)), *chain.from_iterable(part)))
            for number, part in enumerate(parts, 1)
        ]  # fmt: skip

    def answer(self, line: str, utc: datetime) -> list[list[str]]:
        """Return the answer to a command that is for this equipment; none to anything else."""
        manufacturer, identifier, instance, command = alert_command(line) or ("", "", "", "")
        code = next((c for c in Fault if identifier == str(FIRST_IDENTIFIER + c)), None)
        known = instance in ("", _INSTANCE) and command in tuple("AQOS")
        if manufacturer or code is None or not known:
            return []
        if command == "Q" and code in self._alerts:
            return [self._alf(code)]
        return [[sentence("ARC", (_time(utc), "", identifier, instance, command))]]

    def _alf(self, code: Fault) -> list[str]:
        alert = self._alerts[code]
        self._message = (self._message + 1) % 10
        said = (str(self._message),)
        state = (_time(alert.changed), _CATEGORY, PRIORITY[gravest(code)], alert.state)
        same = ("", str(FIRST_IDENTIFIER + code), _INSTANCE, str(alert.revision), "0")
        first = ("2", "1", *said, *state, *same, text_field(title(code), _TITLE))
        second = ("2", "2", *said, *[""] * len(state), *same)
        text = text_field(_HAPPENED.get(code, ""), room("ALF", second))
        return [sentence("ALF", first), sentence("ALF", (*second, text))]


def _time(utc: datetime) -> str:
    return f"{utc:%H%M%S}.{utc.microsecond // 10_000:02}"
