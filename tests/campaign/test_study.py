"""Studies: which cases they make, what they are named, and what is said of a wrong one."""

import pytest
from studies import CONFIGS, small, written

from firmware_sim.campaign import study as case_name
from firmware_sim.campaign.axes import Draws
from firmware_sim.campaign.study import changed, load_study
from firmware_sim.scenario import Scenario
from utank_hil.configuration import ConfigError
from utank_hil.sea import load_ndbc

NDBC = CONFIGS / "seas" / "ndbc_41010_2019-02_spectral_density.txt"


@pytest.mark.parametrize("path", sorted((CONFIGS / "studies").glob("*.yaml")), ids=lambda p: p.stem)
def test_shipped_studies_are_valid(path):
    assert load_study(path).cases


def test_every_value_meets_every_other_and_seeds_make_no_group(tmp_path):
    pressures = [20e3, 30e3, 40e3]
    found = small(
        tmp_path,
        cases=[{"sea.heading_deg": 60.0}, {"sea.heading_deg": 90.0, "sea.speed_m_s": 2.0}],
        grid={"seed": {"first": 7, "count": 4}, "controllers.*.limits.pressure_pa": pressures},
    )
    assert len(found.cases) == len({case.name for case in found.cases}) == 2 * 4 * 3
    assert len({case.group for case in found.cases}) == 2 * 3
    assert {case.seed for case in found.cases} == {7, 8, 9, 10}
    # every group has a case of the first seed before any has one of the second
    assert [case.seed for case in found.cases[:6]] == [7] * 6
    assert len({case.waves for case in found.cases}) == 2 * 4


def test_entries_of_cases_may_have_keys_of_their_own(tmp_path):
    found = small(tmp_path, cases=[{}, {"plant": "roll"}, {"sea.speed_m_s": 3.0}])
    assert found.keys == ("plant", "sea.speed_m_s")
    assert [case.group for case in found.cases] == [("", ""), ("roll", ""), ("", 3.0)]


def test_ranges_are_spaced_counted_and_the_hours_of_a_file(tmp_path):
    spaced = small(tmp_path, grid={"sea.heading_deg": {"low": 30, "high": 150, "count": 5}})
    assert [case.parameters["sea.heading_deg"] for case in spaced.cases] == [30, 60, 90, 120, 150]
    hours = {"hours_of": str(NDBC), "since": "2019-02-10T00:00", "until": "2019-02-10T06:00"}
    measured = small(tmp_path, grid={"sea.time": hours})
    assert [case.parameters["sea.time"] for case in measured.cases] == [
        f"2019-02-10T{hour:02d}:40:00" for hour in range(6)
    ]
    everything = small(tmp_path, grid={"sea.time": {"hours_of": str(NDBC)}})
    assert len(everything.cases) == len(load_ndbc(NDBC).time)


def test_file_is_put_in_place_and_named_by_its_stem(tmp_path):
    laws = [str(CONFIGS / "controllers" / f"{name}.yaml") for name in ("gpc", "lqg")]
    found = small(tmp_path, grid={"controllers.gpc": laws})
    assert [case.group for case in found.cases] == [("gpc",), ("lqg",)]
    kinds = [
        Scenario.model_validate(changed(found.study.scenario, case.values)).controllers["gpc"].law
        for case in found.cases
    ]
    assert [law.kind for law in kinds] == ["gpc", "lqg"]


def test_key_of_the_vessel_is_believed_by_the_controllers_and_the_actual_ship_is_not(tmp_path):
    inertia = 2.0e9
    for key, believed in (("vessel.ship", inertia), ("actual_ship", 1.9275e9)):
        found = small(tmp_path, set={f"{key}.inertia_kg_m2": inertia})
        scenario = Scenario.model_validate(changed(found.study.scenario, found.cases[0].values))
        assert scenario.sailing_ship.inertia_kg_m2 == inertia
        assert scenario.controllers["gpc"].vessel.ship.inertia_kg_m2 == believed


@pytest.mark.parametrize(
    ("section", "key", "value", "said"),
    [
        ("grid", "sea.headin_deg", [90.0], "did you mean heading_deg?"),
        ("grid", "vessel.ship.inertia", [2e9], "did you mean inertia_kg_m2?"),
        ("set", "vesel.ship.inertia_kg_m2", 2e9, "did you mean vessel?"),
        ("set", "controllers.gcp.limits.pressure_pa", 2e4, "there are gpc"),
        ("set", "seed.first", 2, "leads into seed, which is a value"),
        ("set", "operator.4.time_s", 2.0, "names item 4 of operator, which has 1"),
        ("set", "voyage.*.speed_m_s", 2.0, "stands for nothing"),
        ("grid", "sea.speed_m_s", [-1.0], "must be 0 to 40 (got -1.0)"),
        ("grid", "sea.hs_m", [3.0], "is not a known key"),
    ],
)
def test_wrong_key_is_told_with_file_place_and_remedy(tmp_path, section, key, value, said):
    path = written(tmp_path, **{section: {key: value}})
    with pytest.raises(ConfigError) as refused:
        load_study(path)
    messages = [str(problem) for problem in refused.value.problems]
    assert any(f"{path}: {section}.{key}: " in each and said in each for each in messages), messages


@pytest.mark.parametrize(
    ("keys", "said"),
    [
        ({"grid": {"settle_s": [5.0]}, "set": {"settle_s": 6.0}}, "is in set, too"),
        ({"grid": {"seed": {"begin": 3}}}, "must be a list of values"),
        ({"average_over": ["sea.time"]}, "names sea.time, which is not varied"),
        ({"random": {"samples": 3}}, "random.keys: is required but missing"),
        ({"grid": {"seed": {"first": 1, "count": 1e7}}}, "grid.seed"),
    ],
)
def test_wrong_study_is_told_at_its_key(tmp_path, keys, said):
    with pytest.raises(ConfigError, match=said):
        small(tmp_path, **keys)


def test_draws_are_the_same_for_the_same_seed_whatever_else_is_drawn(tmp_path):
    table = tmp_path / "climate.csv"
    table.write_text("# a comment\nsea.hs_m,sea.tp_s,weight\n2,8,3\n4,10.5,1\n5,11,0\n")
    heading = {"low": 0.0, "high": 180.0}
    alone = Draws(samples=400, seed=5, keys={"sea.heading_deg": heading}).samples_drawn()
    both = Draws(
        samples=400, seed=5, table=table,
        keys={"seed": {"first": 3}, "sea.heading_deg": heading},
    ).samples_drawn()  # fmt: skip
    assert [each["sea.heading_deg"] for each in alone] == [each["sea.heading_deg"] for each in both]
    assert [each["seed"] for each in both] == list(range(3, 403))
    drawn = [(each["sea.hs_m"], each["sea.tp_s"]) for each in both]
    assert set(drawn) == {(2, 8), (4, 10.5)}
    assert drawn.count((2, 8)) == pytest.approx(300, abs=35)  # 4 standard deviations
    assert 0 <= min(each["sea.heading_deg"] for each in both) < 5


def test_name_is_of_configuration_seed_code_and_the_data_behind_a_path(tmp_path, monkeypatch):
    data = tmp_path / "sea.txt"
    data.write_text("calm")
    content = {"sea": {"file": str(data)}, "seed": 1}
    first = case_name.case_name("bus", content)
    assert first == case_name.case_name("bus", {"seed": 1, "sea": {"file": str(data)}})
    others = [
        case_name.case_name("linear", content),
        case_name.case_name("bus", {**content, "seed": 2}),
    ]
    data.write_text("rough")
    case_name._file_digest.cache_clear()
    others.append(case_name.case_name("bus", content))
    monkeypatch.setattr(case_name, "code_digest", lambda: "another")
    others.append(case_name.case_name("bus", content))
    assert len({first, *others}) == 5
    elsewhere = tmp_path / "same.txt"
    elsewhere.write_text("rough")
    assert others[-1] == case_name.case_name("bus", {"sea": {"file": str(elsewhere)}, "seed": 1})
