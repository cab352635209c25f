from pathlib import Path

import pytest
from pydantic import Field

from utank_hil.config_files import ConfigError, Section, load_config


class Ship(Section):
    length_m: float = Field(gt=0)
    name: str


class Scenario(Section):
    ship: Ship
    duration_s: float = Field(gt=0)


def write(folder: Path, name: str, text: str) -> Path:
    path = folder / name
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(text, encoding="utf-8")
    return path


def test_file_named_in_another_stands_for_its_content(tmp_path: Path) -> None:
    write(tmp_path, "ships/a.yaml", "length_m: 20\nname: A\n")
    top = write(tmp_path, "scenarios/top.yaml", "ship: ../ships/a.yaml\nduration_s: 10\n")
    scenario = load_config(top, Scenario)
    assert scenario.ship.length_m == 20


def test_every_problem_is_listed_with_the_file_and_key_where_it_stands(tmp_path: Path) -> None:
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


def test_missing_file_is_named_at_the_key_that_names_it(tmp_path: Path) -> None:
    top = write(tmp_path, "top.yaml", "ship: nowhere.yaml\nduration_s: 1\n")
    with pytest.raises(ConfigError, match=r"top\.yaml: ship: names .*nowhere\.yaml"):
        load_config(top, Scenario)


def test_files_that_include_each_other_are_refused(tmp_path: Path) -> None:
    write(tmp_path, "a.yaml", "ship: b.yaml\n")
    write(tmp_path, "b.yaml", "ship: a.yaml\n")
    with pytest.raises(ConfigError, match="includes itself"):
        load_config(tmp_path / "a.yaml", Scenario)


@pytest.mark.parametrize(
    ("text", "reason"),
    [("- 1\n", "mapping"), ("a: [", "not valid YAML"), ("", "mapping")],
)
def test_what_is_no_mapping_is_refused(tmp_path: Path, text: str, reason: str) -> None:
    with pytest.raises(ConfigError, match=reason):
        load_config(write(tmp_path, "bad.yaml", text), Scenario)


def test_not_a_number_is_no_value(tmp_path: Path) -> None:
    top = write(tmp_path, "top.yaml", "ship: {length_m: 1, name: A}\nduration_s: .nan\n")
    with pytest.raises(ConfigError, match="duration_s"):
        load_config(top, Scenario)


def test_path_of_a_data_file_is_relative_to_the_file_that_names_it(tmp_path: Path) -> None:
    write(tmp_path, "ships/a.yaml", "length_m: 20\nname: ./data.txt\n")
    top = write(tmp_path, "top.yaml", "ship: ships/a.yaml\nduration_s: 10\n")
    assert load_config(top, Scenario).ship.name == str(tmp_path / "ships" / "data.txt")
