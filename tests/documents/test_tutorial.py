"""The tutorial: its commands work one after the other, and give the figures that it shows."""

import json
import math
import re
import shutil

import pytest
from pages import ROOT, blocks
from test_how_to import commands, walk

from utank_hil.telemetry import viewer

PAGE = ROOT / "docs" / "tutorial.md"
BLOCKS = blocks(PAGE.read_text(encoding="utf-8"))


class ClosedAtOnce:
    """A viewer that its user closes at once."""

    url = None
    failed = False

    def __init__(self, source, at_s=None):
        shown.append((str(source), at_s))

    def __enter__(self):
        return self

    def __exit__(self, *_):
        pass

    def wait(self, longest_s):
        return True


shown: list[tuple[str, float | None]] = []


def table_rows(text):
    """Roll by run, of a table as it is printed."""
    return {name: float(roll) for name, roll in re.findall(r"│ ([\w ]+?) +│ +([\d.]+) │", text)}


@pytest.mark.slow
@pytest.mark.usefixtures("few_rolls")
def test_its_quick_commands_work(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    walk(PAGE, tmp_path, slow=False)
    assert (tmp_path / "patrol" / "narrow").is_dir()


@pytest.mark.evidence
@pytest.mark.timeout(900)
def test_its_commands_give_its_figures(tmp_path, monkeypatch):
    shutil.copytree(ROOT / "configs", tmp_path / "configs")
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(viewer, "open_viewer", ClosedAtOnce)
    shown.clear()
    walk(PAGE, tmp_path, slow=True)
    printed = [table_rows(block.text) for block in BLOCKS if "│" in block.text]
    assert [len(table) for table in printed] == [3, 3]
    page = " ".join(PAGE.read_text(encoding="utf-8").split())
    for folder, table in zip(("out", "narrow"), printed, strict=True):
        report = json.loads((tmp_path / "patrol" / folder / "bench.json").read_text())
        rolls = {run["name"]: math.degrees(run["roll"]["rms_rad"]) for run in report["runs"]}
        rolls["no tank"] = math.degrees(report["no_tank"]["rms_rad"])
        assert {name: round(roll, 2) for name, roll in rolls.items()} == table
        passive, active = report["runs"]
        assert f"tank takes {100 * passive['roll_below_no_tank']:.0f} % of the roll" in page
        if folder == "out":
            assert f"the pump {100 * active['roll_below_passive']:.0f} % of the rest" in page
    watched, faulty = shown
    assert watched[0] == "patrol/out/bench.rrd"
    assert faulty == ("patrol/faulty/bench.rrd", pytest.approx(100.4, abs=0.06))
    assert "a signal that stands still" in (tmp_path / "patrol/faulty/report.html").read_text()


def test_no_command_of_it_is_left_out():
    """Those that are not walked are of `make`, which has them, or need a bus or two terminals."""
    made = re.findall(r"^make (\w+)$", PAGE.read_text(encoding="utf-8"), re.M)
    makefile = (ROOT / "Makefile").read_text(encoding="utf-8")
    assert made
    assert all(re.search(rf"^{name}:", makefile, re.M) for name in made)
    left = [block for block in BLOCKS if block.language == "sh" and not commands(block)]
    assert ["make bench" in left[0].text, left[1].note] == [True, "vcan"]
    assert len(left) == 2
