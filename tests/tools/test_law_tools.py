"""The tools behind the numbers of the control documents: they run, and say what they should."""

import dataclasses
import math

import numpy as np
import pytest

from tools.studies import many_seas
from tools.studies.sea_trial import TrialShip

pytestmark = pytest.mark.slow


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


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("studies.share_of_possible", "--seeds", "1"), "--seeds must be 2 or more"),
        (("studies.many_seas", "--seconds", "nan"), "--seconds must be 60 or more"),
    ],
)
def test_wrong_arguments_are_refused_with_the_remedy(tool, arguments, message):
    done = tool(*arguments)
    assert done.code == 2
    assert message in done.errors
