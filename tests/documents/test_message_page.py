"""docs/how-to/message.md, walked: its changes made in a copy of the repository."""

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
PAGE = ROOT / "docs" / "how-to" / "message.md"
COPIED = ("configs", "docs", "firmware_sim", "tests", "tools", "utank_hil", "pyproject.toml")
BLOCK = re.compile(r"^```diff\n--- (\S+)\n(.*?)^```$", re.M | re.S)
ROW = re.compile(r"^\| \d+ \| `(\S+)` \|", re.M)


def lines_of(hunk: str, signs: str) -> str:
    """The lines of a change with one of these signs, without it and the last line's end."""
    return "\n".join(line[1:] for line in hunk.splitlines() if line[:1] in signs)


def apply(folder: Path, page: str) -> None:
    """Make a page's changes; each must have one place where it fits."""
    for name, hunks in BLOCK.findall(page):
        text = (folder / name).read_text(encoding="utf-8")
        for hunk in hunks.split("@@\n"):
            old, new = lines_of(hunk, " -"), lines_of(hunk, " +")
            assert text.count(old) == 1, f"{name}: {text.count(old)} places for\n{old}"
            text = text.replace(old, new)
        (folder / name).write_text(text, encoding="utf-8")


def contents(folder: Path) -> dict[str, bytes]:
    """The files that are not made by running."""
    return {
        str(path.relative_to(folder)): path.read_bytes()
        for name in COPIED
        for path in [folder / name, *(folder / name).rglob("*")]
        if path.is_file() and "__pycache__" not in path.parts
    }


@pytest.fixture(scope="module")
def walked(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A copy of the repository after the page's last step."""
    folder = tmp_path_factory.mktemp("walked")
    for name in COPIED:
        # with the compiled code, which numba finds valid by its source's time and size
        copy = shutil.copytree if (ROOT / name).is_dir() else shutil.copy2
        copy(ROOT / name, folder / name)
    apply(folder, PAGE.read_text(encoding="utf-8"))
    run(folder, "tools.documents.write")
    return folder


def run(folder: Path, *arguments: str) -> None:
    """Run a module of the copy, or one that tests it."""
    environment = os.environ | {"PYTHONPATH": str(folder)}
    done = subprocess.run(
        [sys.executable, "-m", *arguments],
        cwd=folder, env=environment, capture_output=True, text=True, timeout=280, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stdout + done.stderr


def test_the_six_files_of_the_page_are_those_that_change(walked: Path) -> None:
    before, after = contents(ROOT), contents(walked)
    changed = {name for name in before.keys() | after.keys() if before.get(name) != after.get(name)}
    assert changed == set(ROW.findall(PAGE.read_text(encoding="utf-8")))
    assert len(changed) == 6


@pytest.mark.slow
def test_the_new_message_passes_the_tests_of_the_bus_and_of_the_inbox(walked: Path) -> None:
    run(walked, "tools.documents.write", "--check")
    of_the_bus = (f"tests/canbus/test_{name}.py" for name in ("catalogue", "codec", "e2e"))
    run(walked, "pytest", "-p", "no:cacheprovider", "tests/runtime/test_inbox.py", *of_the_bus)
