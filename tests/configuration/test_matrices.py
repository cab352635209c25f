"""Laws in matrices: the same law from every kind of file, and clear errors."""

import json
import math
import struct
from pathlib import Path

import control
import h5py
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from others import field_case
from scipy.io import savemat
from scipy.sparse import csc_matrix

from utank_hil.assembly import build_law
from utank_hil.configuration import ConfigError, ControllerConfig, load_config, matrices
from utank_hil.configuration.matrices import read_system

SHIP = Path("configs/ships/thesis_first.yaml").resolve()
LAW = {"A": [[0.5, 0.1], [0.0, 0.2]], "B": [[1.0], [2.0]], "C": [[1e4, 2e4]], "D": [[3e4]]}


def configured(folder, system, measured="[roll_rad]"):
    path = folder / "law.yaml"
    path.write_text(
        f"name: m\nvessel: {SHIP}\n"
        f"law: {{kind: state_space, measured: {measured}, system: {json.dumps(system)}}}\n",
        encoding="utf-8",
    )
    return load_config(path, ControllerConfig)


def written(folder, suffix, content):
    path = folder / f"law{suffix}"
    if suffix == ".json":
        path.write_text(json.dumps(content), encoding="utf-8")
    elif suffix == ".npz":
        np.savez(path, **{name: np.array(value) for name, value in content.items()})
    else:
        savemat(path, content)
    return f"./{path.name}"


def answers(config, outputs=1):
    controller = build_law(config).controller()
    samples = np.random.default_rng(1).standard_normal((5, outputs))
    return np.array([controller.step(y)[0] for y in samples])


@pytest.mark.parametrize(
    ("suffix", "period"), [(".json", "sample_time_s"), (".npz", "dt"), (".mat", "Ts")]
)
def test_every_kind_of_file_holds_the_same_law(tmp_path, suffix, period):
    inline = answers(configured(tmp_path, {**LAW, "sample_time_s": 0.1}))
    assert inline[0] == 3e4 * np.random.default_rng(1).standard_normal()
    system = written(tmp_path, suffix, {**LAW, period: 0.1})
    np.testing.assert_array_equal(answers(configured(tmp_path, system)), inline)


@pytest.mark.parametrize("order", [0, 1, 3])
def test_a_law_of_python_control_goes_through_json_as_it_is(tmp_path, order):
    sampled = control.sample_system(control.tf([2e4, 1e4], [0.2, 1.3, 2.0, 1.0]), 0.1)
    law = control.ss(sampled) if order == 3 else control.ss(order * 0.5, 1.0, 2e4, 3e4, 0.1)
    law = law if order else control.ss([], [], [], [[3e4]], 0.1)
    matrices = {name: getattr(law, name).tolist() for name in "ABCD"}
    content = {**matrices, "dt": law.dt, "name": law.name}
    found = answers(configured(tmp_path, written(tmp_path, ".json", content)))
    y = np.random.default_rng(1).standard_normal((5, 1))
    expected = control.forced_response(law, inputs=y.T).outputs
    np.testing.assert_allclose(found, expected, rtol=1e-12)


@pytest.mark.parametrize("dt", [0, True, None])
def test_a_law_of_python_control_without_a_time_is_refused(tmp_path, dt):
    law = control.ss([[0.5]], [[1.0]], [[2.0]], [[3.0]], dt)
    content = {name: getattr(law, name).tolist() for name in "ABCD"} | {"dt": law.dt}
    with pytest.raises(ConfigError, match=r"law\.system: law\.json: dt "):
        configured(tmp_path, written(tmp_path, ".json", content))


def test_a_law_without_states_has_d_alone(tmp_path):
    static = {"A": np.zeros((0, 0)), "B": np.zeros((0, 2)), "C": np.zeros((1, 0)), "dt": 0.1}
    system = written(tmp_path, ".npz", {**static, "D": [[1.0, -2.0]]})
    config = configured(tmp_path, system, "[roll_rad, level_m]")
    samples = np.random.default_rng(1).standard_normal((5, 2))
    np.testing.assert_allclose(answers(config, 2), samples @ [1.0, -2.0])


def test_a_static_law_may_be_json(tmp_path):
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
        (".json", {**LAW, "dt": "fast"}, "dt must be a time in seconds, got 'fast'"),
        (".json", {**LAW, "dt": 0.1, "B": [[1.0]]}, "system.B: must have shape (2, 1)"),
        (".json", {**LAW, "dt": 0.1, "B": [[1.0, 2.0]] * 2}, "(1, 1): rows as C, columns as B"),
        (".json", {**LAW, "dt": 0.1, "C": [[1.0]]}, "system.C: must have shape (1, 2), got (1, 1)"),
        (".json", {**LAW, "dt": 0.1, "A": [[1.0, 2.0]]}, "got (1, 2): square"),
        (".npz", {**LAW, "dt": 0.1, "D": [[1.0], [2.0]]}, "system.D: must be one row"),
        (".npz", {**LAW, "dt": 0.1, "C": [[np.inf, 0.0]]}, "system.C"),
        (".json", {**LAW, "dt": True}, "dt must be a time in seconds, got True"),
        (".json", {**LAW, "dt": 0.013}, "law.system.sample_time_s: must be a whole number of"),
        (".json", {**LAW, "dt": 0}, "dt is 0, a continuous system: sample it first"),
        (".mat", {**LAW, "Ts": -1.0}, "Ts is -1, an unknown sample time"),
        (".json", {**LAW, "dt": 0.1, "A": [[True, 0.1], [0.0, 0.2]]}, "A has true in the place"),
        (".json", {**LAW, "dt": 0.1, "A": [["0.5", 0.1], [0, 1]]}, "A must hold numbers"),
        (".json", {**LAW, "dt": 0.1, "A": [[0.5], [0.0, 0.2]]}, "A must have rows of one length"),
        (".npz", {**LAW, "dt": 0.1, "C": [[True, False]]}, "C must hold numbers, got bool"),
        (".json", {**LAW, "dt": 0.1, "D": [[math.nan]]}, "NaN is no finite number"),
        (
            ".mat",
            {**LAW, "dt": 0.1, "A": [[1j, 0], [0, 1]]},
            "A must be real, and has imaginary parts",
        ),
    ],
)
def test_what_is_wrong_is_said_at_its_key(tmp_path, suffix, content, message):
    with pytest.raises(ConfigError) as caught:
        configured(tmp_path, written(tmp_path, suffix, content))
    assert message in str(caught.value)
    assert f"{tmp_path / 'law.yaml'}: law.system" in str(caught.value)


def test_a_file_at_which_scipy_crashes_is_refused_in_words(tmp_path):
    """A data type that does not exist ends scipy 1.17's reader by a segmentation fault."""
    savemat(tmp_path / "law.mat", {**LAW, "Ts": 0.1})
    whole = (tmp_path / "law.mat").read_bytes()
    doubles = struct.pack("<II", 9, 8 * len(LAW["B"]))
    assert doubles in whole
    (tmp_path / "law.mat").write_bytes(whole.replace(doubles, b"\x29" + doubles[1:]))
    with pytest.raises(ConfigError, match=r"law\.mat holds no matrices"):
        configured(tmp_path, "./law.mat")


def test_indices_beyond_a_sparse_matrix_are_refused(tmp_path):
    content = {**{name: csc_matrix(value) for name, value in LAW.items()}, "Ts": 0.1}
    savemat(tmp_path / "law.mat", content)
    whole = (tmp_path / "law.mat").read_bytes()
    rows = content["A"].indices.astype("<i4")
    place = whole.index(struct.pack("<II", 5, rows.nbytes) + rows.tobytes()) + 8
    beyond = (rows + 1_000_000).tobytes()
    (tmp_path / "law.mat").write_bytes(whole[:place] + beyond + whole[place + len(beyond) :])
    # scipy checks them as it reads, in its own words, up to 1.16
    refused = (
        r"law\.mat(: A is no sparse matrix: | holds no matrices: axis 0 index 100000\d exceeds)"
    )
    with pytest.raises(ConfigError, match=refused):
        configured(tmp_path, "./law.mat")
    matlab_73(tmp_path / "law.mat", {**LAW, "Ts": 0.1})
    with h5py.File(tmp_path / "law.mat", "r+") as file:
        file["sys/A/ir"][...] += 1_000_000
    with pytest.raises(ConfigError, match=r"law\.mat: A is no sparse matrix: "):
        configured(tmp_path, "./law.mat")


@pytest.mark.parametrize(
    ("name", "text", "message"),
    [
        ("law.json", "[1, 2", "holds no matrices"),
        ("law.json", '{"dt": 0.1, "dt": 0.2}', "it has the key 'dt' twice: remove one"),
        ("law.npz", "PK nonsense", "holds no matrices"),
        ("law.mat", "nonsense", "holds no matrices"),
        ("law.csv", "1, 2", "must be a file of .json, .npz, .mat"),
        ("", "", "can't be read"),
    ],
)
def test_a_file_that_is_none_is_said(tmp_path, name, text, message):
    if name:
        (tmp_path / name).write_text(text, encoding="utf-8")
    with pytest.raises(ConfigError, match=r"law\.system") as caught:
        configured(tmp_path, f"./{name or 'nowhere.npz'}")
    assert message in str(caught.value)


def test_it_measures_as_many_outputs_as_d_has_columns(tmp_path):
    with pytest.raises(ConfigError, match=r"law.measured: must name 1 outputs"):
        configured(tmp_path, {**LAW, "sample_time_s": 0.1}, "[roll_rad, level_m]")


@pytest.mark.parametrize(
    "content",
    [
        {"sys": {**LAW, "Ts": 0.1}},
        {**LAW, "Ts": 0.1, "A": np.array(LAW["A"]) + 0j},
        {**{name: csc_matrix(value) for name, value in LAW.items()}, "Ts": 0.1},
        {**LAW, "Ts": np.uint8(1), "A": np.array(LAW["A"])},
    ],
    ids=["structure", "complex without imaginary part", "sparse", "whole number"],
)
def test_matrices_are_read_as_matlab_has_them(tmp_path, content):
    savemat(tmp_path / "law.MAT", content)
    found = read_system(tmp_path / "law.MAT")
    assert [list(map(list, found[name])) for name in "ABCD"] == list(LAW.values())


def test_a_vector_is_a_column_for_b_and_a_row_for_c(tmp_path):
    vectors = {**LAW, "B": [1.0, 2.0], "C": [1e4, 2e4], "D": 3e4, "dt": 0.1}
    found = read_system(tmp_path / written(tmp_path, ".json", vectors))
    assert [list(map(list, found[name])) for name in "ABCD"] == list(LAW.values())


def matlab_73(path, content):
    """Write matrices as MATLAB's `save -v7.3` does: HDF5, transposed, sparse ones in columns."""
    with h5py.File(path, "w", userblock_size=512) as file:
        struct = file.create_group("sys")
        struct.attrs["MATLAB_class"] = np.bytes_("struct")
        for name, value in content.items():
            matrix = np.atleast_2d(np.asarray(value, dtype=float))
            if name == "A":
                columns = csc_matrix(matrix)
                group = struct.create_group(name)
                group.attrs["MATLAB_sparse"] = np.uint64(len(matrix))
                group["data"], group["ir"], group["jc"] = (
                    columns.data, columns.indices.astype("u8"), columns.indptr.astype("u8"),
                )  # fmt: skip
            elif name == "C":
                kind = np.dtype([("real", "<f8"), ("imag", "<f8")])
                struct[name] = np.array([[(x, 0.0) for x in row] for row in matrix.T], dtype=kind)
            else:
                struct[name] = matrix.T
    with path.open("r+b") as file:
        file.write(b"MATLAB 7.3 MAT-file, Platform: GLNXA64".ljust(508) + b"\x00\x02IM")


def test_files_of_matlab_7_3_are_read(tmp_path):
    matlab_73(tmp_path / "law.mat", {**LAW, "Ts": 0.1})
    found = read_system(tmp_path / "law.mat")
    assert [list(map(list, found[name])) for name in "ABCD"] == list(LAW.values())
    assert found["sample_time_s"] == 0.1


@given(
    st.integers(1, 4).flatmap(
        lambda n: st.tuples(
            arrays(float, (n, n), elements=st.floats(-1e9, 1e9)),
            arrays(float, (n, 2), elements=st.floats(-1e9, 1e9)),
        )
    )
)
def test_matrices_are_read_to_the_bit(tmp_path_factory, pair):
    a, b = pair
    content = {"A": a, "B": b, "C": b[:, :1].T, "D": b[:1], "dt": 0.1}
    folder = tmp_path_factory.mktemp("law")
    savemat(folder / "law.mat", content)
    np.savez(folder / "law.npz", **content)
    lists = {name: np.asarray(value).tolist() for name, value in content.items()}
    (folder / "law.json").write_text(json.dumps(lists))
    with pytest.MonkeyPatch.context() as patch:  # a process takes a quarter of a second to start
        patch.setattr(matrices, "apart", lambda read, *given, **options: [read(*given, **options)])
        read = [read_system(folder / f"law{suffix}") for suffix in (".mat", ".npz", ".json")]
    assert read[0] == read[1] == read[2]
    np.testing.assert_array_equal(read[0]["A"], a)


@pytest.mark.parametrize(
    ("file", "message"),
    [
        ("10-law-in-json-is-not-read-strictly/text.json", "dt must be a time in seconds"),
        ("10-law-in-json-is-not-read-strictly/true.json", "A has true in the place of a number"),
        ("10-law-in-json-is-not-read-strictly/twice.json", "it has the key 'dt' twice"),
        ("15-byte-order-mark/law.json", ""),
        ("16-mat-as-matlab-has-it/struct.mat", ""),
        ("16-mat-as-matlab-has-it/sparse.mat", ""),
        ("16-mat-as-matlab-has-it/complex.mat", ""),
        ("16-mat-as-matlab-has-it/suffix.MAT", ""),
        ("16-mat-as-matlab-has-it/column.json", ""),
    ],
)
def test_cases_from_the_field(file, message):
    path = field_case(file)
    if message:
        with pytest.raises(ValueError, match=message):
            read_system(path)
    else:
        found = read_system(path)
        assert found["A"] == ((0.5, 0.1), (0.0, 0.2))
        assert found["B"] == ((1.0,), (2.0,))
