"""``utank-hil hull``: from a mesh to a ship that rolls on the bench."""

import json
from pathlib import Path

import pytest
from bodies import both_sides, wigley, written
from typer.testing import CliRunner

from firmware_sim.commands.hull import hull
from firmware_sim.scenario import Scenario
from firmware_sim.ship_side import build_ship_side
from utank_hil.base.tick import TICK_NS
from utank_hil.console.common import new_app
from utank_hil.console.exit_codes import ExitCode

app = new_app()
app.command("hull")(hull)


def run(*words: object):
    return CliRunner().invoke(app, [str(word) for word in words], env={"COLUMNS": "200"})


def test_mesh_becomes_a_ship_that_sways_on_the_bench(tmp_path: Path) -> None:
    mesh = written(tmp_path / "wigley.gdf", both_sides(wigley(panels=(14, 4))))
    file = tmp_path / "wigley.nc"
    done = run(mesh, "--gm", 1.6, "--roll-period", 8, "--out", file, "--json")
    assert done.exit_code == 0, done.output
    told = json.loads(done.stdout)
    assert told["panels"] == 112
    assert [told[key] for key in ("length_m", "beam_m", "draught_m")] == pytest.approx([60, 12, 4])
    assert told["roll_period_s"] == pytest.approx(8.0)
    assert told["metacentric_height_m"] == pytest.approx(1.6)
    assert told["displacement_t"] == pytest.approx(1.025 * 4 / 9 * 60 * 12 * 4, rel=0.02)
    tank = {"width_m": 8.0, "height_m": 2.5, "reservoir_area_m2": 2.0, "duct_area_m2": 0.7}
    ship = {"hull": str(file), "damping_ratio": 0.05}
    scenario = Scenario.model_validate({
        "name": "wigley", "vessel": {"name": "w", "ship": ship, "tank": tank, "emulated": True},
        "sea": {"kind": "jonswap", "hs_m": 1.0, "tp_s": 8.0}, "plant": "sway_roll_yaw",
        "duration_s": 60.0, "settle_s": 10.0,
    })  # fmt: skip
    plant = build_ship_side(scenario, 1, ()).plant
    roll, lateral = [], []
    for tick in range(6001):
        plant.advance(tick * TICK_NS)
        roll.append(plant.roll_rad)
        lateral.append(plant.lateral_m_s2)
    assert 0.01 < max(map(abs, roll)) < 0.3
    assert 0.1 < max(map(abs, lateral)) < 1.0


@pytest.mark.parametrize(
    ("words", "reason"),
    [
        (("--gm", 1), "--roll-period or --gyration is needed, and not both"),
        (("--gm", 1, "--gravity", 1, "--gyration", 3), "--gm or --gravity is needed, and not both"),
        (("--gm", 1, "--gyration", 3, "--out", "x.txt"), "--out x.txt: its suffix must be .nc"),
        (("--gm", 1, "--gyration", 3), "none.gdf: there is no such file"),
    ],
)
def test_what_is_missing_or_wrong_is_said(words, reason: str) -> None:
    done = run("none.gdf", *words)
    assert done.exit_code == ExitCode.USAGE
    assert reason in " ".join(done.output.split())
