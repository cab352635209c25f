"""``run`` listens before it talks, and does not start beside another controller."""

from collections.abc import Sequence
from pathlib import Path
from typing import ClassVar

import ports
import pytest
from typer.testing import CliRunner

from utank_hil.canbus import ControllerStatus, Frame, load_catalogue
from utank_hil.cli import app

GPC = Path("configs/controllers/gpc.yaml")


class OccupiedBus(ports.QuietBus):
    """An interface on which another controller says how it is."""

    sent: ClassVar[list[Frame]] = []

    def receive(self) -> Sequence[Frame]:
        return (Frame(load_catalogue().codec(ControllerStatus).can_id, bytes(8)),)

    def send(self, frame: Frame) -> None:
        self.sent.append(frame)


def test_a_bus_on_which_nobody_sends_is_said_at_once(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("utank_hil.canbus.socketcan.SocketCanPort", ports.QuietBus)
    result = CliRunner().invoke(app, ["run", str(GPC), "--bus", "vcan7", "--duration", "0.1"])
    said = "vcan7: nothing came in 0.35 s: check wiring, termination and bit rate"
    assert said in " ".join(result.stderr.split())


def test_a_second_controller_is_refused_before_it_has_sent_a_frame(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr("utank_hil.canbus.socketcan.SocketCanPort", OccupiedBus)
    result = CliRunner().invoke(app, ["run", str(GPC), "--bus", "vcan7", "--duration", "1"])
    assert result.exit_code == 3
    assert "another controller is on this bus" in result.stderr
    assert OccupiedBus.sent == []
