"""Profiles that are shipped, and layouts out of a maker's DBC or EDS."""

from functools import cache
from pathlib import Path
from typing import Any, Final

from utank_hil.canbus import profiles
from utank_hil.configuration.eds_files import OF_AN_EDS, with_eds
from utank_hil.configuration.yaml_text import parse_yaml

FOLDER: Final = Path(profiles.__file__).parent
NATIVE: Final = "native"
OF_A_DBC: Final = "DBC "  #: Begins the name of a device whose layouts were read from a DBC.
ENCODINGS: Final = ("utf-8", "cp1252")
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


def _with_dbc(content: dict[str, Any]) -> dict[str, Any]:
    """Replace the names of messages by their layouts; the file is not needed any longer."""
    rest = {key: value for key, value in content.items() if key not in ("dbc", "messages")}
    named = content.get("messages")
    if not isinstance(named, dict) or not all(isinstance(each, str) for each in named.values()):
        raise ValueError("with dbc, messages names messages of the file: {name: MESSAGE}")
    layouts = _dbc_layouts(str(content["dbc"]))
    for each in named.values():
        if each not in layouts:
            raise ValueError(f"messages: {content['dbc']} has no message {each}")
    messages = {key: layouts[each] for key, each in named.items()}
    return {"profile": f"{OF_A_DBC}{Path(str(content['dbc'])).name}", **rest, "messages": messages}


@cache
def _dbc_layouts(file: str) -> dict[str, dict[str, Any]]:
    """Layouts of all messages of a DBC, as `MessageSection` has them, by their names."""
    from cantools.database.can import Database

    try:
        content = Path(file).read_bytes()
    except OSError as error:
        raise ValueError(f"dbc: {file} can't be read: {error.strerror}") from error
    database = Database(strict=False)  # one message that does not fit spoils no other
    for encoding in ENCODINGS:
        try:
            database.add_dbc_string(content.decode(encoding))
            break
        except UnicodeDecodeError:
            continue
        except Exception as error:  # a damaged file makes the library raise errors of any kind
            why = f"{error}" or type(error).__name__
            raise ValueError(f"dbc: {file} is no DBC: {why}") from error
    else:
        raise ValueError(f"dbc: {file} is text in none of {', '.join(ENCODINGS)}")
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
    }
