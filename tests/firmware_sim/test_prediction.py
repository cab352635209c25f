"""What `init` and `design tank` expect is what a bench of the same files gives."""

import json
import math
import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from typer.testing import CliRunner

from firmware_sim.bench import BenchResult, run_in_turn
from firmware_sim.commands.bench import STORM
from firmware_sim.figures import BenchFigures, figures
from firmware_sim.prediction import (
    ROLLS,
    SEEDS,
    Expected,
    Loading,
    as_json,
    laws_of,
    other_loadings,
    predict,
)
from firmware_sim.run import RECORD_S
from firmware_sim.scenario import Scenario
from firmware_sim.starter import scenario_file
from firmware_sim.tank_report import loading_table, percent, roll_rows
from utank_hil.analysis.loop.margins import of_period
from utank_hil.analysis.motion.statistics import Interval, PumpStatistics
from utank_hil.assembly import build_law
from utank_hil.base.arrays import FloatArray
from utank_hil.canbus import RetuningState
from utank_hil.cli import app
from utank_hil.configuration import load_config
from utank_hil.retuning import ShipFigures, estimator

OPV = "--length 90 --beam 14 --draught 4 --displacement 2000 --gm 1.1 --roll-period 10.5"
YACHT = "--length 40 --beam 8.5 --displacement 330 --gm 0.9 --roll-period 7 --roll-damping 0.04"
SHIPS = {
    "trawler, 24 m": "--length 24 --beam 7.5 --displacement 240 --gm 0.7 --draught 3",
    "yacht, 40 m": YACHT,
    "yacht at anchor in a short sea": f"{YACHT} --hs 0.5 --tp 5.5",
    "OPV in a high sea": f"{OPV} --hs 4 --tp 9",
    "supply vessel, 80 m": "--length 80 --beam 18 --draught 6 --displacement 6000 --gm 1.8",
    "ferry, 180 m": "--length 180 --beam 28 --draught 6.5 --displacement 20000 --gm 1.8",
    "bulk carrier in a high sea": "--length 200 --beam 32.2 --draught 11.5 --displacement 61000 "
    "--gm 2.5 --hs 6 --tp 12",
    "container ship, 330 m": "--length 330 --beam 45 --draught 14.5 --displacement 145000 --gm 1.5",
}


def project(folder: Path, words: str) -> dict[str, Any]:
    done = CliRunner().invoke(app, ["init", str(folder), *words.split(), "--json"])
    assert done.exit_code == 0, done.output
    found: dict[str, Any] = json.loads(done.stdout)
    return found


def bench_of(folder: Path) -> BenchResult:
    """Bench of a project, with the seed of its scenario."""
    scenario = load_config(folder / "scenario.yaml", Scenario)
    (config,) = scenario.controllers.values()
    return run_in_turn(scenario, scenario.seed, {"self_tuned": build_law(config)})


def expected_of(told: dict[str, Any]) -> Expected:
    """What a command said of one law, from its JSON."""
    read = {
        name: Interval(**value) if isinstance(value, dict) and "half_width" in value else value
        for name, value in told.items()
        if name not in ("renewed", "peaks")
    }
    pump = read.pop("pump")
    return Expected(**read, pump=pump and PumpStatistics(**pump))


def predicted(folder: Path) -> dict[str, Any]:
    """What is expected of a project whose files may have been changed."""
    scenario = load_config(folder / "scenario.yaml", Scenario)
    (config,) = scenario.controllers.values()
    return as_json(predict(scenario, config.plant, *laws_of(scenario, config)))


def part(result: BenchResult, begin_s: float, end_s: float) -> BenchFigures:
    """Figures of a bench from one time to another."""
    bare = result.without_tank_rad[: round(end_s / RECORD_S)]
    return figures(replace(result, settle_s=begin_s, end_s=end_s, without_tank_rad=bare))


def renewals(result: BenchResult) -> list[tuple[float, bool]]:
    """Times of a bench's log from which another law was in charge, and whether it knew the ship.

    A law on trial is in charge. None was taken back.
    """
    events = result.runs[1].events
    assert not {event.state for event in events} & {RetuningState.REFUSED, RetuningState.UNDONE}
    of_file = f"roll period {ShipFigures.of(result.scenario.vessel.ship).roll_period_s:.2f} s"
    return [
        (RECORD_S * round(event.time_ns * 1e-9 / RECORD_S), of_file not in event.reasons[0])
        for event in events
        if event.state is RetuningState.TRIAL
    ]


THREE_SIGMA = 3 / 1.96
"""Of some eighty figures that are judged by their 95 % intervals, four are to be outside them."""


def outside(told: dict[str, Any], result: BenchResult, times: float = 1.0) -> list[str]:
    """Figures of a bench that are outside so many times the interval stated for them.

    Those of the pump are of the law that was in charge; `renewed` is for an identified ship.
    """
    first, whole = expected_of(told), figures(result)
    passive = whole.runs[0]
    assert passive.roll is not None
    triples = [
        ("no tank", first.without_tank_rad, whole.no_tank.rms_rad),
        ("passive", first.passive_rad, passive.roll.rms_rad),
        ("below no tank", first.passive_below_no_tank, passive.roll_below_no_tank),
    ]
    end_s, then = result.end_s, renewals(result)
    until_s = min([time_s for time_s, _ in then], default=end_s)
    known_s = min([time_s for time_s, known in then if known], default=end_s)
    period_s = 2 * math.pi / result.scenario.ship_at(0.0).natural_frequency_rad_s
    laws = {
        "first": (first, result.settle_s, until_s),
        "renewed": (expected_of(told["renewed"]), known_s, end_s),
    }
    for name, (expected, begin_s, until_s) in laws.items():
        if until_s - begin_s <= ROLLS / 2 * period_s:
            continue  # fewer rolls have another interval
        bench = part(result, begin_s, until_s)
        active = bench.runs[1]
        assert active.roll is not None
        assert active.pump is not None
        triples += [
            (f"{name}: active", expected.active_rad, active.roll.rms_rad),
            (f"{name}: below passive", expected.active_below_passive, active.roll_below_passive),
            (f"{name}: mean power", expected.mean_power_w, active.pump.power_mean_w),
        ]
    return [
        f"{name}: {value} is not {interval}"
        for name, interval, value in triples
        if interval is None
        or value is None
        or abs(value - interval.mean) > times * interval.half_width
    ]


def test_what_init_says_of_an_opv_is_what_its_bench_gives(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It said 11 % below passive once, by a gentler law; the bench gave 50."""

    def half_as_long(*about: Any) -> str:
        return scenario_file(*about).replace("duration_s: 900", "duration_s: 480")

    monkeypatch.setattr("firmware_sim.starter.scenario_file", half_as_long)
    monkeypatch.setattr(estimator, "SEA_PERIODS", 60.0)  # the first law all along
    told = project(tmp_path / "opv", OPV)["expected"]
    result = bench_of(tmp_path / "opv")
    assert outside(told, result) == []
    assert renewals(result) == []
    expected, bench = expected_of(told), figures(result)
    assert expected.window_s == 420.0
    gain = expected.active_below_passive
    assert gain is not None
    assert gain.half_width < 0.1  # else anything would be inside
    assert told["renewed"]["active_below_passive"]["mean"] > gain.mean
    active, pump = bench.runs[1], expected.pump
    assert pump is not None
    assert active.pump is not None
    # more rolls than the bench's, so the greatest is greater, if by little
    assert 0.9 < pump.level_peak_m / active.pump.level_peak_m < 1.4
    assert expected.flow_peak_m3_s is not None
    assert active.flow_peak_m3_s is not None
    assert 0.9 < expected.flow_peak_m3_s / active.flow_peak_m3_s < 1.4
    assert pump.pressure_peak_pa == pytest.approx(active.pump.pressure_peak_pa, rel=0.1)
    assert pump.power_peak_w == pytest.approx(active.pump.power_peak_w, rel=0.05)


def outside_of_either(told: dict[str, Any], folder: Path) -> list[str]:
    """Figures outside their interval, of the first law all along and of the law for the waves."""
    found = outside(told, bench_of(folder), THREE_SIGMA)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(estimator, "SEA_PERIODS", 1000.0)
        first = bench_of(folder)
    assert renewals(first) == []
    return found + outside(told, first, THREE_SIGMA)


@pytest.mark.evidence
def test_a_pump_that_is_too_weak_is_expected_to_do_less(tmp_path: Path) -> None:
    told = project(tmp_path / "opv", OPV)["expected"]
    ship = tmp_path / "opv" / "ship.yaml"
    text = ship.read_text()
    for key in ("max_pressure_pa", "max_power_w"):
        text = re.sub(rf"({key}: )(\S+)", lambda m: f"{m[1]}{0.3 * float(m[2]):.4g}", text)
    ship.write_text(text)
    expected = predicted(tmp_path / "opv")
    assert outside_of_either(expected, tmp_path / "opv") == []
    for weak, strong in ((expected, told), (expected["renewed"], told["renewed"])):
        assert weak["active_below_passive"]["mean"] < strong["active_below_passive"]["mean"] - 0.1


@pytest.mark.evidence
@pytest.mark.parametrize("words", SHIPS.values(), ids=SHIPS)
def test_what_init_says_is_what_the_bench_gives(words: str, tmp_path: Path) -> None:
    told = project(tmp_path / "ship", words)["expected"]
    assert outside_of_either(told, tmp_path / "ship") == []


@pytest.fixture
def short(monkeypatch: pytest.MonkeyPatch) -> Scenario:
    """The storm, of which few rolls are predicted."""
    monkeypatch.setattr("firmware_sim.prediction.ROLLS", 4)
    return load_config(STORM, Scenario)


def test_without_a_law_the_tank_is_passive(short: Scenario) -> None:
    (found,) = predict(short, next(iter(short.controllers.values())).plant, None)
    assert (found.active_rad, found.active_below_passive, found.pump) == (None, None, None)
    assert found.passive_rad is not None
    assert found.without_tank_rad is not None
    assert found.passive_below_no_tank is not None
    share = 1 - found.passive_rad.mean / found.without_tank_rad.mean
    assert found.passive_below_no_tank.mean == pytest.approx(share)


def test_a_ship_that_capsizes_has_no_roll(short: Scenario, monkeypatch: pytest.MonkeyPatch) -> None:
    def capsizing(scenario: Scenario, seed: int, count: int) -> tuple[FloatArray, float]:
        return np.ones(count), 12.0 if seed == SEEDS[-1] else math.inf

    monkeypatch.setattr("firmware_sim.prediction.roll_without_tank", capsizing)
    (found,) = predict(short, next(iter(short.controllers.values())).plant, None)
    assert (found.without_tank_rad, found.passive_below_no_tank) == (None, None)
    assert found.passive_rad is not None


def test_another_loading_is_the_same_tank_on_a_softer_ship_in_the_same_waves(
    short: Scenario,
) -> None:
    plant = next(iter(short.controllers.values())).plant
    (own,) = predict(short, plant, None)
    found = {each.period_scale: each.expected for each in other_loadings(short, plant, None, own)}
    assert found[1.0] is own
    ship = of_period(short.vessel.ship, 1.3)
    vessel = short.vessel.model_copy(update={"ship": ship})
    assert (found[1.3],) == predict(short.model_copy(update={"vessel": vessel}), plant, None)
    assert found[1.3] != own


def test_a_law_that_rolls_the_ship_more_is_marked() -> None:
    """A law with all margins may swing at its pump's limit on a softer ship."""
    roll = Interval(0.1, 0.01)
    good = Expected(840.0, roll, roll, roll, active_below_passive=Interval(0.3, 0.1))
    bad = Expected(840.0, roll, roll, roll, active_below_passive=Interval(-0.1, 0.3))
    table = loading_table([Loading(1.0, good), Loading(1.3, bad)])
    assert [cell[0] for cell in table.columns[3].cells] == ["5", "*"]
    assert "ROLL_AMPLIFIED" in str(table.caption)
    assert loading_table([Loading(1.0, good)]).caption is None


def test_an_interval_of_power_has_no_more_digits_than_its_mean():
    pump = PumpStatistics(3.1e3, 7.3e3, 3.87e3, 19.8e3, 0.58)
    roll, power = Interval(0.02, 0.002), Interval(3870.0, 594.0)
    found = Expected(840.0, roll, roll, roll, mean_power_w=power, pump=pump, flow_peak_m3_s=1.82)
    assert dict(roll_rows([found]))["shaft power mean"] == "3.87 ± 0.59 kW"


def test_a_pump_to_order_does_for_both_laws():
    roll = Interval(0.02, 0.002)
    first = Expected(
        840.0, roll, roll, roll, mean_power_w=Interval(450.0, 70.0), flow_peak_m3_s=0.69,
        pump=PumpStatistics(1.3e3, 4.5e3, 450.0, 4.4e3, 0.52),
    )  # fmt: skip
    renewed = Expected(
        840.0, roll, roll, Interval(0.01, 0.001), mean_power_w=Interval(730.0, 90.0),
        flow_peak_m3_s=0.81, pump=PumpStatistics(1.7e3, 6.2e3, 730.0, 7.8e3, 0.47),
    )  # fmt: skip
    rows = dict(roll_rows([first, renewed]))
    assert rows["pressure at most"] == "6.2 kPa"
    assert rows["level, flow at most"] == "0.52 m, 0.81 m³/s"
    assert rows["shaft power at most"] == "7.8 kW"
    assert rows["shaft power mean, first law"] == "450 ± 70 W"
    assert rows["shaft power mean, renewed"] == "730 ± 90 W"
    told = as_json([first, renewed])
    most = {"pressure_pa": 6.2e3, "level_m": 0.52, "flow_m3_s": 0.81, "power_w": 7.8e3}
    assert told["peaks"] == most
    assert told["active_rad"]["mean"] == 0.02
    assert told["renewed"]["active_rad"]["mean"] == 0.01
    passive = as_json([Expected(840.0, roll, roll)])
    assert (passive["renewed"], passive["peaks"]) == (None, None)


def test_a_law_that_is_not_renewed_is_foretold_alone(short: Scenario) -> None:
    (law,) = laws_of(short, short.controllers["gpc"])
    assert law is not None


def test_a_share_of_nothing_has_no_sign():
    assert percent(Interval(-0.003, 0.41)) == "0% ± 41%"
    assert percent(Interval(-0.013, 0.41)) == "-1% ± 41%"
    assert percent(None) == ""
