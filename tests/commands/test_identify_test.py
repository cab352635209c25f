"""``utank-hil identify decay`` and ``inclining``, as a user runs them."""

import json
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from utank_hil.cli import app

SHIP = "configs/ships/naval_vessel.yaml"


def run(*words: object) -> tuple[int, str]:
    result = CliRunner(env={"COLUMNS": "200", "TERM": "dumb"}).invoke(app, [*map(str, words)])
    assert result.exception is None or isinstance(result.exception, SystemExit)
    return result.exit_code, result.output


@pytest.fixture
def record(tmp_path: Path) -> Path:
    """Ten seconds of rest at a held heel, then a decay with a ratio of 0.02, in degrees."""
    time = np.arange(0, 90, 0.1)
    since = np.maximum(time - 10, 0)
    w = 2 * np.pi / 5.6
    roll = 8 * np.exp(-0.02 * w * since) * np.cos(w * np.sqrt(1 - 0.02**2) * since)
    path = tmp_path / "roll.csv"
    rows = "".join(f"{t:.2f},{angle:.5f}\n" for t, angle in zip(time, roll, strict=True))
    path.write_text("time_s,roll_deg\n" + rows)
    return path


def test_a_decay_becomes_the_ships_keys_and_a_picture(tmp_path: Path, record: Path) -> None:
    code, out = run(
        "identify", "decay", record, "--from", 10.5, "--ship", SHIP, "--json", "--out", tmp_path
    )
    assert code == 0
    found = json.loads(out)
    assert found["ship"]["roll_period_s"] == pytest.approx(5.6, rel=1e-3)
    assert found["ship"]["damping_ratio"] == pytest.approx(0.02, rel=0.02)
    assert found["ship"]["quadratic_damping_nms2_rad2"] == pytest.approx(0, abs=2e4)
    assert found["command"] == "identify decay"
    assert found["warnings"] == []
    assert (tmp_path / "decay.png").stat().st_size > 10_000
    code, out = run("identify", "decay", record, "--from", 10.5, "--out", tmp_path)
    assert code == 0
    assert "roll_period_s: 5.6" in out
    assert "The ratio is that at" in out
    assert "--ship SHIP.yaml gives both parts" in out
    words = ("identify", "decay", record, "--from", 10.5, "--ship", "configs/ships/patti_b.yaml")
    code, out = run(*words, "--out", tmp_path)
    assert "rolls in" in out
    assert "of a model, or of another ship" in " ".join(out.split())


def test_rest_in_the_record_is_refused_with_the_remedy(tmp_path: Path, record: Path) -> None:
    code, out = run("identify", "decay", record, "--out", tmp_path, "--json")
    assert code == 1
    assert json.loads(out[out.index("{") :])["accepted"] is False
    assert "--from and --to choose a part" in out


def test_a_table_without_roll_is_refused_with_its_columns(tmp_path: Path) -> None:
    path = tmp_path / "other.csv"
    path.write_text("time_s,pitch_deg\n0,1\n1,2\n")
    code, out = run("identify", "decay", path, "--out", tmp_path)
    assert code == 2
    assert "has no column roll_rad or roll_deg" in out


def test_inclining_gives_gm(tmp_path: Path) -> None:
    path = tmp_path / "shifts.csv"
    moments = [0, 1e5, 2e5, 0, -1e5, -2e5]
    weight = 1900e3 * 9.81
    rows = [f"{m},{np.degrees(np.arctan(m / (weight * 0.9)))}" for m in moments]
    path.write_text("moment_nm,heel_deg\n" + "\n".join(rows) + "\n")
    code, out = run("identify", "inclining", path, "--displacement", 1900, "--json")
    assert code == 0
    assert json.loads(out)["gm_m"] == pytest.approx(0.9, rel=1e-3)
    code, out = run("identify", "inclining", path, "--displacement", 1900)
    assert "GM 0.900 m" in out


def test_a_log_needs_no_name_of_its_command(tmp_path: Path) -> None:
    code, out = run("identify", "no.rrd", "configs/controllers/gpc.yaml", "--out", tmp_path)
    assert code == 2
    assert "no.rrd" in out
