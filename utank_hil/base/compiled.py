"""Compiled copies of the modules of a tick, where `tools.compiled` has made them.

mypyc makes one extension library of the same source. It is loaded only while every source file of
both packages is what it was made of and it is whole. A run in lockstep then takes 0.4 of the time
and gives the same result, bit for bit. UTANK_HIL_COMPILED=0 in the environment leaves it out.
"""

import hashlib
import importlib
import os
import sys
from collections.abc import Iterable, Sequence
from importlib.abc import MetaPathFinder
from importlib.machinery import EXTENSION_SUFFIXES, ExtensionFileLoader, ModuleSpec
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path
from types import ModuleType
from typing import Any, Final

ROOT: Final = Path(__file__).resolve().parents[2]
PACKAGES: Final = ("utank_hil", "firmware_sim")
CODECS: Final = "utank_hil_codecs"
"""Compiled module of what `utank_hil.canbus.codec` writes for the messages of the catalogue."""
GROUP: Final = "utank_hil_tick"
SUFFIX: Final = EXTENSION_SUFFIXES[0]
"""Names the version of Python and the processor, so that no other takes the library."""
FOLDER: Final = ROOT / "utank_hil" / "compiled"
_INIT: Final = "init_"


def source_digest() -> str:
    """Digest of every source file of both packages."""
    whole = hashlib.sha256()
    for package in PACKAGES:
        for path in sorted((ROOT / package).rglob("*.py")):
            content = path.read_bytes()
            whole.update(f"{path.relative_to(ROOT)} {len(content)}\n".encode() + content)
    return whole.hexdigest()[:16]


def name_of_library(source: str, content: bytes) -> str:
    """File name of a library: of what source it is, its content, Python and processor."""
    return f"{source}-{hashlib.sha256(content).hexdigest()[:16]}{SUFFIX}"


def current_library() -> Path | None:
    """The whole library of the present source, if there is one."""
    if not FOLDER.is_dir():
        return None
    source = source_digest()
    found = FOLDER.glob(f"{source}-*{SUFFIX}")
    return next(
        (file for file in found if file.name == name_of_library(source, _content(file))), None
    )


def _content(file: Path) -> bytes:
    try:
        return file.read_bytes()
    except OSError:  # it is of someone who does not share it, or was just replaced
        return b""


class _Loader(ExtensionFileLoader):
    def create_module(self, spec: ModuleSpec) -> ModuleType:
        # in one library each initialising function needs a name of its own
        return super().create_module(
            ModuleSpec(spec.name.replace(".", "___"), self, origin=self.path)
        )


class _Finder(MetaPathFinder):
    def __init__(self, library: Path, modules: Iterable[str]) -> None:
        self.shared = str(library)
        self.modules = frozenset(modules)

    def find_spec(
        self,
        fullname: str,
        path: Sequence[str] | None,  # noqa: ARG002
        target: ModuleType | None = None,  # noqa: ARG002
    ) -> ModuleSpec | None:
        if fullname not in self.modules:
            return None
        loader = _Loader(fullname, self.shared)
        return spec_from_file_location(fullname, self.shared, loader=loader)


def _modules_in(library: Path) -> list[str]:
    spec = spec_from_file_location(f"{GROUP}__mypyc", library)
    assert spec is not None
    sys.modules[spec.name] = group = module_from_spec(spec)
    names = (name.removeprefix(_INIT) for name in vars(group) if name.startswith(_INIT))
    return [name.replace("___", ".") for name in names]


def in_use() -> bool:
    """Whether compiled modules are loaded in place of their source."""
    return any(isinstance(finder, _Finder) for finder in sys.meta_path)


def use_if_current() -> None:
    """Have the compiled modules imported from now on, if there are any of this source."""
    if os.environ.get("UTANK_HIL_COMPILED") == "0" or in_use():
        return
    if library := current_library():
        try:
            sys.meta_path.insert(0, _Finder(library, _modules_in(library)))
        except ImportError as error:  # of a newer C library than this machine's
            print(f"compiled modules are left out, plain Python runs: {error}", file=sys.stderr)


def compiled_codecs() -> dict[str, tuple[Any, Any]]:
    """Functions that encode and decode a message, by their text; none if nothing is compiled."""
    if not in_use():
        return {}
    functions: dict[str, tuple[Any, Any]] = importlib.import_module(CODECS).FUNCTIONS
    return functions
