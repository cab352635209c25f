"""Laws in matrices: the same law from every kind of file, and clear errors."""

import json
from pathlib import Path

import numpy as np
import pytest
from scipy.io import savemat

from utank_hil.assembly import build_law
from utank_hil.configuration import ConfigError, ControllerConfig, load_config

SHIP = Path("configs/ships/thesis_first.yaml").resolve()
LAW = {"A": [[0.5, 0.1], [0.0, 0.2]], "B": [[1.0], [2.0]], "C": [[1e4, 2e4]], "D": [[3e4]]}


def configured(folder: Path, system: object, measured: str = "[roll_rad]") -> ControllerConfig:
    path = folder / "law.yaml"
    path.write_text(
        f"name: m\nvessel: {SHIP}\n"
        f"law: {{kind: state_space, measured: {measured}, system: {json.dumps(system)}}}\n",
        encoding="utf-8",
    )
    return load_config(path, ControllerConfig)


def written(folder: Path, suffix: str, content: dict[str, object]) -> str:
    path = folder / f"law{suffix}"
    if suffix == ".json":
        path.write_text(json.dumps(content), encoding="utf-8")
    elif suffix == ".npz":
        np.savez(path, **{name: np.array(value) for name, value in content.items()})
    else:
        savemat(path, content)
    return f"./{path.name}"


def answers(config: ControllerConfig, outputs: int = 1) -> np.ndarray:
    controller = build_law(config).controller()
    samples = np.random.default_rng(1).standard_normal((5, outputs))
    return np.array([controller.step(y)[0] for y in samples])


@pytest.mark.parametrize(
    ("suffix", "period"), [(".json", "sample_time_s"), (".npz", "dt"), (".mat", "Ts")]
)
def test_every_kind_of_file_holds_the_same_law(tmp_path: Path, suffix: str, period: str) -> None:
    inline = answers(configured(tmp_path, {**LAW, "sample_time_s": 0.1}))
    assert inline[0] == 3e4 * np.random.default_rng(1).standard_normal()
    system = written(tmp_path, suffix, {**LAW, period: 0.1})
    np.testing.assert_array_equal(answers(configured(tmp_path, system)), inline)


def test_a_law_without_states_has_d_alone(tmp_path: Path) -> None:
    static = {"A": np.zeros((0, 0)), "B": np.zeros((0, 2)), "C": np.zeros((1, 0)), "dt": 0.1}
    system = written(tmp_path, ".npz", {**static, "D": [[1.0, -2.0]]})
    config = configured(tmp_path, system, "[roll_rad, level_m]")
    samples = np.random.default_rng(1).standard_normal((5, 2))
    np.testing.assert_allclose(answers(config, 2), samples @ [1.0, -2.0])


def test_a_static_law_may_be_json(tmp_path: Path) -> None:
    static = {"A": [], "B": [], "C": [[]], "D": [[2.0]], "dt": 0.1}
    config = configured(tmp_path, written(tmp_path, ".json", static))
    np.testing.assert_allclose(
        answers(config), 2 * np.random.default_rng(1).standard_normal((5, 1))[:, 0]
    )


@pytest.mark.parametrize(
    ("suffix", "content", "message"),
    [
        (".json", {**LAW}, "must hold A, B, C, D and one of sample_time_s, dt, Ts; it has A, B"),
        (".npz", {**LAW, "dt": 0.1, "Ts": 0.1}, "must hold A, B, C, D and one of"),
        (".json", {**LAW, "dt": "fast"}, "must hold matrices of real numbers"),
        (".json", {**LAW, "dt": 0.1, "B": [[1.0]]}, "system.B: must have shape (2, 1)"),
        (".npz", {**LAW, "dt": 0.1, "D": [[1.0], [2.0]]}, "system.D: must be one row"),
        (".npz", {**LAW, "dt": 0.1, "C": [[np.inf, 0.0]]}, "system.C"),
        (".json", {**LAW, "dt": True}, "dt must be a time in seconds, not true or false"),
        (".json", {**LAW, "dt": 0.013}, "law.system.sample_time_s: must be a whole number of"),
        (".mat", {**LAW, "dt": 0.1, "A": [[1j, 0], [0, 1]]}, "a complex one is not"),
    ],
)
def test_what_is_wrong_is_said_at_its_key(tmp_path: Path, suffix, content, message) -> None:
    with pytest.raises(ConfigError) as caught:
        configured(tmp_path, written(tmp_path, suffix, content))
    assert message in str(caught.value)
    assert f"{tmp_path / 'law.yaml'}: law.system" in str(caught.value)


@pytest.mark.parametrize(
    ("name", "text", "message"),
    [
        ("law.json", "[1, 2", "holds no matrices"),
        ("law.npz", "PK nonsense", "holds no matrices"),
        ("law.mat", "nonsense", "holds no matrices"),
        ("law.csv", "1, 2", "must be a file of .json, .npz, .mat"),
        ("", "", "can't be read"),
    ],
)
def test_a_file_that_is_none_is_said(tmp_path: Path, name: str, text: str, message: str) -> None:
    if name:
        (tmp_path / name).write_text(text, encoding="utf-8")
    with pytest.raises(ConfigError, match=r"law\.system") as caught:
        configured(tmp_path, f"./{name or 'nowhere.npz'}")
    assert message in str(caught.value)


def test_it_measures_as_many_outputs_as_d_has_columns(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match=r"law.measured: must name 1 outputs"):
        configured(tmp_path, {**LAW, "sample_time_s": 0.1}, "[roll_rad, level_m]")
