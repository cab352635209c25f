"""The sea of a law: a spectrum by its kind is the same sea as the bands written out."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

from firmware_sim.scenario_sea import ScenarioSea
from utank_hil.configuration import ConfigError, ControllerConfig, Section, load_config
from utank_hil.control.constrained.design import ConstrainedDesign
from utank_hil.control.sea_model import SeaModel

CONFIGS = Path(__file__).resolve().parents[2] / "configs"
DENSITY = CONFIGS / "seas" / "ndbc_41010_2019-02_spectral_density.txt"
MEASURED = {"kind": "measured", "file": str(DENSITY), "time": "2019-02-10T05:40"}
KINDS: dict[str, dict[str, Any]] = {
    "measured": MEASURED,
    "jonswap": {"kind": "jonswap", "hs_m": 3.0, "tp_s": 9.0, "gamma": 2.0},
    "ittc": {"kind": "ittc", "hs_m": 3.0, "tp_s": 9.0},
    "pierson_moskowitz": {"kind": "pierson_moskowitz", "hs_m": 3.0},
}


class Holder(Section):
    sea: ScenarioSea


def loaded(folder: Path, sea: dict[str, Any]) -> SeaModel:
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
def test_a_law_s_sea_is_the_scenario_s_of_the_same_keys(tmp_path: Path, kind: str) -> None:
    model = loaded(tmp_path, {**KINDS[kind], "effective_slope": 0.7, "order": 6})
    path = tmp_path / "scenario.yaml"
    path.write_text(yaml.safe_dump({"sea": KINDS[kind]}))
    sea = load_config(path, Holder).sea
    assert sea.kind != "regular"
    expected = sea.spectrum()
    np.testing.assert_array_equal(model.spectrum.frequency_hz, expected.frequency_hz)
    np.testing.assert_array_equal(model.spectrum.density, expected.density)
    assert (model.effective_slope, model.order, model.floor) == (0.7, 6, 1.3e-3)


def test_the_hour_by_file_and_time_is_the_hour_that_the_shipped_law_writes_out(
    tmp_path: Path,
) -> None:
    shipped = load_config(CONFIGS / "controllers" / "constrained_gpc.yaml", ControllerConfig).law
    assert isinstance(shipped, ConstrainedDesign)
    assert loaded(tmp_path, MEASURED) == shipped.sea


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
    ],
)
def test_what_is_wrong_is_told_with_its_key(
    tmp_path: Path, sea: dict[str, Any], key: str, reason: str
) -> None:
    with pytest.raises(ConfigError) as caught:
        loaded(tmp_path, sea)
    found = {problem.key: problem.reason for problem in caught.value.problems}
    assert list(found) == [key]
    assert reason in found[key]
