"""Configurations of ships that were found: they load, say what was found, and stay."""

import dataclasses
import os
import resource
from pathlib import Path

import numpy as np
import pytest
import yaml

from utank_hil.assembly import build_law
from utank_hil.base.parameters import ParameterError
from utank_hil.commands.identified import IdentifiedShips, read_controller
from utank_hil.configuration import ControllerConfig, Vessel, load_config
from utank_hil.control import PredictiveDesign
from utank_hil.dynamics.ship import restoring
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


def test_the_devices_of_a_ship_that_was_found_are_kept_and_that_she_is_emulated(
    tmp_path: Path,
) -> None:
    vessel = load_config(Path("configs/ships/thesis_first_devices.yaml"), Vessel)
    files = IdentifiedShips(tmp_path, vessel, read_controller(CONFIG)).write(FOUND)
    found = load_config(files["vessel"], Vessel)
    assert (found.devices, found.emulated) == (vessel.devices, True)
    assert found.model_copy(update={"ship": vessel.ship, "tank": vessel.tank}).version == (
        vessel.version
    )


def test_the_least_gm_of_a_ship_that_was_found_is_still_watched(tmp_path: Path) -> None:
    vessel = load_config(CONFIG, ControllerConfig).vessel
    ship = dataclasses.replace(vessel.ship, displacement_n=1.42e8)
    watched = vessel.model_copy(update={"ship": ship, "least_gm_m": 0.7})
    files = IdentifiedShips(tmp_path, watched, read_controller(CONFIG)).write(FOUND)
    assert load_config(files["vessel"], Vessel).least_gm_m == 0.7


@pytest.mark.parametrize("share", [0.7, 1.5])
def test_righting_levers_of_a_ship_that_was_found_scale_with_her_stiffness(
    share: float, tmp_path: Path
) -> None:
    vessel = load_config(CONFIG, ControllerConfig).vessel
    stiffness_nm_rad, displacement_n = vessel.ship.stiffness_nm_rad, 4.0e8
    heel_rad = np.radians(10.0) * np.arange(6)
    levers_m = stiffness_nm_rad / displacement_n * np.sin(heel_rad)
    ship = dataclasses.replace(
        vessel.ship, displacement_n=displacement_n, gz_step_rad=float(heel_rad[1]),
        gz_m=tuple(levers_m.tolist()),
    )  # fmt: skip
    found = dataclasses.replace(FOUND, stiffness_nm_rad=share * stiffness_nm_rad)
    with_levers = vessel.model_copy(update={"ship": ship})
    files = IdentifiedShips(tmp_path, with_levers, read_controller(CONFIG)).write(found)
    written = load_config(files["vessel"], Vessel).ship
    assert written.displacement_n == displacement_n
    np.testing.assert_allclose(
        restoring(written).moment_nm(heel_rad), share * restoring(ship).moment_nm(heel_rad)
    )
    # as the law in charge, and the twin, have her
    assert written == found.ship(ship)


def test_a_ship_that_a_file_may_not_hold_is_not_written(tmp_path: Path) -> None:
    found = dataclasses.replace(FOUND, stiffness_nm_rad=1e7)
    with pytest.raises(ParameterError, match="takes all of the ship's stability"):
        ships(tmp_path).write(found)
    assert list(tmp_path.iterdir()) == []


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


def test_a_ship_that_was_found_outlives_a_power_cut(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    on_disk: list[bytes] = []

    def fsync(descriptor: int) -> None:
        on_disk.append(Path(f"/proc/self/fd/{descriptor}").read_bytes())

    monkeypatch.setattr(os, "fsync", fsync)
    files = ships(tmp_path).write(FOUND)
    assert on_disk == [files[name].read_bytes() for name in ("vessel", "config")]


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
