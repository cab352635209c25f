"""Profiles that are shipped, and layouts out of a maker's DBC or EDS."""

import re
from collections.abc import Container, Iterator
from configparser import ConfigParser, Error
from contextlib import suppress
from functools import cache
from pathlib import Path
from typing import Any, Final

from utank_hil.base.text_files import open_content, unread
from utank_hil.canbus import profiles
from utank_hil.canbus.profiles import drive_plan as cia
from utank_hil.canbus.profiles.drive_plan import MODES, Place
from utank_hil.configuration.error_words import nearest
from utank_hil.configuration.yaml_text import parse_yaml

OF_AN_EDS: Final = "EDS "  #: Begins the name of a device whose layouts were read from an EDS.
FRAME_BYTES: Final = 8
LIMIT_BYTES: Final = 1 << 22  #: Of a file; those of drives have some 100 kB.
LONGEST_WHY: Final = 150  #: Characters of a library's reason, which may hold a file's first line.
ENCODINGS: Final = ("utf-8-sig", "cp1252", "latin-1")
"""A file has no mark of its encoding. The last decodes anything; numbers are ASCII in all three."""
_SIGNED: Final = {2: 8, 3: 16, 4: 32, 0x10: 24, 0x12: 40, 0x13: 48, 0x14: 56, 0x15: 64}
_REAL: Final = {8: 32, 0x11: 64}
_BITS: Final = {
    1: 1, 5: 8, 6: 16, 7: 32, 0x16: 24, 0x18: 40, 0x19: 48, 0x1A: 56, 0x1B: 64, **_SIGNED, **_REAL,
}  # fmt: skip
"""Length of the data types of CiA 301 that a PDO can carry."""
_LONG_ID: Final = 1 << 29  #: In the identifier of a PDO: it has 29 bits.
_MOST_MAPPED: Final = 64  #: Objects of a PDO, by CiA 301: one a bit.
_TIMED: Final = (254, 255)  #: Types of a PDO that its event timer sends.
_INDENT: Final = re.compile(r"^[ \t]+", re.MULTILINE)
_NODE: Final = re.compile(r"^\$NODEID\s*\+?\s*|\s*\+\s*\$NODEID$", re.IGNORECASE)


def _named_file(content: dict[str, Any], kind: str) -> str:
    """The file that a section names by this key."""
    file = content[kind]
    if isinstance(file, str) and file:
        return file
    raise ValueError(f"{kind}: must be the path of a file, such as ./theirs.{kind}")


def _text(kind: str, file: str, encodings: tuple[str, ...]) -> str:
    """Read a file in the first encoding that it is text in."""
    try:
        with open_content(Path(file), LIMIT_BYTES) as opened:
            content = opened.read()
    except OSError as error:
        raise ValueError(f"{kind}: {unread(error)}") from error
    for encoding in encodings:
        with suppress(UnicodeDecodeError):
            return content.decode(encoding)
    raise _another(kind, file, f"is text in none of {', '.join(encodings)}")


def _another(kind: str, file: str, why: str) -> ValueError:
    """A file of another kind."""
    wanted = ".eds or .dcf" if kind == "eds" else f".{kind}"
    why = " ".join(why.split())[:LONGEST_WHY]
    return ValueError(f"{kind}: {file} is no {kind.upper()}: {why}; name the maker's {wanted}")


class Eds:
    """The objects of a file; ValueError names file, object and remedy."""

    def __init__(self, file: str) -> None:
        self.file = file
        parser = ConfigParser(
            interpolation=None, delimiters=("=",), inline_comment_prefixes=(";", "#")
        )
        text = _INDENT.sub("", _text("eds", file, ENCODINGS))  # no value goes on in another line
        try:
            parser.read_string(text, Path(file).name)
        except Error as error:
            raise _another("eds", file, error.message) from error
        if not parser.sections():
            raise _another("eds", file, "has no section")
        self._sections = {name.upper(): dict(parser[name]) for name in parser.sections()}

    def entry(self, place: Place) -> dict[str, str] | None:
        """Keys of an entry, with small letters; None where the device lacks it."""
        whole = self._sections.get(f"{place.number:04X}")
        part = self._sections.get(f"{place.number:04X}SUB{place.subindex:X}")
        if part is not None or whole is None:
            return part
        short = self._number(whole.get("compactsubobj", ""), place) or 0
        if not short:
            parts = self._number(whole.get("subnumber", ""), place)
            return None if place.subindex or parts else whole
        if not place.subindex:
            return {"datatype": "5", "defaultvalue": str(short)}
        if place.subindex > short:
            return None
        values = self._sections.get(f"{place.number:04X}VALUE", {})
        value = values.get(str(place.subindex), whole.get("defaultvalue", ""))
        return whole | {"defaultvalue": value}

    def value(self, place: Place) -> tuple[int, bool] | None:
        """An entry's value, and whether the node's number is to be added; None without a value.

        What the DCF of a node says comes before what its type is delivered with.
        """
        entry = self.entry(place) or {}
        own = entry.get("parametervalue") if self.node is not None else ""
        written = own or entry.get("defaultvalue") or ""
        number = self._number(_NODE.sub("", written) or ("0" if written else ""), place)
        return None if number is None else (number, _NODE.search(written) is not None)

    def number(self, place: Place) -> int:
        """An entry's value; 0 without one."""
        return (self.value(place) or (0, False))[0]

    @property
    def node(self) -> int | None:
        """Node that a DCF is of."""
        found = self._sections.get("DEVICECOMISSIONING", {})  # so the standard spells it
        return self._number(found.get("nodeid", ""), Place(0))

    def sent(self, pdo: int, *, received: bool = False) -> dict[str, Any]:
        """The layout of a sent or `received` PDO, 1 to 512, as `MessageSection` has it."""
        settings = (0x1400 if received else 0x1800) + pdo - 1
        name = f"{'R' if received else 'T'}PDO{pdo}"
        found = self.value(Place(settings, 1))
        if found is None:
            raise self._error(Place(settings, 1), f"has no value: {name} is not in this device")
        cob, relative = found
        if cob & cia.DISABLED:
            reason = f"has bit 31: {name} is off as delivered. Turn it on in device and file"
            raise self._error(Place(settings, 1), reason)
        kind = self.number(Place(settings, 2))
        timed = kind in _TIMED and not received
        signals, bits = self._mapped(settings + 0x200, name)
        can_id = cob & (_LONG_ID - 1)
        place: dict[str, Any] = {"id": can_id, "format": "29bit" if cob & _LONG_ID else "11bit"}
        return {
            **({"cob": can_id} if relative else place),
            "bytes": -(-bits // 8),
            "cycle_ms": (self.number(Place(settings, 5)) if timed else 0) or None,
            "pdo": pdo,
            "pdo_type": kind if timed else 255,
            "signals": signals,
        }

    def _mapped(self, index: int, name: str) -> tuple[dict[str, dict[str, Any]], int]:
        count = self.number(Place(index, 0))
        if not count:
            reason = f"is 0: {name} carries nothing as delivered. Map it in device and file"
            raise self._error(Place(index, 0), reason)
        if not 1 <= count <= _MOST_MAPPED:
            raise self._error(Place(index, 0), f"is {count}: a PDO maps 1 to {_MOST_MAPPED}")
        signals: dict[str, dict[str, Any]] = {}
        start = 0
        for subindex in range(1, count + 1):
            value = self.number(Place(index, subindex))
            place, bits = Place(value >> 16, value >> 8 & 0xFF), value & 0xFF
            if not value:
                raise self._error(Place(index, subindex), "has no value, and is mapped")
            if start + bits > 64:
                raise self._error(Place(index, subindex), "ends beyond the 8 bytes of a frame")
            called = str(place)
            signed = real = False
            if place.number >= 0x1000:
                kind = self._type(place)
                signed, real = kind in _SIGNED, kind in _REAL
                if _BITS[kind] != bits:
                    reason = f"maps {bits} bits of {place}, which has {_BITS[kind]}"
                    raise self._error(Place(index, subindex), reason)
            else:  # a type, which fills a gap
                called = f"gap {subindex}"
            signals[called] = {
                "start": start, "bits": bits, "signed": signed, "real": real, "object": str(place),
            }  # fmt: skip
            start += bits
        return signals, start

    def _type(self, place: Place) -> int:
        entry = self.entry(place)
        kind = self._number((entry or {}).get("datatype", ""), place)
        if kind not in _BITS:
            said = "is mapped, and is not there" if entry is None else f"has the data type {kind}"
            raise self._error(place, f"{said}: no number that a PDO carries")
        return kind

    def _number(self, written: str, place: Place) -> int | None:
        """A number, decimal or hexadecimal; None of an empty one."""
        text = written.strip()
        if not text:
            return None
        if re.fullmatch(r"0[0-9]*[1-9][0-9]+|0+[89]", text):
            reason = f"is {text}: octal or decimal? Write it without the leading zero"
            raise self._error(place, reason)
        try:
            return int(text, 16 if text[:2] in ("0x", "0X") else 10)
        except ValueError:
            raise self._error(place, f"is {text!r}, and must be a whole number") from None

    def _error(self, place: Place, reason: str) -> ValueError:
        return ValueError(f"eds: {self.file}: {place} {reason}")


@cache
def eds_file(file: str) -> Eds:
    """The file of this name, read once."""
    return Eds(file)


def with_eds(content: dict[str, Any]) -> dict[str, Any]:
    """A sensor's section with the layouts of its PDOs in the place of their names."""
    rest = {key: value for key, value in content.items() if key not in ("eds", "messages")}
    named = _named(content, "eds", r"[TR]PDO[1-9][0-9]*")
    pdos = [of for of, _ in named.values() if of[0] in "Tt"]
    eds = eds_file(_named_file(content, "eds"))
    _same_node(eds, content)
    if profile := eds.number(Place(0x1000)) & 0xFFFF:
        rest = {"canopen_profile": profile, "identity": _identity(eds)} | rest
    messages = {
        name: _otherwise(eds.sent(int(of[4:]), received=of[0] in "Rr"), changes)
        for name, (of, changes) in named.items()
    }
    if "cycle_ms" not in rest:
        cycles = [messages[name]["cycle_ms"] for name, (of, _) in named.items() if of in pdos]
        if None in cycles:
            pdo = pdos[cycles.index(None)]
            raise ValueError(
                f"cycle_ms is required but missing: as {eds.file} has it, {pdo} is sent on a "
                "change or at SYNC. Set its type (1800h:2) to 255 and its event timer (1800h:5)"
            )
        rest["cycle_ms"] = max(cycles)
    else:  # it is written into the device
        for each in messages.values():
            each["cycle_ms"] = None
    return {"profile": f"{OF_AN_EDS}{Path(eds.file).name}", **rest, "messages": messages}


def drive_with_eds(content: dict[str, Any]) -> dict[str, Any]:
    """A drive's section with the identity of its file, if that is a drive which can be watched."""
    eds = eds_file(_named_file(content, "eds"))
    _same_node(eds, content)
    rest = {key: value for key, value in content.items() if key != "eds"}
    kind = eds.number(Place(0x1000)) & 0xFFFF
    if kind != cia.PROFILE:
        raise ValueError(f"eds: {eds.file}: 1000h:0 says profile {kind}; a drive has {cia.PROFILE}")
    if eds.entry(Place(0x1016, 1)) is None:
        reason = "the drive would run on after the controller's end. Take one that watches it"
        raise ValueError(f"eds: {eds.file}: there is no 1016h (heartbeat consumer): {reason}")
    if lacking := "; ".join(_lacking(eds, rest)):
        raise ValueError(f"eds: {eds.file}: {lacking}")
    return {"identity": _identity(eds)} | rest


def _lacking(eds: Eds, content: dict[str, Any]) -> Iterator[str]:
    """What the controller would refuse at its start, since the drive's file has it otherwise."""
    mode, able = MODES.get(str(content.get("mode"))), eds.number(cia.MODES_SUPPORTED)
    if mode is None:
        return  # refused elsewhere
    if able and not able >> mode.number - 1 & 1:
        others = [name for name, each in MODES.items() if able >> each.number - 1 & 1]
        others_said = f"choose {' or '.join(others)}" if others else "take another drive"
        yield f"{cia.MODES_SUPPORTED} is {able:#x}, without mode {content['mode']}: {others_said}"
    echo = mode.demand if content.get("echo") == "demand" else cia.CONTROL_WORD
    needs = (
        cia.CONTROL_WORD,
        echo,
        mode.target,
        cia.STATUS_WORD,
        cia.SPEED,
        cia.HEARTBEAT_PRODUCER,
    )
    for place in (*needs, *[cia.TORQUE] * mode.torque):
        if eds.entry(place) is None:
            ways = place == echo or place == mode.target
            remedy = "choose another echo or mode" if ways else "take another drive or firmware"
            yield f"there is no {place}, which the controller needs: {remedy}"
    required = content["require"]
    for name, value in required.items() if isinstance(required, dict) else ():
        with suppress(ValueError):  # no object: refused elsewhere
            if value is not None and eds.entry(place_of(str(name))) is None:
                yield f"there is no {name}: set it to null in require, the maker's own in its place"


def place_of(written: str) -> Place:
    """An object as a file writes it; ValueError if it is none."""
    index, _, subindex = written.partition(":")
    place = Place(int(index.removesuffix("h"), 16), int(subindex or "0", 0))
    if not (0 < place.number <= 0xFFFF and 0 <= place.subindex <= 0xFF):
        raise ValueError(written)
    return place


def _identity(eds: Eds) -> list[int | None]:
    """What a file says of 1018h; zeros stand for nothing."""
    known = [eds.number(Place(0x1018, part)) or None for part in range(1, 5)]
    return known if any(known) else []


def _same_node(eds: Eds, content: dict[str, Any]) -> None:
    if eds.node not in (None, content.get("node")):
        said = content.get("node")
        raise ValueError(f"eds: {eds.file} is the DCF of node {eds.node}, not of node {said}")


FOLDER: Final = Path(profiles.__file__).parent
NATIVE: Final = "native"
OF_A_DBC: Final = "DBC "  #: Begins the name of a device whose layouts were read from a DBC.
DBC_ENCODINGS: Final = ("utf-8", "cp1252")
"""A DBC has no mark of its encoding: UTF-8 fails on anything else, and then it is a Windows one."""


def shipped_profiles() -> tuple[str, ...]:
    """Names of the profiles that are shipped, but for the native nodes."""
    return tuple(sorted(path.stem for path in FOLDER.glob("*.yaml")))


@cache
def _profile(name: str) -> dict[str, Any]:
    content, findings = parse_yaml((FOLDER / f"{name}.yaml").read_text(encoding="utf-8"))
    assert not findings, findings
    assert isinstance(content, dict)
    return content


def with_profile(content: dict[str, Any]) -> dict[str, Any]:
    """A device's section with what its profile, DBC or EDS says, where it says nothing itself.

    ValueError is raised if there is no such profile, or the file can't be read, or has no such
    message.
    """
    content = _as_written(content)
    if "dbc" in content:
        return _with_dbc(content)
    if "eds" in content:
        return with_eds(content)
    name = content.get("profile", "")
    if not isinstance(name, str) or name in ("", NATIVE):
        return content
    if name.startswith((OF_A_DBC, OF_AN_EDS)):
        return content
    if name not in shipped_profiles():
        known = ", ".join((NATIVE, *shipped_profiles()))
        raise ValueError(f"no profile {name!r}: there are {known}; or name a file by dbc or eds")
    return _merged(_profile(name), content)


def _as_written(value: Any) -> Any:
    """Names of keys as in a file, also where they come from a section that was read before."""
    if isinstance(value, dict):
        return {key.rstrip("_"): _as_written(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_as_written(item) for item in value]
    return value


def _merged(below: dict[str, Any], above: dict[str, Any]) -> dict[str, Any]:
    both = {**below, **above}
    for key in below.keys() & above.keys():
        if isinstance(below[key], dict) and isinstance(above[key], dict):
            both[key] = _merged(below[key], above[key])
    return both


def _named(content: dict[str, Any], key: str, names: str) -> dict[str, tuple[str, dict[str, Any]]]:
    """What `messages` names in a file, and what it has otherwise there, by names of the ship's."""
    what, example = ("its PDOs", "TPDO1") if key == "eds" else ("messages of the file", "MESSAGE")
    given = content.get("messages")
    found: dict[str, tuple[str, dict[str, Any]]] = {}
    for name, each in given.items() if isinstance(given, dict) else ():
        rest = dict(each) if isinstance(each, dict) else {"of": each}
        found[name] = str(rest.pop("of", "")), rest
    if not found or not all(re.fullmatch(names, of, re.IGNORECASE) for of, _ in found.values()):
        raise ValueError(
            f"with {key}, messages names {what}: {{name: {example}}}, or, with another "
            f"identifier, {{name: {{of: {example}, id: 0x123}}}}"
        )
    return found


def _otherwise(layout: dict[str, Any], changes: dict[str, Any]) -> dict[str, Any]:
    """A layout with what the ship's file changes; another identifier takes the place of its own."""
    ways = ("id", "pgn", "cob")
    if any(way in changes for way in ways):
        layout = {key: value for key, value in layout.items() if key not in ways}
    return layout | changes


def _with_dbc(content: dict[str, Any]) -> dict[str, Any]:
    """Replace the names of messages by their layouts; the file is not needed any longer."""
    rest = {key: value for key, value in content.items() if key not in ("dbc", "messages")}
    file = _named_file(content, "dbc")
    layouts = _dbc_layouts(file)
    meant = set(_words([content.get(key) for key in ("signals", "valid_when", "protection")]))
    messages: dict[str, dict[str, Any]] = {}
    named: dict[str, dict[str, int]] = {}
    for name, (of, changes) in _named(content, "dbc", ".+").items():
        if of not in layouts:
            near = nearest(of, list(layouts))
            raise ValueError(
                f"messages: {file} has no message {of}"
                + (f"; did you mean {near}?" if near else f"; it has {', '.join(layouts)[:200]}")
            )
        layout = dict(layouts[of])
        if layout["bytes"] > FRAME_BYTES:
            raise ValueError(
                f"messages: {of} has {layout['bytes']} bytes in {file}, and comes in several "
                "frames (fast packet, transport protocol), which are not put together"
            )
        comes_with, choices = layout.pop("comes_with"), layout.pop("choices")
        named |= {f"{name}.{signal}": values for signal, values in choices.items()}
        used = {each: comes_with[each] for each in comes_with if f"{name}.{each}" in meant}
        if used:
            layout["only"] = _one_content(of, used, comes_with)
        if "cycle_ms" in content:  # a file's is a placeholder
            del layout["cycle_ms"]
        if "source" in content and layout["format"] == "29bit":  # so are source and priority
            layout["pgn"] = layout.pop("id") >> 8 & 0x3FFFF
        messages[name] = _otherwise(layout, changes)
    if isinstance(given := content.get("valid_when"), list):
        rest["valid_when"] = [_in_numbers(each, named, file) for each in given]
    cycles_ms = [each["cycle_ms"] for each in messages.values() if each.get("cycle_ms")]
    if len(cycles_ms) == len(messages) and "cycle_ms" not in rest:
        rest["cycle_ms"] = max(cycles_ms)
    return {"profile": f"{OF_A_DBC}{Path(file).name}", **rest, "messages": messages}


def _in_numbers(condition: Any, named: dict[str, dict[str, int]], file: str) -> Any:
    """A condition with the numbers of what a DBC names (VAL_)."""
    values = condition.get("in") if isinstance(condition, dict) else None
    if not isinstance(values, list):
        return condition
    path = str(condition.get("from"))
    known, numbers = named.get(path, {}), []
    for each in values:
        if isinstance(each, str) and each not in known and not each[:1].isdigit():
            there = "give its number" if path in named else "there is no such signal"
            there = f"there are {', '.join(known)[:200]}" if known else there
            raise ValueError(f"valid_when: {file} names no value {each} of {path}: {there}")
        numbers.append(known.get(each, each) if isinstance(each, str) else each)
    return condition | {"in": numbers}


def _words(value: Any) -> Iterator[str]:
    if isinstance(value, str):
        yield value
    elif isinstance(value, dict | list | tuple):
        for each in value.values() if isinstance(value, dict) else value:
            yield from _words(each)


def _one_content(
    of: str, comes_with: dict[str, tuple[str, list[int]]], selectors: Container[str]
) -> dict[str, Any]:
    """What tells the frames of a multiplexed message that have all of these signals."""
    (selector, counts), *others = comes_with.values()
    if selector in selectors:
        raise ValueError(
            f"messages: {selector} of {of}, which tells its contents apart, is not in every frame "
            "itself: set the device to send this in a message of its own"
        )
    both = set(counts).intersection(*(each for _, each in others))
    if not both or any(name != selector for name, _ in others):
        said = ", ".join(comes_with)
        raise ValueError(f"messages: {said} of {of} do not come together: name {of} for each")
    return {"from": selector, "in": sorted(both)}


_DBC_SIZES: Final = re.compile(r"^\s*BO_ +\d+ +\S+ *: *(\d+)|:\s*(\d+)\s*\|\s*(\d+)\s*@", re.M)
"""Length of a message; start and length of a signal."""
_MOST_BITS: Final = 8 * 1785  #: Of the longest message of J1939's transport protocol.


@cache
def _dbc_layouts(file: str) -> dict[str, dict[str, Any]]:
    """Layouts of all messages of a DBC, as `MessageSection` has them, by their names."""
    from cantools.database.can import Database

    text = _text("dbc", file, DBC_ENCODINGS)
    for numbers in _DBC_SIZES.finditer(text):  # the library makes room for what they say
        if any(len(each) > 5 or int(each) > _MOST_BITS for each in numbers.groups() if each):
            raise _another("dbc", file, f"{numbers[0].strip()!r} is in no message")
    database = Database(strict=False)  # one message that does not fit spoils no other
    try:
        database.add_dbc_string(text)
    except Exception as error:  # a damaged file makes the library raise errors of any kind
        raise _another("dbc", file, f"{error}" or type(error).__name__) from error
    return {message.name: _layout(message) for message in database.messages}


def _layout(message: Any) -> dict[str, Any]:
    signals = {
        signal.name: {
            "start": signal.start,
            "bits": signal.length,
            "big_endian": signal.byte_order == "big_endian",
            "signed": signal.is_signed,
            "real": signal.is_float,
            "scale": float(signal.scale),
            "offset": float(signal.offset),
            "unit": signal.unit or "",
        }
        for signal in message.signals
    }
    return {
        "id": message.frame_id,
        "format": "29bit" if message.is_extended_frame else "11bit",
        "bytes": max(message.length, 1),
        "cycle_ms": message.cycle_time or None,
        "signals": signals,
        "choices": {
            signal.name: {
                str(words): number & (1 << signal.length) - 1
                for number, words in (signal.choices or {}).items()
            }
            for signal in message.signals
        },
        "comes_with": {
            signal.name: (signal.multiplexer_signal, signal.multiplexer_ids)
            for signal in message.signals
            if signal.multiplexer_ids
        },
    }
