"""``utank-hil init``: from a ship's dimensions to a project that is ready for the bench."""

import errno
import json
import math
import os
import sys
from collections.abc import Callable
from contextlib import AbstractContextManager, nullcontext
from functools import cache
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import pytest
import typer
from typer.testing import CliRunner, Result

from firmware_sim import prediction
from firmware_sim.bench import BenchOptions, run_bench
from firmware_sim.commands.init import init
from firmware_sim.figures import figures
from firmware_sim.prediction import Expected
from firmware_sim.scenario import Scenario
from firmware_sim.starter import StarterProject, StarterShip, make_starter
from utank_hil.analysis.motion.statistics import Interval
from utank_hil.analysis.tank_sizing import usable_level_m
from utank_hil.configuration import ControllerConfig, Vessel, load_config
from utank_hil.console.common import new_app
from utank_hil.console.exit_codes import ExitCode
from utank_hil.gate import judge

PATROL = {"length": 63, "beam": 9.5, "displacement": 1900, "gm": 0.9, "roll-period": 9.5}
SLOW = {"length": 200, "beam": 32.2, "displacement": 42000, "gm": 1.2, "draught": 11.5}
STIFF = SLOW | {"gm": 3.5}
TRAWLER = {"length": 24, "beam": 7.5, "displacement": 240, "gm": 0.7, "draught": 3.0}

Project = Callable[[dict[str, float]], tuple[Path, Any]]

app = new_app()
app.command("init")(init)


def run(folder: Path, ship: dict[str, float], *more: str) -> Result:
    options = [part for key, value in ship.items() for part in (f"--{key}", str(value))]
    return CliRunner().invoke(app, [str(folder), *options, *more], env={"COLUMNS": "200"})


@pytest.fixture(scope="module")
def project(tmp_path_factory: pytest.TempPathFactory) -> Project:
    """Makes the project of a ship, once; its folder, and what was told as JSON."""

    @cache
    def made(ship: tuple[tuple[str, float], ...]) -> tuple[Path, Any]:
        folder = tmp_path_factory.mktemp("project")
        done = run(folder, dict(ship), "--json")
        assert done.exit_code == 0, done.output
        return folder, json.loads(done.stdout)

    return lambda ship: made(tuple(ship.items()))


@pytest.mark.evidence("0.7", "3.5", "1.2")
@pytest.mark.parametrize("ship", [PATROL, SLOW, STIFF, TRAWLER], ids=lambda ship: str(ship["gm"]))
def test_project_is_valid_and_its_law_is_let_on_the_bus(
    project: Project, ship: dict[str, float], monkeypatch: pytest.MonkeyPatch
) -> None:
    # how good the figures are, `test_prediction.py` judges
    monkeypatch.setitem(prediction.predict.__kwdefaults__, "seeds", prediction.SEEDS[:1])
    monkeypatch.setattr(prediction, "ROLLS", 30)
    folder, told = project(ship)
    vessel = load_config(folder / "ship.yaml", Vessel)
    period_s = 2 * math.pi / vessel.ship.natural_frequency_rad_s
    assert told["roll_period_s"] == pytest.approx(period_s)
    if "roll-period" in ship:
        assert period_s == pytest.approx(ship["roll-period"])
    assert vessel.ship.displacement_n == pytest.approx(9806.65 * ship["displacement"])
    controller = load_config(folder / "controller.yaml", ControllerConfig)
    judged = judge(controller)
    assert judged.accepted
    # the slow ship's water would be too fast in the duct before it is at the roof
    most_m = usable_level_m(vessel.ship, vessel.tank)
    assert controller.limits.level_m == pytest.approx(most_m, rel=0.01)
    peak = judged.robustness.nominal.peak_sensitivity
    # the files have four digits
    assert told["law"]["peak_sensitivity"] == pytest.approx(peak, rel=1e-4)
    scenario = load_config(folder / "scenario.yaml", Scenario)
    assert scenario.controllers["self_tuned"] == controller
    found = told["expected"]
    assert found["passive_below_no_tank"]["mean"] > 0.2
    assert found["active_below_passive"]["mean"] > 0.2
    assert set(told["files"]) == {"ship", "controller", "scenario", "README"}


@pytest.mark.evidence
def test_on_the_bench_the_law_is_armed_and_better_than_passive(
    project: Project,
) -> None:
    scenario = load_config(project(PATROL)[0] / "scenario.yaml", Scenario)
    result = run_bench(scenario, BenchOptions(duration_s=200.0), lambda *_: None)
    passive, active = figures(result).compared
    assert (active.mode, active.fault, active.active_share) == ("ACTIVE", "NONE", 1.0)
    assert active.roll.rms_rad < 0.8 * passive.roll.rms_rad
    assert active.pump.level_peak_m < scenario.vessel.tank.level_limit_m


@pytest.mark.evidence
def test_period_by_the_weather_criterion_is_said_in_the_file(
    project: Project,
) -> None:
    assert "weather criterion's formula" in (project(TRAWLER)[0] / "ship.yaml").read_text()


@pytest.mark.usefixtures("few_rolls")
def test_what_to_do_next_can_be_done_under_any_name(tmp_path: Path) -> None:
    name = 'The "Rolling\nStone": #1'
    done = run(tmp_path, PATROL, "--name", name)
    for file in ("controller.yaml", "scenario.yaml"):
        assert (tmp_path / file).exists()
        assert file in done.output.partition("Next:")[2]
    assert load_config(tmp_path / "ship.yaml", Vessel).name == name
    assert run(tmp_path / "north_star", PATROL).exit_code == 0
    assert load_config(tmp_path / "north_star" / "ship.yaml", Vessel).name == "north star"


@pytest.mark.evidence
def test_with_a_hull_the_ship_sways_by_it(tmp_path: Path) -> None:
    ship = PATROL | {"displacement": 1350, "draught": 3.9, "roll-period": 8}
    done = run(tmp_path, ship, "--hull", "--json")
    assert done.exit_code == 0, done.output
    assert "hull" in json.loads(done.stdout)["files"]
    scenario = load_config(tmp_path / "scenario.yaml", Scenario)
    assert scenario.plant == "sway_roll_yaw"
    vessel = scenario.vessel
    assert 2 * math.pi / vessel.ship.natural_frequency_rad_s == pytest.approx(8.0)
    hull = scenario.lateral_hull
    assert hull is not None
    assert hull.stiffness_nm_rad == pytest.approx(vessel.ship.stiffness_nm_rad, rel=0.01)
    law = (tmp_path / "controller.yaml").read_text()
    assert f"effective_slope: {hull.effective_slope:.2g}" in law


def test_a_hull_needs_a_draught_and_more_damping_than_its_waves(tmp_path: Path) -> None:
    assert "--hull: needs --draught" in run(tmp_path, PATROL, "--hull").stderr
    with pytest.raises(ValueError, match=r"waves alone take 0\.03 from this hull: raise it"):
        StarterShip("", 63, 9.5, 1350, 0.9, 8.0, 3.9, roll_damping_ratio=0.02, radiated_ratio=0.03)


@pytest.mark.evidence
def test_sea_can_be_given(tmp_path: Path) -> None:
    told = json.loads(run(tmp_path, PATROL, "--hs", "2.25", "--tp", "8", "--json").stdout)
    assert (told["sea"]["hs_m"], told["sea"]["tp_s"]) == (2.25, 8)
    scenario = load_config(tmp_path / "scenario.yaml", Scenario)
    assert scenario.sea.spectrum().hs_m == pytest.approx(2.25, rel=0.01)


@pytest.mark.evidence
def test_a_tank_that_hardly_helps_is_said_to(project: Project) -> None:
    assert project(PATROL)[1]["little_help"] is None
    slow = {"length": 300, "beam": 48, "displacement": 180e3, "gm": 0.6, "roll-period": 45}
    said = project(slow)[1]["little_help"]
    assert "of the roll in a sea of 18 s, and the ship rolls in 45.0 s" in said


def test_a_sea_in_which_the_pump_is_switched_off_is_said(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A bench ends in HEEL_LIMIT there, whatever was predicted of a law that goes on."""
    of_pilot_boat = Expected(
        840.0, Interval(0.29, 0.06), Interval(0.2, 0.05), Interval(0.19, 0.05), roll_peak_rad=0.6
    )
    monkeypatch.setattr("firmware_sim.commands.init.predict", lambda *_: (of_pilot_boat,))
    said = json.loads(run(tmp_path, PATROL, "--json").stdout)["little_help"]
    assert "the ship rolls to 34 degrees in this sea, and from 20 on the pump is off (HEEL" in said


def test_a_tank_that_cannot_be_is_refused_with_the_reason(tmp_path: Path) -> None:
    done = run(tmp_path / "new", PATROL | {"gm": 0.15})
    assert done.exit_code == ExitCode.REFUSED
    assert "a GM of 0.15 m can spare nothing for a free surface" in done.stderr
    assert list(tmp_path.iterdir()) == []
    told = json.loads(run(tmp_path, PATROL | {"tank-length": 0.3}, "--json").stdout)
    assert told["possible"] is False
    assert "room's length" in told["reason"]


@pytest.mark.parametrize(
    ("changes", "expected"),
    [
        ({"roll-period": -3}, "--roll-period: must be positive"),
        ({"displacement": 0}, "--displacement: must be positive"),
        ({"tank-height": -1}, "--tank-height: must be positive"),
        ({"tank-breadth": 12}, "--tank-breadth: is 12 m, and the ship's beam 9.5 m"),
        ({"duct-below-cg": math.inf}, "--duct-below-cg: must be finite"),
        ({"gm-loss": 0.5}, "--gm-loss: must be 0.03 to 0.25"),
        ({"roll-damping": 2}, "--roll-damping: must be above 0 and at most 0.3"),
        ({"gm": 24, "roll-period": 2}, "--gm: is 24 m, and the metacentre 23 m above the keel"),
        ({"gm": 22}, "--gm: gives a radius of gyration"),
        ({"displacement": 1.9}, "--displacement: is 0.00317 m of water on 63 m by 9.5 m"),
        ({"displacement": 1.9e6}, "--displacement: is 3.17e+03 m of water"),
        ({"length": 63e3}, "--displacement: is 0.00317 m of water on 63000 m by 9.5 m"),
        ({"duct-below-cg": -7}, "--duct-below-cg: puts the duct -7 m from"),
        ({"hs": 12, "tp": 8}, "--hs: of 12 m at a peak period of 8 s"),
        ({"tp": 60}, "--tp: must be above 0 and at most 40"),
        ({"hs": 0}, "--hs: must be positive"),
        ({"tp": 1}, "--tp: the sea has no waves below"),
    ],
)
def test_wrong_options_are_named(tmp_path: Path, changes: dict[str, float], expected: str) -> None:
    done = run(tmp_path, PATROL | {"roll-period": 20} | changes)
    assert done.exit_code == ExitCode.USAGE
    assert expected in done.stderr
    assert list(tmp_path.iterdir()) == []


def test_period_or_draught_is_needed(tmp_path: Path) -> None:
    ship = {key: value for key, value in PATROL.items() if key != "roll-period"}
    done = run(tmp_path, ship)
    assert done.exit_code == ExitCode.USAGE
    assert "--roll-period: is needed, or else the draught" in done.stderr


@pytest.mark.parametrize("name", ["Bell\a", "Gro\x9fe", os.fsdecode(b"Gr\xf6\xdfe")])
def test_a_name_that_no_file_can_hold_is_refused(tmp_path: Path, name: str) -> None:
    done = run(tmp_path, PATROL, "--name", name)
    assert done.exit_code == ExitCode.USAGE
    assert f"--name: {name!a} has letters that can't be written" in done.stderr
    assert list(tmp_path.iterdir()) == []


def test_files_that_are_there_stay(tmp_path: Path) -> None:
    (tmp_path / "ship.yaml").write_text("mine\n")
    done = run(tmp_path, PATROL)
    assert done.exit_code == ExitCode.USAGE
    assert "ship.yaml: is there already" in done.stderr
    assert (tmp_path / "ship.yaml").read_text() == "mine\n"


def test_of_two_at_once_the_later_leaves_the_files_of_the_other(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    other = tmp_path / "controller.yaml"

    def made(*ship: Any) -> StarterProject:
        other.write_text("the other's\n")
        return make_starter(*ship)

    monkeypatch.setattr("firmware_sim.commands.init.make_starter", made)
    done = run(tmp_path, PATROL)
    assert done.exit_code == ExitCode.USAGE
    assert "controller.yaml: is there already" in done.stderr
    assert [*tmp_path.iterdir()] == [other]
    assert other.read_text() == "the other's\n"


def test_a_full_disk_leaves_no_half_of_a_project(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    module = sys.modules["firmware_sim.commands.init"]
    write = module.write_whole

    def full(path: Path, text: str) -> None:
        if path.name == "scenario.yaml":
            raise OSError(errno.ENOSPC, "No space left on device", str(path))
        write(path, text)

    monkeypatch.setattr(module, "write_whole", full)
    project = SimpleNamespace(texts=dict.fromkeys(module.FILES, "text"))
    with pytest.raises(typer.Exit) as ended:
        module._written(cast(Any, project), None, tmp_path / "new")
    assert ended.value.exit_code == 2
    assert "scenario.yaml: No space left" in "".join(capsys.readouterr().err.split("\n"))
    assert [*tmp_path.glob("new/*")] == []


def test_what_is_being_done_names_the_ship_by_its_folder(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    said: list[str] = []
    monkeypatch.setattr(
        "utank_hil.console.terminal.Terminal.busy", lambda _, words: _note(said, words)
    )
    run(tmp_path / "my_ship", PATROL | {"tank-height": 0.1})
    assert said == ["my ship: sizing tank and pump, designing a law"]


def _note(said: list[str], words: str) -> AbstractContextManager[None]:
    said.append(words)
    return nullcontext()
