"""The sea section: every spectrum with the same keys for heading, speed and spreading."""

import math
import re
from pathlib import Path
from typing import Any, get_args

import numpy as np
import pytest
import yaml

from firmware_sim.report_page import sea_words
from firmware_sim.scenario_sea import ScenarioSea
from firmware_sim.voyage import Waypoint
from utank_hil.configuration import ConfigError, Section, load_config
from utank_hil.sea import Sea, ittc, jonswap, load_ndbc, pierson_moskowitz

ROOT = Path(__file__).resolve().parents[2]
DENSITY = ROOT / "configs" / "seas" / "ndbc_41010_2019-02_spectral_density.txt"
DIRECTION = ROOT / "configs" / "seas" / "ndbc_41010_2019-02_mean_direction.txt"
HOUR = "2019-02-10T05:40"
MEASURED = {"kind": "measured", "file": str(DENSITY), "time": HOUR}
DIRECTED = {**MEASURED, "direction_file": str(DIRECTION), "course_deg": 20.0}
IRREGULAR: dict[str, dict[str, Any]] = {
    "jonswap": {"kind": "jonswap", "hs_m": 3.0, "tp_s": 9.0, "gamma": 2.0},
    "ittc": {"kind": "ittc", "hs_m": 3.0, "tp_s": 9.0},
    "pierson_moskowitz": {"kind": "pierson_moskowitz", "hs_m": 3.0},
    "measured": MEASURED,
}
SPECTRA = {
    "jonswap": lambda: jonswap(3.0, 9.0, 2.0),
    "ittc": lambda: ittc(3.0, 9.0),
    "pierson_moskowitz": lambda: pierson_moskowitz(3.0),
    "measured": lambda: load_ndbc(DENSITY).at(HOUR),
}


class Holder(Section):
    sea: ScenarioSea


def load_sea(folder: Path, content: dict[str, Any]) -> ScenarioSea:
    path = folder / "scenario.yaml"
    path.write_text(yaml.safe_dump({"sea": content}), encoding="utf-8")
    return load_config(path, Holder).sea


def assert_equal(sea: Sea, other: Sea) -> None:
    for name in ("amplitude_m", "omega_rad_s", "heading_rad", "phase_rad", "speed_m_s"):
        np.testing.assert_array_equal(getattr(sea, name), getattr(other, name))


@pytest.mark.parametrize("kind", IRREGULAR)
def test_every_spectrum_takes_heading_speed_and_spreading(tmp_path: Path, kind: str) -> None:
    keys = {"heading_deg": 135.0, "speed_m_s": 6.0, "spreading": 12.0}
    loaded = load_sea(tmp_path, {**IRREGULAR[kind], **keys})
    expected = Sea.irregular(
        SPECTRA[kind](), 3, heading_rad=math.radians(135), speed_m_s=6.0, spreading=12.0
    )
    assert_equal(loaded.sea(3), expected)
    assert np.ptp(loaded.sea(3).heading_rad) > 0.5


@pytest.mark.parametrize("kind", IRREGULAR)
def test_without_them_a_sea_is_long_crested_from_port_on_a_ship_at_rest(
    tmp_path: Path, kind: str
) -> None:
    assert_equal(load_sea(tmp_path, IRREGULAR[kind]).sea(1), Sea.irregular(SPECTRA[kind](), 1))


def test_a_moving_ship_meets_a_regular_wave_at_the_encounter_frequency(tmp_path: Path) -> None:
    content = {"kind": "regular", "amplitude_m": 1.0, "period_s": 10.0, "heading_deg": 180.0}
    (encounter,) = load_sea(tmp_path, {**content, "speed_m_s": 5.0}).sea(0).encounter_rad_s
    omega = math.tau / 10
    assert encounter == pytest.approx(omega + omega**2 / 9.80665 * 5, rel=1e-9)


def test_measured_directions_are_turned_into_the_ship_s_frame(tmp_path: Path) -> None:
    spectrum = load_ndbc(DENSITY, DIRECTION).at(HOUR)
    sea = load_sea(tmp_path, DIRECTED).sea(5)
    assert_equal(sea, Sea.irregular(spectrum, 5, heading_rad=spectrum.heading_rad(20.0)))
    # the band with the most energy: where it comes from, in the file, against the ship's course
    peak = int(np.argmax(spectrum.density))
    towards = math.radians(spectrum.direction_from_deg[peak] + 180 - 20)
    near = np.abs(sea.omega_rad_s / math.tau - spectrum.frequency_hz[peak]) < 2e-3
    np.testing.assert_allclose(np.exp(1j * sea.heading_rad[near]), np.exp(1j * towards))


def test_a_time_with_a_zone_means_the_same_hour(tmp_path: Path) -> None:
    assert_equal(
        load_sea(tmp_path, {**MEASURED, "time": "2019-02-10T06:40+01:00"}).sea(1),
        load_sea(tmp_path, MEASURED).sea(1),
    )


@pytest.mark.parametrize(
    ("content", "key", "reason"),
    [
        ({**IRREGULAR["ittc"], "spreading": -1.0}, "sea.spreading", "(got -1.0)"),
        ({**IRREGULAR["ittc"], "speed_m_s": -1.0}, "sea.speed_m_s", "(got -1.0)"),
        ({**IRREGULAR["ittc"], "hs_m": 0.0}, "sea.hs_m", "(got 0.0)"),
        ({**IRREGULAR["ittc"], "gamma": 3.3}, "sea.gamma", "is not a known key"),
        ({**IRREGULAR["pierson_moskowitz"], "tp_s": 9.0}, "sea.tp_s", "is not a known key"),
        ({"kind": "ittc", "hs_m": 1.0}, "sea.tp_s", "is required but missing"),
        ({"kind": "regular", "amplitude_m": 1.0, "period_s": 9.0, "spreading": 5.0},
         "sea.spreading", "is not a known key"),
        ({**MEASURED, "file": "nowhere.txt"}, "sea.file", "nowhere.txt can't be read: No such"),
        ({**MEASURED, "file": str(ROOT / "README.md")}, "sea.file", "README.md, line "),
        ({**MEASURED, "time": "2019-02-10T05:45"}, "sea.time", "the nearest is of"),
        ({**DIRECTED, "direction_file": "nowhere.txt"}, "sea.direction_file",
         "nowhere.txt can't be read: No such"),
        ({**MEASURED, "direction_file": str(DIRECTION)}, "sea.course_deg",
         "is required with direction_file"),
        ({**MEASURED, "course_deg": 20.0}, "sea.course_deg", "needs direction_file"),
        ({**DIRECTED, "heading_deg": 90.0}, "sea.heading_deg", "and direction_file exclude each"),
        ({"kind": "swell"}, "sea.kind", "jonswap, ittc, pierson_moskowitz"),
    ],
)  # fmt: skip
def test_what_is_wrong_is_told_with_its_key(
    tmp_path: Path, content: dict[str, Any], key: str, reason: str
) -> None:
    with pytest.raises(ConfigError) as caught:
        load_sea(tmp_path, content)
    found = {problem.key: problem.reason for problem in caught.value.problems}
    assert list(found) == [key]
    assert reason in found[key]


@pytest.mark.parametrize(("cell", "key"), [("0.00", "sea.time"), ("999", "sea.direction_file")])
def test_an_hour_without_energy_or_direction_is_refused(
    tmp_path: Path, cell: str, key: str
) -> None:
    """Calm in the density file; energy without a direction in the direction file."""
    lines = (DENSITY if key == "sea.time" else DIRECTION).read_text().splitlines()
    changed = tmp_path / "changed.txt"
    row = next(line for line in lines if line.startswith("2019 02 10 05 40"))
    # one direction stays: an hour without any is left out of the record
    values = " ".join([cell] * (len(row.split()) - 6) + ["0.00" if key == "sea.time" else "90"])
    changed.write_text(lines[0] + "\n2019 02 10 05 40 " + values + "\n")
    name = "file" if key == "sea.time" else "direction_file"
    with pytest.raises(ConfigError) as caught:
        load_sea(tmp_path, {**(MEASURED if key == "sea.time" else DIRECTED), name: str(changed)})
    (problem,) = caught.value.problems
    assert problem.key == key
    assert ("no energy" if key == "sea.time" else "no direction at") in problem.reason


def test_the_document_s_sections_are_valid(tmp_path: Path) -> None:
    text = (ROOT / "docs" / "sea.md").read_text(encoding="utf-8")
    examples = re.findall(r"```yaml\n(.*?)```", text, re.S)
    kinds = set()
    (tmp_path / "seas").symlink_to(ROOT / "configs" / "seas")
    (tmp_path / "scenarios").mkdir()
    for example in examples:
        path = tmp_path / "scenarios" / "example.yaml"
        if not example.startswith("sea:"):
            continue  # a part of another section
        path.write_text(example, encoding="utf-8")
        sea = load_config(path, Holder).sea
        assert sea.sea(1).amplitude_m.size
        kinds.add(sea.kind)
    assert {"measured", "jonswap"} <= kinds
    (voyage,) = (yaml.safe_load(each)["voyage"] for each in examples if "voyage:" in each)
    assert [Waypoint.model_validate(point).time_s for point in voyage] == [
        1800, 3600, 3660, 4200, 6600
    ]  # fmt: skip


@pytest.mark.parametrize(
    ("content", "said"),
    [
        (
            {"kind": "jonswap", "hs_m": 2.0, "tp_s": 8.7, "speed_m_s": 5.0},
            "growing (JONSWAP), significant height 2 m, peak period 8.7 s, waves at 90° to the "
            "course (0° following, 90° from port, 180° head), speed 5 m/s",
        ),
        (
            {"kind": "regular", "amplitude_m": 0.5, "period_s": 10.0, "heading_deg": 45.0},
            "one regular wave, amplitude 0.5 m, period 10 s, waves at 45° to the course "
            "(0° following, 90° from port, 180° head)",
        ),
    ],
)
def test_a_report_says_the_sea_in_words(tmp_path: Path, content: dict[str, Any], said: str) -> None:
    assert sea_words(load_sea(tmp_path, content).model_dump(mode="json")) == said


def test_a_report_has_words_for_every_sea() -> None:
    for sea in get_args(get_args(ScenarioSea)[0]):
        (kind,) = get_args(sea.model_fields["kind"].annotation)
        assert "_" not in sea_words({"kind": kind})
