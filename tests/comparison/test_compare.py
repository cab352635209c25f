"""Comparisons: intervals that hold what they promise, and pairs only of the same waves."""

import json
import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.stats import ttest_ind
from typer.testing import CliRunner

from firmware_sim.campaign.driver import batch_of
from firmware_sim.campaign.simulations import run_batch
from firmware_sim.campaign.store import Store
from firmware_sim.campaign.study import load_study
from firmware_sim.commands.compare import _table, compare
from firmware_sim.comparison import Comparison, Difference, batch_count, difference
from utank_hil.analysis.motion.statistics import batch_means, rms_batches
from utank_hil.canbus.enumerations import Mode
from utank_hil.console.common import new_app
from utank_hil.console.terminal import Terminal
from utank_hil.telemetry.recording import write_recording

APP = new_app()
APP.command()(compare)
COLUMNS = ("time_s", "roll_rad", "starboard_level_m", "port_level_m", "pressure_actual_pa",
           "pump_power_w")  # fmt: skip


STUDY = """
name: {name}
scenario: {configs}/scenarios/storm.yaml
simulation: linear
set:
  controllers: {{gpc: {configs}/controllers/gpc.yaml}}
  controllers.gpc.limits.pressure_pa: {pressure_pa}
  duration_s: 30
  settle_s: 10
grid: {{seed: {{first: {first}, count: 4}}}}
"""


def ran(folder, name, pressure_pa=5e4, first=1):
    """A campaign's folder."""
    path, configs = folder / f"{name}.yaml", Path("configs").resolve()
    path.write_text(STUDY.format(name=name, configs=configs, pressure_pa=pressure_pa, first=first))
    loaded, store = load_study(path), Store(folder / name)
    about = {"keys": loaded.keys, "code": "same", "configuration": {"simulation": "linear"}}
    store.begin(loaded, about, resume=False)
    store.write(run_batch(batch_of(loaded, loaded.cases)))
    return folder / name


def found(*arguments):
    done = CliRunner().invoke(APP, [*map(str, arguments), "--json"])
    assert done.exit_code == 0, done.output
    return json.loads(done.stdout)


def waves(seed, seconds=3600.0, rate_hz=20, damping_ratio=0.05):
    """Roll of a lightly damped ship (12.6 s) under white noise, stationary."""
    count = round(rate_hz * (seconds + 1200))
    omega = np.fft.rfftfreq(count, 1 / rate_hz) * 2 * np.pi
    gain = 1 / (0.25 - omega**2 + 1j * 2 * damping_ratio * 0.5 * omega)
    noise = np.fft.rfft(np.random.default_rng(seed).standard_normal(count))
    return np.fft.irfft(noise * gain)[600 * rate_hz : -600 * rate_hz] * 1e-2


def recorded(path, roll, **about):
    time_s = np.arange(len(roll)) / 20
    other = np.zeros((len(roll), len(COLUMNS) - 2))
    write_recording(path, COLUMNS, {"run": np.column_stack([time_s, roll, other])}, about=about)
    return path


def test_root_mean_square_is_the_mean_of_its_batches_and_differences_add_up():
    one, two = waves(1, 600.0), waves(2, 600.0)
    batches = [rms_batches(each, 8) for each in (one, two)]
    for values, each in zip(batches, (one, two), strict=True):
        assert values.mean() == pytest.approx(math.sqrt(np.mean(each**2)), rel=1e-12)
    assert batch_means(np.arange(7.0), 3).tolist() == [0.5, 2.5, 4.5]
    assert not rms_batches(np.zeros(10), 2).any()
    with pytest.raises(ValueError, match="3 values make no 4 batches"):
        batch_means(np.ones(3), 4)


@pytest.mark.evidence
def test_interval_of_an_hour_holds_the_true_difference_about_as_often_as_it_says():
    ratios, count, held = (0.025, 0.05), 300, 0
    # white noise: the mean square goes with the inverse of the damping
    many = math.sqrt(np.mean([np.mean(waves(k, 36000.0, 2, 0.05) ** 2) for k in range(300)]))
    true = many * (math.sqrt(ratios[1] / ratios[0]) - 1)
    for seed in range(count):
        light, heavy = (waves(seed, 3600.0, 2, ratio) for ratio in ratios)
        batches = batch_count({"roll_rad": light})
        found = difference(rms_batches(heavy, batches), rms_batches(light, batches), paired=True)
        held += abs(found.difference - true) <= found.half_width
    assert 0.91 <= held / count <= 0.98


def test_long_record_has_longer_batches_and_a_short_one_keeps_six():
    counts = [batch_count({"roll_rad": waves(1, 12.6 * rolls)}) for rolls in (90, 170, 400, 4000)]
    assert counts[0] < 6 == counts[1]
    assert counts[2] in (7, 8, 9, 10)
    assert counts[3] == 30


def test_independent_means_have_welch_s_interval():
    one, two = np.array([1.0, 2.0, 4.0]), np.array([2.0, 3.0, 3.0, 6.0])
    found = difference(one, two, paired=False)
    expected = ttest_ind(two, one, equal_var=False).confidence_interval(0.95)
    assert found.difference == pytest.approx((expected.low + expected.high) / 2)
    assert found.half_width == pytest.approx((expected.high - expected.low) / 2)
    assert not found.paired


@pytest.mark.usefixtures("read_here")
def test_recordings_of_the_same_waves_are_paired_piece_by_piece(tmp_path):
    def about_it(file, width_m):
        scenario = {"sea": {"file": file}, "vessel": {"tank": {"duct_width_m": width_m}}}
        return {"configuration": scenario, "seed": 1, "data": {file: "1234"}}

    # another folder and another tank: the waves are the same
    about, moved = about_it("./a", 1.0), about_it("../a", 2.0)
    roll = waves(3, 2400.0)
    first = recorded(tmp_path / "a.rrd", roll, **about)
    small = recorded(tmp_path / "b.rrd", 0.8 * roll, **moved)
    other = recorded(tmp_path / "c.rrd", waves(4, 2400.0), **{**about, "seed": 2})
    together, apart = found(first, small, other)["comparisons"]
    figure = together["figures"]["roll_rms_rad"]
    assert figure["paired"]
    rms = math.sqrt(np.mean(roll**2))
    assert figure["reference"] == pytest.approx(rms, rel=0.05)  # a rest of a batch is left out
    assert figure["difference"] == pytest.approx(-0.2 * figure["reference"], rel=1e-3)
    batches = (rms_batches(each, figure["count"]) for each in (0 * roll, roll))
    single = difference(*batches, paired=True)
    assert figure["half_width"] == pytest.approx(0.2 * single.half_width, rel=1e-2)
    assert not apart["figures"]["roll_rms_rad"]["paired"]
    assert apart["figures"]["roll_rms_rad"]["half_width"] > figure["half_width"]
    assert apart["remarks"] == ["not the same waves: not paired"]
    shorter = recorded(tmp_path / "d.rrd", roll[:-20], **about)
    (each,) = found(first, shorter)["comparisons"]
    assert each["remarks"] == ["the same waves, but not at the same times: not paired"]


@pytest.mark.usefixtures("read_here")
def test_recording_and_somebody_s_table_are_compared_by_the_columns_that_both_have(tmp_path):
    roll = waves(3, 1800.0)
    first = recorded(tmp_path / "a.rrd", roll)
    table = tmp_path / "measured.csv"
    rows = (f"{k / 20:.2f},{math.degrees(0.5 * value):.6f}" for k, value in enumerate(roll))
    table.write_text("time_s,roll_deg\n" + "\n".join(rows) + "\n")
    (each,) = found(first, table)["comparisons"]
    assert list(each["figures"]) == ["roll_rms_rad"]
    figure = each["figures"]["roll_rms_rad"]
    assert figure["value"] == pytest.approx(0.5 * figure["reference"], rel=1e-4)
    said = f"waves unknown, as no scenario is in {first} and {table}: not paired"
    assert said in each["remarks"]
    table.write_text("time_s,pitch_deg\n0,1\n")
    done = CliRunner().invoke(APP, [str(first), str(table)])
    assert done.exit_code == 2
    assert "has no column roll_rad or roll_deg" in done.stderr


@pytest.mark.usefixtures("read_here")
def test_gaps_are_left_out_if_they_are_few(tmp_path):
    roll = waves(5, 1800.0)
    first, second = roll.copy(), 0.5 * roll
    first[:100] = np.nan  # the sensor starts after the log
    second[7000:8000] = np.nan
    about = {"configuration": {"sea": {}}, "seed": 1}
    paths = [
        recorded(tmp_path / f"{n}.rrd", each, **about) for n, each in enumerate((first, second))
    ]
    (each,) = found(*paths)["comparisons"]
    figure = each["figures"]["roll_rms_rad"]
    assert figure["paired"]
    assert figure["difference"] == pytest.approx(-0.5 * figure["reference"], rel=1e-4)
    second[: len(roll) // 5] = np.nan
    recorded(tmp_path / "1.rrd", second, **about)
    (each,) = found(*paths)["comparisons"]
    assert "roll_rms_rad" not in each["figures"]
    table = tmp_path / "measured.csv"
    rows = "".join(f"{k / 20},{'' if k % 3 else 0.1}\n" for k in range(9000))
    table.write_text(f"time_s,roll_rad\n{rows}")
    done = CliRunner().invoke(APP, [str(paths[0]), str(table)])
    assert done.exit_code == 2
    assert "know 90% of the values" in done.stderr


@pytest.mark.usefixtures("read_here")
def test_capsized_ship_has_no_figures_and_a_law_that_lost_the_pump_is_named(tmp_path):
    names, roll = ("time_s", "roll_rad", "true_roll_rad", "mode"), waves(5, 600.0)
    active = np.full(len(roll), Mode.ACTIVE)
    columns = np.column_stack([np.arange(len(roll)) / 20, roll, roll, active])
    lost, over = columns.copy(), columns.copy()
    lost[len(roll) // 2 :, 3] = Mode.FAULT
    over[len(roll) // 2 :, 2] = math.radians(90.02)
    paths = [tmp_path / f"{name}.rrd" for name in ("well", "lost", "over")]
    for path, rows in zip(paths, (columns, lost, over), strict=True):
        write_recording(path, names, {"gpc": rows})
    of_lost, of_over = found(*paths)["comparisons"]
    assert "run gpc: in charge for 100% of the time in the first, 50% in this" in of_lost["remarks"]
    assert of_lost["figures"]
    assert of_over["figures"] == {}
    said = f"not compared: the ship capsized in run gpc of {paths[2]}"
    assert of_over["remarks"] == [said]
    done = CliRunner().invoke(APP, list(map(str, paths)), env={"COLUMNS": "200"})
    assert said in done.stdout


def test_record_without_a_known_roll_raises_no_warning(tmp_path, recwarn):
    assert batch_count({"roll_rad": np.full(100, np.nan)}) == 0
    assert not recwarn.list


@pytest.mark.usefixtures("read_here")
def test_table_of_a_bench_fits_eighty_columns(tmp_path, monkeypatch):
    monkeypatch.setenv("COLUMNS", "80")
    monkeypatch.chdir(tmp_path)
    for n in (1, 2):
        recorded(Path(f"{n}.rrd"), waves(n, 2400.0))
    done = CliRunner().invoke(APP, ["1.rrd", "2.rrd"])
    assert "│   roll rms ° " in done.stdout
    assert "± half width of its 95 % interval" in done.stdout


def test_table_of_long_names_and_wide_intervals_fits_eighty_columns(monkeypatch, capsys):
    monkeypatch.setenv("COLUMNS", "80")
    of = Difference(2777.0, 3919.0, 1142.0, 1234.5, 12, paired=True)
    figures = {"roll_rms_rad": replace(of, reference=0.0274, value=0.0355, difference=0.00815,
                                       half_width=0.00123), "pressure_rms_pa": of}  # fmt: skip
    each = Comparison("out/two", "self_tuned", figures, {"sea.hs_m": 3.5, "seed": 7})
    Terminal().table(_table(Path("out/one"), [each]))
    lines = capsys.readouterr().out.splitlines()
    shown = [" ".join(line.replace("│", " ").split()) for line in lines[4:9]]
    assert shown == [
        "self_tuned",
        "sea.hs_m 3.5",
        "seed 7",
        "roll rms ° 1.57 2.034 +0.467 ± 0.0705 +29.7% 12",
        "pressure rms kPa 2.777 3.919 +1.14 ± 1.23 +41.1% 12",
    ]


@pytest.mark.usefixtures("read_here")
def test_record_that_is_too_short_has_no_interval(tmp_path):
    short = [recorded(tmp_path / f"{n}.rrd", waves(n, 300.0)) for n in (1, 2)]
    (each,) = found(*short)["comparisons"]
    assert each["figures"]["roll_rms_rad"]["half_width"] is None
    assert "no interval: shorter than 120 rolls" in each["remarks"][-1]
    done = CliRunner().invoke(APP, list(map(str, short)))
    assert "no interval" in done.stdout
    assert "±" not in done.stdout


def test_what_can_not_be_compared_is_said(tmp_path):
    empty = tmp_path / "empty"
    empty.mkdir()
    (tmp_path / "no.rrd").write_text("nothing")
    first = recorded(tmp_path / "a.rrd", waves(1, 60.0))
    for other, said in ((empty, "there is no bench.rrd"), (tmp_path / "gone", "there is no such"),
                        (tmp_path / "no.rrd", "no.rrd")):  # fmt: skip
        done = CliRunner().invoke(APP, [str(first), str(other)])
        assert done.exit_code == 2
        assert said in done.stderr


@pytest.mark.parametrize(
    ("table", "said"),
    [
        ("roll_rad\n0\n1\n", "has no column time_s"),
        ("time_s,roll_rad\n2,0\n1,1\n0,2\n", "times must rise"),
        ("time_s,roll_rad\n,0\n1,1\n2,2\n", "times must rise"),
    ],
)
def test_a_table_without_rising_times_is_refused(tmp_path, table, said):
    (tmp_path / "a.csv").write_text("time_s,roll_rad\n0,0\n1,1\n2,0\n")
    (tmp_path / "b.csv").write_text(table)
    done = CliRunner().invoke(APP, [str(tmp_path / "a.csv"), str(tmp_path / "b.csv")])
    assert done.exit_code == 2
    assert f"b.csv: {said}" in done.stderr.replace("\n", " ")


@pytest.mark.slow
def test_campaigns_in_the_same_waves_are_paired_and_their_passive_tank_is_the_same(tmp_path):
    strong, weak = ran(tmp_path, "strong"), ran(tmp_path, "weak", pressure_pa=1.5e4)
    by_run = {each["run"]: each for each in found(strong, weak)["comparisons"]}
    roll = by_run["gpc"]["figures"]["roll_rms_rad"]
    assert (roll["paired"], roll["count"]) == (True, 4)
    assert roll["difference"] == pytest.approx(roll["value"] - roll["reference"])
    peak = by_run["gpc"]["figures"]["pressure_peak_pa"]
    assert (peak["reference"], peak["value"]) == pytest.approx((5e4, 1.5e4), rel=0.02)
    passive = by_run["passive"]["figures"]["roll_rms_rad"]
    assert (passive["difference"], passive["half_width"]) == (0, 0)
    other = ran(tmp_path, "other", first=50)
    unpaired = found(strong, other)["comparisons"][0]["figures"]["roll_rms_rad"]
    assert not unpaired["paired"]
    done = CliRunner().invoke(APP, [str(strong), str(weak)])
    assert "pressure peak kPa" in done.stdout
    done = CliRunner().invoke(APP, [str(strong), str(recorded(tmp_path / "a.rrd", waves(1, 60.0)))])
    assert "name things of one kind" in done.output
