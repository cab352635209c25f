"""``utank-hil identify sea``: yesterday's waves, met again with another law."""

import json
from pathlib import Path

import numpy as np
import pytest
import yaml
from commands.test_identify_test import run

from firmware_sim.bench import run_in_turn
from firmware_sim.figures import figures
from firmware_sim.run import COLUMNS
from firmware_sim.scenario import Scenario
from utank_hil.configuration import load_config
from utank_hil.telemetry.recording import write_recording

STORM = Path("configs/scenarios/storm.yaml")
SHIP = Path("configs/ships/thesis_first.yaml").resolve()


def scenario_in(folder, **keys):
    """The storm with GPC alone, twenty roll periods of it."""
    content = yaml.safe_load(STORM.read_text()) | {
        "vessel": str(SHIP),
        "controllers": {"gpc": str(Path("configs/controllers/gpc.yaml").resolve())},
        "duration_s": 240,
    }
    content["sea"]["file"] = str(STORM.parent.joinpath(content["sea"]["file"]).resolve())
    path = folder / "scenario.yaml"
    path.write_text(yaml.safe_dump(content | keys))
    return path


def benched(scenario, **changes):
    loaded = load_config(scenario, Scenario).model_copy(update=changes)
    return run_in_turn(loaded, loaded.seed)


@pytest.mark.usefixtures("read_here")
def test_the_passive_ship_rolls_in_the_waves_of_a_record_under_a_law_as_in_the_sea(tmp_path):
    first = benched(scenario_in(tmp_path))
    runs = {each.name: each.rows for each in first.runs}
    write_recording(tmp_path / "bench.rrd", COLUMNS, runs)
    code, out = run(
        "identify", "sea", tmp_path / "bench.rrd", "--run", "gpc", "--ship", SHIP,
        "--slope", 0.5, "--out", tmp_path / "sea", "--json",
    )  # fmt: skip
    assert code == 0, out
    found = json.loads(out)
    assert found["duration_s"] == pytest.approx(240, abs=0.5)
    assert (tmp_path / "sea/sea.png").stat().st_size > 10_000
    sea = {"kind": "components", "file": "./sea.csv", "effective_slope": {"coefficient": 0.5}}
    # in the same waves laws do the same
    again = benched(scenario_in(tmp_path / "sea", sea=sea), controllers={})
    passive, expected = (figures(each).runs[0].roll.rms_rad for each in (again, first))
    assert passive == pytest.approx(expected, rel=0.03)


def table(path, roll_deg, *, gap=slice(0), levels=True):
    time_s = 0.1 * np.arange(len(roll_deg))
    columns = np.column_stack([time_s, roll_deg, 0 * time_s, 0 * time_s])
    columns[gap, 1] = np.nan
    rows = "\n".join(",".join("" if np.isnan(x) else f"{x:.4f}" for x in row) for row in columns)
    path.write_text(f"time_s,roll_deg,port_level_m,starboard_level_m\n{rows}\n")
    return path


def test_short_gaps_are_filled_and_long_ones_refused_with_their_place(tmp_path):
    roll = 3 * np.sin(0.5 * 0.1 * np.arange(2000))
    words = ("--ship", SHIP, "--out", tmp_path)
    code, out = run("identify", "sea", table(tmp_path / "a.csv", roll, gap=slice(900, 905)), *words)
    assert code == 0, out
    code, out = run("identify", "sea", table(tmp_path / "b.csv", roll, gap=slice(900, 930)), *words)
    assert code == 1
    assert "gap of 3.1 s around 93 s" in out
    code, out = run(
        "identify", "sea", table(tmp_path / "c.csv", roll, gap=slice(1950, 2000)), *words
    )
    assert code == 1
    assert "gap of" in out


def test_a_record_that_is_too_short_or_runs_backward_is_refused(tmp_path):
    path = table(tmp_path / "a.csv", np.sin(np.arange(500.0)))
    code, out = run("identify", "sea", path, "--ship", SHIP, "--out", tmp_path)
    assert code == 1
    assert "shorter than 120 s" in out
    lines = table(path, np.sin(np.arange(2000.0))).read_text().splitlines()
    path.write_text("\n".join([lines[0], *lines[:0:-1], ""]))
    code, out = run("identify", "sea", path, "--ship", SHIP, "--out", tmp_path)
    assert code == 1
    assert "rising times" in out


def test_a_record_without_levels_says_what_it_needs(tmp_path):
    path = tmp_path / "roll.csv"
    path.write_text("time_s,roll_deg\n" + "".join(f"{t},{t % 3}\n" for t in range(300)))
    code, out = run("identify", "sea", path, "--ship", SHIP, "--out", tmp_path)
    assert code == 2
    assert "no column port_level_m" in out
