"""Common base of all faults."""

from abc import ABC, abstractmethod
from collections.abc import Callable
from itertools import count
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Final

from pydantic import AfterValidator

from firmware_sim.fault_injection.bench_parts import NEVER_NS, Bench, Span, Spoil, Spoiled
from utank_hil.base.parameters import Problem, Range
from utank_hil.canbus import Address, load_catalogue
from utank_hil.canbus.catalogue import NamedMessage
from utank_hil.configuration import Section
from utank_hil.configuration.error_words import nearest

SECOND_NS: Final = 1_000_000_000
LONGEST_FAULT_S: Final = 86_400.0  #: Latest time of a fault: a day, the longest run of a scenario.

NODE_OF: Final[dict[Address, str]] = {
    **{each: each.name.lower() for each in Address if each is not Address.OPERATOR_2},
    Address.OPERATOR: "panel",
}  #: Name of the emulated node at an address.


def one_of(what: str, names: Callable[[], list[str]]) -> AfterValidator:
    """Return the validator of a name that must be one of some."""

    def known(name: str) -> str:
        choices = names()
        if name not in choices:
            near = nearest(name, choices)
            hint = f"did you mean {near}?" if near else f"there are {', '.join(choices)}"
            raise ValueError(f"is no {what}; {hint}")
        return name

    return AfterValidator(known)


def sent_by_nodes() -> list[str]:
    """Names of the messages that an emulated node sends."""
    return [each.codec.name for each in load_catalogue().messages if each.source in NODE_OF]


MessageName = Annotated[str, one_of("message of an emulated node", sent_by_nodes)]
NodeName = Annotated[str, one_of("node", lambda: list(NODE_OF.values()))]
FaultTime = Annotated[float, Range(least=0, most=LONGEST_FAULT_S)]
FaultSpan = Annotated[float, Range(above=0, most=LONGEST_FAULT_S)]


class Fault(Section, ABC):
    """Fault that begins `at_s` after the start and lasts `for_s` or to the end."""

    replayable: ClassVar[bool] = True
    """Whether a controller without the fault would react in the same way to the same frames."""
    needs: ClassVar[tuple[str, ...]] = ()
    """Nodes that must be emulated for every fault of the kind."""

    if TYPE_CHECKING:
        kind: str  #: Each class that has one is a kind of faults (`kinds`).
    at_s: FaultTime = 0.0
    for_s: FaultSpan | None = None

    def node_names(self) -> tuple[str, ...]:
        """Nodes that must be emulated: those of the kind, its own, the sender of its message."""
        own, message = getattr(self, "node", None), getattr(self, "message", None)
        sender = message and NODE_OF[load_catalogue().named(message).source]
        return (*self.needs, *filter(None, (own, sender)))

    @property
    def beyond_commands(self) -> bool:
        """Whether the pump keeps up pressure whatever the command."""
        return False

    @property
    def spoiled_message(self) -> str | None:
        """Message that it alone alters; None if it alters none, or all."""
        return getattr(self, "message", None)

    def place(self, bench: Bench, start_ns: int, seed: int) -> None:
        """Place the fault in a bench; `seed` determines its random values."""
        begin_ns = start_ns + round(self.at_s * SECOND_NS)
        lasts_ns = NEVER_NS if self.for_s is None else round(self.for_s * SECOND_NS)
        self._place(bench, Span(begin_ns, begin_ns + lasts_ns), seed)

    @abstractmethod
    def _place(self, bench: Bench, span: Span, seed: int) -> None:
        """Place the fault for a span of time."""


class MessageFault(Fault):
    """Fault of one message, at the node that sends it."""

    message: MessageName
    of_frames: ClassVar[bool] = False
    """Whether frames of any layout can have it; else it spoils what a device measures."""
    of_catalogue: ClassVar[bool] = False
    """Whether it spoils counter, CRC or length, which are only the catalogue's own."""

    @property
    def named(self) -> NamedMessage:
        """Message in the catalogue."""
        return load_catalogue().named(self.message)

    @abstractmethod
    def _spoil(self, seed: int) -> Spoil:
        """Return the function that spoils a frame."""

    def _place(self, bench: Bench, span: Span, seed: int) -> None:
        codec = self.named.codec
        node = bench.nodes[self.node_names()[0]]
        device = getattr(node.node, "devices", {}).get(codec.can_id)
        if device is None or not self.of_frames:
            spoiled = Spoiled(span, self._spoil(seed), codec.can_id)
            (node if device is None else device).spoiled.append(spoiled)
            return
        for each in device.plan.messages:  # of a device of another maker
            node.spoiled.append(Spoiled(span, self._spoil(seed), each.can_ids[-1]))


def one_in(every: int) -> Callable[[], bool]:
    """Return a function that is true at its first call, and at one in `every` from then on."""
    calls = count()
    return lambda: next(calls) % every == 0


def signal_problems(
    message: NamedMessage, signals: dict[str, Any] | tuple[str, ...]
) -> list[Problem]:
    """Problems of names that are no signals of a message."""
    known = message.kind._fields
    return [
        (
            f"signals.{place}" if isinstance(signals, tuple) else f"values.{name}",
            f"is no signal of {message.codec.name}; it has {', '.join(known)} (got {name!r})",
        )
        for place, name in enumerate(signals)
        if name not in known
    ]
