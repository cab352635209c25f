"""``utank-hil bus`` with a log: its table, its JSON, its exit codes."""

import errno
import json
import time
from pathlib import Path

import can
import pytest
from others import others_file
from typer.testing import CliRunner

from utank_hil.canbus import socketcan
from utank_hil.commands.bus import bus
from utank_hil.console.common import new_app

SHIP = "configs/ships/thesis_first.yaml"


def invoke(*arguments):
    app = new_app()
    app.command()(bus)
    return CliRunner().invoke(app, [str(each) for each in arguments])


def log():
    return others_file("devices/frames/cia402-sample.candump.log")


def test_the_table_fits_in_80_columns(monkeypatch):
    monkeypatch.setenv("COLUMNS", "80")
    done = invoke(log())
    assert done.exit_code == 0
    table = [line for line in done.stdout.splitlines() if "│" in line]
    assert len(table) == 26
    assert max(map(len, done.stdout.splitlines())) <= 80
    assert "node 5: operational" in done.stdout


def test_the_longest_message_and_a_gap_of_minutes_fit_in_80_columns(monkeypatch, tmp_path):
    monkeypatch.setenv("COLUMNS", "80")
    path = tmp_path / "claims.log"
    claim = "18EEFF80#8000000000000000"
    path.write_text(f"(10.000000) can0 {claim}\n(128.820000) can0 {claim}\n")
    (row,) = [line for line in invoke(path).stdout.splitlines() if "18EEFF80" in line]
    assert row.split()[1::2] == ["18EEFF80", "ADDRESS_CLAIM_CONTROLLER", "CONTROLLER",
                                 "0.008", "118820", "8"]  # fmt: skip


def test_json_is_one_object():
    told = json.loads(invoke(log(), "--json").stdout)
    assert len(told["messages"]) == 26
    assert told["canopen"]["1"] == "operational"
    assert 0 < told["load"] < 1


def test_a_ship_that_is_not_there_is_missed():
    done = invoke(log(), "--ship", SHIP, "--json")
    assert done.exit_code == 1
    told = json.loads(done.stdout)
    assert {each["kind"] for each in told["problems"]} == {"missing"}
    assert any("SENSOR_MOTION" in each["text"] for each in told["problems"])


@pytest.mark.parametrize(
    ("failure", "code", "said"),
    [
        (
            can.CanOperationError("down", errno.ENETDOWN),
            3,
            "lo: down; bring it up: ip link set lo up",
        ),
        (None, 0, "nothing came in 0.5 s: check wiring, termination and bit rate"),
    ],
)
def test_an_interface_that_is_down_or_silent_is_said(monkeypatch, failure, code, said):
    class Bus:
        def __init__(self, *_, **__):
            pass

        def recv(self, timeout_s):
            if failure:
                raise failure
            time.sleep(timeout_s)

        def shutdown(self):
            pass

    monkeypatch.setattr(socketcan, "SocketcanBus", Bus)
    monkeypatch.setattr(socketcan, "_SYSFS", Path("nowhere"))
    done = invoke("lo", "--seconds", "0.5")
    assert done.exit_code == code
    assert said in done.output


@pytest.mark.parametrize(("place", "code"), [("nowhere.log", 2), ("nocan9", 3)])
def test_what_can_not_be_listened_to(place, code):
    assert invoke(place).exit_code == code
