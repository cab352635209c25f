from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import gumbel_r

from tools.evidence import ROOT
from tools.studies import false_alarms
from tools.studies.false_alarms import by_monitor, hours, judged, rate_per_hour, sail
from tools.studies.monitor_margins import margins


def test_rate_is_the_tail_of_what_the_hours_were_drawn_from():
    draw = np.random.default_rng(1)
    for place, scale in ((0.5, 0.08), (0.8, 0.05)):
        expected = gumbel_r.sf(1.0, place, scale)
        rates = [
            rate_per_hour(gumbel_r.rvs(place, scale, size=50, random_state=draw).tolist())
            for _ in range(200)
        ]
        assert np.median(rates) == pytest.approx(expected, rel=0.25)
    assert rate_per_hour([0.3] * 50) == 0.0
    assert rate_per_hour([]) == 0.0
    assert rate_per_hour([None] * 50) == 0.0
    assert rate_per_hour([float("nan")] * 50) == 0.0


def test_an_hour_that_another_monitor_ended_is_not_in_the_fit():
    draw = np.random.default_rng(2)
    whole = gumbel_r.rvs(0.6, 0.05, size=50, random_state=draw).tolist()
    runs = [{"largest": {"drift": each}, "found_s": {}} for each in whole]
    expected = judged("gpc", "storm", runs)["rate_per_hour"]["drift"]
    for finding, monitor, counts in (
        ("LEVEL_LIMIT", "drift", False),
        ("ROLL_AMPLIFIED", "drift", False),
        ("ROLL_AMPLIFIED", "roll over twin", True),
        ("LEVEL_LIMIT", "roll over twin", False),
        ("SATURATED", "drift", True),
    ):
        all_of_it = [run | {"largest": {monitor: run["largest"]["drift"]}} for run in runs]
        cut = {"largest": {monitor: 0.05}, "found_s": {finding: 3.0}}
        row = judged("gpc", "storm", [*all_of_it, *[cut] * 9])
        assert (row["rate_per_hour"][monitor] != pytest.approx(expected)) == counts
        assert row["maxima"][monitor][-1] == 0.05


@pytest.mark.evidence
def test_every_shipped_law_sails_every_sea():
    for file in (ROOT / "configs/controllers").glob("*.yaml"):
        seas = dict(hours(file.stem))
        assert list(seas)[:3] == ["calm", "ordinary", "storm"]
        assert all(list(each.controllers) == [file.stem] for each in seas.values())
        slopes = [seas[sea].sea.effective_slope.coefficient for sea in list(seas)[:3]]
        assert slopes == sorted(slopes)


def test_hours_that_were_sailed_are_kept_and_retuning_is_ordered_in_every_second(
    tmp_path, monkeypatch
):
    ordered = []

    def margins(scenario, name, seed, seconds):
        ordered.append((seed, any(act.action.name == "RETUNE" for act in scenario.operator)))
        return {"largest": {"drift": 0.1 * seed}, "found_s": {"DRIFT": 3.0} if seed == 2 else {}}

    monkeypatch.setattr(false_alarms, "CACHE", tmp_path)
    monkeypatch.setattr(false_alarms, "commit", lambda: "abc")
    monkeypatch.setattr(false_alarms, "margins", margins)
    sea, scenario = next(iter(hours("adaptive_gpc")))
    assert len(sail("adaptive_gpc", sea, scenario, 2)) == 2
    runs = sail("adaptive_gpc", sea, scenario, 6)
    assert ordered == [(seed, seed % 2 == 0) for seed in range(1, 7)]
    assert [run["largest"]["drift"] for run in runs] == pytest.approx(0.1 * np.arange(1, 7))
    row = judged("adaptive_gpc", sea, runs)
    assert (row["hours"], row["worst"], row["found_in_hours"]) == (6, "drift", {"DRIFT": [2]})
    assert row["maxima"]["drift"] == pytest.approx(0.1 * np.arange(1, 7))
    monkeypatch.setattr(false_alarms, "commit", lambda: "abc+")  # another change each time
    ordered.clear()
    for _ in range(2):
        assert len(sail("adaptive_gpc", sea, scenario, 1)) == 1
    assert len(ordered) == 2


@pytest.mark.evidence
def test_what_ends_control_is_found_though_no_monitor_finds_it():
    scenario = dict(hours("gpc"))["storm"]
    low = replace(scenario.sensors, high_level_m=0.5)
    found_s = margins(scenario.model_copy(update={"sensors": low}), "gpc", 1, 60.0)["found_s"]
    assert list(found_s) == ["LEVEL_LIMIT"]
    assert 5.0 < found_s["LEVEL_LIMIT"] < 60.0
    assert margins(scenario, "gpc", 1, 60.0)["found_s"] == {}


def test_monitors_are_judged_over_all_hours_of_the_sound_laws():
    rows = [
        {
            "law": law,
            "sea": sea,
            "hours": len(maxima["drift"]),
            "maxima": maxima,
            "rate_per_hour": rates,
        }
        for law, sea, maxima, rates in (
            ("self_tuned", "storm", {"drift": [0.2, 0.4]}, {"drift": 0.1}),
            ("dpc", "voyage", {"drift": [0.6], "noise": [None, 0.1]}, {"drift": 0.3, "noise": 0.0}),
            ("pd", "calm", {"drift": [5.0]}, {"drift": 1.0}),
            ("self_tuned", "voyage", {"drift": [6.0]}, {"drift": 1.0}),
        )
    ]
    assert by_monitor(rows) == {
        "drift": {"hours": 3, "largest": 0.6, "rate_per_hour": pytest.approx(0.2)},
        "noise": {"hours": 1, "largest": 0.1, "rate_per_hour": 0.0},
    }
