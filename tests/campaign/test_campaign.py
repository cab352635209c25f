"""The command and its workers: killed ones change nothing, and what is there is not done again."""

import importlib
import json
import os
import signal
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
import yaml
from distributed import Client
from studies import small, written
from typer.testing import CliRunner, Result

from firmware_sim.campaign.driver import Count, Driver, batch_of, workers
from firmware_sim.campaign.store import Store, read_results
from firmware_sim.campaign.tables import pairs_table
from firmware_sim.campaign.work import run_batch
from firmware_sim.commands.campaign import campaign
from utank_hil.console.common import new_app
from utank_hil.console.exit_codes import ExitCode
from utank_hil.reports.page import write_page

pytestmark = pytest.mark.slow


def without_times(rows: list[dict[str, object]]) -> list[dict[str, object]]:
    return [{key: value for key, value in row.items() if key != "wall_s"} for row in rows]


@pytest.mark.evidence
def test_workers_that_are_killed_and_an_interruption_change_no_bit(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    monkeypatch.setattr("firmware_sim.campaign.driver.LOOK_S", 1.0)
    loaded = small(tmp_path, grid={"seed": {"first": 1, "count": 16}})
    store = Store(tmp_path / "out")
    store.begin(loaded, {"keys": loaded.keys, "configuration": {"stop": None}}, resume=False)
    pids: list[int] = []

    def kill(count: Count) -> None:
        if count.done > 3 and pids:
            os.kill(pids.pop(), signal.SIGKILL)
        if count.done > 8:
            raise KeyboardInterrupt

    with workers(None, 2) as client:
        assert all("127.0.0.1" in address for address in client.scheduler_info()["workers"])
        pids += client.run(os.getpid).values()
        first = Driver(loaded, store, kill)
        with pytest.raises(KeyboardInterrupt):
            first.run(client)
        done = store.done()
        assert 8 < len(done) < 16
        closed: list[int] = []

        def close(count: Count) -> None:
            """Have every nanny give up."""
            while len(closed) < 2:
                client.cluster.sync(list(client.cluster.workers.values())[len(closed)].close)
                closed.append(count.done)

        second = Driver(loaded, store, close)
        assert second.count.needed == 16 - len(done)
        second.run(client)
    found = read_results(tmp_path / "out").rows
    assert list(map(len, found.values())) == [3] * 16
    for case in loaded.cases[::5]:
        serial = without_times(run_batch(batch_of(loaded, [case])))
        kept = [{key: row[key] for key in serial[0]} for row in found[case.name]]
        assert [list(map(str, each.values())) for each in kept] == [
            list(map(str, each.values())) for each in serial
        ]  # as text, which is exact, and in which nan equals nan


@pytest.fixture
def run(monkeypatch: pytest.MonkeyPatch, tmp_path: Path):
    """Run the command with a worker in a thread of this process."""

    @contextmanager
    def here(scheduler: str | None, count: int | None) -> Iterator[Client]:
        with Client(
            processes=False, n_workers=1, threads_per_worker=1, dashboard_address=None
        ) as client:
            yield client

    monkeypatch.setattr("firmware_sim.campaign.driver.workers", here)
    app = new_app()
    app.command()(campaign)

    def invoke(*arguments: object) -> Result:
        out = ("--out", str(tmp_path / "out"))
        return CliRunner().invoke(app, [*map(str, arguments), *out])

    return invoke


def test_command_resumes_counts_failures_and_compares_in_the_same_waves(run, tmp_path: Path):
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
    assert (out / "campaign.png").stat().st_size > 10_000
    about = json.loads((out / "study.json").read_text())
    assert about["configuration"]["grid"] == {**grid, "seed": [1, 2, 3]}
    assert about["data"]
    assert "retuning" in about["leaves_out"]
    rows = sorted((out / "rows").iterdir())
    assert "add --resume" in run(path).stderr
    again = run(path, "--resume")
    assert again.exit_code == 0, again.output
    assert "roll RMS below it %" in again.stdout
    assert "3 cases without a result: sea.heading_deg" in again.stdout
    assert sorted((out / "rows").iterdir()) == rows
    page = write_page([out], tmp_path / "report.html").read_text(encoding="utf-8")
    mean, width = (100 * shares[name] for name in ("mean", "half_width"))
    assert f"gpc (sea.heading_deg 90.0): {mean:.1f} ± {width:.1f} % below the passive" in page
    assert "3 cases have no result." in page


def test_share_of_no_roll_is_no_figure(run, tmp_path: Path):
    calm = {"kind": "jonswap", "hs_m": 1e-5, "tp_s": 9.0, "effective_slope": {"coefficient": 0.5}}
    done = run(written(tmp_path, set={"sea": calm}, grid={"seed": [1, 2]}), "--json")
    (group,) = json.loads(done.stdout)["groups"]
    (pair,) = group["paired"]
    assert group["runs"]["gpc"]["roll_below_passive"]["cases"] == 0
    assert pair["share_below"] == {"mean": None, "half_width": None, "cases": 0}
    assert pair["roll_rms_difference_rad"]["cases"] == 2
    cells = [list(column.cells) for column in pairs_table([group]).columns]
    assert cells[2:4] == [["2"], [""]]
    page = write_page([tmp_path / "out"], tmp_path / "report.html").read_text(encoding="utf-8")
    assert "% below the passive" not in page


def test_groups_of_the_same_waves_are_compared_with_the_first(run, tmp_path: Path):
    pressures = [5e4, 1.5e4]
    grid = {"seed": {"first": 1, "count": 3}, "controllers.*.limits.pressure_pa": pressures}
    found = json.loads(run(written(tmp_path, grid=grid), "--json").stdout)["groups"]
    rolls = [group["runs"]["gpc"]["roll_rms_rad"]["mean"] for group in found]
    bare, passive, gpc = found[1]["beside_first"]
    assert gpc["roll_rms_difference_rad"]["mean"] == pytest.approx(rolls[1] - rolls[0], rel=1e-9)
    assert gpc["share_below"]["cases"] == 3
    for same in (bare, passive):
        assert same["roll_rms_difference_rad"] == {"mean": 0.0, "half_width": 0.0, "cases": 3}


def test_campaign_stops_where_its_interval_is_narrow(run, tmp_path: Path):
    stop = {"metric": "roll_below_passive", "half_width": 0.2, "least": 5}
    path = written(tmp_path, grid={"seed": {"first": 1, "count": 200}}, stop=stop)
    found = json.loads(run(path, "--json").stdout)
    (group,) = found["groups"]
    figure = group["runs"]["gpc"]["roll_below_passive"]
    assert 5 <= figure["cases"] < 200
    assert figure["half_width"] <= 0.2
    # more cases may have been computed; they do not count
    assert found["cases"] == 200
    assert group["counted"] == figure["cases"]


def test_interrupted_campaign_says_so_keeps_what_there_is_and_goes_on(
    run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    path, whole = written(tmp_path, grid={"seed": [1, 2]}), Driver.run

    def interrupted(driver: Driver, client: Client) -> None:
        whole(driver, client)
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


def test_wrong_study_ends_before_anything_is_computed(run, tmp_path: Path):
    path = written(tmp_path, grid={"sea.headin_deg": [90.0]})
    done = run(path)
    assert done.exit_code == 2
    assert "grid.sea.headin_deg" in done.stderr
    assert not (tmp_path / "out").exists()


def test_scheduler_that_does_not_answer_is_named(tmp_path: Path, monkeypatch):
    monkeypatch.setattr("firmware_sim.campaign.driver.CONNECT_S", 0.2)
    app = new_app()
    app.command()(campaign)
    path = written(tmp_path)
    arguments = [str(path), "--scheduler", "tcp://127.0.0.1:1", "--out", str(tmp_path / "out")]
    done = CliRunner().invoke(app, arguments)
    assert done.exit_code == 2, done.output
    assert "--scheduler tcp://127.0.0.1:1" in done.stderr


def test_without_dask_the_remedy_is_named(monkeypatch, capsys):
    from utank_hil.console.failures import failures_named

    with pytest.raises(SystemExit), failures_named():
        raise ModuleNotFoundError("No module named 'distributed'", name="distributed")
    assert "pip install 'utank-hil[bench]'" in capsys.readouterr().err.replace("\n", "")


def test_entry_point_is_the_command():
    import tomllib

    points = tomllib.loads(Path("pyproject.toml").read_text())["project"]["entry-points"]
    module, name = points["utank_hil.commands"]["campaign"].split(":")
    assert getattr(importlib.import_module(module), name) is campaign
    assert yaml.safe_load(Path("configs/studies/storm_seeds.yaml").read_text())["name"]
