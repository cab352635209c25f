"""The folder of a campaign: rows once each, whatever was written twice or cut short."""

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from little_room import little_room
from studies import small

from firmware_sim.campaign.simulations import FAILED, LOST, OK, failed_row
from firmware_sim.campaign.store import Store, StoreError, read_results


def rows(case, roll=1.0):
    ended = {"case": case, "status": OK, "reason": "", "mark": "", "wall_s": 0.1}
    return [{**ended, "run": run, "roll_rms_rad": roll} for run in ("passive", "gpc")]


@settings(max_examples=20)
@given(parts=st.lists(st.lists(st.integers(0, 5), max_size=4), max_size=8))
def test_rows_are_unique_however_often_cases_were_written(tmp_path_factory, parts):
    store = Store(tmp_path_factory.mktemp("campaign"))
    (store.folder / "rows").mkdir()
    for part in parts:
        store.write([row for number in part for row in rows(f"c{number}")])
    expected = {(f"c{n}", run) for part in parts for n in part for run in ("passive", "gpc")}
    for _ in range(2):
        table = store.rows()
        found = list(zip(table["case"].to_pylist(), table["run"].to_pylist(), strict=True))
        assert len(found) == len(set(found))
        assert set(found) == expected
        store.gather()
    assert len(list((store.folder / "rows").iterdir())) <= 1


def test_lost_case_is_not_done_and_gives_way_to_its_rows(tmp_path):
    store = Store(tmp_path)
    (tmp_path / "rows").mkdir()
    store.write([failed_row("c1", LOST, "died"), failed_row("c2", FAILED, "wrong key")])
    assert store.done() == {"c2"}
    store.write(rows("c1"))
    assert store.done() == {"c1", "c2"}
    assert store.rows()["run"].to_pylist().count("") == 1


def test_part_that_was_cut_short_is_not_read(tmp_path):
    loaded, store = small(tmp_path), Store(tmp_path / "out")
    about = {"keys": loaded.keys}
    store.begin(loaded, about, resume=False)
    store.write(rows("c1"))
    cut = tmp_path / "out" / "rows" / "9.parquet.part"
    cut.write_bytes(b"PAR1")
    assert store.done() == {"c1"}
    store.begin(loaded, about, resume=True)
    assert not cut.exists()
    assert store.done() == {"c1"}


def test_results_are_not_overwritten_unasked_and_those_of_other_cases_are_left_aside(tmp_path):
    loaded, store = small(tmp_path), Store(tmp_path / "out")
    store.begin(loaded, {"keys": loaded.keys}, resume=False)
    store.write(rows("of another study"))
    store.write(rows(loaded.cases[0].name))
    with pytest.raises(StoreError, match="add --resume"):
        store.begin(loaded, {}, resume=False)
    found = read_results(tmp_path / "out")
    assert [each["case"] for each in found.cases] == list(found.rows) == [loaded.cases[0].name]
    assert (tmp_path / "out" / "study.yaml").read_bytes() == loaded.path.read_bytes()


def test_a_seed_beyond_the_integers_of_the_table_is_kept_as_text(tmp_path):
    loaded, store = small(tmp_path, grid={"seed": [1, 10**20]}), Store(tmp_path / "out")
    store.begin(loaded, {"keys": loaded.keys}, resume=False)
    assert [case["seed"] for case in read_results(store.folder).cases] == ["1", f"{10**20}"]


def test_rows_that_do_not_fit_are_named_and_those_before_stay(tmp_path):
    store = Store(tmp_path)
    (tmp_path / "rows").mkdir()
    store.write(rows("c1"))
    many = [row for number in range(300) for row in rows(f"c{number}", roll=number**0.5)]
    with little_room(), pytest.raises(OSError, match=rf"File too large: '{tmp_path}/rows/.*parq"):
        store.write(many)
    assert store.done() == {"c1"}
    assert len(list((tmp_path / "rows").iterdir())) == 1
