"""Every wrong value is refused at its key in the project's own words, whatever it is."""

import copy
import math
from pathlib import Path
from typing import Any

import pytest
import yaml
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from whole_configuration import whole

from firmware_sim.scenario import Scenario
from utank_hil.configuration import ConfigError, ControllerConfig, Vessel, load_config
from utank_hil.configuration.yaml_text import parse_yaml

CONFIGS = Path("configs").resolve()
MODELS = {"ships": Vessel, "controllers": ControllerConfig, "scenarios": Scenario}
FOREIGN_WORDS = ("Input ", "valid ", "tag", "dictionary", "instance", "unable to", "Field ")


def places(content, key=()):
    """Keys and values of all that stands in a content."""
    items = (
        content.items() if isinstance(content, dict)
        else enumerate(content) if isinstance(content, list) else ()
    )  # fmt: skip
    for name, value in items:
        yield (*key, name), value
        yield from places(value, (*key, name))


SHIPPED = {
    path: whole(path) for name in sorted(MODELS) for path in sorted((CONFIGS / name).glob("*.yaml"))
}
PLACES = [(path, *place) for path, content in SHIPPED.items() for place in places(content)]
NUMBERS = [
    (path, key)
    for path, key, value in PLACES
    if isinstance(value, int | float) and not isinstance(value, bool)
]


def with_value(path, key, value):
    """A shipped configuration with one value put in the place of another."""
    content = copy.deepcopy(SHIPPED[path])
    place = content
    for part in key[:-1]:
        place = place[part]
    place[key[-1]] = value
    return content


def refused(folder, text, model):
    """Reason by key of all that is wrong with a file."""
    file = folder / "changed.yaml"
    file.write_text(text, encoding="utf-8")
    with pytest.raises(ConfigError) as caught:
        load_config(file, model)
    assert all(problem.file == file for problem in caught.value.problems)
    return {problem.key: problem.reason for problem in caught.value.problems}


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    place=st.sampled_from(NUMBERS),
    value=st.sampled_from(
        [True, False, "yes please", "9,5", [1.0, []], {"a": 1.0}, math.nan, math.inf]
    ),
)
def test_no_number_is_taken_from_what_is_none(tmp_path, place, value):
    path, key = place
    text = yaml.safe_dump(with_value(path, key, value))
    found = refused(tmp_path, text, MODELS[path.parent.name])
    dotted = ".".join(map(str, key))
    assert any(at == dotted or at.startswith(f"{dotted}.") for at in found)
    assert not any(word in reason for reason in found.values() for word in FOREIGN_WORDS)


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    place=st.sampled_from(PLACES),
    value=st.sampled_from(
        [True, "x", "9,5", "1.5", [], {}, [1.0], {"kind": "JONSWAP"}, None, math.nan, math.inf, -3,
         10**400, 2.5, "", ["roll_rad"], 1e300]
    ),
)  # fmt: skip
def test_whatever_stands_anywhere_the_words_are_the_project_s_own(tmp_path, place, value):
    path, key, _ = place
    file = tmp_path / "changed.yaml"
    file.write_text(yaml.safe_dump(with_value(path, key, value)))
    try:
        load_config(file, MODELS[path.parent.name])
    except ConfigError as error:
        reasons = [problem.reason for problem in error.problems]
        assert reasons
        assert not any(word in reason for reason in reasons for word in FOREIGN_WORDS)


SHIP = """name: A
ship:
  inertia_kg_m2: 1.9275e9
  stiffness_nm_rad: 4.81875e8
tank:
  width_m: 17.1
  height_m: 4.88
  reservoir_area_m2: 17.11
  duct_area_m2: 6.22
"""


@pytest.mark.parametrize(
    ("written", "words"),
    [
        ("yes", "must be a number, got true or yes"),
        ("off", "must be a number, got false or no"),
        ("9,5", "must be a number, got '9,5': write a decimal point, 9.5"),
        ("'17.1'", "must be a number, got '17.1': write 17.1, without quotes"),
        ("1_000", "must be a number, got '1_000': write 1000, without quotes"),
        ("17.1 m", "write the number alone, in the unit that the key ends with"),
        ("1:30", "must be a number, got '1:30'"),
        ("wide", "must be a number, got 'wide'"),
        ("[17.1]", "must be a number, got a list"),
        ("{m: 17.1}", "must be a number, got a mapping of keys to values"),
        ("2019-02-10", "must be a number, got the date 2019-02-10"),
        ("", "must be a number, got nothing"),
        (".nan", "must be a finite number, got nan"),
        (f"'{1000 * 'x'}'", "must be a number, got 'xxxxxxxxxx"),
    ],
)
def test_what_is_no_number_is_told_with_the_remedy(tmp_path, written, words):
    reasons = refused(tmp_path, SHIP.replace("17.1\n", f"{written}\n"), Vessel)
    assert words in reasons["tank.width_m"]
    assert len(reasons["tank.width_m"]) < 200


def test_numbers_are_decimal(tmp_path):
    text = "a: 1e7\nb: 010\nc: 5.\nd: .5\ne: -1E-3\nf: -.inf\ng: +4\n"
    values = {"a": 1e7, "b": 10, "c": 5.0, "d": 0.5, "e": -1e-3, "f": -math.inf, "g": 4}
    assert parse_yaml(text) == (values, [])


PD = SHIPPED[CONFIGS / "controllers" / "pd.yaml"]


def scenario(**changes):
    """The storm with keys changed."""
    path = CONFIGS / "scenarios" / "storm.yaml"
    return yaml.safe_dump({**SHIPPED[path], **changes})


@pytest.mark.parametrize(
    ("changes", "key", "words"),
    [
        ({"sea": {"kind": "JONSWAP", "hs_m": 2.0, "tp_s": 8.0}}, "sea.kind",
         "must be one of measured, tabulated, jonswap, ittc, pierson_moskowitz, regular, "
         "components; did you mean jonswap? (got 'JONSWAP')"),
        ({"sea": {"hs_m": 2.0}}, "sea",
         "needs the key kind: one of measured, tabulated, jonswap, ittc, pierson_moskowitz, "
         "regular, components"),
        ({"sea": "rough"}, "sea", "must be a mapping of keys to values, got 'rough'"),
        ({"operator": [{"time_s": 5.0, "action": "amr"}]}, "operator.0.action",
         "must be one of standby, passive, arm, disarm, stop, reset"),
        ({"operator": "arm"}, "operator", "must be a list, got 'arm'"),
        ({"name": True}, "name", "must be text, got true or yes: put it in quotes"),
        ({"seed": 1.5}, "seed", "must be a whole number, got 1.5"),
        ({"controllers": {}}, "controllers", "must have 1 or more, got 0"),
        ({"controllers": {f"c{n}": PD for n in range(8)}}, "controllers",
         "must have 7 at most, got 8"),
        ({"durations": 5}, "durations", "is not a known key; did you mean duration_s?"),
    ],
)  # fmt: skip
def test_what_is_no_choice_list_or_text_is_told(tmp_path, changes, key, words):
    assert words in refused(tmp_path, scenario(**changes), Scenario)[key]


def test_key_that_only_looks_alike_is_not_suggested(tmp_path):
    text = SHIP.replace("ship:\n", "ship:\n  loss_m: 0.9\n")
    assert refused(tmp_path, text, Vessel)["ship.loss_m"] == "is not a known key"


@pytest.mark.parametrize(
    ("shipped", "key", "named", "has", "model"),
    [
        (
            "controllers/pd.yaml",
            "vessel",
            "../controllers/gpc.yaml",
            "vessel, law",
            ControllerConfig,
        ),
        ("controllers/pd.yaml", "law", "../ships/patti_b.yaml", "ship, tank", ControllerConfig),
        ("scenarios/storm.yaml", "vessel", "../scenarios/still_water.yaml", "sea", Scenario),
        ("scenarios/storm.yaml", "controllers", "../ships/patti_b.yaml", "", Scenario),
    ],
)
def test_file_of_another_kind_is_named_at_the_key_that_names_it(
    tmp_path, shipped, key, named, has, model
):
    content = SHIPPED[CONFIGS / shipped]
    file = CONFIGS / "ships" / named
    value: Any = str(file)
    if key == "controllers":
        key, value = "controllers.one", {"one": str(file)}
    reasons = refused(tmp_path, yaml.safe_dump({**content, key.partition(".")[0]: value}), model)
    assert set(reasons) == {key}
    assert f"names {file}, which has the keys" in reasons[key]
    assert has in reasons[key]
    assert "; a file for this has " in reasons[key]


def test_file_of_another_kind_is_refused_in_one_line():
    with pytest.raises(ConfigError) as caught:
        load_config(CONFIGS / "ships" / "patti_b.yaml", ControllerConfig)
    (problem,) = caught.value.problems
    assert problem.key == ""
    assert problem.reason == "is a ship, and a controller is wanted"


def test_a_file_that_its_reader_names_is_not_named_twice(tmp_path):
    waves = tmp_path / "waves.txt"
    waves.write_text("none\n")
    reason = refused(tmp_path, f"sea: {{kind: measured, file: {waves}}}\n", Scenario)["sea.file"]
    assert reason == (
        f"{waves}, line 1: no header line with frequencies stands before the data; if it is not "
        "NDBC's, make a table of it, kind: tabulated"
    )
