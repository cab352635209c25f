"""Sentences of IEC 61162-1 and datagrams of IEC 61162-450."""

import re
from collections.abc import Iterator, Sequence
from functools import reduce
from operator import xor
from typing import Final

TALKER: Final = "U0"  #: User-configured talker; the standard has none for stabilising tanks.
SOURCE: Final = f"{TALKER}0001"  #: System function identifier of the first such equipment.
LONGEST: Final = 82  #: Characters of a sentence, from $ to line feed (IEC 61162-1).
TOKEN: Final = b"UdPbC\0"  #: Begins a datagram of sentences (IEC 61162-450).
_ENDS: Final = len("*hh\r\n")
_RESERVED: Final = re.compile(r"[$*,!\\^~\x00-\x1f\x7f]")
_SENTENCE: Final = re.compile(r"\$([^$*!\\\r\n]*)\*([0-9A-Fa-f]{2})")
_LINE: Final = re.compile(r"\\([^\\\r\n]*)\*([0-9A-Fa-f]{2})\\(.*)")


def checksum(text: str) -> str:
    """Exclusive or of the characters between $ and *, two hexadecimal digits."""
    return f"{reduce(xor, text.encode('ascii'), 0):02X}"


def sentence(formatter: str, fields: Sequence[str]) -> str:
    """Return a whole sentence; ValueError if it is longer than the standard allows."""
    body = ",".join((TALKER + formatter, *fields))
    whole = f"${body}*{checksum(body)}\r\n"
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
    if found is None or checksum(found[1]) != found[2].upper():
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
            lines.append(f"\\{block}*{checksum(block)}\\{each}")
        return TOKEN + "".join(lines).encode("ascii")

    def lines(self, datagram: bytes) -> Iterator[str]:
        """Yield the sentences of a datagram; those with a damaged header are left out."""
        if self._header != datagram.startswith(TOKEN):
            return
        text = datagram.removeprefix(TOKEN).decode("ascii", errors="replace")
        for line in text.splitlines():
            tagged = _LINE.fullmatch(line)
            if tagged is None and not self._header:
                yield line
            elif tagged is not None and tagged[1].isascii() and checksum(tagged[1]) == tagged[2]:
                yield tagged[3]
