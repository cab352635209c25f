"""Which runs of a bench count, and what the others leave empty."""

import dataclasses
import json
import math
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from firmware_sim.bench import BenchResult
from firmware_sim.figures import figures, mark_of
from firmware_sim.model_limits import MODEL_LIMITS, passed_limits, steepness
from firmware_sim.report_page import bar_of, bench_page
from firmware_sim.report_tables import in_one_unit, motion_table, pump_table
from firmware_sim.run import COLUMNS, RECORD_S, Run
from firmware_sim.scenario import Scenario
from firmware_sim.scenario_sea import JonswapSea
from utank_hil.base.provenance import describe
from utank_hil.canbus import Fault, Mode
from utank_hil.configuration import load_config
from utank_hil.console.exit_codes import ExitCode
from utank_hil.nodes.panel import Action, TimedAction
from utank_hil.safety.faults import fault_text
from utank_hil.sea import Spectrum

STORM = load_config(Path("configs/scenarios/storm.yaml"), Scenario)
LENGTH = 2000
SETTLE_S, END_S = 20.0, 100.0
READY_S = 1.0


def run(
    name: str,
    roll_rad: float,
    mode: Mode = Mode.ACTIVE,
    from_s: float = 6.5,
    **changes: object,
) -> Run:
    """A run that rolls regularly, and comes into `mode` from STANDBY at a time."""
    rows = np.zeros((LENGTH, len(COLUMNS)))
    time_s = RECORD_S * np.arange(LENGTH)
    rows[:, COLUMNS.index("time_s")] = time_s
    rows[:, COLUMNS.index("true_roll_rad")] = math.sqrt(2) * roll_rad * np.sin(time_s)
    rows[:, COLUMNS.index("mode")] = np.where(time_s < READY_S, Mode.INIT, Mode.STANDBY)
    rows[time_s >= from_s, COLUMNS.index("mode")] = mode
    return dataclasses.replace(Run(name, rows, 0.2, 0, 1.0), **changes)


def with_column(run: Run, name: str, value: float, where: slice) -> Run:
    rows = run.rows.copy()
    rows[where, COLUMNS.index(name)] = value
    return dataclasses.replace(run, rows=rows)


PASSIVE_RUN = run("passive", 0.04, Mode.PASSIVE, 2.5)


def result_of(*runs: Run, operator: tuple[TimedAction, ...] = STORM.operator) -> BenchResult:
    return BenchResult(
        STORM.model_copy(update={"operator": operator}),
        "lockstep",
        1,
        END_S,
        SETTLE_S,
        END_S,
        0.05 * math.sqrt(2) * np.sin(RECORD_S * np.arange(LENGTH)),
        runs,
        (),
        False,
        1.0,
    )


def test_runs_that_count_are_ranked_by_their_roll_with_reductions() -> None:
    result = result_of(PASSIVE_RUN, run("a", 0.03), run("b", 0.02))
    told = {each.name: each for each in figures(result).compared}
    assert [told[name].rank for name in ("passive", "a", "b")] == [3, 2, 1]
    assert told["b"].roll_below_no_tank == pytest.approx(0.6)
    assert told["b"].roll_below_passive == pytest.approx(0.5)
    assert figures(result).endings == ()
    assert figures(result).exit_code == ExitCode.OK
    assert list(motion_table(figures(result)).columns[6].cells) == ["", "", "100%", "100%"]


BAD = {
    "capsized": (
        run("bad", 0.01, capsized_s=55.5),
        "the ship capsized at 55.5 s",
    ),
    "fault": (
        with_column(
            with_column(run("bad", 0.01), "mode", Mode.FAULT, slice(1990, None)),
            "fault",
            Fault.MOTION_SILENT,
            slice(1990, None),
        ),
        f"the controller ended in FAULT, fault {fault_text(Fault.MOTION_SILENT)}",
    ),
    "idle": (
        run("bad", 0.01, from_s=30.0),
        "the controller was in ACTIVE for 87.5% of the time that the operator wanted it there",
    ),
}


@pytest.mark.parametrize("word", BAD)
def test_a_marked_run_is_not_ranked_gives_no_reduction_and_the_exit_code_says_so(word: str) -> None:
    bad, why = BAD[word]
    result = result_of(PASSIVE_RUN, bad, run("good", 0.02))
    told = {each.name: each for each in figures(result).compared}
    marked = told["bad"]
    assert (marked.ranked, marked.rank) == (False, None)
    assert marked.roll_below_no_tank is marked.roll_below_passive is None
    assert [told[name].rank for name in ("good", "passive")] == [1, 2]
    assert told["good"].roll_below_passive == pytest.approx(0.5)
    (said,) = figures(result).endings
    assert said.startswith(f"bad: not ranked, {why}")
    assert figures(result).exit_code == ExitCode.NOT_RANKED
    rows = list(
        zip(*(column.cells for column in motion_table(figures(result)).columns), strict=True)
    )
    assert [row[0] for row in rows] == ["no tank", "passive", "good", "bad"]
    assert rows[-1][4:6] == (word, "")
    json_run = json.loads(json.dumps(figures(result).as_json({}, {}), allow_nan=False))["runs"][1]
    assert json_run["mark"]["word"] == word
    assert json_run["mark"]["why"].startswith(why)
    assert (json_run["ranked"], json_run["rank"], json_run["roll_below_passive"]) == (
        False, None, None,
    )  # fmt: skip


@pytest.mark.parametrize(
    "passive",
    [
        dataclasses.replace(PASSIVE_RUN, capsized_s=70.0),
        run("passive", 0.04, Mode.STANDBY),  # the drive is off: another tank
    ],
    ids=["capsized", "rotor free"],
)
def test_nothing_is_said_to_be_below_a_passive_run_that_does_not_count(passive: Run) -> None:
    result = result_of(passive, run("good", 0.02))
    _, good = figures(result).compared
    assert good.roll_below_passive is None
    assert good.roll_below_no_tank == pytest.approx(0.6)
    assert figures(result).exit_code == ExitCode.NOT_RANKED


def test_nothing_is_said_to_be_below_a_bare_ship_that_capsized() -> None:
    result = result_of(PASSIVE_RUN, run("good", 0.02))
    result = dataclasses.replace(result, without_tank_capsized_s=88.0)
    _, good = figures(result).compared
    assert good.roll_below_no_tank is None
    assert good.roll_below_passive == pytest.approx(0.5)
    assert figures(result).endings == ("no tank: the ship capsized at 88.0 s",)
    assert figures(result).exit_code == ExitCode.OK  # that the tank kept her up is what it is for
    assert figures(result).as_json({}, {})["no_tank"]["capsized_s"] == 88.0


def test_time_in_which_the_operator_wanted_no_controller_does_not_count() -> None:
    disarmed = with_column(run("a", 0.03), "mode", Mode.PASSIVE, slice(1220, None))
    script = (TimedAction(5.0, Action.ARM), TimedAction(60.0, Action.DISARM))
    result = result_of(PASSIVE_RUN, disarmed, operator=script)
    assert mark_of(result, disarmed) is None
    assert figures(result).compared[1].active_share == pytest.approx(41 / 80)
    assert mark_of(result_of(PASSIVE_RUN, disarmed), disarmed) is not None
    never = result_of(PASSIVE_RUN, disarmed, operator=(TimedAction(5.0, Action.PASSIVE),))
    mark = mark_of(never, disarmed)
    assert (mark.word, mark.why) == (
        "idle",
        "no order to go to ACTIVE before the end of the window",
    )


def test_operators_clock_starts_when_the_controller_is_ready() -> None:
    slow = with_column(run("a", 0.03, from_s=46.0), "mode", Mode.INIT, slice(0, 800))
    assert mark_of(result_of(PASSIVE_RUN, slow), slow) is None
    late = run("a", 0.03, from_s=46.0)
    assert mark_of(result_of(PASSIVE_RUN, late), late) is not None


def test_a_run_without_a_row_is_said_by_the_exit_code() -> None:
    result = dataclasses.replace(result_of(PASSIVE_RUN, run("a", 0.03)), not_run=("b",))
    assert figures(result).endings == ("not run: b",)
    assert figures(result).exit_code == ExitCode.NOT_RANKED


def test_ninety_percent_in_charge_is_enough_and_less_is_not() -> None:
    for share, counts in ((0.91, True), (0.89, False)):
        late = run("a", 0.03, from_s=END_S - share * (END_S - SETTLE_S))
        assert (mark_of(result_of(PASSIVE_RUN, late), late) is None) == counts


def test_what_passes_a_limit_of_the_model_is_said_with_its_figure() -> None:
    assert passed_limits(result_of(PASSIVE_RUN, run("a", 0.03))) == []
    wild = dataclasses.replace(
        run("wild", math.radians(30.0)),
        strikes=12,
        max_strike_impulse_nms=3.4e6,
        pump_speed_rad_s=1.1 * STORM.vessel.pump.max_speed_rad_s,
    )
    result = result_of(PASSIVE_RUN, wild)
    steep = JonswapSea(kind="jonswap", hs_m=7.2, tp_s=7.0)
    changes = {"sea": steep, "plant": "linear"}
    result = dataclasses.replace(result, scenario=STORM.model_copy(update=changes))
    said = passed_limits(result)
    assert len(said) == len(MODEL_LIMITS)
    for words, expected in zip(
        said,
        ("wild rolled to 42°", "wild rolled to 42°",
         "wild: water struck roof or bottom 12 times, at most with 3.4 MN m",
         "the sea's steepness is ", "wild: rotor at "),
        strict=True,
    ):  # fmt: skip
        assert words.startswith("limit of the model passed, ")
        assert expected in words
    assert figures(result).as_json({}, {})["limits_passed"] == tuple(passed_limits(result))


def test_level_beyond_the_tank_without_a_strike_is_said_too() -> None:
    through = with_column(run("linear", 0.03), "true_level_m", -5.5, slice(500, 501))
    (said,) = passed_limits(result_of(PASSIVE_RUN, through))
    assert "linear: level of 5.50 m with room for 4.88 m" in said


def test_steepness_is_that_of_height_and_zero_crossing_period() -> None:
    # 9 s in deep water is 126.5 m long
    narrow = Spectrum(np.array([0.110, 1 / 9, 0.112]), np.array([0.0, 500.0, 0.0]))
    found, most = steepness(narrow)
    assert found == pytest.approx(narrow.hs_m / (9.81 * 81 / (2 * math.pi)), rel=2e-3)
    assert most == pytest.approx((1 / 10 + 1 / 15) / 2, rel=1e-3)


@given(st.lists(st.floats(0, 1e8), min_size=1, max_size=8))
def test_a_column_has_one_unit_in_which_its_largest_value_is_readable(values: list[float]) -> None:
    unit, cells = in_one_unit(values, "W")
    scale = {"W": 1.0, "kW": 1e3, "MW": 1e6}[unit]
    for value, cell in zip(values, cells, strict=True):
        assert float(cell) * scale == pytest.approx(value, abs=0.005 * max(*values, 1.0))
    if max(values) >= 1.0:
        assert 1.0 <= max(values) / scale < 1e3
        assert max(len(cell.replace(".", "")) for cell in cells) >= 3


def test_small_ships_pumps_are_shown_in_kilowatts() -> None:
    weak = with_column(run("a", 0.03), "true_shaft_power_w", 4.2e3, slice(None))
    table = pump_table(figures(result_of(PASSIVE_RUN, weak)))
    assert [column.header for column in table.columns][3:5] == ["power\nmean kW", "power\npeak kW"]
    assert list(table.columns[3].cells) == ["0.00", "4.20"]


def test_no_peak_of_the_pressure_reads_less_than_its_rms() -> None:
    still = with_column(run("a", 0.03), "true_pressure_pa", 12.0, slice(None))
    pressed = with_column(run("b", 0.03), "true_pressure_pa", 12_300.0, slice(None, None, 9))
    table = pump_table(figures(result_of(PASSIVE_RUN, still, pressed)))
    rms, peak = (list(map(float, column.cells)) for column in table.columns[1:3])
    assert peak[-1] > rms[-1] > 0
    assert all(most >= mean for mean, most in zip(rms, peak, strict=True))


def test_the_picture_says_power_by_three_digits_and_no_difference_of_nothing() -> None:
    weak = with_column(run("a", 0.03), "true_shaft_power_w", 102_700.0, slice(None))
    found = figures(result_of(PASSIVE_RUN, weak)).runs[1]
    for below, words in ((-0.001, "as passive"), (-0.02, "2% above passive")):
        bar = bar_of(dataclasses.replace(found, roll_below_passive=below), "C0")
        assert bar.cost == "103, at most 103 kW"
        assert bar.said == f"1.73°   {words}"


def test_the_page_says_the_sea_and_the_command_that_gives_it_again() -> None:
    result = result_of(PASSIVE_RUN, run("a", 0.03))
    options = {"scenario": "my seas/storm.yaml", "duration": 80000.125}
    options |= {"real_time": True, "out": "o"}
    about = describe("bench", result.scenario, Path.cwd(), options=options, seed=3)
    said = bench_page(figures(result), about, None, {}).sections[0].texts
    again = "Again: utank-hil bench 'my seas/storm.yaml' --seed 3 --duration 80000.125 --realtime"
    assert said[-1] == again
    height = 4 * math.sqrt(result.scenario.sea.sea(result.scenario.seed).elevation.variance)
    assert f"significant height {height:.2f} m" in said[1]


def test_the_page_of_a_short_window_carries_its_interval() -> None:
    result = result_of(PASSIVE_RUN, run("a", 0.03))
    about = describe("bench", result.scenario, Path.cwd(), options={}, seed=1)
    page = bench_page(figures(result), about, None, {})
    # 80 s of a ship of 0.5 rad/s: 1.96 / 2 / sqrt(0.1 * 0.5 * 80)
    assert "uncertain by ±49% (95 %)" in " ".join(page.verdicts[0].lines)
