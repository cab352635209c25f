"""Compiled copies of the modules of a tick, where `make compiled` has made them.

mypyc makes extension modules of the same source. They are loaded only while every source file of
both packages is what they were made of, so that what runs is always what the files say. A run in
lockstep then takes 0.4 of the time and gives the same result, bit for bit. The variable
UTANK_HIL_COMPILED=0 in the environment leaves them out.
"""

import hashlib
import importlib
import os
import sys
from collections.abc import Mapping, Sequence
from importlib.abc import MetaPathFinder
from importlib.machinery import EXTENSION_SUFFIXES, ModuleSpec
from importlib.util import spec_from_file_location
from pathlib import Path
from types import ModuleType
from typing import Any, Final

ROOT: Final = Path(__file__).resolve().parents[2]
PACKAGES: Final = ("utank_hil", "firmware_sim")
CODECS: Final = "utank_hil_codecs"
"""Compiled module of what `utank_hil.canbus.codec` writes for the messages of the catalogue."""
_MADE: Final = ROOT / ".cache" / "compiled"


def folder() -> Path:
    """Where modules belong that the present compiler makes of the present source."""
    whole = hashlib.sha256(sys.version.encode())
    sources = [path for package in PACKAGES for path in sorted((ROOT / package).rglob("*.py"))]
    for path in [*sources, *ROOT.glob("tools/compiled.py")]:
        content = path.read_bytes()
        whole.update(f"{path.relative_to(ROOT)} {len(content)}\n".encode() + content)
    return _MADE / whole.hexdigest()[:16]


class _Finder(MetaPathFinder):
    def __init__(self, files: Mapping[str, Path]) -> None:
        self.files = files

    def find_spec(
        self,
        fullname: str,
        path: Sequence[str] | None,  # noqa: ARG002
        target: ModuleType | None = None,  # noqa: ARG002
    ) -> ModuleSpec | None:
        file = self.files.get(fullname)
        return spec_from_file_location(fullname, file) if file else None


def modules_in(made: Path) -> dict[str, Path]:
    """Extension modules below a folder, by their dotted names."""
    return {
        ".".join(path.relative_to(made).parts).removesuffix(suffix): path
        for suffix in EXTENSION_SUFFIXES[:1]
        for path in made.rglob(f"*{suffix}")
    }


def in_use() -> bool:
    """Whether compiled modules are loaded in place of their source."""
    return any(isinstance(finder, _Finder) for finder in sys.meta_path)


def use_if_current() -> None:
    """Have the compiled modules imported from now on, if there are any of this source."""
    if os.environ.get("UTANK_HIL_COMPILED") == "0" or in_use() or not _MADE.is_dir():
        return
    if files := modules_in(folder()):
        sys.meta_path.insert(0, _Finder(files))


def compiled_codecs() -> dict[str, tuple[Any, Any]]:
    """Functions that encode and decode a message, by their text; none if nothing is compiled."""
    if not in_use():
        return {}
    functions: dict[str, tuple[Any, Any]] = importlib.import_module(CODECS).FUNCTIONS
    return functions
