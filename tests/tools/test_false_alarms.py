from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest
from scipy.stats import gumbel_r

from tools.evidence.sources import ROOT
from tools.studies import false_alarms, monitor_margins
from tools.studies.false_alarms import by_monitor, hours, judged, rate_per_hour, sail
from tools.studies.monitor_margins import Onlooker


def test_rate_is_the_tail_of_what_the_hours_were_drawn_from() -> None:
    draw = np.random.default_rng(1)
    for place, scale in ((0.5, 0.08), (0.8, 0.05)):
        expected = 6 * gumbel_r.sf(1.0, place, scale)  # blocks of ten minutes
        rates = [
            rate_per_hour(gumbel_r.rvs(place, scale, size=50, random_state=draw).tolist())
            for _ in range(200)
        ]
        assert np.median(rates) == pytest.approx(expected, rel=0.25)
    assert rate_per_hour([0.3] * 50) == 0.0
    assert rate_per_hour([]) == 0.0
    assert rate_per_hour([0.3, 0.3, 1.1]) == pytest.approx(2.0)  # too few for a distribution


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

    def margins(
        scenario: Any, name: str, seed: int, seconds: float, block_s: float
    ) -> dict[str, Any]:
        assert (seconds, block_s) == (3600.0, 600.0)
        ordered.append((seed, any(act.action.name == "RETUNE" for act in scenario.operator)))
        blocks = [{"drift": 0.1 * seed}, {}]
        return {"blocks": blocks, "found_s": {"DRIFT": 3.0} if seed == 2 else {}}

    monkeypatch.setattr(false_alarms, "CACHE", tmp_path)
    monkeypatch.setattr(false_alarms, "margins", margins)
    sea, scenario = next(iter(hours("adaptive_gpc")))
    assert len(sail("adaptive_gpc", sea, scenario, 2)) == 2
    runs = sail("adaptive_gpc", sea, scenario, 6)
    assert ordered == [(seed, seed % 2 == 0) for seed in range(1, 7)]
    row = judged("adaptive_gpc", sea, runs)
    assert row["maxima"]["drift"] == pytest.approx(0.1 * np.arange(1, 7))
    assert (row["hours"], row["worst"], row["found_in_hours"]) == (6, "drift", {"DRIFT": 1})


def test_monitors_are_judged_over_all_laws_that_are_sound() -> None:
    rows = [
        {"law": law, "sea": "calm", "maxima": {"drift": maxima}, "rate_per_hour": {"drift": rate}}
        for law, maxima, rate in (("gpc", [0.2, 0.4], 0.1), ("dpc", [0.6], 0.3), ("pd", [5.0], 6.0))
    ]
    assert by_monitor(rows) == {
        "drift": {
            "hours": pytest.approx(0.5),
            "largest": 0.6,
            "rate_per_hour": pytest.approx(0.2),
            "worst": "dpc, calm",
            "worst_rate_per_hour": 0.3,
        }
    }


def test_the_largest_is_kept_block_by_block_and_nothing_where_nothing_is_known(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    said = iter([{"drift": 0.2}, {"drift": 0.4}, {"drift": float("nan")}, {"drift": 0.1}])
    monkeypatch.setattr(monitor_margins, "shares", lambda _: next(said))
    onlooker = Onlooker(cast(Any, SimpleNamespace(monitors=SimpleNamespace(found=0))), block_s=2.0)
    for second in (0, 1, 2, 5):
        onlooker.tick(second * 10**9)
    assert onlooker.blocks == [{"drift": 0.4}, {}, {"drift": 0.1}]
