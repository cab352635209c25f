"""The sea of a law: a spectrum by its kind is the same sea as the bands written out."""

import os
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

from firmware_sim.scenario_sea import ScenarioSea
from utank_hil.configuration import ConfigError, ControllerConfig, Section, load_config
from utank_hil.control.constrained.design import ConstrainedDesign

CONFIGS = Path(__file__).resolve().parents[2] / "configs"
DENSITY = CONFIGS / "seas" / "ndbc_41010_2019-02_spectral_density.txt"
MEASURED = {"kind": "measured", "file": str(DENSITY), "time": "2019-02-10T05:40"}
KINDS: dict[str, dict[str, Any]] = {
    "measured": MEASURED,
    "jonswap": {"kind": "jonswap", "hs_m": 3.0, "tp_s": 9.0, "gamma": 2.0},
    "ittc": {"kind": "ittc", "hs_m": 3.0, "tp_s": 9.0},
    "pierson_moskowitz": {"kind": "pierson_moskowitz", "hs_m": 3.0},
}


def tabulated(folder, text):
    (folder / "sea.csv").write_text(text)
    return {"kind": "tabulated", "file": "./sea.csv"}


def test_a_sea_is_read_from_a_table_of_frequency_and_density(tmp_path):
    sea = tabulated(tmp_path, "frequency_hz;density_m2_hz\n0.08;1.5\n0.10;4\n0.12;2\n")
    assert loaded(tmp_path, sea).spectrum.density.tolist() == [1.5, 4, 2]
    (tmp_path / "scenario.yaml").write_text(yaml.safe_dump({"sea": sea}))
    scenario_sea = load_config(tmp_path / "scenario.yaml", Holder).sea
    assert scenario_sea.sea(1).amplitude_m.size == 512


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("f,s\n0.1,1\n", "needs the columns frequency_hz and density_m2_hz, has f, s"),
        ("frequency_hz,density_m2_hz\n0.2,1\n0.1,1\n", "increasing, got 0.1 after 0.2: sort"),
        ("frequency_hz,density_m2_hz\n0.1,-1\n0.2,1\n", "zero or more, got -1 at 0.1 Hz"),
        ("frequency_hz,density_m2_hz\n0.6,0.2\n0.7,0.4\n", "0.4 at 0.7 Hz .* in rad/s are divided"),
        ("frequency_hz,density_m2_hz\n0.1,9e3\n0.2,9e3\n", "holds a sea of"),
        ("frequency_hz,density_m2_hz\n0.1,0\n0.2,0\n", "holds a sea of 0 m"),
        ("frequency_hz,density_m2_hz\n0.1,\n0.2,1\n", "density must be finite and zero"),
    ],
)
def test_a_table_that_holds_no_sea_is_refused(tmp_path, text, said):
    (tmp_path / "scenario.yaml").write_text(yaml.safe_dump({"sea": tabulated(tmp_path, text)}))
    with pytest.raises(ConfigError, match=said):
        load_config(tmp_path / "scenario.yaml", Holder)


def test_rows_that_are_left_out_are_a_warning_and_a_new_file_is_read_anew(tmp_path):
    file = tmp_path / "sea.txt"
    head = "#YY  MM DD hh mm .05 .10\n2020 01 01 01 00 1 2\n"
    file.write_text(head + "2020 01 01 02 00 1\n")
    sea = {"kind": "measured", "file": "./sea.txt", "time": "2020-01-01T01:00"}
    (tmp_path / "scenario.yaml").write_text(yaml.safe_dump({"sea": sea}))
    ((key, why),) = load_config(tmp_path / "scenario.yaml", Holder).sea.warnings()
    assert key == "file"
    assert "line 3: 1 values for 2 frequencies" in why
    file.write_text(head)
    os.utime(file, ns=(1, 1))
    assert not load_config(tmp_path / "scenario.yaml", Holder).sea.warnings()


class Holder(Section):
    sea: ScenarioSea


def loaded(folder, sea):
    """The sea of a constrained law that names it so."""
    path = CONFIGS / "controllers" / "constrained_gpc.yaml"
    content = yaml.safe_load(path.read_text())
    content["vessel"] = str(CONFIGS / "ships" / "thesis_first.yaml")
    content["law"]["sea"] = sea
    own = folder / "controller.yaml"
    own.write_text(yaml.safe_dump(content))
    law = load_config(own, ControllerConfig).law
    assert isinstance(law, ConstrainedDesign)
    return law.sea


@pytest.mark.parametrize("kind", KINDS)
def test_a_law_s_sea_is_the_scenario_s_of_the_same_keys(tmp_path, kind):
    model = loaded(tmp_path, {**KINDS[kind], "effective_slope": 0.7, "order": 6})
    path = tmp_path / "scenario.yaml"
    path.write_text(yaml.safe_dump({"sea": KINDS[kind]}))
    sea = load_config(path, Holder).sea
    assert sea.kind != "regular"
    expected = sea.spectrum()
    np.testing.assert_array_equal(model.spectrum.frequency_hz, expected.frequency_hz)
    np.testing.assert_array_equal(model.spectrum.density, expected.density)
    assert (model.effective_slope, model.order, model.floor) == (0.7, 6, 1.3e-3)


def test_the_hour_by_file_and_time_is_the_hour_that_the_shipped_law_writes_out(tmp_path):
    shipped = load_config(CONFIGS / "controllers" / "constrained_gpc.yaml", ControllerConfig).law
    assert isinstance(shipped, ConstrainedDesign)
    assert loaded(tmp_path, MEASURED) == shipped.sea


TIMELESS = {key: value for key, value in MEASURED.items() if key != "time"}


@pytest.mark.parametrize(
    ("sea", "key", "reason"),
    [
        ({"kind": "swell"}, "law.sea.kind", "jonswap, ittc, pierson_moskowitz"),
        ({"kind": "regular", "amplitude_m": 1.0, "period_s": 9.0}, "law.sea.kind", "measured"),
        ({"kind": "jonswap", "hs_m": 0.0, "tp_s": 9.0}, "law.sea.hs_m", "must be above 0 and"),
        ({"kind": "ittc", "hs_m": 1.0}, "law.sea.tp_s", "is required but missing"),
        ({**KINDS["ittc"], "heading_deg": 90.0}, "law.sea.heading_deg", "is not a known key"),
        ({**KINDS["ittc"], "order": 0}, "law.sea.order", "must be 1 to"),
        ({**KINDS["ittc"], "frequency_hz": [0.1, 0.2]}, "law.sea.frequency_hz", "exclude each"),
        ({**MEASURED, "file": "nowhere.txt"}, "law.sea.file", "nowhere.txt can't be read"),
        ({**MEASURED, "time": "2019-02-10T05:45"}, "law.sea.time", "the nearest is of"),
        (TIMELESS, "law.sea.time", "is required but missing: the file has 2019-02-06T00:40:00 to"),
    ],
)
def test_what_is_wrong_is_told_with_its_key(tmp_path, sea, key, reason):
    with pytest.raises(ConfigError) as caught:
        loaded(tmp_path, sea)
    found = {problem.key: problem.reason for problem in caught.value.problems}
    assert list(found) == [key]
    assert reason in found[key]
