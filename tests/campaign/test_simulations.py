"""The kinds of simulation: what they share, and what a case says that can't be computed."""

import json
import math
from dataclasses import replace

import pytest
from studies import CONFIGS, small

from firmware_sim.campaign.driver import batch_of
from firmware_sim.campaign.simulations import OtherCodeError, rows_of, run_batch
from firmware_sim.campaign.study import changed
from firmware_sim.scenario import Scenario
from utank_hil.assembly import build_law

pytestmark = pytest.mark.slow

CALM_SEA = {"sea": {"kind": "jonswap", "hs_m": 0.5, "tp_s": 11.0}}


def computed(folder, simulation, **values):
    """Rows of a case by run."""
    found = small(folder, set=values)
    content = changed(found.study.scenario, found.cases[0].values)
    scenario = Scenario.model_validate(content)
    laws = {name: build_law(each) for name, each in scenario.controllers.items()}
    return {str(row["run"]): row for row in rows_of(simulation, scenario, 3, laws)}


def test_nonlinear_simulation_is_near_the_bus_and_has_the_same_bare_ship(tmp_path):
    # on the bus the law has a quarter of its pressure until the water was seen to obey it
    long = {"duration_s": 100.0, "settle_s": 50.0}
    bus, fast = (computed(tmp_path, simulation, **long) for simulation in ("bus", "nonlinear"))
    assert list(bus) == list(fast)
    assert bus["no tank"] == pytest.approx(fast["no tank"], nan_ok=True)
    for run, within in (("passive", 1e-3), ("gpc", 0.05)):
        assert bus[run]["roll_rms_rad"] == pytest.approx(fast[run]["roll_rms_rad"], rel=within)
    assert bus["gpc"]["power_mean_w"] == pytest.approx(fast["gpc"]["power_mean_w"], rel=0.1)


def test_linear_simulation_and_bus_agree_where_motions_are_small(tmp_path):
    # two programs: closed form and sampled model here, Runge-Kutta steps of the plant there; on the
    # bus the law has a quarter of its pressure until the water was seen to obey it
    long = {"duration_s": 150.0, "settle_s": 60.0, "sensors.roll_noise_rad": 0.0}
    quiet = {f"sensors.{name}": 0.0 for name in ("roll_rate_noise_rad_s", "level_noise_m",
                                                 "pressure_noise_pa")}  # fmt: skip
    linear, bus = (
        computed(tmp_path, simulation, **CALM_SEA, **long, **quiet)
        for simulation in ("linear", "bus")
    )
    assert list(linear) == list(bus) == ["no tank", "passive", "gpc"]
    for run, within in (("no tank", 2e-4), ("passive", 5e-4), ("gpc", 0.05)):
        assert linear[run]["roll_rms_rad"] == pytest.approx(bus[run]["roll_rms_rad"], rel=within)
    assert linear["gpc"]["roll_below_passive"] > 0.1
    assert linear["passive"]["level_peak_m"] == pytest.approx(
        bus["passive"]["level_peak_m"], rel=2e-3
    )


def test_shares_are_of_the_rolls_and_a_ship_that_capsized_counts_for_none(tmp_path):
    values = {"duration_s": 60.0, "settle_s": 5.0}
    rows = computed(tmp_path, "linear", **values)
    shares = {run: 1 - row["roll_rms_rad"] / rows["passive"]["roll_rms_rad"]
              for run, row in rows.items()}  # fmt: skip
    assert rows["gpc"]["roll_below_passive"] == pytest.approx(shares["gpc"], abs=1e-12)
    # Patti-B in waves far beyond her threshold
    scenario = str(CONFIGS / "scenarios" / "patti_b.yaml")
    found = small(tmp_path, scenario=scenario, simulation="bus", set={
        "controllers": {"gpc": str(CONFIGS / "controllers" / "patti_b_constrained_gpc.yaml")},
        "sea": {"kind": "regular", "amplitude_m": 5.0, "period_s": 10.5}, "duration_s": 120.0,
    })  # fmt: skip
    rows = {row["run"]: row for row in run_batch(batch_of(found, found.cases))}
    assert rows["no tank"]["mark"] == "capsized"
    assert math.isnan(rows["gpc"]["roll_below_no_tank"])


@pytest.mark.parametrize(
    ("simulation", "values", "reason"),
    [
        ("linear", {"voyage": [{"time_s": 10.0, "speed_m_s": 2.0}]}, "take nonlinear or bus"),
        ("linear", {"actual_ship.wind_moment_nm": 1e6}, "knows no steady heel"),
        ("linear", {"actual_ship.inertia_kg_m2": 2e9, "actual_from_s": 5.0}, "keeps ship"),
        (
            "linear",
            {"faults": [{"kind": "hangs", "node": "sensors"}]},
            "faults befall bus and nodes",
        ),
        ("linear", {"controllers.gpc.law.sample_time_s": 0.2}, "is not a known key"),
        ("linear", {"controllers.gpc.law.order": 2e9}, "order"),
        ("linear", {"sea.heading_deg": 0.0}, "gives no roll moment"),
    ],
)
def test_case_that_can_not_be_computed_says_why(tmp_path, simulation, values, reason):
    found = small(tmp_path, simulation=simulation)
    batch = batch_of(found, found.cases)
    ((name, seed, written),) = batch.cases
    both = json.dumps(json.loads(written) | values)
    wrong, right = run_batch(
        replace(batch, cases=((name, seed, both),))
    ), run_batch(batch)  # fmt: skip
    assert [row["status"] for row in wrong] == ["failed"]
    assert reason in wrong[0]["reason"]
    assert {row["status"] for row in right} == {"ok"}


def test_vessel_with_a_valve_needs_the_bus(tmp_path):
    scenario = str(CONFIGS / "scenarios" / "semi_active.yaml")
    controllers = {"valve": str(CONFIGS / "controllers" / "valve_on_off.yaml")}
    found = small(tmp_path, scenario=scenario, set={"controllers": controllers})
    (row,) = run_batch(batch_of(found, found.cases))
    assert "take that" in row["reason"]


def test_worker_of_other_code_ends_the_campaign(tmp_path, monkeypatch):
    found = small(tmp_path)
    batch = batch_of(found, found.cases)
    monkeypatch.setattr("firmware_sim.campaign.simulations.code_digest", lambda: "older")
    with pytest.raises(OtherCodeError, match="the code has changed"):
        run_batch(batch)
