"""Interfaces for the command `run` where there is no CAN."""

from collections.abc import Sequence

from utank_hil.canbus import Frame, PortError


class QuietBus:
    """An interface on which nobody sends."""

    others = 0

    def __init__(self, channel: str, can_ids: object = None) -> None:
        pass

    def send(self, frame: Frame) -> None:
        pass

    def receive(self) -> Sequence[Frame]:
        return ()

    def close(self) -> None:
        pass


class DeadBus(QuietBus):
    """An interface that opens, and then takes and gives nothing."""

    def send(self, frame: Frame) -> None:
        raise PortError("down")

    def receive(self) -> Sequence[Frame]:
        raise PortError("down")
