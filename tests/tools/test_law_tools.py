"""The tools behind the numbers of the control documents: they run, and say what they should."""

import pytest

from tools.studies.share_of_possible import CLAIRVOYANT, NO_TANK, PASSIVE, run_seed, shipped

pytestmark = pytest.mark.slow


def test_no_law_is_better_than_the_bound_and_the_passive_tank_better_than_none():
    found = run_seed(shipped("constrained_gpc").plant, {}, 60.0, 3)
    rolls = [found[name].roll_rms_rad for name in (CLAIRVOYANT, PASSIVE, NO_TANK)]
    assert rolls == sorted(rolls)
    assert found[PASSIVE].pressure_rms_pa == 0


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


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("studies.share_of_possible", "--seeds", "1"), "--seeds must be 2 or more"),
        (("studies.share_of_possible", "--seconds", "nan"), "--seconds must be 60 or more"),
        (("studies.renewed_seas", "--only", "calm"), "no sea's name; there are"),
    ],
)
def test_wrong_arguments_are_refused_with_the_remedy(tool, arguments, message):
    done = tool(*arguments)
    assert done.code == 2
    assert message in done.errors
