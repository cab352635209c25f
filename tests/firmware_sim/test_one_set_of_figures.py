"""`init`, `check` and `design tank` say one flow, head and power of a pump."""

import json
from pathlib import Path

import pytest
from typer.testing import CliRunner

from utank_hil.cli import app

RUNNER = CliRunner(env={"COLUMNS": "80"})


def run(*words: object) -> str:
    result = RUNNER.invoke(app, [str(word) for word in words])
    assert result.exit_code == 0, result.output
    return str(result.stdout)


@pytest.mark.evidence
def test_one_pump_is_to_be_ordered(tmp_path: Path) -> None:
    ship = tmp_path / "opv"
    figures = [
        "--length",
        "90",
        "--beam",
        "14",
        "--displacement",
        "1900",
        "--gm",
        "1.1",
        "--roll-period",
        "11",
    ]
    first = run("init", ship, *figures)
    assert max(len(line) for line in first.splitlines()) <= 80 or str(tmp_path) in first
    line = next(line for line in first.splitlines() if "net head" in line)
    order = line.strip("│ ").removeprefix("pump: net head, flow, shaft, duty").strip("│ ")
    checked = json.loads(run("check", ship / "ship.yaml", "--json"))
    found = [checked[f"pump_{name}"] for name in ("head_m", "flow_m3_s", "power_w")]
    said = [float(part.split()[0]) for part in order.split(", ")[:3]]
    assert [f"{value:.2g}" for value in found[:2]] == [f"{value:.2g}" for value in said[:2]]
    assert abs(found[2] / 1e3 - said[2]) < 0.1
    words = ("design", "tank", ship / "ship.yaml", "--scenario", ship / "scenario.yaml")
    assert order in run(*words, "--out", tmp_path / "out")
