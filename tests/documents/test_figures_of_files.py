"""Figures that documents give for shipped files and laws are those of the files and laws."""

import re
from dataclasses import replace
from pathlib import Path

import pytest

from tools.studies.share_of_possible import STORM_HOUR, expecting, measured_hour, shipped
from utank_hil.analysis.loop.margins import robustness
from utank_hil.configuration import Vessel, load_config
from utank_hil.control import ConstrainedDesign
from utank_hil.sea import jonswap

ROOT = Path(__file__).resolve().parents[2]
PAGE = (ROOT / "docs" / "control.md").read_text()


def test_pump_of_the_fishing_boat_is_that_of_her_file():
    text = " ".join((ROOT / "docs" / "dynamics.md").read_text().split())
    pattern = r"is the similar one of ([\d.]+) m² for (\d+) kPa: (\d+) rad/s and ([\d.]+) kW"
    found = re.search(pattern, text)
    assert found is not None
    pump = load_config(ROOT / "configs" / "ships" / "patti_b.yaml", Vessel).pump
    values = (pump.duct_area_m2, pump.max_pressure_pa / 1e3, pump.max_speed_rad_s,
              pump.max_power_w / 1e3)  # fmt: skip
    for written, value in zip(found.groups(), values, strict=True):
        assert float(written) == pytest.approx(value, rel=5e-3)


@pytest.mark.slow
def test_height_and_period_alone_pass_with_the_weight_that_the_page_names():
    weight = float(re.search(r"`pressure_weight_rad2: ([\d.e-]+)`: with", PAGE)[1])
    hour = measured_hour(STORM_HOUR)
    config = expecting(shipped("constrained_gpc"), jonswap(hour.hs_m, hour.tp_s))
    assert isinstance(config.law, ConstrainedDesign)
    for scale, passes in ((1.0, True), (0.5, False)):
        law = replace(config.law, pressure_weight_rad2=scale * weight)
        report = robustness(
            law.law(config.plant), config.plant, law.measured, with_delay_margin=False
        )
        assert (not report.failures()) == passes
