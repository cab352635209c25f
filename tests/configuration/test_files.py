import json
from itertools import pairwise

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from pydantic import BaseModel, Field

from firmware_sim.scenario_sea import ScenarioSea
from utank_hil.configuration import ConfigError, Section, load_config
from utank_hil.configuration.files import kind_of
from utank_hil.configuration.yaml_text import parse_yaml


class Ship(Section):
    length_m: float = Field(gt=0)
    name: str


class Scenario(Section):
    ship: Ship
    duration_s: float = Field(gt=0)


class SeaHolder(Section):
    sea: ScenarioSea


def write(folder, name, text):
    path = folder / name
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(text, encoding="utf-8")
    return path


def test_file_named_in_another_stands_for_its_content(tmp_path):
    write(tmp_path, "ships/a.yaml", "length_m: 20\nname: A\n")
    top = write(tmp_path, "scenarios/top.yaml", "ship: ../ships/a.yaml\nduration_s: 10\n")
    scenario = load_config(top, Scenario)
    assert scenario.ship.length_m == 20


def test_every_problem_is_listed_with_the_file_and_key_where_it_stands(tmp_path):
    write(tmp_path, "ships/a.yaml", "length_m: -3\ncolour: red\n")
    top = write(tmp_path, "top.yaml", "ship: ships/a.yaml\nduration_s: soon\n")
    with pytest.raises(ConfigError) as caught:
        load_config(top, Scenario)
    found = {(problem.file.name, problem.key) for problem in caught.value.problems}
    assert found == {
        ("a.yaml", "length_m"),
        ("a.yaml", "colour"),
        ("a.yaml", "name"),
        ("top.yaml", "duration_s"),
    }
    assert "(got -3)" in str(caught.value)


def test_missing_file_is_named_at_the_key_that_names_it(tmp_path):
    top = write(tmp_path, "top.yaml", "ship: nowhere.yaml\nduration_s: 1\n")
    with pytest.raises(ConfigError, match=r"top\.yaml: ship: names .*nowhere\.yaml"):
        load_config(top, Scenario)


def problems(path, model=Scenario):
    """File name, key and reason of all problems of a file."""
    with pytest.raises(ConfigError) as caught:
        load_config(path, model)
    return [(each.file.name, each.key, each.reason) for each in caught.value.problems]


def test_missing_file_hides_nothing_but_what_it_was_to_hold(tmp_path):
    top = write(tmp_path, "top.yaml", "ship: nowhere.yaml\nduration_s: -1\n")
    assert {key for _, key, _ in problems(top)} == {"ship", "duration_s"}


def test_missing_file_is_a_problem_even_where_nothing_is_required(tmp_path):
    class Optional(Section):
        ship: dict[str, float] = Field(default_factory=dict)

    top = write(tmp_path, "top.yaml", "ship: nowhere.yaml\n")
    ((_, key, _),) = problems(top, Optional)
    assert key == "ship"


@pytest.mark.slow
@pytest.mark.parametrize(
    ("text", "key", "reason"),
    [
        ("duration_s: 1\nduration_s: 2\n", "duration_s", "written twice, in lines 1 and 2"),
        ("ship: {name: A,\n  length_m: 1, name: B}\n", "ship.name", "in lines 1 and 2"),
        ("ship: {name: A, length_m: 1}\nyes: 3\n", "yes", "is read as a bool and not as a name"),
        ("ship: {length_m: 9,5, name: A}\n", "ship.length_m", "decimal comma (line 1): write"),
        ("ship: {name: A, length_m: 1}\n5:\n", "5", "is read as a int and not as a name"),
        ("? [1, 2]\n: 3\n", "", "line 1, column 3: found unhashable key"),
        ("ship: &a {name: *a}\n", "", "an alias (*) names what it stands in"),
        ("ship: 2019-13-45\n", "", "line 1, column 7: month must be in 1..12; put text in quotes"),
        ("ship: !!int x\n", "", "put text in quotes"),
        (
            "a: &a [x, x, x, x, x, x, x, x, x]\n"
            + "".join(f"{c}: &{c} [{', '.join([f'*{b}'] * 9)}]\n" for b, c in pairwise("abcdefgh")),
            "", "holds more than 200000 values, aliases (*) written out",
        ),
        (f"# {'x' * (1 << 22)}\n", "", "holds more than 4194304 bytes"),
        ("[" * 5000, "", "nested too deeply"),
        ("ship: {name: A\n", "", "is not valid YAML in line 2, column 1"),
        ("a: 1\n--- \nb: 2\n", "", "is not valid YAML"),
        ("ship: \x07", "", "is not valid YAML"),
        ("shp: 1\n", "shp", "did you mean ship?"),
        ("ship: {nam: A}\n", "ship.nam", "did you mean name?"),
        ('ship: "\\0.yaml"\n', "ship", "can't be read"),
        (f"ship: {'x' * 300}.yaml\n", "ship", "can't be read: File name too long"),
    ],
)  # fmt: skip
def test_what_plain_yaml_passes_over_is_told(tmp_path, text, key, reason):
    top = write(tmp_path, "top.yaml", text)
    assert any(at == key and reason in why for _, at, why in problems(top)), problems(top)


def test_merged_keys_may_be_written_again(tmp_path):
    class Fleet(Section):
        first: Ship
        second: Ship

    text = "first: &a {name: A, length_m: 1}\nsecond: {<<: *a, name: B}\n"
    fleet = load_config(write(tmp_path, "fleet.yaml", text), Fleet)
    assert (fleet.second.name, fleet.second.length_m) == ("B", 1)


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.text(alphabet="ship: duration_s\n{}[]&*<?-!|>'\"\\0129.,#%@`~é", max_size=60))
def test_any_text_loads_or_is_told_what_is_wrong(tmp_path, text):
    path = write(tmp_path, "any.yaml", text)
    try:
        load_config(path, Scenario)
    except ConfigError as error:
        assert all(problem.file == path for problem in error.problems)  # noqa: PT017


@pytest.mark.parametrize("name", ["a.yml", "a.YAML", "a b.yaml"])
def test_other_files_are_named_with_any_suffix_of_yaml(tmp_path, name):
    write(tmp_path, name, "name: A\nlength_m: 20\n")
    top = write(tmp_path, "top.yml", f"ship: {name}\nduration_s: 10\n")
    assert load_config(top, Scenario).ship.length_m == 20


def test_the_name_of_a_file_is_text(tmp_path):
    write(tmp_path, "a.yaml", "name: as in b.yaml\nlength_m: 20\n")
    top = write(tmp_path, "top.yaml", "ship: a.yaml\nduration_s: 10\n")
    assert load_config(top, Scenario).ship.name == "as in b.yaml"


@pytest.mark.parametrize("encoding", ["utf-8-sig", "utf-16"])
def test_a_byte_order_mark_is_no_part_of_the_text(tmp_path, encoding):
    top = tmp_path / "top.yaml"
    top.write_text("ship: {name: Älv, length_m: 20}\r\nduration_s: 10\r\n", encoding=encoding)
    assert load_config(top, Scenario).ship.name == "Älv"


def test_kind_is_told_by_the_keys_that_no_other_has(tmp_path):
    kinds: dict[str, type[BaseModel]] = {"ship": Ship, "scenario": Scenario}
    assert kind_of(write(tmp_path, "a.yaml", "length_m: wrong\ncolour: 1\n"), kinds) == "ship"
    assert kind_of(write(tmp_path, "b.yaml", "ship: a.yaml\n"), kinds) == "scenario"
    for text in ("colour: red\n", "length_m: 1\nship: 2\n"):
        with pytest.raises(ConfigError, match="a ship has length_m, name; a scenario has"):
            kind_of(write(tmp_path, "c.yaml", text), kinds)
    with pytest.raises(ConfigError, match="can't be read"):
        kind_of(tmp_path / "nowhere.yaml", kinds)


def test_files_that_include_each_other_are_refused(tmp_path):
    write(tmp_path, "a.yaml", "ship: b.yaml\n")
    write(tmp_path, "b.yaml", "ship: a.yaml\n")
    with pytest.raises(ConfigError, match="includes itself"):
        load_config(tmp_path / "a.yaml", Scenario)


@pytest.mark.parametrize(
    ("text", "reason"), [("- 1\n", "mapping"), ("a: [", "not valid YAML"), ("", "mapping")]
)
def test_what_is_no_mapping_is_refused(tmp_path, text, reason):
    with pytest.raises(ConfigError, match=reason):
        load_config(write(tmp_path, "bad.yaml", text), Scenario)


def test_path_of_a_data_file_is_relative_to_the_file_that_names_it(tmp_path):
    write(tmp_path, "ships/a.yaml", "length_m: 20\nname: ./data.txt\n")
    top = write(tmp_path, "top.yaml", "ship: ships/a.yaml\nduration_s: 10\n")
    assert load_config(top, Scenario).ship.name == str(tmp_path / "ships" / "data.txt")


def test_a_data_file_is_named_by_its_key_where_it_is_a_yaml_file(tmp_path):
    write(tmp_path, "ships/a.yaml", "length_m: 20\nname: A\n")
    words = "sea: {kind: tabulated, file: ../ships/a.yaml, effective_slope: {coefficient: 0.5}}\n"
    top = write(tmp_path, "seas/sea.yaml", words)
    with pytest.raises(ConfigError, match=r"seas/sea\.yaml: sea\.file: .*ships/a\.yaml"):
        load_config(top, SeaHolder)


def test_a_name_of_a_file_beside_the_one_that_names_it_is_its_path(tmp_path, monkeypatch):
    """Wherever the command is called from; the name of a ship is text, whatever stands beside."""
    write(tmp_path, "seas/table.csv", "frequency_hz,density_m2_hz\n0.08,1\n0.1,4\n0.12,2\n")
    words = "sea: {kind: tabulated, file: table.csv}\n"
    monkeypatch.chdir(tmp_path)
    found = load_config(write(tmp_path, "seas/sea.yaml", words), SeaHolder).sea
    assert found.file == tmp_path / "seas" / "table.csv"
    write(tmp_path, "ships/a.yaml", "length_m: 20\nname: data.txt\n")
    write(tmp_path, "ships/data.txt", "1")
    top = write(tmp_path, "top.yaml", "ship: ships/a.yaml\nduration_s: 10\n")
    assert load_config(top, Scenario).ship.name == "data.txt"
    other = write(tmp_path, "seas/sea.yaml", words.replace("table", "nowhere"))
    with pytest.raises(ConfigError, match=r"sea\.file: nowhere\.csv .*beside the file"):
        load_config(other, SeaHolder)


@pytest.mark.parametrize("text", ["1e-05", "2e3", "-1E+2", "3.e4", "1.5e-7"])
def test_numbers_as_json_writes_them_are_numbers(text):
    assert parse_yaml(f"{{x: {text}}}")[0] == {"x": float(text)}


@given(value=st.floats(allow_nan=False, allow_infinity=False))
def test_any_number_comes_back_from_json(value):
    assert parse_yaml(json.dumps({"x": value}))[0] == {"x": value}


@pytest.mark.parametrize("text", ["1e", "e5", "1e5m", "0x1e5"])
def test_words_that_look_like_numbers_are_no_floats(text):
    assert not isinstance(parse_yaml(f"x: {text}")[0]["x"], float)


def test_what_is_read_of_a_text_is_the_readers_own():
    text = "law: {weights: [1.0]}"
    for _ in range(2):
        content, findings = parse_yaml(text)
        assert content == {"law": {"weights": [1.0]}}
        content["law"]["weights"].append(2.0)
        findings.append("else")
    assert parse_yaml(text)[1] == []
