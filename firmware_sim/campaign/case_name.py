"""Names of cases: a hash of configuration, seed and code, so that no case is computed twice."""

import hashlib
import importlib.metadata
import json
import re
from datetime import date
from functools import cache
from pathlib import Path
from typing import Any, Final

_PACKAGES: Final = ("utank_hil", "firmware_sim")
_SUFFIXES: Final = (".py", ".dbc")
_NUMERICAL: Final = ("numpy", "scipy", "numba")
_ROOT: Final = Path(__file__).resolve().parents[2]
_DIGITS: Final = 24
"""Hexadecimal digits of a hash: 96 bits, without collisions among a million cases."""
_PATH: Final = re.compile(r'"([^"\\]*/[^"\\]*)"')
_WAVES: Final = ("sea", "voyage", "duration_s", "settle_s")


@cache
def code_digest() -> str:
    """Hash of the program's files and of the versions of the numerical packages."""
    whole = hashlib.sha256()
    for package in _PACKAGES:
        files = (file for file in (_ROOT / package).rglob("*") if file.suffix in _SUFFIXES)
        for file in sorted(files):
            content = file.read_bytes()
            name = file.relative_to(_ROOT).as_posix()
            whole.update(f"{name}\n{len(content)}\n".encode() + content)
    for name in _NUMERICAL:
        whole.update(f"{name} {importlib.metadata.version(name)}\n".encode())
    return whole.hexdigest()[:_DIGITS]


def case_name(simulation: str, content: dict[str, Any]) -> str:
    """Name of a case: a hash of the scenario's content, its seed and its data files."""
    return _digest([simulation, content, code_digest()])


def waves_name(content: dict[str, Any]) -> str:
    """Hash of a scenario's waves and of the span that is judged.

    Runs with the same name met the same waves and are compared pair by pair.
    """
    return _digest([{key: content.get(key) for key in _WAVES}, content.get("seed", 1)])


def as_text(content: Any) -> str:
    """Content as JSON in canonical form."""
    return json.dumps(content, sort_keys=True, default=_plain)


def _digest(content: Any) -> str:
    text = _PATH.sub(lambda found: _file_digest(found[1]) or found[0], as_text(content))
    return hashlib.sha256(text.encode()).hexdigest()[:_DIGITS]


@cache
def _file_digest(name: str) -> str:
    file = Path(name)
    return hashlib.sha256(file.read_bytes()).hexdigest() if file.is_file() else ""


def _plain(value: Any) -> str:
    if isinstance(value, date):
        return value.isoformat()
    raise TypeError(f"{type(value).__name__} is no content of a configuration")
