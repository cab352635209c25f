"""What the service manager is told, and when it is not."""

import socket
import threading
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from ports import QuietBus
from typer.testing import CliRunner

from utank_hil.cli import app
from utank_hil.commands import run as module
from utank_hil.commands import service_manager
from utank_hil.commands.lines import Lines
from utank_hil.commands.service_manager import ServiceManager
from utank_hil.console.exit_codes import ExitCode

GPC = Path("configs/controllers/gpc.yaml")


@pytest.fixture
def manager(tmp_path: Path):
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as heard:
        heard.bind(str(tmp_path / "notify"))
        heard.settimeout(10)
        yield heard


def environment(heard: socket.socket, watchdog_us: int = 500_000) -> dict[str, str]:
    return {"NOTIFY_SOCKET": heard.getsockname(), "WATCHDOG_USEC": str(watchdog_us)}


def test_a_watchdog_that_is_no_number_is_said(manager) -> None:
    with pytest.raises(OSError, match="WATCHDOG_USEC=soon is no number of microseconds"):
        ServiceManager(environment(manager) | {"WATCHDOG_USEC": "soon"})


def messages(heard: socket.socket) -> list[str]:
    heard.setblocking(False)
    found = []
    while True:
        try:
            found.append(heard.recv(4096).decode())
        except BlockingIOError:
            return found


def test_watchdog_is_fed_by_the_count_of_ticks_and_several_times_in_its_time(manager) -> None:
    with ServiceManager(environment(manager)) as service:
        for tick in range(100):  # a second
            service.progress(tick)
        assert messages(manager) == ["WATCHDOG=1"] * 9  # every 120 ms of 500
        for _ in range(1000):  # the loop's process lives, but nothing goes on
            service.progress(101)
        assert messages(manager) == []


def test_a_name_of_several_lines_is_one_line_and_no_order_to_the_manager(manager) -> None:
    with ServiceManager(environment(manager)) as service:
        service.ready("a\nWATCHDOG=trigger \ud800 on can0")
    assert messages(manager) == ["READY=1\nSTATUS=a WATCHDOG=trigger ? on can0"]


def test_ready_waits_for_a_manager_that_is_busy(manager) -> None:
    with ServiceManager(environment(manager)) as service:
        for _ in range(1000):  # its queue is full after some
            service.progress(0)
        reading = threading.Timer(0.2, manager.recv, [4096])
        reading.start()
        service.ready("here")
        reading.join()
        service.progress(0)  # a sign of life never waits
    assert messages(manager)[-1] == "READY=1\nSTATUS=here"


def test_a_manager_that_never_takes_it_is_an_error(manager, monkeypatch) -> None:
    monkeypatch.setattr(service_manager, "READY_S", 0.05)
    with ServiceManager(environment(manager)) as service:
        for _ in range(1000):
            service.progress(0)
        with pytest.raises(TimeoutError):
            service.ready("here")


@pytest.mark.slow
def test_run_that_the_manager_does_not_hear_is_started_again_and_controls_nothing(
    manager, monkeypatch: pytest.MonkeyPatch
) -> None:
    def unheard(*_: object) -> None:
        raise TimeoutError("timed out")

    monkeypatch.setattr("utank_hil.canbus.socketcan.SocketCanPort", QuietBus)
    monkeypatch.setattr(module, "RealTimeLoop", lambda *_, **__: pytest.fail("begun"))
    monkeypatch.setattr(ServiceManager, "ready", unheard)
    monkeypatch.setenv("NOTIFY_SOCKET", manager.getsockname())
    result = CliRunner().invoke(app, ["run", str(GPC), "--bus", "any0"])
    assert result.exit_code == ExitCode.SYSTEM
    assert "NOTIFY_SOCKET: the manager does not answer: timed out" in result.stderr


def test_without_a_watchdog_nothing_is_fed_and_without_a_manager_nothing_is_sent(manager) -> None:
    with ServiceManager({"NOTIFY_SOCKET": manager.getsockname()}) as service:
        service.ready("here")
        service.progress(0)
        service.stopping()
    assert messages(manager) == ["READY=1\nSTATUS=here", "STOPPING=1"]
    with ServiceManager({}) as nobody:
        nobody.ready("")
        nobody.progress(0)


def test_names_in_the_abstract_namespace_are_reached_too() -> None:
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as heard:
        heard.bind("\0utank-hil-test")
        with ServiceManager({"NOTIFY_SOCKET": "@utank-hil-test"}) as service:
            service.stopping()
        assert messages(heard) == ["STOPPING=1"]


def test_a_manager_that_does_not_listen_or_goes_away_never_holds_the_loop(manager) -> None:
    with ServiceManager(environment(manager, 10_000)) as service:
        for tick in range(5000):  # far more than its queue holds
            service.progress(tick)
        manager.close()
        service.progress(0)


def test_a_socket_that_is_not_there_is_said(tmp_path: Path) -> None:
    with pytest.raises(OSError, match="No such file"):
        ServiceManager({"NOTIFY_SOCKET": str(tmp_path / "nobody")})


@pytest.mark.slow
def test_run_tells_that_it_is_ready_alive_and_stopping_in_this_order(
    manager, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("utank_hil.canbus.socketcan.SocketCanPort", QuietBus)
    for name, value in environment(manager).items():
        monkeypatch.setenv(name, value)
    words = ["run", str(GPC), "--bus", "any0", "--duration", "0.5", "--json"]
    assert CliRunner().invoke(app, words).exit_code == ExitCode.OK
    first, *alive, last = messages(manager)
    assert first == "READY=1\nSTATUS=GPC, roll on any0"
    assert len(alive) >= 2
    assert set(alive) == {"WATCHDOG=1"}
    assert last == "STOPPING=1"


@pytest.mark.slow
def test_an_error_in_the_loop_ends_the_watchdog_before_its_traceback(
    manager, monkeypatch: pytest.MonkeyPatch
) -> None:
    """What is closed before it is printed takes longer than the watchdog waits."""

    class Broken(QuietBus):
        ticks = 0

        def receive(self):
            self.ticks += 1
            if self.ticks > 60:  # the first 35 are heard before the loop begins
                raise RuntimeError("a defect")
            return super().receive()

    told: list[list[str]] = []
    close = Lines.close

    def closing(lines: Lines) -> None:
        told.append(messages(manager))
        close(lines)

    monkeypatch.setattr(Lines, "close", closing)
    monkeypatch.setattr("utank_hil.canbus.socketcan.SocketCanPort", Broken)
    for name, value in environment(manager).items():
        monkeypatch.setenv(name, value)
    result = CliRunner().invoke(app, ["run", str(GPC), "--bus", "any0", "--duration", "5"])
    assert "a defect" in str(result.exception)
    assert [each[-1] for each in told] == ["STOPPING=1"]


@pytest.mark.slow
def test_ready_is_told_when_nothing_but_the_loop_is_left_to_begin(
    manager, monkeypatch: pytest.MonkeyPatch
) -> None:
    told: dict[str, list[str]] = {}

    def noting(step: str) -> Callable[..., Any]:
        do = getattr(module, step)

        def noted(*words: Any, **named: Any) -> Any:
            told[step] = messages(manager)
            return do(*words, **named)

        return noted

    class NoLoop:
        def __init__(self, *_: object, **__: object) -> None:
            told["loop"] = messages(manager)

        def run(self, *_: object) -> None:
            pass

    before = (
        *("open_port", "RunRecording", "retuner_process", "printed_lines"),
        *("build_controller_node", "scheduled"),
    )
    monkeypatch.setattr("utank_hil.canbus.socketcan.SocketCanPort", QuietBus)
    for step in before:
        monkeypatch.setattr(module, step, noting(step))
    monkeypatch.setattr(module, "RealTimeLoop", NoLoop)
    for name, value in environment(manager).items():
        monkeypatch.setenv(name, value)
    CliRunner().invoke(app, ["run", str(GPC), "--bus", "any0"])
    ready = {"loop": ["READY=1\nSTATUS=GPC, roll on any0"]}
    assert told == {step: [] for step in before} | ready


@pytest.mark.slow
def test_a_loop_that_stands_still_feeds_no_watchdog(
    manager, monkeypatch: pytest.MonkeyPatch
) -> None:
    class Standing:
        def __init__(self, *_: object, statistics: Any) -> None:
            self._statistics = statistics

        def run(self, stop: Callable[[], bool], _duration_ns: int | None) -> None:
            for ticks in (*range(25), *[25] * 1000):
                self._statistics.ticks = ticks
                stop()

    monkeypatch.setattr("utank_hil.canbus.socketcan.SocketCanPort", QuietBus)
    monkeypatch.setattr(module, "RealTimeLoop", Standing)
    for name, value in environment(manager).items():
        monkeypatch.setenv(name, value)
    CliRunner().invoke(app, ["run", str(GPC), "--bus", "any0"])
    assert messages(manager)[1:] == ["WATCHDOG=1"] * 3 + ["STOPPING=1"]  # at ticks 0, 12 and 24
