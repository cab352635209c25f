"""``utank-hil commission`` and its record: what it says, what it writes, what run makes of it."""

import copy
import json
import os
import shlex
import stat
from pathlib import Path
from typing import Any

import pytest
import yaml
from ports import QuietBus
from typer.testing import CliRunner

from firmware_sim.scenario import Scenario
from firmware_sim.ship_side import build_ship_side
from utank_hil.canbus.ports import why_other_bit_rate
from utank_hil.cli import app
from utank_hil.commands import commission as module
from utank_hil.commands.commissioning_record import (
    make_record,
    record_path,
    why_not_commissioned,
    why_not_replaceable,
    write_record,
)
from utank_hil.configuration import ControllerConfig, load_config
from utank_hil.console.common import new_app
from utank_hil.console.exit_codes import ExitCode
from utank_hil.nodes.commissioning.checks import Check
from utank_hil.nodes.panel import Action, TimedAction
from utank_hil.runners import Lockstep

SHIP = yaml.safe_load(Path("configs/ships/naval_vessel.yaml").read_text())
ON_BOARD = {key: value for key, value in SHIP.items() if key != "emulated"}
GOOD = Check("roll", "roll, by what it does to the water", 1.01, 1.0, 0.3, "1", "Turn it round.")
BAD = Check("port_level", "port level", float("nan"), 1.0, 0.15, "1", "Look at the gauge.")


@pytest.fixture
def file(tmp_path: Path) -> Path:
    content = yaml.safe_load(Path("configs/controllers/naval_constrained_gpc.yaml").read_text())
    path = tmp_path / "naval.yaml"
    path.write_text(yaml.safe_dump(content | {"vessel": ON_BOARD}))
    return path


def loaded(file: Path) -> ControllerConfig:
    return load_config(file, ControllerConfig)


def reason(file: Path, bus: str = "can0", path: Path | None = None) -> str:
    return why_not_commissioned(loaded(file), bus, file, path)


def passed(file: Path, bus: str = "can0", *checks: Check, ended: str = "") -> Path:
    path = record_path(file)
    write_record(path, make_record(loaded(file), file, bus, list(checks or (GOOD,)), ended))
    return path


def test_without_a_record_the_reason_names_the_command(file: Path) -> None:
    assert reason(file) == (
        f"{record_path(file)}: there is no record of a commissioning; run utank-hil commission "
        f"{file} --bus can0 at the quay"
    )


def test_a_passed_one_admits_and_says_who_when_and_what(file: Path) -> None:
    path = passed(file)
    assert path == file.with_name("naval.commissioning.json")
    assert reason(file) == ""
    record = json.loads(path.read_text())
    assert record["passed"] is True
    assert record["configuration_version"] == loaded(file).vessel.version
    assert record["date"].endswith("Z")
    assert {"program", "version", "commit", "bus", "commissioned_for"} <= set(record)
    assert record["commissioned_for"]["catalogue_version"]
    (check,) = record["checks"]
    assert (check["measured"], check["expected"], check["tolerance"]) == (1.01, 1.0, 0.3)
    assert check["verdict"] == "pass"
    assert path.stat().st_mode & 0o777 == 0o644


@pytest.mark.parametrize(
    ("checks", "ended"), [((GOOD, BAD), ""), ((GOOD,), "Disarmed before the end."), ((), "")]
)
def test_one_that_was_not_passed_does_not_admit(
    file: Path, checks: tuple[Check, ...], ended: str
) -> None:
    record = make_record(loaded(file), file, "can0", list(checks), ended)
    write_record(record_path(file), record)
    assert "was not passed" in reason(file)
    assert [check["measured"] for check in record["checks"]] == [1.01, None][: len(checks)]


def test_what_a_commissioning_stands_for_makes_it_void_when_it_changes(file: Path) -> None:
    path = passed(file)
    content = yaml.safe_load(file.read_text())
    vessel = copy.deepcopy(ON_BOARD)
    vessel["tank"]["width_m"] = 6.5
    vessel["name"] = "Renamed"
    (file.parent / "ship.yaml").write_text(yaml.safe_dump(vessel))
    file.write_text(yaml.safe_dump(content | {"vessel": "ship.yaml"}))
    assert "these changed: tank.width_m; run utank-hil commission" in reason(file)
    vessel["tank"]["width_m"] = ON_BOARD["tank"]["width_m"]
    both = {"second_motion_sensor": True, "hardwired_inputs": True}
    (file.parent / "ship.yaml").write_text(yaml.safe_dump(vessel | {"redundancy": both}))
    changed = "redundancy.second_motion_sensor"
    assert f"these changed: {changed}" in reason(file)
    sensor = {"motion": {"profile": "sbg_ellipse", "accept_unprotected": True}}
    for devices, key in (
        (sensor, "devices"), ({"pump": {"stop_within_ms": 200}}, "devices, stop_within_ms")
    ):  # fmt: skip
        (file.parent / "ship.yaml").write_text(yaml.safe_dump(vessel | {"devices": devices}))
        assert f"these changed: {key};" in reason(file)
    (file.parent / "ship.yaml").write_text(yaml.safe_dump(vessel))
    file.write_text(yaml.safe_dump(content | {"sensors": {"level_noise_m": 0.006}}))
    assert "these changed: sensors.level_noise_m" in reason(file)
    # the law and its limits are judged by other means
    file.write_text(yaml.safe_dump(content | {"name": "Another", "law": {"kind": "passive"}}))
    assert reason(file) == ""
    record = json.loads(path.read_text())
    record["commissioned_for"]["catalogue_version"] += 1
    path.write_text(json.dumps(record))
    assert "these changed: catalogue_version" in reason(file)


@pytest.mark.parametrize(
    "changes",
    [
        {"checks": []},
        {"checks": [{"verdict": "pass"}, {"verdict": "fail"}]},
        {"ended": "Disarmed before the end."},
    ],
)
def test_one_that_says_passed_and_was_not_does_not_admit(file: Path, changes: Any) -> None:
    path = passed(file)
    path.write_text(json.dumps(json.loads(path.read_text()) | changes))
    assert "was not passed" in reason(file)


@pytest.mark.parametrize("changes", [{"bus": None}, {"commissioned_for": []}, {"passed": 1}])
def test_one_with_a_value_of_another_type_is_none(file: Path, changes: Any) -> None:
    path = passed(file)
    path.write_text(json.dumps(json.loads(path.read_text()) | changes))
    assert "is no record of a commissioning that can be read" in reason(file)


def test_a_default_that_a_later_version_changes_makes_it_void(file: Path) -> None:
    record = json.loads(passed(file).read_text())["commissioned_for"]
    assert record["sensors"]["roll_noise_rad"] == loaded(file).sensors.roll_noise_rad
    assert record["ship"]["wind_moment_nm"] == 0.0


@pytest.mark.parametrize(
    "content", ["", "{", "[]", "{}", '{"passed": true}', "\x00", "[" * 100_000]
)
def test_a_file_that_is_no_record_does_not_admit(file: Path, content: str) -> None:
    record_path(file).write_text(content)
    assert "is no record of a commissioning that can be read; run" in reason(file)


@pytest.mark.parametrize("bus", ["can0", "vcan0"])
def test_only_a_ship_declared_to_be_emulated_asks_for_none(
    file: Path, tmp_path: Path, bus: str
) -> None:
    assert "there is no record" in reason(file, bus)  # whatever the interface is named
    content, on_board = yaml.safe_load(file.read_text()), loaded(file).vessel.version
    file.write_text(yaml.safe_dump(content | {"vessel": SHIP}))
    assert reason(file, bus) == ""
    assert loaded(file).vessel.version != on_board  # with nodes of that version it never arms
    assert "there is no record" in reason(file, bus, tmp_path / "none.json")
    path = passed(file, bus)
    assert reason(file, bus, path) == ""
    file.write_text(yaml.safe_dump(content))
    assert "these changed: emulated" in reason(file, bus)


def test_a_ship_with_nothing_to_arm_needs_none(file: Path) -> None:
    vessel = copy.deepcopy(ON_BOARD)
    del vessel["pump"]
    content = {"name": "none", "vessel": vessel, "law": {"kind": "passive"}}
    file.write_text(yaml.safe_dump(content))
    assert reason(file) == ""


def test_a_record_is_there_as_a_whole_or_not_at_all(
    file: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = passed(file)
    before = path.read_text()

    def full(descriptor: int) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "fsync", full)
    with pytest.raises(OSError, match="No space left"):
        write_record(path, {"passed": False})
    assert path.read_text() == before
    assert sorted(each.name for each in file.parent.iterdir()) == [path.name, file.name]


def test_a_record_is_on_the_disk_before_it_takes_the_place_of_the_one_before(
    file: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = passed(file)
    before = path.read_text()
    on_disk: list[tuple[Path, str, str]] = []

    def fsync(descriptor: int) -> None:
        written = Path(os.readlink(f"/proc/self/fd/{descriptor}"))
        content = written.name if written.is_dir() else written.read_text()
        on_disk.append((written.parent, content, path.read_text()))

    monkeypatch.setattr(os, "fsync", fsync)
    with path.open() as read_meanwhile:
        write_record(path, {"passed": False})
        assert read_meanwhile.read() == before
    # in the same folder: what takes the place of another in one step is on the same disk
    after, folder = path.read_text(), file.parent
    assert on_disk == [(folder, after, before), (folder.parent, folder.name, after)]
    assert json.loads(path.read_text()) == {"passed": False}


def test_a_record_can_be_read_by_the_service_whoever_commissioned(file: Path) -> None:
    before = os.umask(0o077)
    try:
        path = passed(file)
    finally:
        os.umask(before)
    assert stat.S_IMODE(path.stat().st_mode) == 0o644


class AtTheQuay:
    """Stands for the real-time loop: the same nodes in lockstep, with the ship's side."""

    script = (TimedAction(22.0, Action.ARM),)
    stop_after_s = 300.0

    def __init__(self, nodes: list[Any], port: object, statistics: object) -> None:
        config = ControllerConfig.model_validate(
            {"name": "any", "vessel": ON_BOARD, "law": {"kind": "passive"}}
        )
        scenario = Scenario.model_validate(
            {
                "name": "quay",
                "vessel": config.vessel,
                "sea": {"kind": "regular", "amplitude_m": 0.0, "period_s": 10.0},
                "controllers": {"any": config},
                "operator": self.script,
                "duration_s": 300.0,
                "settle_s": 0.0,
            }
        )
        self._lockstep = Lockstep([*build_ship_side(scenario, 1, self.script).nodes, *nodes])

    def run(self, stop: Any) -> None:
        while not stop() and self._lockstep.now_ns < self.stop_after_s * 1e9:
            self._lockstep.run_until(self._lockstep.now_ns + 10_000_000)


def commission(monkeypatch: pytest.MonkeyPatch, loop: type[AtTheQuay], *words: object) -> Any:
    monkeypatch.setattr("utank_hil.canbus.socketcan.SocketCanPort", QuietBus)
    monkeypatch.setattr(module, "RealTimeLoop", loop)
    application = new_app()
    application.command()(module.commission)
    return CliRunner().invoke(application, [*map(str, words), "--bus", "can0"])


def test_the_command_leads_through_and_writes_the_record(
    file: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    result = commission(monkeypatch, AtTheQuay, file)
    assert result.exit_code == ExitCode.OK, result.output
    assert "roll, by what it does to the water" in result.stdout
    assert "passed; record: " in result.stdout
    assert f"  utank-hil run {file} --bus can0 --out log\n" in result.stdout
    said = capfd.readouterr().err
    places = [said.index(words) for words in ("Waiting until", "Measuring the zeros", "Arm at the",
                                              "move a little. Stop", "Done.")]  # fmt: skip
    assert places == sorted(places)
    assert " of 54 s" in said
    assert reason(file) == ""


def test_the_command_that_it_prints_finds_the_record_and_allows_the_law(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The words of a folder are quoted; a record elsewhere and a law that is code are named."""
    folder = tmp_path / "the ship"
    folder.mkdir()
    law = {"kind": "python", "factory": "./mine.py:law", "measured": ["roll_rad"]}
    file, record = folder / "own.yaml", folder / "elsewhere.json"
    file.write_text(yaml.safe_dump({"name": "Own", "vessel": ON_BOARD, "law": law}))
    (folder / "mine.py").write_text("def law():\n    raise AssertionError\n")
    result = commission(monkeypatch, AtTheQuay, file, "--record", record)
    assert result.exit_code == ExitCode.OK, result.output
    (printed,) = [line for line in result.stdout.splitlines() if line.startswith("  utank-hil ")]
    assert shlex.split(printed) == [
        *("utank-hil", "run", str(file), "--bus", "can0", "--record", str(record)),
        *("--out", "log", "--allow-code"),
    ]
    config = load_config(file, ControllerConfig, allow_code=True)
    assert why_not_commissioned(config, "can0", file, record) == ""
    record.unlink()
    remedy = why_not_commissioned(config, "can0", file, record).partition("; run ")[2]
    assert shlex.split(remedy.removesuffix(" at the quay")) == [
        *("utank-hil", "commission", str(file), "--bus", "can0", "--record", str(record)),
    ]


@pytest.mark.evidence
def test_json_is_the_record_and_nothing_else(
    file: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "elsewhere.json"
    result = commission(monkeypatch, AtTheQuay, file, "--record", path, "--json")
    assert result.exit_code == ExitCode.OK
    printed = json.loads(result.stdout)
    assert printed.pop("record") == str(path)
    assert printed == json.loads(path.read_text())
    assert len(printed["checks"]) == 18


def test_ended_before_the_end_it_writes_nothing(
    file: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    class Short(AtTheQuay):
        stop_after_s = 10.0

    result = commission(monkeypatch, Short, file)
    assert result.exit_code == ExitCode.INTERRUPTED
    assert not record_path(file).exists()
    passed(file)
    commission(monkeypatch, Short, file)
    assert reason(file) == ""  # nothing has moved yet


def test_ended_while_the_pump_moves_it_leaves_no_older_record(
    file: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    """Whoever sees that the water goes the wrong way, and ends it, is not to arm with that."""

    class Short(AtTheQuay):
        stop_after_s = 35.0

    passed(file)
    result = commission(monkeypatch, Short, file)
    assert result.exit_code == ExitCode.INTERRUPTED
    assert "Pump and valve move" in capfd.readouterr().err
    assert "there is no record" in reason(file)


@pytest.mark.evidence("True")
@pytest.mark.parametrize("full", [False, True])
def test_the_record_before_is_void_whatever_hinders_the_new_one(
    file: Path, monkeypatch: pytest.MonkeyPatch, *, full: bool
) -> None:
    class Stopped(AtTheQuay):
        script = (*AtTheQuay.script, TimedAction(24.0, Action.STOP))

    def fails(*_: object) -> None:
        raise OSError(28, "No space left on device") if full else ZeroDivisionError("a defect")

    passed(file)
    assert reason(file) == ""
    replaced = "write_record" if full else "make_record"
    monkeypatch.setattr(module.commissioning_record, replaced, fails)
    result = commission(monkeypatch, Stopped, file)
    assert "there is no record" in reason(file)
    if full:
        assert result.exit_code == ExitCode.USAGE
        assert "ended early: Disarmed before the end." in result.stdout
        assert "can't be written: No space left on device" in result.stderr


def test_stopped_by_the_operator_it_is_not_passed(
    file: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    class Stopped(AtTheQuay):
        script = (*AtTheQuay.script, TimedAction(24.0, Action.STOP))

    result = commission(monkeypatch, Stopped, file)
    assert result.exit_code == ExitCode.REFUSED
    assert "ended early: Disarmed before the end." in result.stdout
    assert "not passed: arming is refused" in result.stdout
    assert "was not passed" in reason(file)


@pytest.mark.evidence
def test_who_arms_before_the_stage_asks_for_it_is_told_to_wait(
    file: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    class Early(AtTheQuay):
        script = (
            TimedAction(1.0, Action.ARM),
            TimedAction(2.0, Action.DISARM),
            *AtTheQuay.script,
        )

    assert commission(monkeypatch, Early, file).exit_code == ExitCode.OK
    said = capfd.readouterr().err
    assert said.count("not armed: wait until this asks for it") == 1
    assert "NOT_COMMISSIONED" not in said


def test_a_place_that_is_not_writable_is_named_before_the_ship_is_moved(
    file: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "file").write_text("")
    result = commission(monkeypatch, AtTheQuay, file, "--record", tmp_path / "file" / "r.json")
    assert result.exit_code == ExitCode.USAGE
    assert "--record" in result.output


@pytest.mark.parametrize(
    "there", ["name: a ship\n", "[1, 2]", '["commissioned_for"]', '{"roll_rad": 1.0}', "3", None]
)
def test_what_is_no_record_is_not_replaced_by_one(
    file: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, there: str | None
) -> None:
    path = tmp_path / "there"
    if there is None:
        os.mkfifo(path)
    else:
        path.write_text(there)
    result = commission(monkeypatch, AtTheQuay, file, "--record", path)
    assert result.exit_code == ExitCode.USAGE
    assert str(path) in result.output.replace("\n", "")
    assert "--record" in result.output
    assert path.is_fifo() if there is None else path.read_text() == there


@pytest.mark.parametrize(("name", "there"), [
    ("r.json", ""), ("r.json", None), ("r.json", '{"commissioned_for": {}}'),
    ("r.commissioning.json", "cut off {"),
])  # fmt: skip
def test_a_record_that_is_there_is_replaced(tmp_path: Path, name: str, there: str | None) -> None:
    if there is not None:
        (tmp_path / name).write_text(there)
    assert why_not_replaceable(tmp_path / name) == ""


def test_a_record_is_json_that_anybody_reads(file: Path) -> None:
    written = passed(file).read_text()
    assert "Infinity" not in written
    assert "NaN" not in written
    record_path(file).write_text(written.replace('"headroom_m": null', '"headroom_m": Infinity'))
    assert reason(file) == ""  # as it was written before


def test_a_record_counts_on_its_own_interface(file: Path) -> None:
    path = passed(file, "can1")
    assert "was made on can1, and this is other hardware; run" in reason(file, "can0")
    assert reason(file, "can1") == reason(file, "can1", path) == ""


def test_run_says_why_arming_will_be_refused(file: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("utank_hil.canbus.socketcan.SocketCanPort", QuietBus)
    words = ["run", str(file), "--bus", "any0", "--duration", "0.1", "--json"]
    result = CliRunner().invoke(app, words)
    assert json.loads(result.stdout)["not_commissioned"].startswith(f"{record_path(file)}: there")
    assert "arming will be refused:" in result.stderr
    passed(file, "any0")
    result = CliRunner().invoke(app, words)
    assert json.loads(result.stdout)["not_commissioned"] == ""
    assert "refused" not in result.stderr


def test_a_bit_rate_that_the_interface_has_not_is_refused(
    file: Path, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    link = [{"linkinfo": {"info_data": {"bittiming": {"bitrate": 500_000}}}}]
    ip = tmp_path / "ip"
    ip.write_text(f"#!/bin/sh\necho '{json.dumps(link)}'\n")
    ip.chmod(0o755)
    monkeypatch.setenv("PATH", str(tmp_path), prepend=":")
    for command in ("run", "commission"):
        result = CliRunner().invoke(app, [command, str(file), "--bus", "any0"])
        assert result.exit_code == ExitCode.USAGE
        said = result.output.replace("\n", " ")
        assert "bit_rate: is 250000, but any0 runs at 500000" in said
    assert why_other_bit_rate("any0", 500_000) == ""
    ip.write_text("#!/bin/sh\necho '[{}]'\n")  # a virtual interface
    assert why_other_bit_rate("any0", 500_000) == ""
