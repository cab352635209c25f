"""``utank-hil check`` says what the numbers mean, so that a wrong unit is seen."""

import json
import math
from pathlib import Path
from typing import Any

import pytest
import yaml
from typer.testing import CliRunner

from utank_hil.cli import app
from utank_hil.configuration.yaml_text import parse_yaml
from utank_hil.console.ship_report import power_words, tonnes

CONFIGS = Path("configs").resolve()
G = 9.80665


def invoke(*arguments: object):
    environment = {"TERM": "dumb", "COLUMNS": "200", "NO_COLOR": "1"}
    return CliRunner(env=environment).invoke(app, [str(each) for each in arguments])


def ship(folder: Path, **changes: Any) -> Path:
    content = parse_yaml((CONFIGS / "ships" / "thesis_first.yaml").read_text())[0]
    for key, value in changes.items():
        section, name = key.split("__")
        content[section][name] = value
    path = folder / "ship.yaml"
    path.write_text(yaml.safe_dump(content))
    return path


def test_figures_are_those_of_a_hand_calculation(tmp_path: Path) -> None:
    found = json.loads(invoke("check", ship(tmp_path, ship__displacement_n=4e8), "--json").stdout)
    assert found["roll_period_s"] == pytest.approx(2 * math.pi / 0.5)
    assert found["gm_m"] == pytest.approx(4.81875e8 / 4e8)
    water_kg = 1000 * (2 * 4.88 * 17.11 + 17.1 * 6.22)
    assert found["water_kg"] == pytest.approx(water_kg)
    assert found["water_share"] == pytest.approx(water_kg * G / 4e8)
    length_m = 2 * 4.88 + 17.1 * 17.11 / 6.22
    assert found["tank_period_s"] == pytest.approx(2 * math.pi * math.sqrt(length_m / (2 * G)))
    assert found["pump_head_m"] == pytest.approx(50e3 / (1000 * G))
    # h = level sin(omega t), the usable level, 0.85 of the roll period of the ship with its water
    flow_m3_s = found["pump_flow_m3_s"]
    assert flow_m3_s == pytest.approx(17.11 * 3.85 * 0.5 / 0.85, rel=5e-3)
    assert found["pump_power_asked_w"] == pytest.approx(50e3 * flow_m3_s)
    # in still water dP = rho / 2 lift r p n^2, T n = (p dP + rho / 2 friction r^2 n^2 r) A n
    speed = math.sqrt(50e3 / (500 * 1.405 * 0.985 * 0.40))
    torque_nm = 6.22 * (0.40 * 50e3 + 500 * 0.005 * 0.985**3 * speed**2)
    assert found["pump_power_held_w"] == pytest.approx(speed * torque_nm, rel=1e-6)
    assert found["pump_power_w"] == 3.6e6
    periods = [mode["period_s"] for mode in found["modes"]]
    assert periods[0] > found["roll_period_s"] > found["tank_period_s"] > periods[1]


def test_heel_that_the_pump_holds_is_one_that_she_can_have(tmp_path: Path) -> None:
    found = json.loads(invoke("check", ship(tmp_path), "--json").stdout)
    level_m = 50e3 / (2 * 1000 * G)  # in the upright ship; both grow until she rests
    upright_rad = 1000 * G * 17.11 * 17.1 * level_m / (4.81875e8 + 9.1e5)
    assert found["pump_heel_rad"] == pytest.approx(upright_rad / (1 - 0.0508), rel=0.01)
    assert found["pump_heel_at_the_end"] is False
    patti_b = CONFIGS / "ships" / "patti_b.yaml"
    for made, said in (
        (lambda: ship(tmp_path), "0.92°"),
        (
            lambda: ship(tmp_path, tank__headroom_m=1.0),
            "0.34° │ │ a reservoir is then │ full or empty",
        ),
        (lambda: patti_b, "capsizes the ship"),
    ):
        path = made()
        assert f"holds │ {said} " in " ".join(invoke("check", path).stdout.split())


def test_figures_of_a_great_ship_have_no_exponent() -> None:
    assert [tonnes(mass) for mass in (1.4149e6, 273.4e3, 47.5e3)] == ["1415 t", "273 t", "47.5 t"]
    assert [power_words(power) for power in (4.16e6, 999.6e3, 800.0)] == [
        "4.16 MW",
        "1000 kW",
        "0.8 kW",
    ]


def test_figures_are_printed_for_ship_controller_and_scenario(tmp_path: Path) -> None:
    text = invoke("check", ship(tmp_path, ship__displacement_n=4e8)).stdout
    for row in ("GM │ 1.20 m", "in the tank │ 273 t", "displacement │ 0.67%", "in metres of water",
                "of GM │ 0.061 m", "pump for │ 38.6 m³/s", "losses │ 1.93 MW",
                "still water │ 1.71 MW", "motor │ 3.60 MW"):  # fmt: skip
        assert row in " ".join(text.split()), row
    line = "rolls in 12.6 s, with the water in 13.2 and 10.4 s; 273 t of water take 5.1%"
    assert line in invoke("check", CONFIGS / "controllers" / "pd.yaml").stdout
    text = invoke("check", CONFIGS / "scenarios" / "still_water.yaml").stdout
    assert line in text
    assert "Waves of 0.00 m significant height" in text


def test_scenario_says_what_the_sea_is_to_the_ship(tmp_path: Path) -> None:
    content = parse_yaml((CONFIGS / "scenarios" / "naval_vessel.yaml").read_text())[0]
    content["vessel"] = str(CONFIGS / "ships" / "naval_vessel.yaml")
    # the other law takes long to design
    planned = CONFIGS / "controllers" / "naval_constrained_gpc.yaml"
    content["controllers"] = {"constrained": str(planned)}
    path = tmp_path / "scenario.yaml"
    path.write_text(yaml.safe_dump(content))
    report = json.loads(invoke("check", path, "--json").stdout)
    figures = report["figures"]
    assert figures["hs_m"] == pytest.approx(0.5, rel=1e-3)
    assert 2 * math.pi / 5.8 < figures["encounter_rad_s"] < 1.4 * 2 * math.pi / 5.8  # mean, peak
    assert figures["static_roll_rms_rad"] == pytest.approx(figures["wave_moment_rms_nm"] / 3.9063e6)
    assert report["ship"]["roll_period_s"] == pytest.approx(5.64, abs=5e-3)
    assert report["warnings"] == []


def test_warnings_are_notes_with_key_and_remedy_and_do_not_fail(tmp_path: Path) -> None:
    path = ship(tmp_path, pump__max_power_w=225e3)
    words = f"{path}: pump.max_power_w: is 225 kW, and to hold max_pressure_pa, 50 kPa, takes"
    result = invoke("check", path)
    assert result.exit_code == 0
    assert f"warning: {words}" in result.stderr
    assert "warning:" not in result.stdout
    (warning,) = json.loads(invoke("check", path, "--json").stdout)["warnings"]
    assert warning.startswith(words)


def test_warning_of_a_scenario_names_the_file_and_key_where_the_value_stands(
    tmp_path: Path,
) -> None:
    path = ship(tmp_path, pump__max_power_w=225e3)
    content = parse_yaml((CONFIGS / "controllers" / "pd.yaml").read_text())[0]
    controller = tmp_path / "controller.yaml"
    controller.write_text(yaml.safe_dump({**content, "vessel": str(path)}))
    sea = {"kind": "jonswap", "hs_m": 8.0, "tp_s": 9.0}
    file = tmp_path / "scenario.yaml"
    file.write_text(
        yaml.safe_dump(
            {"name": "s", "vessel": str(path), "sea": sea, "controllers": {"one": str(controller)},
             "operator": [], "duration_s": 60, "settle_s": 0}
        )
    )  # fmt: skip
    warnings = json.loads(invoke("check", file, "--json").stdout)["warnings"]
    assert [each.partition(": is")[0].partition(": of")[0] for each in warnings] == [
        f"{path}: pump.max_power_w",
        f"{file}: sea.hs_m",
    ]
    run = invoke("run", controller, "--bus", "nowhere0")
    assert f"warning: {path}: pump.max_power_w" in run.stderr
