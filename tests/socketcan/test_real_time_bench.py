"""``utank-hil bench --realtime --bus vcan0``, and the same waves in lockstep beside it."""

from contextlib import closing
from pathlib import Path

import numpy as np
import pytest
import yaml
from busy_machine import first_that_can_be_judged, judged_by, lost
from two_processes import CHANNEL, CONFIGS, Program, patient_controller

from firmware_sim.bench import jobs_of
from firmware_sim.run import RECORD_S, run_lockstep
from firmware_sim.scenario import Scenario
from utank_hil.analysis.loop.sea_response import roll_without_tank
from utank_hil.canbus import Mode
from utank_hil.configuration import load_config
from utank_hil.console.exit_codes import ExitCode
from utank_hil.nodes.panel import Action, TimedAction
from utank_hil.telemetry.frame_log import FrameLog
from utank_hil.telemetry.recording_reader import read_recording
from utank_hil.telemetry.replay import replay_log
from utank_hil.telemetry.replay_head import recorded_config

pytestmark = [pytest.mark.evidence, pytest.mark.socketcan, pytest.mark.timeout(900)]

DURATION_S = 20.0
Bench = tuple[Scenario, dict, dict[str, dict[str, np.ndarray]]]
ENOUGH_S = 10.0
HELD_UP_S = 0.3
QUIET_SHARE = 0.1


def scenario_file(folder):
    """The storm with one controller, armed soon."""
    content = yaml.safe_load((CONFIGS / "scenarios" / "storm.yaml").read_text())
    content["vessel"] = str(CONFIGS / "ships" / "thesis_first.yaml")
    content["sea"]["file"] = str(CONFIGS / "seas" / "ndbc_41010_2019-02_spectral_density.txt")
    content["controllers"] = {"gpc": str(patient_controller(folder, 100.0))}
    content["operator"] = [{"time_s": 0.5, "action": "arm"}]
    content["settle_s"] = 10
    path = folder / "scenario.yaml"
    path.write_text(yaml.safe_dump(content))
    return path


def active(run):
    """The rows from arming until the controller was no longer in charge, or was held up.

    Where the machine stops both processes for long, the pump holds its pressure meanwhile: that is
    another run from then on.
    """
    in_charge = run["mode"] == Mode.ACTIVE
    begin = int(np.argmax(in_charge))
    on_time = np.diff(run["time_s"], append=np.inf) < HELD_UP_S
    end = np.flatnonzero(~(in_charge & on_time)[begin:])
    return slice(begin, begin + int(end[0]) + int(in_charge[begin + end[0]]))


def lost_share(report):
    """Share of the last run's ticks that the machine left out."""
    loop = report["runs"][-1]["loop"]
    return loop["skipped"] / (loop["ticks"] + loop["skipped"])


def attempt(folder):
    """Bench on the bus.

    A process that the machine holds up for longer than the drive's command timeout is a dead one
    to the drive, and the pump stays off from then on.
    """
    scenario = scenario_file(folder)
    program = Program(
        folder, "utank-hil", "bench", scenario, "--realtime", "--bus", CHANNEL,
        "--duration", DURATION_S, "--out", folder, "--frames", "--json",
    )  # fmt: skip
    with closing(program):
        # a machine that is busy for long is judged below
        codes = ExitCode.OK, ExitCode.NOT_RANKED
        report, _ = program.end(*codes, interrupt=False, timeout_s=300.0)
    recording = read_recording(folder / "bench.rrd")
    longest_s = max(run["loop"]["lateness"]["max_ns"] for run in report["runs"]) * 1e-9
    with judged_by(lambda: lost(lost_share(report), longest_s)):
        rows = recording["gpc"]["time_s"][active(recording["gpc"])]
        assert len(rows) > 0, "never in charge"
        assert rows[-1] - rows[0] > ENOUGH_S, "in charge for too short a time"
        assert lost_share(report) < QUIET_SHARE, "too many ticks left out"
    return load_config(scenario, Scenario), report, recording


@pytest.fixture(scope="module")
def bench(tmp_path_factory):
    """Scenario, report and recording."""
    return first_that_can_be_judged(attempt, tmp_path_factory.mktemp("bench"))


def lockstep(scenario, index, arm_s=0.5):
    script = (TimedAction(arm_s, Action.ARM),)
    changed = scenario.model_copy(update={"operator": script})
    return run_lockstep(jobs_of(changed, scenario.seed, 2 * DURATION_S)[index])


def roll_at(when_s, run):
    return np.interp(when_s, run.column("time_s"), run.column("true_roll_rad"))


def test_both_runs_come_back_with_their_deadlines(bench):
    _, report, recording = bench
    assert report["mode"] == f"real time on {CHANNEL}"
    assert list(recording) == [run["name"] for run in report["runs"]] == ["passive", "gpc"]
    assert (report["interrupted"], report["not_run"]) == (False, [])
    for run in report["runs"]:
        # a drive that timed out stands at zero, from where the next command is too great a step
        timed_out = (recording[run["name"]]["mode"] == Mode.FAULT).any()
        assert timed_out or run["refused_commands"] == 0
        assert run["loop"]["ticks"] + run["loop"]["skipped"] == DURATION_S * 100
        assert run["loop"]["send_errors"] == run["loop"]["receive_errors"] == 0
        assert 0.1 < run["bus_load"] < 0.4


def test_rows_are_on_the_ships_time_and_both_processes_begin_together(bench):
    scenario, _, recording = bench
    moment = scenario.wave_moment(scenario.seed)
    for run in recording.values():
        expected = moment.at(run["time_s"])
        atol = 1e-6 * np.abs(expected).max()
        np.testing.assert_allclose(run["wave_moment_nm"], expected, rtol=0, atol=atol)
        # a process that is begun on its own comes many seconds late here
        assert run["time_s"][0] < 2.0
        assert run["time_s"][-1] > DURATION_S - 2.0


def test_figures_are_of_one_window_of_the_same_waves(bench):
    scenario, report, recording = bench
    start_s, end_s = report["settle_s"], report["end_s"]
    assert start_s == pytest.approx(scenario.settle_s)
    grid_s = start_s + RECORD_S * np.arange(round((end_s - start_s) / RECORD_S))
    ship, moment = scenario.vessel.ship, scenario.wave_moment(scenario.seed)
    bare = roll_without_tank(ship, moment, 0.01, 1 + round(100 * grid_s[-1]))
    bare_rms = np.sqrt(np.mean(bare[np.round(100 * grid_s).astype(int)] ** 2))
    assert report["no_tank"]["rms_rad"] == pytest.approx(bare_rms, rel=1e-9)
    rms = {}
    for run in report["runs"]:
        rows = recording[run["name"]]
        window = (rows["time_s"] > start_s - 0.025) & (rows["time_s"] < end_s - 0.025)
        assert run["rows"] == window.sum() <= len(grid_s) + 1  # one that came late from before it
        assert run["expected_rows"] == len(grid_s)
        assert run["compared"] == (window.sum() >= 0.9 * len(grid_s))
        if not run["compared"]:
            continue
        own = np.sqrt(np.mean(rows["true_roll_rad"][window] ** 2))
        assert run["roll"]["rms_rad"] == pytest.approx(own, rel=1e-6)
        if run["mark"] is not None:  # the machine held the controller up until it let go, say
            assert run["roll_below_no_tank"] is run["roll_below_passive"] is None
            continue
        rms[run["name"]] = own
        assert run["roll_below_no_tank"] == pytest.approx(1 - own / bare_rms, abs=1e-6)
        if "passive" in rms:
            below = 1 - own / rms["passive"]
            assert run["roll_below_passive"] == pytest.approx(below, abs=1e-6)


def test_measured_roll_stands_beside_the_true_roll_of_the_same_time(bench):
    _, _, recording = bench
    for run in recording.values():
        heard = run["time_s"] > run["time_s"][0] + 0.5
        error = (run["roll_rad"] - run["true_roll_rad"])[heard]
        rate = np.sqrt(np.mean(run["roll_rate_rad_s"] ** 2))
        # 20 ms in the sensor, 10 in the loop, 25 of the record's grid, and noise of 2e-4; where the
        # machine held the ship up, the controller rightly shows what it heard before, hence the
        # median
        assert np.median(np.abs(error)) < rate * 0.06 + 3e-4


def test_passive_tank_rolls_the_ship_as_in_lockstep(bench):
    scenario, _, recording = bench
    run = recording["passive"]
    expected = roll_at(run["time_s"], lockstep(scenario, 0))
    difference = run["true_roll_rad"] - expected
    rms = np.sqrt(np.mean(expected**2))
    print(f"passive: {np.sqrt(np.mean(difference**2)) / rms:.2%} of {rms:.4f} rad")
    # the same sea and integration; the pump is switched on at another moment, and until then its
    # rotor turns with the water, which is worth seven per cent of the tank's inertia
    assert np.sqrt(np.mean(difference**2)) < 0.03 * rms


def test_armed_controller_rolls_the_ship_as_in_lockstep(bench):
    scenario, report, recording = bench
    run = recording["gpc"]
    when_s = run["time_s"]
    in_charge = active(run)
    armed_s = when_s[in_charge.start]
    own = lockstep(scenario, 1)
    own_armed_s = own.column("time_s")[np.argmax(own.column("mode") == Mode.ACTIVE)]
    same = lockstep(scenario, 1, max(0.5 + armed_s - own_armed_s, 0.0))
    when_s, roll = when_s[in_charge], run["true_roll_rad"][in_charge]
    expected = roll_at(when_s, same)
    passive = roll_at(when_s, lockstep(scenario, 0))
    error, effect = (np.sqrt(np.mean((roll - other) ** 2)) for other in (expected, passive))
    lost = lost_share(report)
    print(f"active: {error / effect:.2%} of what the pump does, {lost:.1%} of its ticks lost")
    assert np.std(roll) < np.std(passive)
    # noise falls on other samples and the law samples at another phase: a hundredth; what ticks are
    # lost, measurements and commands are late
    assert error < (1 / 4 + 2 * lost) * effect


@pytest.mark.parametrize("name", ["passive", "gpc"])
def test_both_runs_are_replayed_bit_for_bit(bench, name):
    _, report, _ = bench
    path = Path(report["files"][f"frames of {name}"])
    log = FrameLog(path)
    with recorded_config(log.head) as config:
        result, why, law = replay_log(log, config, path.parent)
    assert (why, law.why_not_recorded, law.differences) == ([], "", [])
    (run,) = (run for run in report["runs"] if run["name"] == name)
    assert (result.first, result.ticks) == (None, run["loop"]["ticks"])
