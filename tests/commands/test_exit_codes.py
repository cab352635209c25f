"""What a command tells by its exit code."""

import errno
import json
import os
import signal
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace

import pytest
from ports import DeadBus, QuietBus
from typer.testing import CliRunner

from utank_hil.canbus import Fault, Mode
from utank_hil.cli import app
from utank_hil.commands import lines
from utank_hil.commands import panel as operating
from utank_hil.commands import run as module
from utank_hil.console.exit_codes import ExitCode

GPC = Path("configs/controllers/gpc.yaml")


@pytest.mark.parametrize(
    ("mode", "fault", "link_lost", "code"),
    [
        (Mode.STANDBY, Fault.NONE, False, ExitCode.OK),
        (Mode.ACTIVE, Fault.LEVEL_LIMIT, False, ExitCode.OK),  # the law gave zero, not latched
        (Mode.INIT, Fault.MOTION_SILENT, False, ExitCode.OK),  # still waits
        (Mode.FAULT, Fault.MOTION_SILENT, False, ExitCode.FAULT),
        (Mode.FAULT, Fault.BUS_LOST, False, ExitCode.BUS_LOST),
        (Mode.FAULT, Fault.MOTION_SILENT, True, ExitCode.BUS_LOST),
        (Mode.INIT, Fault.BUS_LOST, True, ExitCode.BUS_LOST),
    ],
)
def test_run_ends_with_a_code_of_its_own_for_a_fault_and_for_a_lost_bus(
    mode: Mode, fault: Fault, link_lost: bool, code: ExitCode
) -> None:
    node = SimpleNamespace(mode=mode, fault=fault, measured=SimpleNamespace(link_lost=link_lost))
    assert module._code(node) is code


@pytest.mark.slow
def test_run_on_a_bus_that_is_down_ends_with_the_code_of_a_lost_bus(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr("utank_hil.canbus.socketcan.SocketCanPort", DeadBus)
    words = ["run", str(GPC), "--bus", "any0", "--duration", "0.3", "--json"]
    result = CliRunner().invoke(app, words)
    assert result.exit_code == ExitCode.BUS_LOST
    assert "the bus does not work yet: down" in result.stderr
    report = json.loads(result.stdout)
    assert (report["exit_code"], report["fault"]) == (ExitCode.BUS_LOST, "BUS_LOST")


@pytest.mark.parametrize("words", [["bench", "--realtime"], ["faults"]])
def test_a_bench_on_a_bus_that_is_down_is_not_begun(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, words: list[str]
) -> None:
    monkeypatch.setattr("utank_hil.canbus.socketcan.SocketCanPort", DeadBus)
    result = CliRunner().invoke(app, [*words, "--bus", "any0", "--out", str(tmp_path / "out")])
    assert result.exit_code == ExitCode.NO_BUS
    assert result.stderr.splitlines()[-1] == "error: --bus any0: down"


def test_run_that_is_ended_before_its_first_tick_ends_in_words(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    class Ended(QuietBus):
        """An interface during whose start the service is stopped."""

        def receive(self) -> tuple[()]:
            signal.raise_signal(signal.SIGTERM)
            return ()

    monkeypatch.setattr("utank_hil.canbus.socketcan.SocketCanPort", Ended)
    result = CliRunner().invoke(app, ["run", str(GPC), "--bus", "any0", "--json"])
    assert result.exit_code == ExitCode.OK
    report = json.loads(result.stdout)
    assert (report["mode"], report["loop"]["ticks"]) == ("INIT", 0)


def test_run_that_the_system_refuses_memory_is_started_again(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def refuse(*_: object, **__: object) -> None:
        raise OSError(errno.EMFILE, "Too many open files", "/psm_1")

    monkeypatch.setattr("utank_hil.canbus.socketcan.SocketCanPort", QuietBus)
    monkeypatch.setattr(module, "RunRecording", refuse)
    result = CliRunner().invoke(app, ["run", str(GPC), "--bus", "any0"])
    assert result.exit_code == ExitCode.SYSTEM
    assert result.stderr.splitlines()[-1] == "error: /psm_1: Too many open files"
    unit = Path("deploy/utank-hil.service").read_text(encoding="utf-8")
    (line,) = [line for line in unit.splitlines() if line.startswith("RestartPreventExitStatus=")]
    assert str(int(ExitCode.SYSTEM)) not in line.partition("=")[2].split()


@pytest.mark.parametrize(
    "words",
    [
        ["commission", str(GPC), "--bus", "any0", "--record", "{}/record.json"],
        ["panel", "configs/ships/thesis_first.yaml", "--bus", "any0"],
    ],
)
def test_a_command_that_is_refused_a_process_can_be_started_again(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, words: list[str]
) -> None:
    def refuse() -> None:
        raise OSError(errno.EAGAIN, "Resource temporarily unavailable")

    monkeypatch.setattr("utank_hil.canbus.socketcan.SocketCanPort", QuietBus)
    monkeypatch.setattr(operating, "SocketCanPort", QuietBus)
    monkeypatch.setattr(lines, "Lines", refuse)
    result = CliRunner().invoke(app, [word.format(tmp_path) for word in words])
    assert result.exit_code == ExitCode.SYSTEM
    assert "Resource temporarily unavailable" in result.stderr
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(("number", "named"), [(errno.ENOMEM, True), (errno.EBADF, False)])
def test_run_names_what_the_system_refuses_and_hides_no_defect(
    monkeypatch: pytest.MonkeyPatch, number: int, *, named: bool
) -> None:
    def refuse(*_: object, **__: object) -> None:
        raise OSError(number, "reason")

    monkeypatch.setattr("utank_hil.canbus.socketcan.SocketCanPort", QuietBus)
    monkeypatch.setattr(module, "build_controller_node", refuse)
    result = CliRunner().invoke(app, ["run", str(GPC), "--bus", "any0"])
    assert isinstance(result.exception, SystemExit if named else OSError)
    assert result.exit_code == (ExitCode.SYSTEM if named else 1)


@pytest.mark.evidence("full-stdout", "closed-stderr", "closed-stdout")
@pytest.mark.slow
@pytest.mark.parametrize("stream", ["stdout", "stderr"])
@pytest.mark.parametrize("gone", ["full", "closed"])
def test_run_goes_on_and_keeps_its_code_where_its_terminal_is_full_or_gone(
    stream: str, gone: str
) -> None:
    program = (
        "import ports, utank_hil.canbus.socketcan\n"
        "utank_hil.canbus.socketcan.SocketCanPort = ports.DeadBus\n"
        "from utank_hil.cli import main; main()"
    )
    words = ["run", str(GPC), "--bus", "any0", "--duration", "0.3"]
    read, written = os.pipe()
    os.close(read)
    with Path("/dev/full").open("w") as full, os.fdopen(written, "w") as closed:
        done = subprocess.run(
            [sys.executable, "-c", program, *words],
            env=os.environ | {"PYTHONPATH": str(Path(__file__).parent)},
            **{"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
            | {stream: full if gone == "full" else closed},  # type: ignore[call-overload]
            check=False,
        )
    assert done.returncode == ExitCode.BUS_LOST


def test_codes_differ_and_the_shells_own_are_left_alone() -> None:
    assert len(set(ExitCode)) == len(list(ExitCode)) == len(ExitCode.__members__)
    as_by_signals = {128 + signal.SIGINT: "INTERRUPTED", 128 + signal.SIGPIPE: "UNREAD"}
    assert {code: code.name for code in ExitCode if code >= 126} == as_by_signals
