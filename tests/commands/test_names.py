"""Names are the user's own: what Rich would take for markup is printed as it is."""

import io
from pathlib import Path
from typing import Any

import pytest
import yaml
from ports import QuietBus
from typer.testing import CliRunner

from utank_hil.cli import app
from utank_hil.console import admission
from utank_hil.console.terminal import Terminal

CONFIGS = Path("configs").resolve()
LAW, SHIP, SEA, RUN = "law [/red]", "ship [/b]", "sea [/i]", "gpc [bold]"


def written(path: Path, shipped: str, **changes: Any) -> Path:
    source = CONFIGS / shipped
    content = yaml.safe_load(source.read_text(encoding="utf-8")) | changes
    path.write_text(yaml.safe_dump(content), encoding="utf-8")
    return path


def controller(folder: Path) -> Path:
    ship = written(folder / "ship.yaml", "ships/thesis_first.yaml", name=SHIP)
    return written(folder / "law.yaml", "controllers/gpc.yaml", name=LAW, vessel=str(ship))


def told(*words: object) -> str:
    environment = {"TERM": "dumb", "COLUMNS": "300"}
    result = CliRunner(env=environment).invoke(app, [str(word) for word in words])
    assert result.exit_code == 0, result.output
    return result.output


def test_check_prints_names_as_they_are(tmp_path: Path) -> None:
    config = controller(tmp_path)
    assert f"{LAW} for {SHIP}: the configuration" in told("check", config)
    assert f"{SHIP}: the ship is valid" in told("check", tmp_path / "ship.yaml")


def test_a_terminal_shows_that_a_law_is_being_designed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    shown = io.StringIO()
    monkeypatch.setattr(admission, "notes", Terminal(file=shown, force_terminal=True, _environ={}))
    told("check", controller(tmp_path))
    assert f"{LAW}: designing its law" in shown.getvalue()


def test_run_goes_on_whatever_the_law_is_called(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("utank_hil.canbus.socketcan.SocketCanPort", QuietBus)
    output = told("run", controller(tmp_path), "--bus", "any0", "--duration", "0.3")
    assert output.count(LAW) == 2


@pytest.mark.evidence
def test_bench_prints_names_as_they_are(tmp_path: Path) -> None:
    config = controller(tmp_path)
    scenario = written(
        tmp_path / "sea.yaml",
        "scenarios/still_water.yaml",
        name=SEA,
        vessel=str(tmp_path / "ship.yaml"),
        controllers={RUN: str(config)},
    )
    checked = told("check", scenario)
    assert f"{SEA}, {SHIP}: the scenario" in checked
    out = tmp_path / "out [b]"
    output = told("bench", scenario, "--duration", 30, "--out", out)
    assert SEA in output
    assert output.count(RUN) >= 2
    assert f"recording: {out}" in output
