"""The changes that how-to pages show, made in a copy of the repository.

A block of language ``diff`` begins with the line ``--- path``; lines ``@@`` part its hunks.
The numbered table at the head of the page lists the files that change.
"""

import os
import re
import shutil
import subprocess
import sys

import pytest
from pages import HOW_TO, ROOT, blocks

from tools.documents.write import TABLES, WHOLE

pytestmark = pytest.mark.slow

COPIED = ("configs", "docs", "firmware_sim", "tests", "tools", "utank_hil", "pyproject.toml")
ROW = re.compile(r"^\| \d+ \| `(\S+)` \|", re.M)
CHANGING = [page for page in HOW_TO if "```diff" in page.read_text(encoding="utf-8")]
ALSO = ("catalogue", "codec", "e2e")
"""Tests of the bus, beside those that a page changes."""


def lines_of(hunk, signs):
    """The lines of a change with one of these signs, without it and the last line's end."""
    return "\n".join(line[1:] for line in hunk.splitlines() if line[:1] in signs)


def apply(folder, page):
    """Make a page's changes; each must have one place where it fits."""
    for block in blocks(page):
        if block.language != "diff":
            continue
        head, _, hunks = block.text.partition("\n")
        file = folder / head.removeprefix("--- ")
        if not file.exists():
            file.write_text(lines_of(hunks, "+") + "\n", encoding="utf-8")
            continue
        text = file.read_text(encoding="utf-8")
        for hunk in hunks.split("@@\n"):
            old, new = lines_of(hunk, " -"), lines_of(hunk, " +")
            assert text.count(old) == 1, f"{file.name}: {text.count(old)} places for\n{old}"
            text = text.replace(old, new)
        file.write_text(text, encoding="utf-8")


def run(folder, *arguments):
    """Run a module of the copy, or one that tests it."""
    environment = os.environ | {"PYTHONPATH": str(folder)}
    done = subprocess.run(
        [sys.executable, "-m", *arguments],
        cwd=folder, env=environment, capture_output=True, text=True, timeout=280, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stdout + done.stderr


def contents(folder):
    """The files that are not made by running."""
    return {
        str(path.relative_to(folder)): path.read_bytes()
        for name in COPIED
        for path in [folder / name, *(folder / name).rglob("*")]
        if path.is_file() and "__pycache__" not in path.parts
    }


@pytest.fixture(scope="module", params=CHANGING, ids=lambda page: page.stem)
def walked(request, tmp_path_factory):
    """A copy of the repository after the last step of a page."""
    folder = tmp_path_factory.mktemp(request.param.stem)
    for name in COPIED:
        # with the compiled code, which numba finds valid by its source's time and size
        copy = shutil.copytree if (ROOT / name).is_dir() else shutil.copy2
        copy(ROOT / name, folder / name)
    apply(folder, request.param.read_text(encoding="utf-8"))
    return folder


def rows(walked):
    """The files in the table of the page that was walked."""
    (page,) = (page for page in CHANGING if walked.name.startswith(page.stem))
    return ROW.findall(page.read_text(encoding="utf-8"))


def changed(walked):
    """The files that the page has changed so far."""
    before, after = contents(ROOT), contents(walked)
    return {name for name in before.keys() | after.keys() if before.get(name) != after.get(name)}


def test_the_files_of_the_page_are_those_that_change(walked):
    generated = {str(page.relative_to(ROOT)) for page in (*TABLES, *WHOLE)}
    assert changed(walked) == set(rows(walked)) - generated
    assert len(rows(walked)) <= 7


@pytest.mark.evidence
def test_the_change_passes_its_tests_and_those_of_the_bus(walked):
    run(walked, "tools.documents.write")
    also = {"docs/configuration.md"}  # whenever a key is new
    assert changed(walked) - also == set(rows(walked)) - also
    tests = {name for name in rows(walked) if name.startswith("tests/")}
    tests |= {"tests/safety/test_faults.py"} | {f"tests/canbus/test_{name}.py" for name in ALSO}
    run(walked, "pytest", "-p", "no:cacheprovider", "-m", "not slow", *sorted(tests))
