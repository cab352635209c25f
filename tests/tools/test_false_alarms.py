from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.stats import gumbel_r

from tools.evidence.sources import ROOT
from tools.studies import false_alarms
from tools.studies.false_alarms import by_monitor, hours, judged, rate_per_hour, sail


def test_rate_is_the_tail_of_what_the_hours_were_drawn_from() -> None:
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
    assert rate_per_hour([float("nan")] * 50) == 0.0


def test_every_shipped_law_sails_every_sea() -> None:
    for file in (ROOT / "configs/controllers").glob("*.yaml"):
        seas = dict(hours(file.stem))
        assert list(seas)[:3] == ["calm", "ordinary", "storm"]
        assert all(list(each.controllers) == [file.stem] for each in seas.values())
        slopes = [seas[sea].sea.effective_slope.coefficient for sea in list(seas)[:3]]
        assert slopes == sorted(slopes)


def test_hours_that_were_sailed_are_kept_and_retuning_is_ordered_in_every_second(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    ordered = []

    def margins(scenario: Any, name: str, seed: int, seconds: float) -> dict[str, Any]:
        ordered.append((seed, any(act.action.name == "RETUNE" for act in scenario.operator)))
        return {"largest": {"drift": 0.1 * seed}, "found_s": {"DRIFT": 3.0} if seed == 2 else {}}

    monkeypatch.setattr(false_alarms, "CACHE", tmp_path)
    monkeypatch.setattr(false_alarms, "margins", margins)
    sea, scenario = next(iter(hours("adaptive_gpc")))
    assert len(sail("adaptive_gpc", sea, scenario, 2)) == 2
    runs = sail("adaptive_gpc", sea, scenario, 6)
    assert ordered == [(seed, seed % 2 == 0) for seed in range(1, 7)]
    assert [run["largest"]["drift"] for run in runs] == pytest.approx(0.1 * np.arange(1, 7))
    row = judged("adaptive_gpc", sea, runs)
    assert (row["hours"], row["worst"], row["found_in_hours"]) == (6, "drift", {"DRIFT": 1})


def test_monitors_are_judged_over_all_hours_of_the_sound_laws() -> None:
    rows = [
        {"law": "gpc", "maxima": {"drift": [0.2, 0.4]}},
        {"law": "dpc", "maxima": {"drift": [0.6], "noise": [0.1]}},
        {"law": "pd", "maxima": {"drift": [5.0]}},
    ]
    found = by_monitor(rows)
    assert {name: (each["hours"], each["largest"]) for name, each in found.items()} == {
        "drift": (3, 0.6),
        "noise": (1, 0.1),
    }
