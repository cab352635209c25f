"""Configurations of ships that were found: they load, say what was found, and stay."""

import dataclasses
import resource
from pathlib import Path

import numpy as np
import pytest
import yaml

from utank_hil.assembly import build_law
from utank_hil.commands.identified import IdentifiedShips, read_controller
from utank_hil.configuration import ControllerConfig, Vessel, load_config
from utank_hil.control import PredictiveDesign
from utank_hil.retuning import ModelSummary

CONFIG = Path("configs/controllers/adaptive_dpc.yaml")
FOUND = ModelSummary(9.0, 0.01, 1.8e9, 8.8e8, 5e7, 0.12, 0.99, 1.4, 0.3)


def ships(folder: Path) -> IdentifiedShips:
    return IdentifiedShips(
        folder, load_config(CONFIG, ControllerConfig).vessel, read_controller(CONFIG)
    )


def test_configuration_loads_with_the_ship_that_was_found_and_all_else_as_it_was(
    tmp_path: Path,
) -> None:
    files = ships(tmp_path / "new" / "folder").write(FOUND)
    given = load_config(CONFIG, ControllerConfig)
    found = load_config(files["config"], ControllerConfig)
    ship, tank = found.vessel.ship, found.vessel.tank
    assert (ship.inertia_kg_m2, ship.stiffness_nm_rad, ship.damping_nms_rad) == (1.8e9, 8.8e8, 5e7)
    assert tank.damping_ratio == 0.12
    assert tank.width_m == given.vessel.tank.width_m
    assert found.vessel.pump == given.vessel.pump
    assert found.vessel.version != given.vessel.version
    same = {"vessel": given.vessel}
    assert found.model_copy(update=same) == given


def test_the_valve_of_a_ship_that_was_found_is_kept(tmp_path: Path) -> None:
    vessel = load_config(Path("configs/ships/thesis_first_valve.yaml"), Vessel)
    files = IdentifiedShips(tmp_path, vessel, read_controller(CONFIG)).write(FOUND)
    assert load_config(files["vessel"], Vessel).valve == vessel.valve


def test_the_least_gm_of_a_ship_that_was_found_is_still_watched(tmp_path: Path) -> None:
    vessel = load_config(CONFIG, ControllerConfig).vessel
    ship = dataclasses.replace(vessel.ship, displacement_n=1.42e8)
    watched = vessel.model_copy(update={"ship": ship, "least_gm_m": 0.7})
    files = IdentifiedShips(tmp_path, watched, read_controller(CONFIG)).write(FOUND)
    assert load_config(files["vessel"], Vessel).least_gm_m == 0.7


def test_ship_found_later_is_written_beside_the_earlier(tmp_path: Path) -> None:
    keep = ships(tmp_path)
    pairs = [keep.write(FOUND) for _ in range(5)]
    assert len(list(tmp_path.iterdir())) == 10
    for pair in pairs:
        named = yaml.safe_load(pair["config"].read_text())["vessel"]
        assert named == pair["vessel"].name


@pytest.mark.parametrize("name", ["limits.yaml", "./limits.yaml", "../{}/limits.yaml"])
def test_files_that_the_configuration_names_are_still_found(tmp_path: Path, name: str) -> None:
    there = tmp_path / "there"
    there.mkdir()
    content = read_controller(CONFIG) | {"limits": name.format("there")}
    (there / "limits.yaml").write_text("pressure_pa: 40000.0\n")
    config = there / "controller.yaml"
    config.write_text(yaml.safe_dump(content))
    keep = IdentifiedShips(
        tmp_path / "out", load_config(config, ControllerConfig).vessel, read_controller(config)
    )
    files = keep.write(FOUND)
    assert load_config(files["config"], ControllerConfig).limits.pressure_pa == 40e3


def test_next_start_has_the_law_that_was_retuned(tmp_path: Path) -> None:
    given = load_config(CONFIG, ControllerConfig)
    files = ships(tmp_path).write(FOUND)
    started = load_config(files["config"], ControllerConfig)
    assert isinstance(given.law, PredictiveDesign)
    vessel = started.vessel
    found = dataclasses.replace(given.plant, ship=vessel.ship, tank=vessel.tank)
    retuned = given.law.law(found)  # as `retune` does
    again = build_law(started).linear
    assert again is not None
    for part in "ABCD":
        np.testing.assert_array_equal(
            getattr(retuned.matrices(), part), getattr(again.matrices(), part)
        )


@pytest.mark.parametrize("which", ["vessel", "config"])
def test_no_half_of_a_ship_is_left_on_a_full_disk(tmp_path: Path, which: str) -> None:
    keep, limits = ships(tmp_path), resource.getrlimit(resource.RLIMIT_FSIZE)
    files = keep.write(FOUND)
    vessel_bytes, bytes_there = (files[name].stat().st_size for name in ("vessel", which))
    assert bytes_there >= vessel_bytes
    resource.setrlimit(resource.RLIMIT_FSIZE, (bytes_there - 1, limits[1]))
    try:
        with pytest.raises(OSError, match=f"File too large: '{tmp_path}"):
            keep.write(FOUND)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)
    assert {*tmp_path.iterdir()} == {*files.values()}
