"""The guard beside devices of other makers: it judges their own frames."""

import ctypes
import math
import subprocess
from pathlib import Path
from typing import Any

import pytest
import yaml
from device_ship import (
    ALL,
    ENABLE,
    J1939,
    LEVELS,
    PUMP,
    QUICK_STOP,
    SBG,
    DeviceBench,
    config_of,
    config_of_all,
    scenario_of,
)
from guard_in_c import FLAGS, SOURCE, GuardInC
from hypothesis import Phase, given, settings
from hypothesis import strategies as st
from typer.testing import CliRunner

import firmware_sim.commands.bench as bench_command
from firmware_sim.fault_injection.nodes import Pump
from firmware_sim.faulty_bench import FaultyBench
from firmware_sim.guard.parameters import guard_parameters
from firmware_sim.guard.reference import Reason
from firmware_sim.scenario import Scenario
from utank_hil.canbus import Frame
from utank_hil.canbus.profiles.guarded import Stream
from utank_hil.cli import app
from utank_hil.configuration import ConfigError, load_config


@pytest.fixture(scope="session")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("guard_devices")


@pytest.fixture
def bench(folder: Path) -> DeviceBench:
    return DeviceBench(folder)


def test_it_allows_once_all_was_heard_and_reads_the_values(bench: DeviceBench) -> None:
    assert bench.run(30, without=["levels"]) == Reason.WAITING
    bench.press(15e3)
    bench.noise = 0.0
    bench.says["motion"][:] = [-0.0123, 0.031]
    bench.says["levels"][:2] = [-1.3, 1.2]
    assert bench.run(200, without=["motion_2"]) == 0
    python, said = bench.guards[0], bench.table
    assert (python._roll, python._rate) == (-123, round(0.031 / 3.125e-5))
    assert python._level == pytest.approx(2500, abs=2)
    assert python._pump_pa * 8 == pytest.approx(15e3, abs=16)
    bench.says["motion_2"][:] = [0.0523, -0.02]
    assert bench.run(20, without=["motion"]) == 0
    assert python._roll == pytest.approx(523, abs=1)
    assert python._rate == pytest.approx(-0.02 / 3.125e-5, abs=3)
    assert said.torque_drive == 1


@pytest.mark.parametrize(
    ("changes", "reason", "within"),
    [
        ({"motion": [-0.7, 0.0], "motion_2": [-0.7, 0.0]}, Reason.ROLL, 13),
        ({"motion": [0.0, 0.9], "motion_2": [0.0, 0.9]}, Reason.ROLL, 13),
        ({"levels": [-4.9, 4.9, 0.0, 0.0]}, Reason.LEVEL, 14),
        ({"pump_sensor": [-60e3, 0.0]}, Reason.PRESSURE, 64),
        ({"panel": [0.0] * 5}, Reason.PRESSURE, 194),
        ({"panel": [1.0, 1.0, 0.0, 0.0, 0.0]}, Reason.STOP, 10),
    ],
)
def test_each_reason_is_found_in_its_time(
    bench: DeviceBench, changes: dict[str, list[float]], reason: Reason, within: int
) -> None:
    bench.press(10e3)
    bench.says.update(changes)
    if within > 10:
        assert bench.run(within // 2) == 0
    assert bench.run(within) & reason


def test_a_drive_that_presses_on_when_told_to_stop_is_cut(bench: DeviceBench) -> None:
    bench.press(20e3)
    bench.word = QUICK_STOP
    assert bench.run(55) == 0
    assert bench.run(10) & Reason.PRESSURE


def test_a_drive_that_says_that_it_is_off_and_presses_is_cut(bench: DeviceBench) -> None:
    bench.press(20e3)
    bench.word, bench.status = 0, 0x260  # disabled, with bits that do not count
    assert bench.run(66) & Reason.PRESSURE


@pytest.mark.parametrize(
    ("without", "of"),
    [
        (("motion", "motion_2"), Stream.MOTION),
        *(
            ((f"motion.{name}", "motion_2"), Stream.MOTION)
            for name in ("status", "gyro", "gyro_info", "attitude", "attitude_info")
        ),
        (("motion.gyro", "motion.attitude", "motion_2"), Stream.MOTION),
        (("motion", "motion_2.slope"), Stream.MOTION),
        (("motion", "motion_2.rates"), Stream.MOTION),
        (("levels",), Stream.TANK),
        (("pump_sensor",), Stream.PUMP),
        (("panel",), Stream.ORDER),
        (("drive",), Stream.DRIVE),
    ],
)
def test_what_is_silent_under_pressure_cuts(
    bench: DeviceBench, without: tuple[str, ...], of: Stream
) -> None:
    bench.press(10e3)
    patience = bench.table.messages[of].patience
    assert bench.run(patience - 22, without=without) == 0
    assert bench.run(50, without=without) & Reason.SILENT


@pytest.mark.parametrize("role", ["motion", "levels"])
def test_a_device_that_says_it_is_not_well_is_silent(bench: DeviceBench, role: str) -> None:
    bench.press(10e3)
    spare = ["motion_2"] if role == "motion" else []
    assert bench.run(250, without=spare, missing=[role]) & Reason.SILENT


def test_content_that_stands_is_none(bench: DeviceBench) -> None:
    bench.press(10e3)
    bench.noise = 0.0
    for step in range(4):  # a still ship, whose rate moves by a step now and then
        bench.says["motion_2"][1] = 3e-3 * (step % 2)
        bench.says["levels"][1] = 2e-3 * (step % 2)
        assert bench.run(150, without=["motion"]) == 0
    assert bench.run(80, without=["motion"]) == 0
    assert bench.run(20, without=["motion"]) & Reason.SILENT


def test_a_frozen_counter_and_a_wrong_checksum_are_silence(bench: DeviceBench) -> None:
    bench.press(10e3)
    frame = bench.encoders["pump_sensor"][0].frame(bench.says["pump_sensor"], 0)
    for _ in range(300):
        bench.send(frame)
        bench.run(1, without=["pump_sensor"])
    assert bench.guards[0].reasons & Reason.SILENT


def test_a_cut_is_reset_at_the_panel_and_armed_anew(bench: DeviceBench) -> None:
    bench.press(10e3)
    bench.says["panel"][1] = 1.0
    assert bench.run(12) == Reason.STOP
    bench.says["panel"][:2] = [0.0, 0.0]
    bench.says["pump_sensor"][0], bench.word = 0.0, 0
    assert bench.run(30) == Reason.STOP
    bench.says["panel"][3] = 1.0
    assert bench.run(12) == 0
    bench.says["panel"][3] = 0.0
    bench.word = ENABLE
    assert bench.run(1000, without=["panel"]) == 0  # it holds zero, as in PASSIVE
    bench.says["pump_sensor"][0] = 8e3
    assert bench.run(64) == Reason.PRESSURE


_ROLES = st.sampled_from(sorted(ALL))
_VALUE = st.floats(-1e5, 1e5) | st.floats(-1, 1) | st.just(float("nan"))
_STEPS = st.one_of(
    st.tuples(st.just("sound"), st.integers(1, 90)),
    st.tuples(st.just("without"), st.tuples(_ROLES, st.integers(1, 60))),
    st.tuples(st.just("says"), st.tuples(_ROLES, st.integers(0, 4), _VALUE)),
    st.tuples(st.just("raw"), st.tuples(st.integers(0, 31), st.binary(max_size=8))),
    st.tuples(st.just("word"), st.sampled_from((0, 2, 6, 7, 15, 0x8F, 0xFF0F))),
    st.tuples(st.just("status"), st.integers(0, 0xFFFF)),
)


@settings(max_examples=40, deadline=None, phases=[Phase.explicit, Phase.generate])
@given(steps=st.lists(_STEPS, max_size=14))
def test_any_frames_are_judged_alike_in_both(folder: Path, steps: list[tuple[str, Any]]) -> None:
    bench = DeviceBench(folder)
    bench.run(30)
    for kind, what in steps:
        if kind == "sound":
            bench.run(what)
        elif kind == "without":
            bench.run(what[1], without=[what[0]])
        elif kind == "says" and what[0] in bench.says:
            values = bench.says[what[0]]
            values[min(what[1], len(values) - 1)] = what[2]
        elif kind == "raw":
            part = bench.table.parts[what[0] % len(bench.table.parts)]
            data = what[1].ljust(part.length, b"\0")[: part.length]
            at = part.crc.byte
            if at < len(data):  # rightly protected, whatever it says
                data = data[:at] + bytes([part.crc.of(data)]) + data[at + 1 :]
            bench.send(Frame(part.can_id, data))
            bench.send(Frame(part.can_id, what[1]))
        elif kind == "word":
            bench.word = what
        elif kind == "status":
            bench.status = what
        bench.run(1)


LINE = {"profile": "psxn", "bus": "udp:127.0.0.1:5001:127.0.0.1", "accept_unprotected": True}
N2K = {"profile": "n2k_attitude", "source": 9, "accept_unprotected": True, "cycle_ms": 50,
       "age_ms": 200}  # fmt: skip
GAPS = {"valid_when": [{"from": "status.SOLUTION", "mask": "0xF", "in": [1, 2, 4]}]}


@pytest.mark.parametrize(
    ("devices", "words"),
    [
        ({"motion": LINE}, "devices.motion comes on the line udp:127.0.0.1:5001:127.0.0.1"),
        ({"motion_2": N2K}, "devices.motion_2 has a rate that is derived of the roll"),
        ({"motion": SBG | GAPS}, "has in status good states with bad ones between"),
    ],
)
def test_what_it_cannot_judge_is_refused_by_name(devices: dict[str, Any], words: str) -> None:
    with pytest.raises(ValueError, match=words):
        guard_parameters(config_of(devices))


@pytest.mark.slow
def test_on_the_bench_it_lets_a_healthy_controller_be_and_cuts_a_drive_that_disobeys() -> None:
    devices = {"motion": SBG, "motion_2": J1939, "levels": LEVELS, "pump": PUMP}
    scenario = scenario_of(devices)
    config = scenario.controllers["gpc"]
    found = FaultyBench(scenario, config, seed=1, script=scenario.operator)
    assert found.ship.guard is not None
    guard, plant = found.ship.guard.guard, found.ship.plant
    assert guard.reasons == Reason.WAITING
    most_pa = 0.0
    for tenth in range(25, 140):
        found.run(tenth * 100_000_000)
        assert guard.reasons == 0
        most_pa = max(most_pa, abs(plant.pressure_pa))
    assert found.node.mode.name == "ACTIVE"
    assert most_pa > 20e3
    held_pa = -math.copysign(20e3, plant.pressure_pa)
    found.place([Pump(kind="pump", times=0, plus_pa=held_pa, off_too=True)])
    found.run(14_500_000_000)
    assert found.node.mode.name == "FAULT"
    assert (guard.reasons, plant.pressure_pa) == (0, pytest.approx(held_pa))
    found.run(15_000_000_000)
    assert guard.reasons == Reason.PRESSURE
    assert abs(plant.pressure_pa) < 5e3


def test_the_header_of_a_ship_with_devices_compiles(tmp_path: Path) -> None:
    (tmp_path / "guard_parameters.h").write_text(guard_parameters(config_of_all()).header)
    main = tmp_path / "main.c"
    main.write_text(
        '#include "guard_parameters.h"\n'
        "const struct guard_parameters *table(void);\n"
        "const struct guard_parameters *table(void) { return &GUARD_PARAMETERS; }\n"
    )
    library = tmp_path / "table.so"
    words = ["cc", *FLAGS, f"-I{SOURCE}", "-shared", "-fPIC", main, "-o", library]
    subprocess.run([str(word) for word in words], check=True)
    of = ctypes.CDLL(str(library)).table
    of.restype = ctypes.c_void_p
    expected = GuardInC.table_of(guard_parameters(config_of_all()))
    assert ctypes.string_at(of(), len(expected)) == expected


def test_check_and_a_scenario_name_what_it_cannot_judge(tmp_path: Path) -> None:
    configs = Path("configs").resolve()
    ship = yaml.safe_load((configs / "ships/thesis_first_devices.yaml").read_text())
    path = tmp_path / "ship.yaml"
    path.write_text(yaml.safe_dump(ship))
    assert "guard" not in CliRunner().invoke(app, ["check", str(path)]).output
    ship["devices"]["motion"] |= GAPS
    path.write_text(yaml.safe_dump(ship))
    said = CliRunner(env={"COLUMNS": "300"}).invoke(app, ["check", str(path)]).output
    assert "the guard can't judge this ship: devices.motion has in status good states" in said
    law = yaml.safe_load((configs / "controllers/pd.yaml").read_text()) | {"vessel": "ship.yaml"}
    (tmp_path / "pd.yaml").write_text(yaml.safe_dump(law))
    sea = yaml.safe_load((configs / "scenarios/storm.yaml").read_text())["sea"]
    sea["file"] = str(configs / "scenarios" / sea["file"])
    content = {
        "name": "x", "vessel": "ship.yaml", "controllers": {"pd": "pd.yaml"}, "sea": sea,
        "operator": [], "duration_s": 60, "settle_s": 1, "guard": True,
    }  # fmt: skip
    (tmp_path / "x.yaml").write_text(yaml.safe_dump(content))
    with pytest.raises(ConfigError, match="must be left out: the guard can't judge this ship"):
        load_config(tmp_path / "x.yaml", Scenario)
    del content["guard"]
    (tmp_path / "x.yaml").write_text(yaml.safe_dump(content))
    words = ["bench", str(tmp_path / "x.yaml"), "--with", "guard", "--out", str(tmp_path / "out")]
    refused = CliRunner(env={"COLUMNS": "300"}).invoke(app, words)
    assert "--with guard must be left out: the guard can't judge" in refused.output
    assert refused.exit_code == 2


def test_bench_adds_it_by_an_option(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    class StopError(Exception):
        pass

    def run(loaded: Scenario, *_: object) -> None:
        assert loaded.guard
        raise StopError

    monkeypatch.setattr(bench_command, "_run", run)
    words = ["bench", "configs/scenarios/still_water.yaml", "--with", "guard"]
    result = CliRunner().invoke(app, [*words, "--out", str(tmp_path / "out")])
    assert isinstance(result.exception, StopError)
