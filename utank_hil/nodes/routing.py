"""Who takes a frame: the receiver of a message, or a device of another maker."""

from collections.abc import Callable
from typing import Any, TypeVar

from utank_hil.canbus import Frame, Receiver
from utank_hil.canbus.profiles.device import ProfiledDevice, Taker, hear
from utank_hil.nodes.canopen_setup import Emergency, SensorSetup
from utank_hil.safety.monitors.senders import Heard

_M = TypeVar("_M", bound=tuple[Any, ...])
Accept = Callable[[Frame], tuple[Any, ...] | None]
Handle = Callable[[Any, int], None]


class _Subscription(Taker):
    def __init__(self, accept: Accept, handle: Handle) -> None:
        self._accept, self._handle = accept, handle

    def take(self, frame: Frame, now_ns: int) -> None:
        message = self._accept(frame)
        if message is not None:
            self._handle(message, now_ns)


class Routing:
    """Subscriptions by identifier."""

    def __init__(self) -> None:
        self.watched: list[Heard] = []  #: Counters of every message that is heard.
        self.setups: list[SensorSetup] = []  #: Sensors that are configured by SDO.
        self.takers: dict[int, Taker] = {}  #: What takes the frames of an identifier.
        self.emergencies: list[tuple[str, Emergency]] = []  #: Of CANopen devices, by their names.
        self._sources: list[ProfiledDevice[Any]] = []

    def subscribe(self, receiver: Receiver[_M], handle: Callable[[_M, int], None]) -> Receiver[_M]:
        """Hand the accepted messages of a receiver to `handle`, with the time they came."""
        self.accept(receiver.can_id, receiver.accept, handle)
        self.watched.append(receiver)
        return receiver

    def accept(self, can_id: int, accept: Accept, handle: Handle) -> None:
        """Hand the messages of an identifier that `accept` returns to `handle`."""
        self.takers[can_id] = _Subscription(accept, handle)

    def hear(
        self, source: Receiver[_M] | ProfiledDevice[_M], handle: Callable[[_M, int], None]
    ) -> None:
        """Hand on what a node, or a device of another maker, has measured."""
        if isinstance(source, Receiver):
            self.subscribe(source, handle)
            return
        source.deliver = handle
        self._sources.append(source)
        plan = source.plan
        if plan.steps:
            self.setups.append(SensorSetup(source))
            self.emergencies.append((plan.name, self.setups[-1].setup.emergency))
        elif plan.node is not None:  # it is heard, and told nothing
            emergency = Emergency(plan.bus, plan.node)
            hear(self.takers, emergency.can_id, emergency)
            self.emergencies.append((plan.name, emergency))
        for can_id, taker in source.takers.items():
            hear(self.takers, can_id, taker)
        self.watched += source.watched

    @property
    def device_error(self) -> bool:
        """Whether a CANopen device reports an error."""
        return any(emergency.words for _, emergency in self.emergencies)

    @property
    def errors(self) -> list[str]:
        """Device, node, code and register of each that reports an error."""
        return [f"{name}: {each.node_words}" for name, each in self.emergencies if each.words]

    def configures(self, now_ns: int) -> list[Frame]:
        """What CANopen sensors are configured with in this tick."""
        frames: list[Frame] = []
        for each in self.setups:
            frames += each.frames(now_ns)
        return frames

    def wakes(self, now_ns: int) -> list[Frame]:
        """What is to be sent to devices of other makers that are silent."""
        frames = []
        for device in self._sources:
            frame = device.wake(now_ns)
            if frame is not None:
                frames.append(frame)
        return frames
