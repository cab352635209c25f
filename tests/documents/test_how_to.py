"""The steps of every how-to page work as written.

A page is walked from top to bottom in a folder that has ``configs`` only:

* a block that names a file, after the fence or in a line "`path`:" above it, becomes that file; if
  the repository has the file, the block must be quoted from it;
* the commands of an ``sh`` block are run, if all are ``utank-hil`` or ``firmware-sim`` without a
  bus, or ``sed``; those of ``sh slow`` in the slow tests only, those of ``exits-6`` end so;
* other ``python`` blocks are run.
"""

import re
import shlex
import shutil
import subprocess

import pytest
from pages import HOW_TO, ROOT, Block, blocks, run_python
from typer.testing import CliRunner

from firmware_sim.cli import app as firmware_sim
from utank_hil.cli import app as utank_hil

COMMANDS = {"utank-hil": utank_hil, "firmware-sim": firmware_sim}


def commands(block):
    """The commands of a block that can be run here; none if one of them can't."""
    if block.language != "sh":
        return []
    lines = [shlex.split(line, comments=True) for line in block.text.splitlines()]
    found = [line for line in lines if line]
    here = all(line[0] in {*COMMANDS, "sed"} and not {"--bus", "&"} & set(line) for line in found)
    return found if here else []


def walk(page, folder, *, slow):
    """Take the steps of a page in a folder, which is the current one."""
    for block in blocks(page.read_text(encoding="utf-8")):
        where = f"{page.name}:{block.line}"
        if block.file and (ROOT / block.file).exists():
            assert block.text in (ROOT / block.file).read_text(encoding="utf-8"), where
        elif block.file:
            (folder / block.file).parent.mkdir(parents=True, exist_ok=True)
            (folder / block.file).write_text(block.text, encoding="utf-8")
        elif block.language == "python":
            run_python(page, block)
        elif "slow" in block.note.split() and not slow:
            continue
        else:
            expected = re.search(r"\bexits-(\d+)", block.note)
            for name, *arguments in commands(block):
                if name not in COMMANDS:
                    subprocess.run([name, *arguments], check=True)
                    continue
                result = CliRunner().invoke(COMMANDS[name], arguments)
                said = f"{where}: {shlex.join(arguments)}\n{result.output}"
                assert result.exit_code == (int(expected[1]) if expected else 0), said


def has_slow_steps(page):
    return any("slow" in block.note.split() for block in blocks(page.read_text(encoding="utf-8")))


@pytest.mark.evidence("ship", "ship-slow", "law-slow", "logs-slow")
@pytest.mark.parametrize(
    ("page", "slow"),
    [
        *(pytest.param(page, False, id=page.stem) for page in HOW_TO),
        *(
            pytest.param(page, True, id=f"{page.stem}-slow", marks=pytest.mark.slow)
            for page in HOW_TO
            if has_slow_steps(page)
        ),
    ],
)
def test_the_steps_of_a_page_work(page, slow, tmp_path, monkeypatch):
    shutil.copytree(ROOT / "configs", tmp_path / "configs")
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend(tmp_path)
    walk(page, tmp_path, slow=slow)


@pytest.mark.parametrize(
    ("text", "why"),
    [
        ("```sh\nutank-hil check nothing.yaml\n```\n", "nothing.yaml"),
        ("`x.yaml`:\n\n```yaml\na: 1\n```\n\n```sh\nutank-hil check x.yaml\n```\n", "x.yaml: has"),
        ("```python\nimport nothing_like_it\n```\n", "nothing_like_it"),
        ("```python utank_hil/control/interface.py\nnot there\n```\n", "page.md:1"),
    ],
    ids=["missing file", "wrong file", "wrong snippet", "wrong quotation"],
)
def test_a_wrong_step_is_found(text, why, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    page = tmp_path / "page.md"
    page.write_text(text, encoding="utf-8")
    with pytest.raises((AssertionError, ImportError), match=why):
        walk(page, tmp_path, slow=True)


def test_what_is_a_file_and_what_is_run():
    (page,) = (each for each in HOW_TO if each.stem == "ship")
    found = blocks(page.read_text(encoding="utf-8"))
    assert [each.file for each in found if each.file] == [
        f"configs/{kind}/supply_vessel.yaml" for kind in ("ships", "controllers", "scenarios")
    ]
    assert [len(commands(each)) for each in found if each.language == "sh"] == [2, 1, 2, 1, 1, 1]
    for text in ("make docs\n", "utank-hil run a.yaml --bus vcan0\n", "firmware-sim a.yaml &\n"):
        assert commands(Block("sh", "", "", 1, "utank-hil check a.yaml\n" + text)) == []
