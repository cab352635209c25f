"""Who takes a frame: the receiver of a message, or a device of another maker."""

from collections.abc import Callable
from typing import Any, TypeVar

from utank_hil.canbus import Frame, Receiver
from utank_hil.canbus.profiles.device import ProfiledDevice, Take, hear
from utank_hil.nodes.canopen_setup import SensorSetup
from utank_hil.safety.monitors.senders import Heard

_M = TypeVar("_M", bound=tuple[Any, ...])
Accept = Callable[[Frame], tuple[Any, ...] | None]
Handle = Callable[[Any, int], None]


class Routing:
    """Subscriptions by identifier."""

    def __init__(self) -> None:
        self.watched: list[Heard] = []  #: Counters of every message that is heard.
        self.setups: list[SensorSetup] = []  #: Sensors that are configured by SDO.
        self.devices: dict[int, Take] = {}  #: Devices of other makers.
        self._subscriptions: dict[int, tuple[Accept, Handle]] = {}
        self._sources: list[ProfiledDevice[Any]] = []

    def subscribe(self, receiver: Receiver[_M], handle: Callable[[_M, int], None]) -> Receiver[_M]:
        """Hand the accepted messages of a receiver to `handle`, with the time they came."""
        self.accept(receiver.can_id, receiver.accept, handle)
        self.watched.append(receiver)
        return receiver

    def accept(self, can_id: int, accept: Accept, handle: Handle) -> None:
        """Hand the messages of an identifier that `accept` returns to `handle`."""
        self._subscriptions[can_id] = accept, handle

    def hear(
        self, source: Receiver[_M] | ProfiledDevice[_M], handle: Callable[[_M, int], None]
    ) -> None:
        """Hand on what a node, or a device of another maker, has measured."""
        if isinstance(source, Receiver):
            self.subscribe(source, handle)
            return
        source.deliver = handle
        self._sources.append(source)
        if source.plan.steps:
            self.setups.append(SensorSetup(source))
        for can_id, take in source.takes.items():
            hear(self.devices, can_id, take)
        self.watched += source.watched

    def passes_on(self, frame: Frame, now_ns: int) -> bool:
        """Hand a frame on; False where nobody takes its identifier."""
        subscription = self._subscriptions.get(frame.can_id)
        if subscription is not None:
            accept, handle = subscription
            message = accept(frame)
            if message is not None:
                handle(message, now_ns)
            return True
        take = self.devices.get(frame.can_id)
        if take is None:
            return False
        take(frame, now_ns)
        return True

    def configures(self, now_ns: int) -> list[Frame]:
        """What CANopen sensors are configured with in this tick."""
        frames: list[Frame] = []
        for each in self.setups:
            frames += each.frames(now_ns)
        return frames

    def wakes(self, now_ns: int) -> list[Frame]:
        """What is to be sent to devices of other makers that are silent."""
        frames = (device.wake(now_ns) for device in self._sources)
        return [frame for frame in frames if frame is not None]
