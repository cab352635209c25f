"""The emulated ship as an FMU: FMPy finds nothing wrong, and it moves as the bench's plant."""

import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from fmpy import extract, read_model_description
from fmpy.fmi2 import FMU2Slave
from fmpy.validation import validate_fmu
from typer.testing import CliRunner

from firmware_sim.fmu_export import INPUTS, OUTPUTS, write_fmu
from firmware_sim.fmu_file import FmuFile
from firmware_sim.fmu_plant import RunningFmu
from firmware_sim.plant import Plant
from firmware_sim.scenario import Scenario
from firmware_sim.ship_side import plant_of
from utank_hil.base.tick import TICK_NS, TICK_S
from utank_hil.cli import app
from utank_hil.configuration import load_config
from utank_hil.configuration.files import ALLOW_CODE

CONFIGS = Path("configs").resolve()
SHOWN = [name for name in OUTPUTS if name != "flow_m3_s"]


def scenario(name: str, **changes: Any) -> Scenario:
    return load_config(CONFIGS / f"scenarios/{name}.yaml", Scenario).model_copy(update=changes)


@contextmanager
def loaded(file: Path, start_s: float = 0.0) -> Iterator[tuple[FMU2Slave, dict[str, int]]]:
    """The FMU as an importer has it, and its references by name."""
    assert validate_fmu(str(file)) == []
    about = read_model_description(str(file))
    folder = extract(str(file))
    identifier = about.coSimulation.modelIdentifier
    fmu = FMU2Slave(guid=about.guid, unzipDirectory=folder, modelIdentifier=identifier)
    fmu.instantiate()
    fmu.setupExperiment(startTime=start_s)
    fmu.enterInitializationMode()
    fmu.exitInitializationMode()
    yield fmu, {each.name: each.valueReference for each in about.modelVariables}
    fmu.terminate()
    fmu.freeInstance()
    shutil.rmtree(folder)


def greatest_difference(sailed: Scenario, file: Path, seed: int, ticks: int) -> tuple[float, Plant]:
    """Of any output from the plant's, as a share of that output's size; and that plant at its end.

    The pump is driven past its limits and let go, the valve is closed and opened.
    """
    write_fmu(sailed, file, seed)
    plant = plant_of(sailed, seed)
    most_pa = 1.2 * (sailed.vessel.pump.max_pressure_pa if sailed.vessel.pump else 0.0)
    theirs, ours = np.zeros((ticks, len(SHOWN))), np.zeros((ticks, len(SHOWN)))
    with loaded(file) as (fmu, references):
        shown = [references[name] for name in SHOWN]
        plant.advance(0)
        for tick in range(ticks):
            command_pa = most_pa * np.sin(0.005 * tick + 2e-6 * tick * tick)
            enabled = tick // 700 % 4 != 3
            if sailed.vessel.pump:
                plant.drive_pump(command_pa, enabled=enabled)
                fmu.setReal([references["setpoint_pa"]], [command_pa])
                fmu.setBoolean([references["pump_enabled"]], [enabled])
            if sailed.vessel.valve:
                loss = 1e5 * (tick // 300 % 2)
                plant.set_valve_loss(loss)
                fmu.setReal([references["valve_loss_pa_s2_m2"]], [loss])
            fmu.doStep(tick * TICK_S, TICK_S)
            plant.advance((tick + 1) * TICK_NS)
            theirs[tick] = fmu.getReal(shown)
            ours[tick] = [getattr(plant, name) for name in SHOWN]
    size = np.abs(ours).max(axis=0)
    return float((np.abs(theirs - ours).max(axis=0) / np.where(size > 0, size, 1)).max()), plant


@pytest.mark.parametrize("name", ["storm", "patti_b", "naval_vessel", "semi_active", "still_water"])
def test_moves_as_the_plant_of_the_bench(name: str, tmp_path: Path) -> None:
    difference, _ = greatest_difference(scenario(name), tmp_path / "ship.fmu", 3, 2500)
    assert difference < 1e-12


def test_ship_that_sways_moves_as_that_of_the_bench(tmp_path: Path) -> None:
    sailed = scenario("storm", actual_ship={"sway_of_slope": 0.5})
    difference, plant = greatest_difference(sailed, tmp_path / "ship.fmu", 3, 4000)
    assert difference < 1e-12
    assert plant.lateral_m_s2 != 0
    assert plant.strikes > 0


@pytest.mark.evidence
def test_an_hour_is_that_of_the_bench(tmp_path: Path) -> None:
    difference, plant = greatest_difference(scenario("storm"), tmp_path / "ship.fmu", 1, 360_000)
    assert difference < 1e-9
    assert plant.strikes > 0


def test_steps_of_any_length_end_at_the_last_whole_tick(tmp_path: Path) -> None:
    file = tmp_path / "ship.fmu"
    write_fmu(scenario("storm"), file, 1)
    with loaded(file) as (fmu, references), loaded(file, start_s=5.0) as (other, _):
        level = [references["level_m"]]
        fmu.setReal([references["setpoint_pa"]], [4e4])
        other.setReal([references["setpoint_pa"]], [4e4])
        found = []
        for tick in range(300):
            fmu.doStep(tick * TICK_S, TICK_S)
            found += fmu.getReal(level)
        for step in range(120):
            other.doStep(5.0 + step * 0.025, 0.025)
            assert other.getReal(level) == [found[int(2.5 * (step + 1) + 1e-6) - 1]]


def test_a_state_is_kept_and_gone_back_to(tmp_path: Path) -> None:
    file = tmp_path / "ship.fmu"
    write_fmu(scenario("storm"), file, 1)
    with loaded(file) as (fmu, references):
        shown = [references[name] for name in SHOWN]
        fmu.setReal([references["setpoint_pa"]], [4e4])
        fmu.doStep(0.0, 2.0)
        state = fmu.getFMUstate()
        kept = fmu.serializeFMUstate(state)
        fmu.doStep(2.0, 2.0)
        after = fmu.getReal(shown)
        fmu.freeFMUstate(state)
        state = fmu.deSerializeFMUstate(kept)
        fmu.setFMUstate(state)
        fmu.doStep(2.0, 2.0)
        assert fmu.getReal(shown) == after
        fmu.freeFMUstate(state)
        fmu.reset()
        assert fmu.getReal(shown) != after
        with pytest.raises(Exception, match="fmi2SetReal failed"):
            fmu.setReal([references["setpoint_pa"]], [float("nan")])
        with pytest.raises(Exception, match="fmi2SetReal failed"):
            fmu.setReal([references["roll_rad"]], [0.0])


def test_a_moment_from_outside_heels_the_ship(tmp_path: Path) -> None:
    sailed, file = scenario("still_water"), tmp_path / "ship.fmu"
    write_fmu(sailed, file, 1)
    with loaded(file) as (fmu, references):
        fmu.setReal([references["external_moment_nm"]], [2e7])
        fmu.doStep(0.0, 0.1)
        (rate,) = fmu.getReal([references["roll_rate_rad_s"]])
    assert rate == pytest.approx(0.1 * 2e7 / sailed.vessel.ship.inertia_kg_m2, rel=0.2)


def test_what_is_offered_is_what_the_vessel_has(tmp_path: Path) -> None:
    file = tmp_path / "ship.fmu"
    write_fmu(scenario("storm"), file, 1)
    with loaded(file) as (_, references):
        assert "valve_loss_pa_s2_m2" not in references
        assert set(OUTPUTS) <= set(references)
    command = ["bench", str(CONFIGS / "scenarios/semi_active.yaml"), "--fmu", str(file)]
    assert CliRunner().invoke(app, command).exit_code == 0
    with loaded(file) as (_, references):
        assert {*INPUTS, *OUTPUTS} <= set(references)


def test_the_bench_reads_units_of_its_own_fmu(tmp_path: Path) -> None:
    file = tmp_path / "ship.fmu"
    write_fmu(scenario("storm"), file, 1)
    names = ("roll_rad", "roll_rate_rad_s", "level_m", "flow_m3_s", "lateral_m_s2")
    content = {"file": file, "variables": {name: name for name in names}}
    content["variables"]["wave_moment_nm"] = "external_moment_nm"
    running = RunningFmu(FmuFile.model_validate(content, context={ALLOW_CODE: True}))
    running.step({"wave_moment_nm": 0.0})
    plant = plant_of(scenario("storm"), 1)
    plant.drive_pump(0.0, enabled=True)
    plant.advance(0)
    plant.advance(TICK_NS)
    assert running.outputs() == {name: getattr(plant, name) for name in names}


@pytest.mark.parametrize(
    ("name", "changes", "compiler", "words"),
    [
        ("voyage", {}, "cc", "voyage, actual_from_s, sea: .* changes"),
        ("load_change", {}, "cc", "voyage, actual_from_s, sea: .* changes"),
        ("storm", {"plant": "six_degrees"}, "cc", "plant: is six_degrees"),
        ("storm", {}, "no-such-compiler", "no C compiler 'no-such-compiler': apt-get install"),
        ("storm", {}, "false", "false failed"),
    ],
)
def test_what_makes_no_fmu_is_refused(
    name: str,
    changes: dict[str, Any],
    compiler: str,
    words: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr("firmware_sim.fmu_export.CC", compiler)
    with pytest.raises(ValueError, match=words):
        write_fmu(scenario(name, **changes), tmp_path / "ship.fmu", 1)
    assert not list(tmp_path.iterdir())


def test_command_says_why_not(tmp_path: Path) -> None:
    voyage = CONFIGS / "scenarios/voyage.yaml"
    ran = CliRunner().invoke(app, ["bench", str(voyage), "--fmu", str(tmp_path / "ship.fmu")])
    assert ran.exit_code == 2
    assert "voyage, actual_from_s, sea:" in " ".join(ran.stderr.split())
