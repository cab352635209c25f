"""The campaign: its rows against the fault table, its judgement, and all of it in one sea."""

import errno
import json
import math
import os
import signal
import time
from concurrent.futures.process import BrokenProcessPool
from dataclasses import replace
from functools import cache
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast
from xml.etree import ElementTree

import numpy as np
import pytest
import typer
import yaml
from judged_rows import CAMPAIGN, GOOD, ROWS, verdict
from pydantic import ValidationError
from typer.testing import CliRunner

from firmware_sim.commands import faults as commands
from firmware_sim.fault_campaign import runner
from firmware_sim.fault_campaign import verdict as verdicts
from firmware_sim.fault_campaign.campaign import Campaign, Limit, Row
from firmware_sim.fault_campaign.runner import run_rows
from firmware_sim.fault_campaign.trial import Sea, Window, in_a_copy, times_of
from firmware_sim.fault_campaign.verdict import judged
from firmware_sim.fault_campaign.watch import BusLog, Watch, first_difference
from firmware_sim.live_faults import rows as live
from firmware_sim.live_faults.bench import LiveTimes
from firmware_sim.scenario import Scenario
from utank_hil.assembly import build_law
from utank_hil.canbus import Fault, Mode
from utank_hil.configuration import ConfigError, ControllerConfig, load_config
from utank_hil.configuration.devices import DevicesSection
from utank_hil.configuration.files import problems_in_words
from utank_hil.console.common import KILLED
from utank_hil.console.exit_codes import ExitCode
from utank_hil.control.limiter import CommandLimiter
from utank_hil.nodes.running_law import RunningLaw
from utank_hil.safety.faults import FAULTS
from utank_hil.safety.monitors.drive import DriveFollowing
from utank_hil.safety.supervisor import Supervisor
from utank_hil.telemetry.recording_reader import read_recording

commands_load = commands.load


def test_what_a_requirement_says_shows_it_is_there():
    for each in CAMPAIGN.requirements:
        for place in each.elsewhere.split(", "):
            assert not place or Path(place.strip("`")).exists()


TEXT = Path("configs/faults/campaign.yaml").read_text()


def problems_of(text):
    """Keys of what is wrong in a campaign with other text, its setups left as they are."""
    content = yaml.load(text, yaml.CSafeLoader) | {"setups": CAMPAIGN.setups}
    with pytest.raises(ValidationError) as caught:
        Campaign.model_validate(content)
    return [
        ".".join(map(str, key)) for key, _ in problems_in_words(caught.value, content, Campaign)
    ]


@pytest.mark.parametrize(
    ("old", "new", "key"),
    [
        ("id: motion-silent,", "id: tank-silent,", "rows.9.id"),
        ("meets: [F05]", "meets: [F99]", "rows.26.meets"),
        ("setup: wind", "setup: calm", "rows.68.fault.setup"),
        ("codes: [LEVEL_LIMIT]", "codes: [LEVEL]", "rows.65.expect.codes.0"),
        ("meets: [F17", "meets: [F18", "requirements"),
        ("{id: F01, ", "{id: F02, ", "requirements.0.id"),
        ("setup: valve,", "setup: pump,", "rows.170.fault.inject.0"),
        ("codes: [DRIVE_WARNING]", "codes: []", "rows.142.expect.codes"),
        ("fault_s: 40.0", "fault_s: 1.0e+300", "fault_s"),
        ("arm_s: 1.0", "arm_s: 1.0e+300", "arm_s"),
        ("followed_s: 92", "followed_s: 1.0e+300", "rows.69.fault.followed_s"),
        ("for_s: 0.7}]", "for_s: 0.7, at_s: 43}]", "rows.61.fault.inject.9.at_s"),
        ("roll: 1.5, roll_window_s: 600", "roll_window_s: 1.0e+300", "rows.58.limit.roll_window_s"),
    ],
)
def test_what_is_wrong_in_a_campaign_is_named(old, new, key):
    assert old in TEXT
    assert any(problem.startswith(key) for problem in problems_of(TEXT.replace(old, new)))


def test_a_controller_that_the_scenario_lacks_is_named_in_its_file(tmp_path):
    """The one wrong campaign that is read as a command reads it, scenarios and all."""
    scenarios = Path("configs/scenarios").resolve()
    text = TEXT.replace("controller: on_off", "controller: off")
    path = tmp_path / "campaign.yaml"
    path.write_text(text.replace("../scenarios", str(scenarios)))
    with pytest.raises(ConfigError) as caught:
        load_config(path, Campaign)
    assert [each.key for each in caught.value.problems] == ["setups.valve.controller"]


def test_any_hundred_seas_have_each_phase_of_a_second_and_any_five_each_of_50_ms():
    ticks = [round(100 * CAMPAIGN.fault_at_s(seed)) for seed in range(1, 301)]
    for first in range(200):
        assert len({tick % 100 for tick in ticks[first : first + 100]}) == 100
        assert len({tick % 5 for tick in ticks[first : first + 5]}) == 5
    assert all(0 <= tick - round(100 * CAMPAIGN.fault_s) < 100 for tick in ticks)


@pytest.mark.parametrize(
    ("row", "active_s", "over_s", "found_s", "found_ms"),
    [
        ("motion-silent", 1.0, None, 40.5, 500.0),  # from the fault, at 40 s
        ("both-signs-from-start", 41.0, 43.0, 44.0, 1000.0),  # from the later of both
        ("both-signs-from-start", 43.0, 41.0, 44.0, 1000.0),
        ("rate-stuck", 1.0, 41.0, 41.2, 200.0),  # from where the difference shows
        ("rate-stuck", 1.0, 41.0, 40.8, 0.0),  # found before that
        ("rate-stuck", 1.0, None, 40.8, 0.0),
        ("rate-stuck", 1.0, 41.0, None, None),
    ],
)
def test_from_when_a_row_counts(row, active_s, over_s, found_s, found_ms):
    first_s = {"active": active_s, "found": found_s}
    assert times(row, first_s, over_s, 40.0).get("found") == found_ms


def times(row, first_s, over_s, pressed_s):
    """Times of a row whose fault began at 40 s."""
    first_ns = {name: round(each * 1e9) for name, each in first_s.items() if each is not None}
    over_ns = None if over_s is None else round(over_s * 1e9)
    watch = SimpleNamespace(first_ns=first_ns, over_ns=over_ns, pressed_ns=round(pressed_s * 1e9))
    return times_of(ROWS[row], cast(Any, watch), BusLog(), 40_000_000_000)


def test_what_is_found_before_it_counts_has_no_more_time_to_zero():
    found = times("rate-stuck", {"active": 1.0, "found": 41.0}, 51.0, 43.0)
    assert (found["found"], found["zero"]) == (0.0, 2010.0)


@pytest.mark.evidence("motion-silent")
@pytest.mark.slow
@pytest.mark.parametrize("row", ["motion-silent", "tank-silent"])
def test_a_ramp_that_is_a_cut_is_not_passed(row, monkeypatch):
    assert verdict(row, outcome_of(ROWS[row])).passed
    monkeypatch.setattr(CommandLimiter, "ramp_to_zero", CommandLimiter.cut)
    problems = verdict(row, outcome_of(ROWS[row])).problems
    assert [why.partition(" at ")[0] for why in problems] == ["seed 1: commands changed"]


@pytest.mark.slow
def test_what_the_operator_does_is_not_taken_for_the_fault():
    accepts = {"time_s": 0.1, "action": "accept"}
    beyond = {"kind": "lost", "message": "SENSOR_MOTION", "at_s": 3.999, "for_s": 0.0005}
    assert outcome_of(row_of("none", inject=(beyond,), operator=(accepts,))).wire == ""
    assert outcome_of(row_of("none", operator=(accepts,))).wire != ""


@pytest.mark.evidence("3")
@pytest.mark.slow
@pytest.mark.parametrize("seed", [1, 3])
def test_a_fault_that_changes_nothing_is_not_on_the_bus(seed):
    """Whatever the phase of the messages' cycles in which it begins."""
    rare = {"kind": "bit_errors", "share": 1e-12}
    outcome = outcome_of(row_of("none", inject=(rare,)), seed=seed)
    assert outcome.wire == ""


def row_of(reaction, **fault):
    """A row that asks for a reaction to what is done."""
    return Row.model_validate(
        {"id": "row", "meets": ("F01",), "fault": fault, "expect": {"reaction": reaction}}
    )


def begun(sea, row):
    """A bench with the faults of a row in it, and the log of its bus."""
    bench, log = sea._start() if row.fault.from_start else sea._underway
    bench.place(row.fault.inject)
    bench.join([Watch(bench, row)])
    return bench, log.frames


def frames(sea, row, seconds):
    bench, log = begun(sea, row)
    bench.run(bench.lockstep.now_ns + round(seconds * 1e9))
    return log


def differs(sea, row, whole, seconds):
    """Whether the bus of a row differs from another's, second by second up to where it does."""
    bench, log = begun(sea, row)
    for _ in range(math.ceil(seconds)):
        bench.run(bench.lockstep.now_ns + 1_000_000_000)
        if log != whole[: len(log)]:
            return True
    return False


@pytest.mark.slow
@pytest.mark.parametrize(
    "name",
    [
        pytest.param(row.id, marks=() if row.id == "second-panel-arms" else pytest.mark.evidence)
        for row in CAMPAIGN.rows
        if len(row.fault.inject) > 1
    ],
)
def test_of_a_row_with_several_faults_each_is_on_the_bus(name):
    """A row that needs them all could otherwise pass with one of them."""
    row = ROWS[name]
    sea = sea_of(row.fault.setup, 1, False)
    inject = row.fault.inject
    # the same again, seconds later, is placed as the first was
    tried = [index for index, each in enumerate(inject) if each.at_s < 4.0]
    seconds = max(inject[index].at_s for index in tried) + 8.0
    whole = in_a_copy(lambda: frames(sea, row, seconds))
    for index in tried:
        fault = inject[index]
        never = fault.model_copy(update={"at_s": 1000.0})
        others = (*inject[:index], never, *inject[index + 1 :])
        without = row.model_copy(update={"fault": trial(row, inject=others)})
        seen = in_a_copy(lambda without=without: differs(sea, without, whole, seconds))
        assert seen, f"without fault {index} nothing is different"


def _after(seconds, mode):
    """What a supervisor does in FAULT that leaves it by itself."""
    since: dict[int, int] = {}
    sound = Supervisor._while_faulted

    def while_faulted(self, seen, now_ns):
        sound(self, seen, now_ns)
        if now_ns - since.setdefault(id(self), now_ns) >= seconds * 1e9:
            self.mode = mode

    return while_faulted


@pytest.mark.evidence(
    "Supervisor-_while_faulted-while_faulted-levels-stuck-not latched",
    "Supervisor-_while_faulted-while_faulted-levels-stuck-armed again",
)
@pytest.mark.slow
@pytest.mark.parametrize(
    ("owner", "name", "broken", "row", "words"),
    [
        (Supervisor, "_while_faulted", _after(2.0, Mode.STANDBY), "levels-stuck", "not latched"),
        (Supervisor, "_while_faulted", _after(15.0, Mode.ACTIVE), "levels-stuck", "armed again"),
        (RunningLaw, "share", lambda *_: 1.0, "roll-drift-slow", "more than it may"),
        (DriveFollowing, "update", lambda *_, **__: 0, "pump-stalled", "was not found"),
    ],
)
def test_a_controller_that_is_broken_passes_no_row(owner, name, broken, row, words, monkeypatch):
    monkeypatch.setattr(owner, name, broken)
    outcome = outcome_of(ROWS[row], patient=True)
    assert any(words in why for why in verdict(row, outcome).problems)


@pytest.mark.slow
def test_a_pump_that_was_wrong_for_long_was_to_be_found_then():
    """The count does not begin anew with each time that the command crosses the pressure."""
    bench: Any = SimpleNamespace(
        node=SimpleNamespace(
            mode=Mode.ACTIVE, fault=Fault.NONE,
            safety=SimpleNamespace(
                alarms=SimpleNamespace(codes=set()),
                supervisor=SimpleNamespace(mode=Mode.ACTIVE, fault=Fault.NONE, degraded=False),
            ),
            inbox=SimpleNamespace(watched=(), foreign=0, discarded=0),
            measured=SimpleNamespace(pressure_pa=0.0),
        ),
        ship=SimpleNamespace(
            drive=SimpleNamespace(setpoint_pa=0.0), valve=None,
            plant=SimpleNamespace(roll_rad=0.0),
        ),
        lockstep=SimpleNamespace(now_ns=0),
    )  # fmt: skip
    row = row_of("none")
    limit: dict[str, Any] = {"counts_from": {"pressure_pa": 12e3}}
    watch = Watch(bench, row.model_copy(update={"limit": Limit(**limit, found_ms=250.0)}))
    for tick in range(400):
        bench.ship.drive.setpoint_pa = 20e3 * math.sin(2 * math.pi * tick / 100)
        watch.tick(10_000_000 * tick)
    assert watch.over_ns is not None
    slow = watch.over_ns
    watch = Watch(bench, row.model_copy(update={"limit": Limit(**limit, found_ms=350.0)}))
    for tick in range(400):
        bench.ship.drive.setpoint_pa = 20e3 * math.sin(2 * math.pi * tick / 100)
        watch.tick(10_000_000 * tick)
    assert slow < 500_000_000 < (watch.over_ns or 10**12)


@pytest.mark.slow
def test_what_the_drive_refuses_is_counted():
    beyond = {
        "kind": "value",
        "message": "PUMP_CMD",
        "values": {"pressure_pa": 60e3},
        "for_s": 0.05,
    }
    outcome = outcome_of(row_of("none", inject=(beyond,)))
    assert 2 <= outcome.refused <= 3


@pytest.mark.slow
def test_who_arms_by_himself_once_the_bus_is_no_longer_followed_is_found_all_the_same():
    pressed = ((3.0, "disarm"), (4.0, "reset"), (6.0, "arm"))
    row = row_of(
        "ramp",
        followed_s=0.2,
        inject=({"kind": "lost", "message": "SENSOR_TANK", "for_s": 1.5},),
        operator=tuple({"time_s": time_s, "action": action} for time_s, action in pressed),
    )
    outcome = outcome_of(row)
    assert (outcome.mode, outcome.armed_again) == ("ACTIVE", True)


@pytest.mark.slow
def test_where_nobody_arms_nothing_is_found():
    fault = {"kind": "value", "message": "OPERATOR_CMD", "values": {"arm": False}}
    row = row_of("stop", inject=(fault,), from_start=True)
    outcome = outcome_of(row)
    assert outcome.code == "NONE"
    (problem, *_) = judged(CAMPAIGN, row, [outcome])["problems"]
    assert problem == f"seed 1: was not found; instead: nothing, and ended in {outcome.mode}"


def test_first_difference_of_two_logs():
    log = [(1, 2, b"a"), (3, 2, b"b")]
    assert first_difference(log, log, 10) is None
    assert first_difference(log, [log[0], (3, 2, b"c")], 10) == (log[1], (3, 2, b"c"))
    assert first_difference(log, log[:1], 10) == (log[1], None)
    assert first_difference(log, log[:1], 3) is None  # as far as both were followed


def test_a_copy_of_the_process_hands_back_what_it_did_and_changes_nothing():
    kept: list[int] = []
    assert in_a_copy(lambda: kept.append(1) or len(kept)) == 1
    assert not kept
    with pytest.raises(RuntimeError, match="ZeroDivisionError"):
        in_a_copy(lambda: 1 / 0)
    with pytest.raises(InterruptedError):
        in_a_copy(lambda: time.sleep(3600), lambda: True)
    with pytest.raises(BrokenProcessPool):
        in_a_copy(lambda: os.kill(os.getpid(), signal.SIGKILL))


def test_a_row_whose_copy_was_killed_gets_no_verdict(monkeypatch):
    def killed(_row):
        raise BrokenProcessPool

    sea = SimpleNamespace(prepare=lambda _: None, outcome=killed)
    monkeypatch.setattr(runner, "Sea", lambda *_, **__: sea)
    monkeypatch.setattr(runner, "shared", lambda: (CAMPAIGN, Window(), False, None, None))
    monkeypatch.setitem(runner._laws, ROWS[GOOD.row].fault.setup, None)
    with pytest.raises(BrokenProcessPool):
        runner._do(ROWS[GOOD.row].fault.setup, 1, [ROWS[GOOD.row]], True)


@pytest.mark.evidence
def test_a_stopped_ship_alone_rolls_as_she_does_on_the_bench():
    row = ROWS["motion-silent"]
    alone, bench = (
        outcome_of(row.model_copy(update={"fault": trial(row, followed_s=followed_s)}))
        for followed_s in (2.0, 12.0)
    )
    assert alone.variance == pytest.approx(bench.variance, rel=1e-9)


def trial(row, **changes):
    return row.fault.model_copy(update=changes)


@cache
def sea_of(setup, seed, patient):
    """A ship under way: what is done to it is done to copies."""
    whole = CAMPAIGN.setups[setup]
    law = law_of(setup)
    return Sea(CAMPAIGN, whole, law, seed, Window(12.0, 12.0), patient=patient)


@cache
def law_of(setup):
    return build_law(CAMPAIGN.setups[setup].config)


def outcome_of(row, *, seed=1, patient=False):
    sea = sea_of(row.fault.setup, seed, patient)
    sea.prepare([row])
    return sea.outcome(row)


def quick_rows():
    """Rows of a few seconds that are the first of a requirement, or of a fault's name."""
    seen: set[str] = set()
    rows = []
    for row in CAMPAIGN.rows:
        codes = row.expect.codes
        shows = {*row.meets, *codes[:1], *(f"{code} alone" for code in codes if len(codes) == 1)}
        if row.fault.setup == "pump" and row.fault.followed_s <= 6.0 and not shows <= seen:
            rows.append(row)
            seen |= shows
    return rows


def results_of(rows, window):
    # each task begins with a passive ship's ten minutes
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(runner, "ROWS_A_TASK", 100)
        outcomes = run_rows(CAMPAIGN, rows, [1], window, lambda _: None, lambda: False)
    return {row.id: verdict(row.id, *outcomes[row.id]) for row in rows}


@pytest.fixture(scope="module")
def results():
    return results_of([row for row in CAMPAIGN.rows if not row.long], Window(60.0, 20.0))


def assert_all_passed(results):
    failed = {name: each.problems for name, each in results.items() if not each.passed}
    # the mean of several seas is asked for, and one of them need not be
    assert all(why.startswith("rolls 1.") for why in failed.pop("both-signs-from-start", ()))
    assert not failed
    for name, each in results.items():
        assert math.isfinite(each.roll_ratio)
        assert each.wire or not ROWS[name].fault.inject


@pytest.mark.slow
def test_quick_rows_are_passed_in_one_sea():
    assert_all_passed(results_of(quick_rows(), Window(20.0, 8.0)))


@pytest.mark.evidence
def test_every_row_is_passed_in_one_sea_and_its_fault_was_on_the_bus(results):
    assert_all_passed(results)


@pytest.mark.evidence
def test_every_fault_of_the_table_was_the_name_of_one(results):
    named = {code for each in results.values() for code in each.codes}
    named |= {
        ROWS[name].expect.codes[0]
        for name, each in results.items()
        if len(ROWS[name].expect.codes) == 1 and each.outcomes[0].alarm is not None
    }
    # the first one's row takes long; of the other the valve itself may say it first
    assert {row.code.name for row in FAULTS} - named <= {"STABILITY_LOW", "VALVE_NOT_FOLLOWING"}


@pytest.mark.evidence
@pytest.mark.usefixtures("one_process")
def test_the_same_rows_again_give_the_same_to_the_last_digit(results):
    names = ("noise-10-fold", "flood-80-percent", "gateway-loses-5-percent", "rate-stuck")
    again = run_rows(
        CAMPAIGN, [ROWS[name] for name in names], [1], Window(60.0, 20.0), lambda _: None,
        lambda: False,
    )  # fmt: skip
    for name in names:
        assert verdict(name, *again[name]).told == results[name].told


@pytest.fixture(autouse=True)
def read_once(monkeypatch):
    """The fault table is read once for all commands; other campaigns are read by each."""

    def load(path, kind):
        return CAMPAIGN if path == commands.CAMPAIGN else commands_load(path, kind)

    monkeypatch.setattr(commands, "load", load)


def invoke(*arguments):
    app = typer.Typer()
    app.command()(commands.faults)
    return CliRunner().invoke(app, arguments)


@pytest.mark.evidence
@pytest.mark.usefixtures("one_process")
def test_command_prints_one_object():
    done = invoke("--rows", "roll-spike,F26", "--seeds", "1", "--json")
    assert done.exit_code == ExitCode.OK, done.output
    told = json.loads(done.stdout)
    assert {row["id"] for row in told["rows"]} == {"roll-spike", "roll-spikes"}
    assert {row["verdict"] for row in told["rows"]} == {"pass"}
    for row in told["rows"]:
        assert row["requirement"].startswith("F12: spike")
    assert told["not_run"]
    assert [each["id"] for each in told["not_run"]] == ["F26"]


def test_a_row_leaves_a_recording_of_its_first_sea(tmp_path, monkeypatch):
    row = next(row for row in CAMPAIGN.rows if row.id == "roll-spikes")
    setup = CAMPAIGN.setups[row.fault.setup]
    law = build_law(setup.config)
    sea = Sea(CAMPAIGN, setup, law, 1, Window(1.0, 1.0), recorded=True)
    sea.prepare([row])
    outcome = sea.outcome(row)
    monkeypatch.setattr(runner, "run_rows", lambda *_, **__: {row.id: [outcome]})
    done = invoke("--rows", row.id, "--seeds", "1", "--json", "--out", str(tmp_path))
    (told,) = json.loads(done.stdout)["rows"]
    (rows,) = read_recording(Path(told["recording"])).values()
    before_s = CAMPAIGN.fault_at_s(1) - rows["time_s"][0]
    assert before_s == pytest.approx(10.0, abs=0.11)
    assert np.abs(rows["true_roll_rad"] - rows["roll_rad"]).max() < 0.02
    assert json.loads(invoke("--rows", row.id, "--seeds", "1", "--json").stdout)["rows"][0][
        "recording"] is None  # fmt: skip


@pytest.mark.parametrize(("found_ms", "late"), [(500.0, False), (1e6, True)])
def test_a_row_that_fails_is_told_by_the_exit_code(found_ms, late, monkeypatch):
    outcome = replace(GOOD, found=found_ms)
    monkeypatch.setattr(runner, "run_rows", lambda *_, **__: {GOOD.row: [outcome]})
    done = invoke("--rows", GOOD.row, "--seeds", "1")
    assert done.exit_code == (ExitCode.REFUSED if late else ExitCode.OK), done.output
    assert ("allowed" in done.output) is late


@pytest.mark.parametrize(
    ("roll_deg", "found_ms", "said"), [(0.9, 1e6, True), (1.1, 1e6, False), (0.9, 500.0, False)]
)
def test_a_row_that_fails_in_a_calm_says_so_of_an_own_ship(roll_deg, found_ms, said, monkeypatch):
    variance = math.radians(roll_deg) ** 2
    outcome = replace(GOOD, found=found_ms, variance=variance, passive_variance=variance)
    monkeypatch.setattr(runner, "run_rows", lambda *_, **__: {GOOD.row: [outcome]})
    asked = "--rows", GOOD.row, "--seeds", "1"
    done = invoke(*asked, "--scenario", "configs/scenarios/storm.yaml")
    assert done.exit_code == (ExitCode.REFUSED if found_ms > 1e4 else ExitCode.OK)
    assert ("rolls 0.9 degrees RMS in this sea" in " ".join(done.stderr.split())) is said
    assert "in this sea" not in invoke(*asked).stderr


def test_a_place_for_the_junit_file_that_is_none_is_told_before_the_rows(tmp_path):
    done = invoke("--rows", GOOD.row, "--junit", str(tmp_path))
    assert done.exit_code == ExitCode.USAGE
    assert f"{tmp_path}: is a folder; choose another place with --junit" in done.stderr


@pytest.mark.usefixtures("_vcan7")
def test_live_rows_are_run_on_a_bus_alone_and_all_stands_in_the_junit_file(tmp_path, monkeypatch):
    monkeypatch.setattr(runner, "run_rows", lambda *_, **__: {GOOD.row: [GOOD]})
    xml, on_bus = tmp_path / "faults.xml", []

    def attempted(row, bus):
        on_bus.append(bus)
        killed = row is live.ROWS["live-controller-killed"]
        return ["the drive went on"] if killed else [], LiveTimes(50.0, 60.0, 0.0)

    monkeypatch.setattr(live, "attempted", attempted)
    asked = "--rows", f"{GOOD.row},live-controller", "--seeds", "1", "--junit", str(xml), "--json"
    done = invoke(*asked)
    assert done.exit_code == ExitCode.OK
    assert on_bus == []
    names = [name for name in live.ROWS if name.startswith("live-controller")]
    waiting = [{"id": name, "why": "needs a live bus: --bus"} for name in names]
    assert json.loads(done.stdout)["not_run"] == waiting
    assert len(ElementTree.parse(xml).findall("testcase/skipped")) == len(names)
    done = invoke(*asked, "--bus", "vcan7")
    assert done.exit_code == ExitCode.REFUSED
    told = json.loads(done.stdout)
    assert [row["id"] for row in told["rows"]] == [GOOD.row, *names]
    assert (told["passed"], told["failed"], told["not_run"]) == (len(names), 1, [])
    assert set(on_bus) == {"vcan7"}
    (failed,) = ElementTree.parse(xml).findall("testcase/failure")
    assert failed.text == "the drive went on"
    assert "passed, 60 ms of 500" in invoke(*asked[:-1], "--bus", "vcan7").stdout
    assert "need --bus" in invoke("--rows", "live").output


def test_a_bus_that_is_none_is_said_before_any_row_is_run(monkeypatch):
    monkeypatch.setattr(runner, "run_rows", lambda *_, **__: pytest.fail("a row was run"))
    done = invoke("--rows", f"{GOOD.row},live-controller", "--bus", "none0")
    assert done.exit_code == ExitCode.NO_BUS
    assert "--bus none0: " in done.stderr


@pytest.fixture
def _vcan7(monkeypatch):
    monkeypatch.setattr("utank_hil.console.loops.require_bus", lambda _: None)


@pytest.mark.usefixtures("_vcan7")
@pytest.mark.parametrize(
    ("signalled", "code", "why"),
    [(True, ExitCode.INTERRUPTED, "interrupted"), (False, ExitCode.SYSTEM, KILLED)],
)
def test_a_campaign_that_ends_early_judges_what_was_run_and_says_what_lacks(
    signalled, code, why, monkeypatch
):
    def run_rows(_, rows, seeds, *__, **___):
        if signalled:
            os.kill(os.getpid(), signal.SIGINT)
        outcomes = [replace(GOOD, seed=seed) for seed in seeds]
        return {row.id: outcomes[:1] if row.id == GOOD.row else [] for row in rows}

    monkeypatch.setattr(runner, "run_rows", run_rows)
    live = "live-controller-killed"
    asked = "--rows", f"{GOOD.row},rate-stuck,{live}", "--seeds", "2", "--bus", "none0"
    done = invoke(*asked, "--json")
    assert done.exit_code == code
    told = json.loads(done.stdout)
    assert [(row["id"], row["verdict"], row["seeds"]) for row in told["rows"]] == [
        (GOOD.row, "pass", 1)
    ]
    assert told["not_run"] == [{"id": name, "why": why} for name in ("rate-stuck", live)]
    printed = invoke(*asked).stdout
    assert "1 of 2" in printed
    assert "1 row in up to 2 seas" in printed


@pytest.mark.usefixtures("_vcan7")
@pytest.mark.parametrize(
    ("error", "code", "why"),
    [
        (KeyboardInterrupt(), ExitCode.INTERRUPTED, "interrupted"),
        (OSError(errno.ENODEV, "no interface vcan7"), ExitCode.NO_BUS, "--bus vcan7: no interface"),
        (OSError(errno.ENOSPC, "disk full", "/tmp/x"), ExitCode.USAGE, "/tmp/x: disk full"),
    ],
)
def test_what_was_judged_before_live_rows_end_early_is_kept(
    error, code, why, tmp_path, monkeypatch
):
    monkeypatch.setattr(runner, "run_rows", lambda *_, **__: {GOOD.row: [GOOD]})
    began = []

    def attempted(row, _):
        began.append(row)
        if len(began) == 2:
            raise error
        return [], LiveTimes(50.0, 60.0, 0.0)

    monkeypatch.setattr(live, "attempted", attempted)
    xml = tmp_path / "faults.xml"
    asked = "--rows", f"{GOOD.row},live-ship,live-bus", "--seeds", "1", "--bus", "vcan7"
    done = invoke(*asked, "--junit", str(xml), "--json")
    assert done.exit_code == code, done.output
    told = json.loads(done.stdout)
    kept, *left = [name for name in live.ROWS if name.startswith(("live-ship", "live-bus"))]
    assert [row["id"] for row in told["rows"]] == [GOOD.row, kept]
    assert (told["passed"], told["failed"]) == (2, 0)
    assert [row["id"] for row in told["not_run"]] == left
    assert all(row["why"].startswith(why) for row in told["not_run"])
    assert len(ElementTree.parse(xml).findall("testcase")) == 4
    began.clear()
    done = invoke(*asked)
    assert f"{kept}: passed" in done.stdout
    assert "2 rows in 1 sea, 0 failed, 2 not run" in done.stdout
    assert (why in done.stderr) is (code is not ExitCode.INTERRUPTED)


def test_a_disk_too_full_for_recordings_loses_no_verdict(tmp_path, monkeypatch):
    def full(*_):
        raise OSError(errno.ENOSPC, "No space left on device", str(tmp_path / "row.rrd"))

    monkeypatch.setattr(runner, "run_rows", lambda *_, **__: {GOOD.row: [GOOD]})
    monkeypatch.setattr(verdicts, "write_recordings", full)
    done = invoke("--rows", GOOD.row, "--seeds", "1", "--out", str(tmp_path))
    assert done.exit_code == ExitCode.USAGE
    assert GOOD.row in done.stdout
    assert "row.rrd: No space left" in done.stderr


@pytest.mark.parametrize(
    ("arguments", "run"),
    [([], False), (["--full"], True), (["--seeds", "20"], False), (["--rows", "gm-"], True)],
)
def test_rows_that_take_long_are_left_out_unless_they_are_asked_for(monkeypatch, arguments, run):
    asked: list[Row] = []

    def rows_of(_, rows, *args, **named):
        asked.extend(rows)
        return {row.id: [] for row in rows}

    monkeypatch.setattr(runner, "run_rows", rows_of)
    told = json.loads(invoke("--json", *arguments).stdout)
    (long,) = [row for row in CAMPAIGN.rows if row.id == "gm-below-the-limit"]
    assert long.long
    assert (long in asked) is run
    reasons = {each["id"]: each["why"] for each in told["not_run"]}
    assert ("takes long" in reasons[long.id]) is not run


@pytest.mark.parametrize(("arguments", "words"), [(["--rows", "no-such"], "no row"),
                                                  (["--rows", "F12,motoin"], "motoin"),
                                                  (["--rows", "F27"], "tests show all of them"),
                                                  (["none.yaml"], "none.yaml")])  # fmt: skip
def test_wrong_arguments_are_refused(arguments, words):
    done = invoke(*arguments)
    assert done.exit_code == ExitCode.USAGE
    assert words in done.output


@pytest.mark.parametrize(
    ("row", "found_ms"),
    [("canopen-four-of-five-commands-lost", 100), ("canopen-heartbeat-lost", 180)],
)
def test_a_drive_of_another_maker_that_misses_frames_is_stopped(row, found_ms):
    assert ROWS[row].limit.found_ms == found_ms
    outcome = outcome_of(ROWS[row], patient=True)
    assert outcome.code == "DRIVE_SILENT"
    assert verdict(row, outcome).passed, outcome


@pytest.mark.slow
def test_a_ship_that_her_pump_can_capsize_has_gauges_that_show_in_time_that_they_are_stuck():
    # in this sea her roll has 2.5 times the passive variance with gauges of 5 mm
    assert verdict("patti-levels-stuck", outcome_of(ROWS["patti-levels-stuck"], seed=3)).passed


@pytest.mark.slow
def test_rows_run_on_another_ship():
    patti = "configs/scenarios/patti_b.yaml"
    rows = "F35,F31,motion-zero,motion-silent-of-two,panel-replayed,pump-stuck-and,level-spike"
    done = invoke("--scenario", patti, "--seeds", "1", "--json", "--rows", rows)
    found = json.loads(done.stdout)
    assert done.exit_code == 0
    windows = {row["id"]: row["roll_window_s"] for row in found["rows"]}
    assert windows.keys() == {
        "not-commissioned", "motion-zero", "motion-silent-of-two", "panel-replayed",
        "pump-stuck-and-not-to-be-switched-off", "level-spike",
    }  # fmt: skip
    assert windows["motion-zero"] == 600.0  # a lightly damped ship rolls on for minutes
    # a lull, in which the law rolls the ship more than the passive tank, with the fault or without
    assert windows["motion-silent-of-two"] == 54.0  # five rolls
    words = "needs a ship, nodes and counters as of setup valve"
    assert {row["why"] for row in found["not_run"]} == {words}
    ship = load_config(Path(patti), Scenario)
    moved = CAMPAIGN.on(ship, "constrained")
    assert set(moved.setups) == {"pump", "redundant", "uncommissioned"}
    assert all(setup.config.vessel.ship == ship.vessel.ship for setup in moved.setups.values())


def test_a_fault_is_as_large_for_another_ship_as_for_the_first():
    ship = load_config(Path("configs/scenarios/patti_b.yaml"), Scenario)
    moved = {row.id: row for row in CAMPAIGN.on(ship, "constrained").rows}
    rows = {row.id: row for row in CAMPAIGN.rows}
    limits = (CAMPAIGN.setups["pump"].config.limits, ship.controllers["constrained"].limits)
    for name, key, limit in (
        ("level-spike", "by", "level_m"),
        ("level-offset", "by", "level_m"),
        ("pump-stuck-at-50-kpa", "plus_pa", "pressure_pa"),
    ):
        here, there = (getattr(each[name].fault.inject[0], key) for each in (rows, moved))
        assert there / here == pytest.approx(getattr(limits[1], limit) / getattr(limits[0], limit))
    assert moved["roll-spike"].fault == rows["roll-spike"].fault
    # the next sample of a law may be later: 0.1 over 0.25 rad/s where it finds its own time
    law = load_config(Path("configs/controllers/self_tuned.yaml"), ControllerConfig)
    heavy = replace(law.vessel.ship, inertia_kg_m2=law.vessel.ship.stiffness_nm_rad / 0.25**2)
    vessel = law.vessel.model_copy(update={"ship": heavy})
    own = {"own": law.model_copy(update={"vessel": vessel})}
    late = CAMPAIGN.on(ship.model_copy(update={"vessel": vessel, "controllers": own}), "own")
    found_ms = {row.id: row.limit.found_ms for row in late.rows}
    assert [found_ms[name] for name in ("law-raises", "law-answers-nan", "law-opposite")] == (
        pytest.approx([420.0, 420.0, 90e3])
    )
    assert moved["law-raises"].limit.found_ms == 220.0
    # what another ship may be told and roll does not count on the first one
    assert moved["law-opposite"].expect.codes == ("ROLL_AMPLIFIED", "HEEL_LIMIT")
    assert rows["law-opposite"].expect.codes == ("ROLL_AMPLIFIED",)
    assert moved["motion-zero"].limit.beside_stop
    assert not any(row.limit.beside_stop for row in CAMPAIGN.rows)
    seen = moved["pump-stuck-at-50-kpa"].limit.counts_from["pressure_pa"]
    assert seen == pytest.approx(12e3 * limits[1].pressure_pa / limits[0].pressure_pa)
    # no command takes that pressure away
    assert moved["pump-presses-in-standby"].limit.roll is None
    assert rows["pump-presses-in-standby"].limit.roll == 1.3
    quiet = replace(ship.sensors, roll_noise_rad=ship.sensors.roll_noise_rad / 2)
    row = {
        row.id: row
        for row in CAMPAIGN.on(ship.model_copy(update={"sensors": quiet}), "constrained").rows
    }["noise-10-fold"]
    assert row.fault.inject[0].deviation == pytest.approx(0.001)


def on_ship(scenario, **tank):
    """The campaign on a scenario's ship, with another tank."""
    vessel = scenario.vessel.model_copy(update={"tank": replace(scenario.vessel.tank, **tank)})
    name, law = next(iter(scenario.controllers.items()))
    moved = scenario.model_copy(
        update={"vessel": vessel, "controllers": {name: law.model_copy(update={"vessel": vessel})}}
    )
    return {row.id: row for row in CAMPAIGN.on(moved, name).rows}


def test_times_that_follow_from_the_first_ships_tank_follow_from_another_ships():
    setup = CAMPAIGN.setups["pump"]
    first, scenario = setup.scenario.vessel.tank, setup.scenario
    longer = 1.44 * first.effective_length_m - 2 * first.height_m  # 1.2 times its period
    width_m = longer * first.duct_area_m2 / first.reservoir_area_m2
    moved = on_ship(scenario, width_m=width_m)
    gaps = [each.at_s for each in moved["pump-sensor-gaps"].fault.inject]
    assert gaps == pytest.approx([1.2 * (2 + 4 * n) for n in range(10)])
    assert moved["pump-sensor-gaps"].fault.inject[9].for_s == pytest.approx(0.84)
    assert moved["roll-2-s-late"].fault.inject[0].by_s == pytest.approx(2.4)
    for name, found_s in (
        ("pump-sensor-gaps", 48.0), ("roll-2-s-late", 36.0), ("law-opposite", 108.0),
        ("levels-swapped", 12.84), ("both-signs-flipped", 12.84),
    ):  # fmt: skip
        assert moved[name].limit.found_ms == pytest.approx(1e3 * found_s)
    # what a bus, a sensor's figures or a person gives stays
    for name in ("roll-100-ms-late", "roll-drift-slow", "tank-silent", "panel-silent"):
        assert moved[name].fault == ROWS[name].fault
        assert moved[name].limit.found_ms == ROWS[name].limit.found_ms
    # a twentieth of 18 s or more is a silence that ends control
    slow = on_ship(scenario, width_m=4 * width_m)
    assert "pump-sensor-gaps" in moved
    assert "pump-sensor-gaps" not in slow


def test_a_gauge_is_off_by_more_than_another_ships_water_may():
    scenario = CAMPAIGN.setups["pump"].scenario
    first = scenario.vessel.tank
    assert ROWS["level-offset"].fault.inject[0].by == 0.25  # 1.7 times 3 % of 4.88 m
    deep = on_ship(scenario, height_m=2 * first.height_m)
    assert deep["level-offset"].fault.inject[0].by == pytest.approx(0.5)
    assert deep["zeros-off"].fault == ROWS["zeros-off"].fault


def test_what_shows_late_is_followed_until_its_time_is_over():
    row = ROWS["roll-stuck"]
    short = row.model_copy(update={"fault": row.fault.model_copy(update={"followed_s": 0.05})})
    outcome = outcome_of(short)
    assert outcome.found == outcome_of(row).found
    assert verdict("roll-stuck", outcome).passed


def test_an_own_ship_with_its_law_is_compared_over_five_rolls():
    setup = CAMPAIGN.setups["pump"]
    ship = setup.scenario.vessel.ship
    assert commands._window(CAMPAIGN) == Window(600.0, 63.0)  # of 12.6 s
    for stiffer, window_s in ((100.0, 20.0), (0.25, 126.0)):
        quick = replace(ship, stiffness_nm_rad=stiffer * ship.stiffness_nm_rad)
        vessel = setup.scenario.vessel.model_copy(update={"ship": quick})
        scenario = setup.scenario.model_copy(update={"vessel": vessel})
        setups = {**CAMPAIGN.setups, "pump": setup.model_copy(update={"scenario": scenario})}
        own = CAMPAIGN.model_copy(update={"setups": setups})
        assert commands._window(own) == Window(600.0, window_s)


def test_of_a_device_without_counters_no_row_asks_for_what_only_they_show():
    storm = load_config(Path("configs/scenarios/storm.yaml"), Scenario)
    bought = {"profile": "sbg_ellipse", "accept_unprotected": True}
    drive = {"profile": "cia402", "node": 5, "mode": "torque", "pressure_pa_per_unit": 80.0,
             "speed_rad_s_per_unit": 1e-3}  # fmt: skip
    vessel = storm.vessel.model_copy(update={"devices": DevicesSection(motion=bought, pump=drive)})
    kept = {row.id for row in CAMPAIGN.on(storm, "gpc").rows}
    other = storm.model_copy(update={"vessel": vessel})
    left = {row.id for row in CAMPAIGN.on(other, "gpc").rows}
    of_the_drive = {row.id for row in CAMPAIGN.rows if row.fault.setup == "canopen"}
    assert of_the_drive <= left
    left -= of_the_drive
    assert {"motion-silent", "motion-bad-quality", "motion-frozen", "tank-corrupted"} <= left < kept
    dropped = {"motion-1-frame-lost", "motion-corrupted-once", "motion-short-once",
               "motion-counter-frozen", "drive-status-corrupted"}  # fmt: skip
    assert dropped <= kept - left


def test_a_scenario_can_not_spoil_what_a_device_does_not_send():
    storm = load_config(Path("configs/scenarios/storm.yaml"), Scenario).model_dump(mode="json")
    bought = {"profile": "sbg_ellipse", "accept_unprotected": True}
    storm["vessel"]["devices"] = DevicesSection(motion=bought).model_dump(mode="json")
    del storm["vessel"]["tank"]["headroom_m"]
    storm["controllers"] = {"law": {"name": "L", "vessel": storm["vessel"], "law": {"kind": "pd"}}}
    storm["faults"] = [{"kind": "length", "message": "SENSOR_MOTION", "length": 7, "at_s": 5}]
    with pytest.raises(ValueError, match=r"devices\.motion sends no SENSOR_MOTION; take kind lost"):
        Scenario.model_validate(storm)


def with_own_drive():
    """The storm with a CANopen drive of other node numbers, on the controller's own bus."""
    scenario = load_config(Path("configs/scenarios/storm.yaml"), Scenario)
    pump = CAMPAIGN.setups["canopen"].devices.pump
    own = pump.model_copy(update={"node": 9, "controller_node": 120, "bus": ""})
    vessel = scenario.vessel.model_copy(update={"devices": DevicesSection(pump=own.model_dump())})
    controllers = {
        name: config.model_copy(update={"vessel": vessel})
        for name, config in scenario.controllers.items()
    }
    return scenario.model_copy(update={"vessel": vessel, "controllers": controllers})


def test_rows_of_a_canopen_drive_run_on_a_ship_that_has_one():
    moved = CAMPAIGN.on(with_own_drive(), "gpc")
    rows = {row.id: row.fault.inject[0] for row in moved.rows if row.id.startswith("canopen")}
    assert len(rows) == 10
    assert rows["canopen-four-of-five-commands-lost"].id_11bit == 0x209
    assert rows["canopen-heartbeat-lost"].id_11bit == 0x709
    assert rows["canopen-controller-heartbeat-lost"].id_11bit == 0x778
    assert moved.setups["canopen"].config.vessel.devices.pump.node == 9
    native = CAMPAIGN.on(load_config(Path("configs/scenarios/storm.yaml"), Scenario), "gpc")
    assert not [row.id for row in native.rows if row.id.startswith("canopen")]


@pytest.mark.slow
def test_a_drive_of_an_own_ship_that_hears_one_command_of_five_is_stopped():
    moved = CAMPAIGN.on(with_own_drive(), "gpc")
    row = next(row for row in moved.rows if row.id == "canopen-four-of-five-commands-lost")
    own = moved.setups["canopen"]
    sea = Sea(moved, own, build_law(own.config), 1, Window(12.0, 12.0))
    sea.prepare([row])
    outcome = sea.outcome(row)
    assert outcome.code == "DRIVE_SILENT"
    assert outcome.wire
    assert outcome.found <= 100
