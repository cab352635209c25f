"""``utank-hil conform``: its record, its table, its exit codes."""

import json
import re
from inspect import getsource as source

import pytest
import yaml
from typer.testing import CliRunner

from firmware_sim.canopen_drive import CanopenPumpDrive
from tests.firmware_sim.drive_bench import VESSEL, calm_plant
from tests.nodes.canopen_peers import PROFILE
from utank_hil.base.tick import TICK_NS
from utank_hil.canbus import socketcan
from utank_hil.canbus.profiles.drive_plan import NetworkState, Place
from utank_hil.commands import conform as command
from utank_hil.configuration.device_sections import DriveSection
from utank_hil.console.common import new_app
from utank_hil.console.terminal import Terminal
from utank_hil.nodes.commissioning import checks as commissioning
from utank_hil.nodes.commissioning import conformance
from utank_hil.runners import NodeError

SAID = re.compile(r'Check\((?:"\w+"|f"{name}_ms"), "([^"]+)"')
"""What a check is of, as it stands in the code."""
SHIP = "configs/ships/thesis_first.yaml"


def invoke(*arguments):
    app = new_app()
    app.command()(command.conform)
    return CliRunner().invoke(app, [str(each) for each in arguments])


@pytest.fixture
def drive(monkeypatch):
    """The bench's drive on the interface, in simulated time."""
    plan = DriveSection(**PROFILE).plan(0, VESSEL.pump)
    made = CanopenPumpDrive(calm_plant(), VESSEL.pump, plan)

    class Port:
        def __init__(self, channel, *, standard, receive_only):
            assert (channel, standard, receive_only) == ("can0", True, False)

        def receive(self):
            return ()

        def close(self): ...

    class Loop:
        def __init__(self, nodes, port):
            (self.trial,) = nodes

        def run(self, ended):
            now_ns = 0
            while not ended():
                try:
                    frames = self.trial.tick(now_ns)
                except Exception as error:  # as the loop takes them
                    raise NodeError(f"{error}") from error
                for frame in frames:
                    made.receive(frame, now_ns)
                for frame in made.tick(now_ns):
                    self.trial.receive(frame, now_ns)
                now_ns += TICK_NS

    monkeypatch.setattr(socketcan, "SocketCanPort", Port)
    monkeypatch.setattr(command, "RealTimeLoop", Loop)
    return made


@pytest.fixture
def ship(tmp_path):
    with open(SHIP, encoding="utf-8") as file:
        content = yaml.safe_load(file)
    path = tmp_path / "ship.yaml"
    path.write_text(yaml.safe_dump(content | {"devices": {"pump": PROFILE}}), encoding="utf-8")
    return path


@pytest.mark.parametrize(
    ("of", "name", "figures", "shown"),
    [
        (conformance, "frames of wrong length, checksum or order", (1880.0, 1000.0, 150.0, "ms"),
         "1880 ms │ 1000 ± 150 │ pass"),
        (commissioning, "heel by levels and pressure, less roll", (0.0031, 0.0, 0.03, "deg/s"),
         "0.003 deg/s │ 0 ± 0.03 │ pass"),
    ],
)  # fmt: skip
def test_checks_are_a_table_at_80_columns(of, name, figures, shown, monkeypatch, capsys):
    monkeypatch.setenv("COLUMNS", "80")
    names = set(SAID.findall(source(of)))
    assert name in names
    check = dict(zip(("measured", "expected", "tolerance", "unit"), figures, strict=True))
    checks = [check | {"what": each, "verdict": "pass"} for each in names]
    command.print_checks(Terminal(), "motion of opv", checks)
    lines = capsys.readouterr().out.splitlines()
    assert len(lines) == len(names) + 5
    assert sum(shown in " ".join(line.split()) for line in lines) == len(names)


@pytest.mark.parametrize(("identity", "code"), [(0x22, 0), (0x23, 1)])
def test_the_record_says_what_was_seen(drive, ship, tmp_path, identity, code):
    drive.entries[Place(0x1018, 2)].value = identity
    path = tmp_path / "made.json"
    asked = ("pump", "--bus", "can0", "--ship", ship, "--record", path, "--hand-s", "1", "--json")
    done = invoke(*asked)
    assert done.exit_code == code, done.output
    told, record = json.loads(done.stdout), json.loads(path.read_text())
    assert told == record | {"record": str(path)}
    assert record["passed"] is (code == 0)
    assert record["checks"][0]["name"] == "set_up"
    assert ("1018h:2 is 0x23, not 0x22" in record["checks"][0]["remedy"]) is bool(code)


def test_where_nobody_can_answer_it_ends_before_the_pump_turns(drive, ship, tmp_path, monkeypatch):
    monkeypatch.setattr(command.select, "select", lambda read, *_: (read, [], []))
    record = tmp_path / "r"
    done = invoke("pump", "--bus", "can0", "--ship", ship, "--record", record)
    assert (done.exit_code, record.exists()) == (2, False)
    assert "the input has ended: use --hand-s" in done.stderr
    assert drive.state is NetworkState.PRE_OPERATIONAL  # as it started


def test_the_table_has_the_remedy(drive, ship, tmp_path):
    drive.entries[Place(0x1018, 2)].value = 0x23
    asked = ("pump", "--bus", "can0", "--ship", ship, "--record", tmp_path / "r", "--hand-s", "1")
    done = invoke(*asked)
    assert done.exit_code == 1
    assert "FAIL" in done.stdout
    assert "product" in done.stdout
    assert "does not conform" in done.stdout


@pytest.mark.parametrize(
    ("device", "words"),
    [("pump", "devices.pump is native.*utank-hil commission"), ("rudder", "no device.*levels")],
)
def test_what_has_no_profile_is_refused(device, words):
    done = invoke(device, "--bus", "can0", "--ship", SHIP)
    assert done.exit_code == 2
    assert re.search(words, " ".join(done.stderr.split()))


def test_an_interface_that_is_missing(ship, tmp_path):
    done = invoke("pump", "--bus", "nocan9", "--ship", ship, "--record", tmp_path / "record.json")
    assert done.exit_code == 3
