"""``utank-hil replay``: exact for what was recorded, and a change is named."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from ship_in_the_port import ShipInThePort
from typer.testing import CliRunner, Result

from utank_hil.canbus import Mode, PumpCommand, load_catalogue
from utank_hil.commands.replay import replay
from utank_hil.commands.run import run
from utank_hil.console.common import new_app
from utank_hil.console.exit_codes import ExitCode
from utank_hil.telemetry import law_values
from utank_hil.telemetry.frame_log import FrameLog, FrameLogWriter, Kind
from utank_hil.telemetry.replay import entries_of

pytestmark = pytest.mark.slow

COMMANDS = load_catalogue().codec(PumpCommand)
#: In Pa/rad. It shares no factor with the steps of roll and pressure on the bus: with -1.5e5 a
#: roll that stands asks for a pressure between two steps, and the last bit decides which is sent.
GAIN = -151_234.5
WIDE = {"TERM": "dumb", "COLUMNS": "300", "NO_COLOR": "1"}


def invoke(command: Any, *words: object) -> Result:
    app = new_app()
    app.command()(command)
    return CliRunner(env=WIDE).invoke(app, [str(word) for word in words])


def controller(folder: Path, gain: float = GAIN) -> Path:
    """A law in matrices, in a data file, on a machine that may be busy."""
    system = {"A": [[0.5]], "B": [[1.0]], "C": [[gain]], "D": [[2 * gain]], "dt": 0.1}
    (folder / "law.json").write_text(json.dumps(system))
    content = {
        "name": "matrices",
        "vessel": str(Path("configs/ships/thesis_first.yaml").resolve()),
        "law": {"kind": "state_space", "measured": ["roll_rad"], "system": "./law.json"},
        "accept_low_margins": True,
        "safety": {
            "overruns_in_ten": None,
            "long_overrun_ms": 1000,
            **dict.fromkeys(
                ("motion_age_ms", "tank_degraded_age_ms", "drive_age_ms", "echo_age_ms"), 500
            ),
        },
    }
    path = folder / "controller.yaml"
    path.write_text(yaml.safe_dump(content))
    return path


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with the frame log of a run in real time, in which the pump was driven."""
    for duration_s in (3.5, 10.0, 30.0):  # a busy machine takes longer until it is in charge
        folder = tmp_path_factory.mktemp("run")
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr("utank_hil.canbus.socketcan.SocketCanPort", ShipInThePort)
            words = "--bus", "vcan0", "--duration", duration_s, "--out", folder, "--json"
            result = invoke(run, controller(folder), *words)
        report = json.loads(result.stdout)
        if report["mode"] == Mode.ACTIVE.name and len(driven(log_of(folder))) > 20:
            break
    assert report["mode"] == Mode.ACTIVE.name
    assert report["recording"]["records_lost"] == 0
    assert Path(report["recording"]["file"]) == log_of(folder)
    return folder


def driven(log: Path) -> list[bytes]:
    """Commands of a pressure that is not zero."""
    return [
        data
        for number, data, kind, _ in entries_of(FrameLog(log).blocks())
        if kind == Kind.SENT and number == COMMANDS.can_id and COMMANDS.decode(data).pressure_pa
    ]


def log_of(folder: Path) -> Path:
    (log,) = folder.glob("run-*.frames")
    return log


def test_a_run_in_real_time_is_replayed_bit_for_bit(folder: Path) -> None:
    result = invoke(replay, log_of(folder), "--json")
    assert result.exit_code == 0, result.stderr
    found = json.loads(result.stdout)
    assert found["exact"]
    assert found["causes"] == []
    assert found["law"] == {
        "recorded_law_ran": True, "why_not": "", "same_design": True, "differences": [],
        "loops": None,
    }  # fmt: skip
    assert found["ticks"] > 200
    assert found["frames"] > found["ticks"] / 2
    assert driven(log_of(folder))


def test_the_last_bit_of_a_gain_is_named_even_where_no_frame_shows_it(
    folder: Path, tmp_path: Path
) -> None:
    other = controller(tmp_path, float(np.nextafter(GAIN, 0)))
    result = invoke(replay, log_of(folder), "--config", other, "--json")
    assert result.exit_code == 0
    found = json.loads(result.stdout)
    assert found["exact"]
    assert not found["law"]["recorded_law_ran"]
    assert found["law"]["why_not"] == "another configuration was named"
    assert ["-151234.5", "-151234.49999999997"] in [
        [each["recorded"], each["designed"]] for each in found["law"]["differences"]
    ]
    assert all(each["deviation"] < 2e-16 for each in found["law"]["differences"])
    assert any(line.startswith("configuration, law.system") for line in found["causes"])


def test_a_recorded_law_answers_though_another_would_be_designed_here(
    folder: Path, tmp_path: Path
) -> None:
    log = FrameLog(log_of(folder))
    recorded = law_values.decoded(log.head["law"])
    # what the log says is 1e-10 beside what is designed here; no frame shows that
    log.head["law"] = law_values.encoded(recorded | {"c": recorded["c"] * (1 + 1e-10)})
    changed = tmp_path / "run-x.frames"
    with FrameLogWriter(changed, log.head) as writer:
        for block in log.blocks():
            writer.write(block)
    result = invoke(replay, changed, "--json")
    found = json.loads(result.stdout)
    assert (result.exit_code, found["exact"], found["causes"]) == (0, True, [])
    assert found["law"]["recorded_law_ran"]
    (difference,) = found["law"]["differences"]
    assert difference["name"] == "c[0, 0]"
    assert difference["deviation"] == pytest.approx(1e-10, rel=1e-3)
    text = invoke(replay, changed).stdout
    assert "equal bit for bit: " in text
    assert "the law designed here is not the recorded one, by 1.0e-10 of an array" in text


def test_another_gain_is_named_by_tick_message_and_signal(folder: Path, tmp_path: Path) -> None:
    # of the other sign: on a busy machine a few commands come, all of them at the rate's limit
    other = controller(tmp_path, -GAIN)
    result = invoke(replay, log_of(folder), "--config", other, "--json")
    assert result.exit_code == 1
    found = json.loads(result.stdout)
    first = found["first_difference"]
    assert (first["message"], first["signal"]) == ("PUMP_CMD", "pressure_pa")
    assert float(first["recorded"]) != float(first["replayed"])
    assert found["different_frames"]["PUMP_CMD"] > 10
    assert first["tick"] > 80  # armed after 0.8 s
    text = invoke(replay, log_of(folder), "--config", other).stdout
    assert f"first at tick {first['tick']}" in text
    assert "configuration, law.system" in text


def test_a_cut_log_is_compared_up_to_where_it_is_whole(folder: Path, tmp_path: Path) -> None:
    content = log_of(folder).read_bytes()
    cut = tmp_path / "run-x.frames"
    cut.write_bytes(content[: len(content) * 3 // 4])
    found = json.loads(invoke(replay, cut, "--json").stdout)
    assert found["exact"]
    assert 0 < found["ticks"] < 350
    assert "is cut at byte" in found["cut"]


def test_a_log_without_a_tick_is_no_equal_one(tmp_path: Path) -> None:
    content = Path("tests/replay/every-mode.frames").read_bytes()
    size = len(content)
    for length in range(size // 20, size, size // 20):  # the head alone, cut within the first block
        cut = tmp_path / "cut.frames"
        cut.write_bytes(content[:length])
        result = invoke(replay, cut)
        if result.exit_code == ExitCode.USAGE and "no tick" in result.stderr:
            if "cut.frames is cut at byte" in result.stderr:
                return
            assert FrameLog(cut).head  # cut where the head ends: nothing is broken
    raise AssertionError("each has a tick, or is not said to be cut")


def test_a_log_of_another_program_state_says_what_is_not_the_same(
    folder: Path, tmp_path: Path
) -> None:
    log = FrameLog(log_of(folder))
    log.head["about"]["commit"] = "0123456789ab"
    log.head["packages"]["numpy"] = "1.0"
    changed = tmp_path / "run-x.frames"
    with FrameLogWriter(changed, log.head) as writer:
        for block in log.blocks():
            writer.write(block)
    found = json.loads(invoke(replay, changed, "--json").stdout)
    assert found["exact"]
    assert [line.split(":")[0] for line in found["causes"]] == ["commit", "numpy"]


def test_a_log_of_another_machine_says_so_in_its_first_line(folder: Path, tmp_path: Path) -> None:
    log = FrameLog(log_of(folder))
    here = invoke(replay, log_of(folder))
    log.head["about"]["machine"] |= {"processor": "Core of another kind", "blas": "openblas Old"}
    changed = tmp_path / "run-x.frames"
    with FrameLogWriter(changed, log.head) as writer:
        for block in log.blocks():
            writer.write(block)
    first, *rest = invoke(replay, changed).stdout.splitlines()
    assert first.startswith("another machine's log: Core of another kind, numpy ")
    assert rest == here.stdout.splitlines()
    told = json.loads(invoke(replay, changed, "--json").stdout)["other_machine"]
    assert "openblas Old" in told


def test_a_part_from_the_middle_of_a_run_is_refused(folder: Path, tmp_path: Path) -> None:
    part = tmp_path / "run-x-part002.frames"
    part.write_bytes(log_of(folder).read_bytes())
    result = invoke(replay, part)
    assert result.exit_code == 2
    assert "give the run's first part" in result.stderr


@pytest.mark.parametrize("holder", [None, "pump_with_valve", "valve_clipped", "two deep"])
def test_a_log_does_not_choose_code_to_run(holder: str | None, tmp_path: Path) -> None:
    log = FrameLog(Path("tests/replay/valve-and-pump.frames"))
    law: dict[str, Any] = {
        "kind": "python",
        "factory": "os:system",
        "measured": ["roll_rad"],
        "parameters": {"command": f"touch {tmp_path / 'ran'}"},
    }
    if holder is not None:
        law = {"kind": holder if holder != "two deep" else "valve_clipped", "pump": law}
    if holder == "two deep":
        law = {"kind": "pump_with_valve", "pump": law}
    log.head["about"]["configuration"]["law"] = law
    changed = tmp_path / "run-x.frames"
    FrameLogWriter(changed, log.head).close()
    result = invoke(replay, changed)
    assert not (tmp_path / "ran").exists()
    assert result.exit_code == 2
    assert "os:system, which a log must not choose" in result.stderr


@pytest.mark.parametrize("content", [b"", b"nothing like it"])
def test_a_file_that_is_no_log_is_an_error_with_its_name(tmp_path: Path, content: bytes) -> None:
    file = tmp_path / "x.frames"
    file.write_bytes(content)
    result = invoke(replay, file)
    assert result.exit_code == 2
    assert "x.frames: is no frame log" in result.stderr
    assert "x.rrd holds no frames: give a .frames" in invoke(replay, tmp_path / "x.rrd").stderr


@pytest.mark.parametrize(
    "changed",
    [
        {"retuner": None}, {"packages": []}, {"catalogue": None}, {"law": 3},
        {"law": {"gains": ["<f8", [1], "zzzz"]}}, {"law": {"gains": ["<f8"]}},
        {"files": {"a.csv": "zzzz"}}, {"files": {"a.csv": law_values.packed(bytes(1 << 29))}},
    ],
)  # fmt: skip
def test_a_head_that_no_program_of_ours_writes_is_refused_in_words(
    tmp_path: Path, changed: dict[str, Any]
) -> None:
    log = FrameLog(Path("tests/replay/motion-silent.frames"))
    file = tmp_path / "x.frames"
    FrameLogWriter(file, log.head | changed).close()
    result = invoke(replay, file)
    assert result.exit_code == ExitCode.USAGE, result.exception
    assert "its head is not one that this program writes" in result.stderr


@pytest.mark.parametrize("kind", [Kind.STARTED, Kind.ALIVE])
def test_a_record_without_its_byte_ends_no_replay(tmp_path: Path, kind: Kind) -> None:
    log = FrameLog(Path("tests/replay/drive-fault.frames"))
    records = next(log.blocks()).copy()
    records["kind"][0], records["length"][0] = kind, 0
    file = tmp_path / "x.frames"
    with FrameLogWriter(file, log.head) as writer:
        writer.write(records)
    result = invoke(replay, file)
    assert isinstance(result.exception, SystemExit), result.exception
