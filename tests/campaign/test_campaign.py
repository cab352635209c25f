"""The command and its workers: killed ones change nothing, and what is there is not done again."""

import errno
import importlib
import io
import json
import multiprocessing
import os
import signal
import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
import yaml
from one_process import in_one_process
from rich.console import Console
from rich.measure import Measurement
from studies import small, written
from typer.testing import CliRunner

from firmware_sim.campaign import simulations
from firmware_sim.campaign.driver import Driver, batch_of
from firmware_sim.campaign.simulations import FAILED, LOST, OK, failed_row, run_batch
from firmware_sim.campaign.store import METRICS, Results, Store, read_results
from firmware_sim.campaign.summary import figure, summary, units_of
from firmware_sim.campaign.tables import pairs_table, runs_table
from firmware_sim.commands.campaign import campaign
from firmware_sim.commands.report import report
from utank_hil.analysis.motion.statistics import mean_interval
from utank_hil.console.common import new_app
from utank_hil.console.exit_codes import ExitCode

pytestmark = pytest.mark.slow


def without_times(rows):
    return [{key: value for key, value in row.items() if key != "wall_s"} for row in rows]


@pytest.mark.evidence
def test_workers_that_are_killed_and_an_interruption_change_no_bit(tmp_path):
    loaded = small(tmp_path, grid={"seed": {"first": 1, "count": 16}})
    store = Store(tmp_path / "out")
    store.begin(loaded, {"keys": loaded.keys}, resume=False)
    killed: list[int] = []

    def kill(count):
        if count.done > 3 and not killed:
            killed.append(multiprocessing.active_children()[0].pid or 0)
            os.kill(killed[0], signal.SIGKILL)
        if count.done > 8:
            raise KeyboardInterrupt

    first = Driver(loaded, store, kill)
    with pytest.raises(KeyboardInterrupt):
        first.run(2)
    assert killed
    assert not multiprocessing.active_children()
    done = store.done()
    assert 8 < len(done) < 16
    second = Driver(loaded, store, lambda count: None)
    assert second.count.needed == 16 - len(done)
    second.run(2)
    found = read_results(tmp_path / "out").rows
    assert list(map(len, found.values())) == [3] * 16
    for case in loaded.cases[::5]:
        serial = without_times(run_batch(batch_of(loaded, [case])))
        kept = [{key: row[key] for key in serial[0]} for row in found[case.name]]
        assert [list(map(str, each.values())) for each in kept] == [
            list(map(str, each.values())) for each in serial
        ]  # as text, which is exact, and in which nan equals nan


def _killed_by_the_second(batch):
    if "2" in [str(seed) for _, seed, _ in batch.cases]:
        os.kill(os.getpid(), signal.SIGKILL)
    return run_batch(batch)


@pytest.mark.evidence
def test_a_case_that_kills_each_process_is_lost_alone(tmp_path):
    loaded = small(tmp_path, grid={"seed": [1, 2, 3, 4]})
    store = Store(tmp_path / "out")
    store.begin(loaded, {"keys": loaded.keys}, resume=False)
    Driver(loaded, store, lambda count: None, _killed_by_the_second).run(2)
    rows = read_results(tmp_path / "out").rows
    status = {case.seed: rows[case.name][0]["status"] for case in loaded.cases}
    assert status == {1: OK, 2: LOST, 3: OK, 4: OK}


def test_a_lost_case_is_tried_again_where_others_were_enough_for_the_interval(tmp_path):
    stop = {"metric": "roll_below_passive", "half_width": 0.9, "least": 4}
    loaded = small(tmp_path, grid={"seed": [1, 2, 3, 4, 5, 6, 7]}, stop=stop)
    store = Store(tmp_path / "out")
    store.begin(loaded, {"keys": loaded.keys}, resume=False)
    lost, *others = loaded.cases[:5]
    store.write([failed_row(lost.name, LOST, "killed"), *run_batch(batch_of(loaded, others))])
    with in_one_process():
        Driver(loaded, store, lambda _: None).run(1)
    assert lost.name in store.done()


@pytest.mark.parametrize(("number", "status"), [(errno.ENOSPC, LOST), (errno.ENOENT, FAILED)])
def test_what_the_machine_lacks_is_tried_again_and_a_missing_file_is_not(
    tmp_path, monkeypatch, number, status
):
    def fails(*_):
        raise OSError(number, "a reason", "a file")

    monkeypatch.setattr(simulations, "rows_of", fails)
    loaded = small(tmp_path, grid={"seed": [1]})
    (row,) = run_batch(batch_of(loaded, loaded.cases))
    assert row["status"] == status
    assert "a reason: 'a file'" in row["reason"]


@pytest.fixture
def run(tmp_path):
    """Run the command in this process."""
    app = new_app()
    app.command()(campaign)

    def invoke(*arguments):
        out = ("--out", str(tmp_path / "out"))
        with in_one_process():
            return CliRunner().invoke(app, [*map(str, arguments), *out])

    return invoke


reports = new_app()
reports.command()(report)


def test_command_resumes_counts_failures_and_compares_in_the_same_waves(run, tmp_path):
    grid = {"seed": {"first": 1, "count": 3}, "sea.heading_deg": [90.0, 60.0, 0.0]}
    path = written(tmp_path, grid=grid)
    first = run(path, "--json")
    assert first.exit_code == 0, first.output
    found = json.loads(first.stdout)
    groups = {group["parameters"]["sea.heading_deg"]: group for group in found["groups"]}
    assert [groups[heading]["failed"] for heading in (90.0, 60.0, 0.0)] == [0, 0, 3]
    assert found["failures"] == {next(iter(found["failures"])): 3}
    assert "gives no roll moment" in next(iter(found["failures"]))
    pair = groups[90.0]["paired"][0]
    assert (pair["run"], pair["against"]) == ("gpc", "passive")
    shares = groups[90.0]["runs"]["gpc"]["roll_below_passive"]
    assert pair["share_below"] == pytest.approx(shares)
    assert shares["cases"] == 3
    assert shares["half_width"] > 0
    worst = groups[90.0]["runs"]["gpc"]["worst"]
    assert worst["sea.heading_deg"] == 90.0
    assert worst["seed"] in (1, 2, 3)
    assert worst["roll_rms_rad"] > groups[90.0]["runs"]["gpc"]["roll_rms_rad"]["mean"]
    # headings are another sea: nothing is beside the first
    assert [group["beside_first"] for group in found["groups"]] == [[], [], []]
    out = tmp_path / "out"
    about = json.loads((out / "study.json").read_text())
    assert about["configuration"]["grid"] == {**grid, "seed": [1, 2, 3]}
    assert about["data"]
    assert "retuning" in about["leaves_out"]
    rows = sorted((out / "rows").iterdir())
    assert "add --resume" in run(path).stderr
    again = run(path, "--resume")
    assert again.exit_code == 0, again.output
    assert "roll RMS below it %" in again.stdout
    assert (out / "campaign.png").stat().st_size > 10_000
    done = CliRunner().invoke(reports, [str(out), str(out), "--json"])
    assert done.exit_code == 0, done.output
    page = Path(json.loads(done.stdout)["page"]).read_text()
    assert page.count("3 cases have no result.") == 2
    assert f"{100 * shares['mean']:.1f} ± " in page
    assert "3 cases without a result: sea.heading_deg" in again.stdout
    assert sorted((out / "rows").iterdir()) == rows


def test_a_case_that_was_removed_from_the_study_fails_no_more_and_one_named_twice_counts_once(
    run, tmp_path
):
    assert run(written(tmp_path, grid={"sea.heading_deg": [90.0, 0.0]})).exit_code == 0
    again = run(
        written(tmp_path, cases=[{"seed": 1}, {}, {"sea.speed_m_s": 1.0}]), "--json", "--resume"
    )
    found = json.loads(again.stdout)
    assert found["failures"] == {}
    assert [group["planned"] for group in found["groups"]] == [1, 1]
    named = runs_table(found["groups"], "test").columns[1]
    assert list(named.cells) == ["", "", "", "1", "1", "1"]


def test_share_of_no_roll_is_no_figure(run, tmp_path):
    calm = {"kind": "jonswap", "hs_m": 1e-5, "tp_s": 9.0, "effective_slope": {"coefficient": 0.5}}
    done = run(written(tmp_path, set={"sea": calm}, grid={"seed": [1, 2]}), "--json")
    (group,) = json.loads(done.stdout)["groups"]
    (pair,) = group["paired"]
    assert group["runs"]["gpc"]["roll_below_passive"]["cases"] == 0
    assert pair["share_below"] == {"mean": None, "half_width": None, "cases": 0}
    assert pair["roll_rms_difference_rad"]["cases"] == 2
    cells = [list(column.cells) for column in pairs_table([group]).columns]
    assert cells[2:4] == [["2"], [""]]


def test_groups_of_the_same_waves_are_compared_with_the_first(run, tmp_path):
    pressures = [5e4, 1.5e4]
    grid = {"seed": {"first": 1, "count": 3}, "controllers.*.limits.pressure_pa": pressures}
    found = json.loads(run(written(tmp_path, grid=grid), "--json").stdout)["groups"]
    rolls = [group["runs"]["gpc"]["roll_rms_rad"]["mean"] for group in found]
    bare, passive, gpc = found[1]["beside_first"]
    assert gpc["roll_rms_difference_rad"]["mean"] == pytest.approx(rolls[1] - rolls[0], rel=1e-9)
    assert gpc["share_below"]["cases"] == 3
    for same in (bare, passive):
        assert same["roll_rms_difference_rad"] == {"mean": 0.0, "half_width": 0.0, "cases": 3}


def test_the_interval_of_a_mean_knows_what_cases_share():
    """Six seeds in twelve days of weather, each with an effect of its own: coverage of 95 %.

    As values of their own the 72 cases hold the truth in under six of ten campaigns.
    """
    rng, held, apart = np.random.default_rng(1), 0, 0
    keys = [(seed, day) for seed in range(6) for day in range(12)]
    cases = [
        {"case": f"{n}", "index": n, "waves": f"{n}", "seed": seed,
         "sea.time": f"2019-02-{day + 1:02}T05:40"}
        for n, (seed, day) in enumerate(keys)
    ]  # fmt: skip
    about = {"configuration": {"average_over": ["seed", "sea.time"]}}
    units = units_of(Results(about, (), cases, {}))
    for _ in range(300):
        of_seed, of_day, own = rng.normal(size=6), rng.normal(size=12), rng.normal(size=72)
        values = [of_seed[seed] + of_day[day] + own[n] for n, (seed, day) in enumerate(keys)]
        found = figure([(f"{n}", value) for n, value in enumerate(values)], units)
        held += abs(found["mean"]) < found["half_width"]
        apart += abs(found["mean"]) < mean_interval(values).half_width
    assert held > 0.9 * 300
    assert apart < 0.6 * 300


def test_hours_of_one_day_are_one_weather_and_draws_one_ship():
    cases = [
        {"case": name, "index": n, "waves": name, "sea.time": time, "gm": gm, "seed": 1}
        for n, (name, time, gm) in enumerate(
            [("a", "2019-02-10T05:40", 1.0), ("b", "2019-02-10T06:40", 2.0),
             ("c", "2019-02-11T05:40", 1.0)]
        )
    ]  # fmt: skip
    about = {"configuration": {"average_over": ["sea.time"]}}
    found = units_of(Results(about, ("seed",), cases, {}))
    assert found == {
        "a": ("2019-02-10", (1.0,)), "b": ("2019-02-10", (2.0,)), "c": ("2019-02-11", (1.0,))
    }  # fmt: skip


def test_draws_in_the_same_waves_are_paired_each_with_its_own():
    """Two groups of three draws of a ship in one sea; in the second the last has no result."""
    draws = [(group, draw) for group in (1.0, 2.0) for draw in (10.0, 20.0, 30.0)]
    figures = dict.fromkeys(METRICS, 0.0) | {"run": "gpc", "mark": "", "status": "ok"}
    cases = [
        {"case": f"{group}{draw}", "index": n, "waves": "a", "limit": group, "gm": draw}
        for n, (group, draw) in enumerate(draws)
    ]
    rows = {
        f"{group}{draw}": [figures | {"case": f"{group}{draw}", "roll_rms_rad": group + draw}]
        for group, draw in draws[:-1]
    }
    (pair,) = summary(Results({}, ("limit",), cases, rows))[1]["beside_first"]
    assert pair["roll_rms_difference_rad"] == {"mean": 1.0, "half_width": 0.0, "cases": 2}


@pytest.mark.evidence
def test_a_group_stops_where_its_interval_is_narrow(run, tmp_path):
    wide = {"metric": "roll_rms_rad", "half_width": 1.0, "least": 3}
    path = written(tmp_path, grid={"seed": {"first": 1, "count": 40}}, stop=wide)
    done = run(path, "--workers", "1", "--json")
    (group,) = json.loads(done.stdout)["groups"]
    assert (group["planned"], group["counted"]) == (40, 3)
    assert len(Store(tmp_path / "out").done()) < 40


class Client:
    """In place of a Dask client: a cluster of two threads, one of whose workers dies once."""

    def __init__(self, address, timeout):
        if address != "tcp://10.0.0.5:8786":
            raise OSError("no answer")

    def __enter__(self):
        return self

    def __exit__(self, *_):
        pass

    def scheduler_info(self, n_workers):
        return {"workers": {"a": 1, "b": 2}}

    def get_executor(self, pure):
        return ThreadPoolExecutor(2)


def test_a_cluster_computes_the_same_and_a_batch_that_kills_its_workers_is_lost(
    tmp_path, monkeypatch, run
):
    class KilledWorker(Exception):
        pass

    def work(batch):
        if "2" in [str(seed) for _, seed, _ in batch.cases]:
            raise KilledWorker
        return run_batch(batch)

    dask = SimpleNamespace(Client=Client, KilledWorker=KilledWorker)
    monkeypatch.setitem(sys.modules, "distributed", dask)
    loaded = small(tmp_path, grid={"seed": [1, 2, 3]})
    store = Store(tmp_path / "cluster")
    store.begin(loaded, {"keys": loaded.keys}, resume=False)
    Driver(loaded, store, lambda count: None, work).run(1, "tcp://10.0.0.5:8786")
    rows = read_results(tmp_path / "cluster").rows
    assert {case.seed: rows[case.name][0]["status"] for case in loaded.cases} == {
        1: OK, 2: LOST, 3: OK,
    }  # fmt: skip
    path = written(tmp_path, grid={"seed": [1]})
    assert "tcp://10.0.0.6:1: no answer" in run(path, "--scheduler", "tcp://10.0.0.6:1").stderr
    assert "leave it out" in run(path, "--scheduler", "tcp://a:1", "--workers", "1").stderr


def test_interrupted_campaign_says_so_keeps_what_there_is_and_goes_on(run, tmp_path, monkeypatch):
    path, whole = written(tmp_path, grid={"seed": [1, 2]}), Driver.run

    def interrupted(driver, workers, scheduler):
        whole(driver, workers)
        raise KeyboardInterrupt

    with monkeypatch.context() as patch:
        patch.setattr(Driver, "run", interrupted)
        done = run(path, "--json")
    assert done.exit_code == ExitCode.INTERRUPTED, done.output
    told = json.loads(done.stdout)
    assert told["interrupted"] is True
    assert told["groups"][0]["runs"]["gpc"]["roll_rms_rad"]["cases"] == 2
    again = run(path, "--json", "--resume")
    assert again.exit_code == ExitCode.OK, again.output
    assert json.loads(again.stdout)["interrupted"] is False


def test_a_campaign_interrupted_before_its_first_case_shows_no_empty_table(
    run, tmp_path, monkeypatch
):
    def interrupted(driver, workers, scheduler):
        raise KeyboardInterrupt

    monkeypatch.setattr(Driver, "run", interrupted)
    done = run(written(tmp_path, grid={"seed": [1, 2]}))
    assert done.exit_code == ExitCode.INTERRUPTED, done.output
    assert "0 of 2 cases are kept, --resume goes on from here" in done.stderr
    assert "cases" not in done.stdout


def test_wrong_study_ends_before_anything_is_computed(run, tmp_path):
    path = written(tmp_path, grid={"sea.headin_deg": [90.0]})
    done = run(path)
    assert done.exit_code == 2
    assert "grid.sea.headin_deg" in done.stderr
    assert not (tmp_path / "out").exists()


def test_entry_point_is_the_command():
    import tomllib

    points = tomllib.loads(Path("pyproject.toml").read_text())["project"]["entry-points"]
    module, name = points["utank_hil.commands"]["campaign"].split(":")
    assert getattr(importlib.import_module(module), name) is campaign
    assert yaml.safe_load(Path("configs/studies/storm_seeds.yaml").read_text())["name"]


def test_a_campaign_over_one_key_is_a_table_of_80_columns():
    """Narrower than a terminal it is a list, in which nothing can be compared."""
    one = {"mean": 0.09, "half_width": 0.05, "cases": 3}
    figures = {
        "marked": {},
        "worst": {"roll_max_rad": 0.4},
        "roll_rms_rad": one,
        "roll_below_passive": {**one, "mean": 0.299, "half_width": 0.369},
        "level_peak_m": one,
        "power_mean_w": {**one, "mean": 25.1e3},
    }
    group = {"parameters": {"sea.tp_s": 9.5}, "runs": {"no tank": figures, "self_tuned": figures}}
    console = Console(width=80, file=io.StringIO())
    wide = Measurement.get(console, console.options.update(max_width=1000), runs_table([group], ""))
    assert wide.maximum <= 80
