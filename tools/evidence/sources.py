"""What a part was made from: a digest of the code that it imports and of the configurations."""

import ast
import hashlib
from collections.abc import Iterable, Iterator
from functools import cache
from pathlib import Path

import yaml

ROOT = Path(__file__).resolve().parents[2]
PACKAGES = ("utank_hil", "firmware_sim", "tools")


def digest_of(files: Iterable[Path]) -> str:
    """Digest of files; comments, docstrings and layout do not count.

    Parameters
    ----------
    files : iterable of Path
        Python files, YAML files and others; under `ROOT`.
    """
    whole = hashlib.sha256()
    for file in sorted(set(files)):
        content = _meaning(file)
        whole.update(f"{file.relative_to(ROOT)}\n{len(content)}\n".encode() + content)
    return whole.hexdigest()[:16]


def imported(start: Iterable[Path]) -> set[Path]:
    """Files of this repository that these import, and those import in turn; themselves included.

    Imports within functions count. A module that is loaded by its name as a string is not seen.
    """
    found: set[Path] = set()
    waiting = list(start)
    while waiting:
        file = waiting.pop()
        if file in found:
            continue
        found.add(file)
        waiting += (other for name in _imports(file) for other in _files(name))
    return found


@cache
def _imports(file: Path) -> frozenset[str]:
    """Dotted names that a file imports, modules among them."""
    names: list[str] = []
    for node in ast.walk(ast.parse(file.read_bytes())):
        if isinstance(node, ast.Import):
            names += (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and node.module:
            names += (node.module, *(f"{node.module}.{alias.name}" for alias in node.names))
    return frozenset(names)


def _files(name: str) -> Iterator[Path]:
    """Files that importing a name runs, its packages' included; none if it is not of ours."""
    parts = name.split(".")
    if parts[0] not in PACKAGES:
        return
    for length in range(1, len(parts) + 1):
        place = ROOT.joinpath(*parts[:length])
        for file in (place.with_suffix(".py"), place / "__init__.py"):
            if file.is_file():
                yield file


@cache
def _meaning(file: Path) -> bytes:
    """What a file says, in one form."""
    if file.suffix == ".yaml":
        return repr(yaml.safe_load(file.read_bytes())).encode()
    if file.suffix != ".py":
        return file.read_bytes()
    tree = ast.parse(file.read_bytes())
    for node in ast.walk(tree):
        if isinstance(node, (ast.Module, ast.ClassDef, ast.FunctionDef)):
            first = node.body[0] if node.body else None
            if isinstance(first, ast.Expr) and isinstance(first.value, ast.Constant):
                node.body = node.body[1:]
    return ast.unparse(tree).encode()
