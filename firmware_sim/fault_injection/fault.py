"""What every fault has."""

from abc import ABC, abstractmethod
from functools import partial
from typing import Annotated, Any, ClassVar, Final

from pydantic import AfterValidator

from firmware_sim.fault_injection.faulty_node import NEVER_NS, Span, Spoil, Spoiled
from firmware_sim.fault_injection.place import Bench
from utank_hil.base.parameters import Problem, Range
from utank_hil.canbus import Address, Frame, load_catalogue
from utank_hil.canbus.catalogue import NamedMessage
from utank_hil.canbus.codec import FRAME_BYTES
from utank_hil.configuration import Section
from utank_hil.configuration.known_keys import nearest

SECOND_NS: Final = 1_000_000_000
LONGEST_FAULT_S: Final = 86_400.0
"""A day, the longest run of a scenario: no time of a fault is greater."""

NODE_OF: Final = {
    Address.SENSORS: "sensors",
    Address.DRIVE: "drive",
    Address.VALVE: "valve",
    Address.OPERATOR: "panel",
    Address.SENSORS_2: "sensors_2",
    Address.HARDWIRED: "hardwired",
    Address.CONTROLLER: "controller",
}
"""Name of the emulated node at an address."""


def _choice(of: str, choices: list[str], name: str) -> str:
    if name in choices:
        return name
    near = nearest(name, choices)
    hint = f"; did you mean {near}?" if near else f"; there are {', '.join(choices)}"
    raise ValueError(f"is no {of}{hint}")


def sent_by_nodes() -> list[str]:
    """Names of the messages that an emulated node sends."""
    return [each.codec.name for each in load_catalogue().messages if each.source in NODE_OF]


MessageName = Annotated[
    str, AfterValidator(lambda name: _choice("message of an emulated node", sent_by_nodes(), name))
]
AnyMessageName = Annotated[
    str,
    AfterValidator(
        lambda name: _choice(
            "message", [each.codec.name for each in load_catalogue().messages], name
        )
    ),
]
NodeName = Annotated[str, AfterValidator(partial(_choice, "node", list(NODE_OF.values())))]


FaultTime = Annotated[float, Range(least=0, most=LONGEST_FAULT_S)]
FaultSpan = Annotated[float, Range(above=0, most=LONGEST_FAULT_S)]


class Fault(Section, ABC):
    """When a fault is there: `at_s` after the start, for `for_s` or till the end."""

    replayable: ClassVar[bool] = True
    """Whether a controller without it, handed the same frames, would do the same."""
    needs: ClassVar[tuple[str, ...]] = ()
    """Nodes that must be emulated for any fault of the kind."""

    at_s: FaultTime = 0.0
    for_s: FaultSpan | None = None

    def span(self, start_ns: int) -> Span:
        """When it is there, of a run whose faults count from `start_ns`."""
        begin_ns = start_ns + round(self.at_s * SECOND_NS)
        lasts_ns = NEVER_NS if self.for_s is None else round(self.for_s * SECOND_NS)
        return Span(begin_ns, begin_ns + lasts_ns)

    def node_names(self) -> tuple[str, ...]:
        """Nodes that must be emulated for it."""
        return self.needs

    @property
    def beyond_commands(self) -> bool:
        """Whether the pump presses on whatever it is commanded."""
        return False

    @property
    def spoiled_message(self) -> str | None:
        """The message that it alone alters; None of one that alters none, or all."""
        return getattr(self, "message", None)

    @abstractmethod
    def place(self, bench: Bench, span: Span, seed: int) -> None:
        """Place it; `seed` is of what it draws."""


class MessageFault(Fault):
    """A fault of one message, at the node that sends it."""

    message: MessageName

    @property
    def named(self) -> NamedMessage:
        """The message in the catalogue."""
        return load_catalogue().named(self.message)

    def node_names(self) -> tuple[str, ...]:
        """The sender."""
        return (NODE_OF[self.named.source],)

    def spoil_frames(self, bench: Bench, span: Span, spoil: Spoil) -> None:
        """Spoil the message's frames where they leave their node."""
        _, source, codec = self.named
        bench.nodes[NODE_OF[source]].spoiled.append(Spoiled(span, spoil, codec.can_id))


def whole_cycles(by_s: float, cycle_ns: int) -> int:
    """Cycles that a delay takes: no less than it, and one at least."""
    return max(1, -(-round(by_s * SECOND_NS) // cycle_ns))


def intact(named: NamedMessage, frame: Frame) -> Any:
    """What a frame of the message says, None if another fault has been at it."""
    return named.codec.decode(frame.data) if len(frame.data) == FRAME_BYTES else None


def signal_problems(
    message: NamedMessage, signals: dict[str, Any] | tuple[str, ...]
) -> list[Problem]:
    """Names that a message has no signal for."""
    known = message.kind._fields  # type: ignore[attr-defined]  # a NamedTuple
    return [
        (
            f"signals.{place}" if isinstance(signals, tuple) else f"values.{name}",
            f"is no signal of {message.codec.name}; it has {', '.join(known)} (got {name!r})",
        )
        for place, name in enumerate(signals)
        if name not in known
    ]
