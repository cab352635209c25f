"""The tools behind the numbers of the control documents: they run, and say what they should."""

import dataclasses
import json
import math
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from tools.studies import many_seas, model_errors
from tools.studies.sea_trial import TrialShip

pytestmark = [pytest.mark.slow, pytest.mark.usefixtures("short_search")]


def test_campaign_compares_seed_by_seed_and_draws(tool, tmp_path: Path):
    arguments = ("--seeds", "2", "--seconds", "60", "--out", str(tmp_path), "--json")
    found = tool("studies.constrained_campaign", *arguments, "--only", ":40").found
    assert len(found["cases"]) == 3  # measured hours, with the shipped pump
    assert (tmp_path / "campaign.png").stat().st_size > 10_000
    for case in found["cases"]:
        rolls = {name: [one["roll_rms_rad"] for one in runs] for name, runs in case["runs"].items()}
        shares = [
            1 - mine / theirs
            for mine, theirs in zip(rolls["constrained"], rolls["clipped"], strict=True)
        ]
        assert case["below"]["clipped"]["mean"] == pytest.approx(sum(shares) / 2, abs=1e-12)
    # where no limit is near, the plan is the clipped law itself
    swell = found["cases"][0]
    assert swell["runs"]["clipped"][0]["held_back"] == 0
    assert swell["below"]["clipped"]["mean"] == pytest.approx(0, abs=1e-6)


@pytest.mark.evidence
def test_share_of_the_possible_is_one_at_the_bound_and_zero_with_the_tank_passive(tool):
    found = tool("studies.share_of_possible", "--seeds", "2", "--seconds", "90", "--json").found
    rows = found["rows"]
    passive, best = rows["passive"]["roll_rms_deg"], rows["clairvoyant"]["roll_rms_deg"]
    for name, row in rows.items():
        if "share" in row:
            assert row["roll_rms_deg"] > best, name
    assert best < passive
    assert rows["clairvoyant"]["level_peak_m"] <= 4.0 + 1e-6
    assert best < rows["causal bound"]["roll_rms_deg"] < passive
    assert rows["causal bound"]["share"] < 1


@pytest.mark.evidence
def test_a_law_that_knows_the_sea_leaves_less_roll_than_one_tuned_in_a_storm(tool, monkeypatch):
    # bounds of two records of five minutes, in this process
    monkeypatch.setattr(many_seas, "CAUSAL_RECORDS", 2)
    monkeypatch.setattr(many_seas, "CAUSAL_RECORD_S", 300.0)
    monkeypatch.setattr(
        many_seas, "causal_shares", lambda wanted: list(map(many_seas.causal_share, wanted))
    )
    arguments = ("--seeds", "2", "--seconds", "120", "--only", "17 s", "--json")
    found = tool("studies.many_seas", *arguments).found["seas"]
    assert len(found) == 2
    for row in found.values():
        assert row["constrained"]["mean"] < row["self-tuned"]["mean"] < row["causal bound"]["mean"]
    assert "mean of the first sixteen" not in found


def test_a_self_tuned_law_is_told_the_waves_as_they_meet_the_ship():
    storm = many_seas.measured_hour(many_seas.STORM_HOUR)
    still = TrialShip(many_seas.shipped("gpc").plant)
    omega = np.linspace(0.05, 8.0, 4000)

    def slope(**course: float) -> np.ndarray:
        return (
            many_seas.Case(storm, dataclasses.replace(still, **course)).model().slope_density(omega)
        )

    def mean(density: np.ndarray) -> float:
        return float(omega @ density / density.sum())

    beam, bow = slope(), slope(heading_rad=math.radians(135.0), speed_m_s=6.0)
    # abeam the speed changes nothing, and the bow meets the waves sooner, their slope less abeam
    assert slope(speed_m_s=6.0).sum() == pytest.approx(beam.sum(), rel=0.02)
    assert bow.sum() == pytest.approx(beam.sum() / 2, rel=0.05)
    assert mean(bow) > 1.2 * mean(beam)


def test_model_errors_change_what_the_laws_take_away(tool, monkeypatch):
    names = ("none", "pump gain 0.8", "roll period x 0.7")
    some = [error for error in model_errors.ERRORS if error.name in names]
    monkeypatch.setattr(model_errors, "ERRORS", some)
    found = tool("studies.model_errors", "--seeds", "2", "--seconds", "60", "--json").found
    nominal, weak = (found[name]["below_passive"] for name in ("none", "pump gain 0.8"))
    assert nominal["GPC"]["mean"] != weak["GPC"]["mean"]
    assert "GPC, designed for her" in found["roll period x 0.7"]["below_passive"]


def test_forecasts_grow_worse_with_time_and_the_spectrum_s_factor_is_the_best(tool):
    found = tool("studies.forecast_errors", "--seeds", "2", "--seconds", "900", "--json").found
    errors = {
        name: [sum(column) / 2 for column in zip(*model["error_shares"], strict=True)]
        for name, model in found["models"].items()
    }
    factor = next(values for name, values in errors.items() if name.startswith("factor"))
    assert factor == sorted(factor)
    assert all(one <= min(others) for one, *others in zip(factor, *errors.values(), strict=True))


def test_tables_of_the_linear_laws_hold_the_printed_ratios(tool):
    found = tool("studies.linear_law_tables", "index", "--json").found["index"]
    assert found["printed"]["GPC (roll)"] == pytest.approx(578 / 499)
    assert found["printed laws, 25.2 m²"]["GPC (roll)"] == pytest.approx(578 / 499, rel=0.01)


def test_undelayed_linearization_without_brake_or_shift_hardly_grows(tool):
    found = tool("studies.nonlinear_law_tables", "growth", "--json").found["growth"]
    assert 0 < found["first ship, kL = 0"]["ideal, 10 ms: 1/s"] < 0.01
    assert all(
        value < 0
        for name, value in found["first ship, level braked, zeta_h 0.4"].items()
        if name.endswith("1/s")
    )


@pytest.mark.evidence
def test_benchmark_times_every_kind_of_controller():
    # in a process of its own, whose scheduling it changes
    command = [sys.executable, "-m", "tools.benchmarks.controllers", "--steps", "100", "--json"]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    found = json.loads(done.stdout)
    assert {"gpc", "constrained_gpc", "fuzzy_indirect", "clipped valve"} <= set(found)
    for cost in found.values():
        assert 0 < cost["p50_us"] <= cost["p99_us"] <= cost["max_us"] < math.inf
    assert found["constrained_gpc"]["held_bytes"] > found["passive (floor)"]["held_bytes"]


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("studies.share_of_possible", "--seeds", "1"), "--seeds must be 2 or more"),
        (("studies.constrained_campaign", "--horizon-s", "2"), "--horizon-s must be 12 or more"),
        (("studies.model_errors", "--seconds", "nan"), "--seconds must be 60 or more"),
    ],
)
def test_wrong_arguments_are_refused_with_the_remedy(tool, arguments, message):
    done = tool(*arguments)
    assert done.code == 2
    assert message in done.errors
