"""Frames that came while a command was setting up look fresh, and are none."""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

import pytest
from ports import DeadBus, QuietBus
from typer.testing import CliRunner

from utank_hil.canbus import Frame
from utank_hil.cli import app
from utank_hil.commands import commission, run
from utank_hil.runners import real_time_scheduling

GPC = Path("configs/controllers/gpc.yaml")
OLD = Frame(0x123, bytes(8))


class BusyBus(QuietBus):
    """An interface on which frames came since it was opened."""

    waiting: list[Frame]

    def __init__(self, channel: str) -> None:
        BusyBus.waiting = [OLD]

    def receive(self) -> Sequence[Frame]:
        taken, BusyBus.waiting = BusyBus.waiting, []
        return taken


class FirstLook:
    """Stands for the real-time loop: takes what there is for its first tick."""

    heard: list[Sequence[Frame]]

    def __init__(self, _nodes: object, port: QuietBus, **_: object) -> None:
        self._port = port

    def run(self, *_: object) -> None:
        FirstLook.heard.append(self._port.receive())


@contextmanager
def slow_scheduling() -> Iterator[object]:
    """Lock so much memory that a frame comes meanwhile."""
    BusyBus.waiting.append(OLD)
    with real_time_scheduling() as report:
        yield report


@pytest.mark.evidence("commission")
@pytest.mark.slow
@pytest.mark.parametrize("name", ["run", "commission"])
def test_the_loop_is_handed_no_frame_that_came_before_it_began(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    FirstLook.heard = []
    for module in (run, commission):
        monkeypatch.setattr("utank_hil.canbus.socketcan.SocketCanPort", BusyBus)
        monkeypatch.setattr(module, "RealTimeLoop", FirstLook)
        monkeypatch.setattr("utank_hil.console.loops.real_time_scheduling", slow_scheduling)
    words = ["--record", str(tmp_path / "record.json")]
    CliRunner().invoke(app, [name, str(GPC), "--bus", "any0", *words])
    assert FirstLook.heard == [[]]


@pytest.mark.slow
def test_commission_begins_on_a_bus_that_is_down(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Its loop meets the error, too, and has nodes that react."""
    begun: list[object] = []

    class Loop(FirstLook):
        def run(self, *_: object) -> None:
            begun.append(self._port)

    monkeypatch.setattr("utank_hil.canbus.socketcan.SocketCanPort", DeadBus)
    monkeypatch.setattr(commission, "RealTimeLoop", Loop)
    words = ["--record", str(tmp_path / "record.json")]
    CliRunner().invoke(app, ["commission", str(GPC), "--bus", "any0", *words])
    assert len(begun) == 1
