"""Faults of the bus, and foreign nodes on it."""

from collections.abc import Iterable
from typing import Annotated, Any, Final, Literal

from pydantic import AfterValidator, Field, model_validator

from firmware_sim.fault_injection.bench_parts import (
    NEVER_NS,
    Bench,
    Disturbance,
    FaultyNode,
    OtherFrame,
    Span,
    Spoiled,
)
from firmware_sim.fault_injection.fault import (
    NODE_OF,
    SECOND_NS,
    Fault,
    FaultSpan,
    MessageName,
    NodeName,
    one_of,
)
from firmware_sim.fault_injection.signals import value_problems, values_of
from utank_hil.base.parameters import refuse
from utank_hil.canbus import Frame, Station, load_catalogue
from utank_hil.canbus.codec import FRAME_BYTES
from utank_hil.nodes.panel import OperatorPanel, TimedAction

BIT_RATE: Final = 250_000  #: Bit rate of the bus in bit/s (docs/can-catalogue.md).
_SHARE = Annotated[float, Field(gt=0, le=1)]


def _identifier(written: str) -> str:
    try:
        number = int(written, 16)
    except ValueError:
        number = -1
    if not 0 <= number < 1 << 29:
        raise ValueError("must be a hexadecimal identifier of at most 29 bits, such as '08FF1080'")
    return written


Identifier = Annotated[str, AfterValidator(_identifier)]


class BusFault(Fault):
    """Fault of the simulated bus; it cannot be injected on a real one."""

    needs = ("controller",)


class Disturbed(BusFault):
    """A gateway loses, delays, doubles or swaps a share of the frames."""

    kind: Literal["gateway"]
    does: Literal["loses", "delays", "doubles", "swaps"]  #: Kind of disturbance.
    share: _SHARE = 1.0  #: Share of the frames disturbed at random.
    message: MessageName | None = None  #: Message that is disturbed; all if none is named.
    by_s: FaultSpan | None = None  #: Delay of a frame.

    @model_validator(mode="after")
    def _delay(self) -> "Disturbed":
        if (self.by_s is None) is (self.does == "delays"):
            refuse("", [("by_s", "is for does: delays, which needs it")])
        return self

    def _place(self, bench: Bench, span: Span, seed: int) -> None:  # noqa: ARG002
        assert bench.bus is not None
        can_id = None if self.message is None else load_catalogue().named(self.message).codec.can_id
        by_ns = round((self.by_s or 0.0) * SECOND_NS)
        bench.bus.disturbances.append(Disturbance(span, self.does, self.share, can_id, by_ns))


class BitErrors(BusFault):
    """A share of the transmissions is destroyed; with `node`, as by a broken transceiver."""

    kind: Literal["bit_errors"]
    share: _SHARE  #: Share of the transmissions destroyed at random.
    node: NodeName | None = None
    """Node with the broken transceiver; without it the frames of all nodes are concerned."""

    def _place(self, bench: Bench, span: Span, seed: int) -> None:  # noqa: ARG002
        assert bench.bus is not None
        names = list(bench.nodes)
        sender = None if self.node is None else names.index(self.node)
        bench.bus.bit_errors.append((span, self.share, sender))

        def report(time_ns: int, of: int, reason: str) -> None:
            if of < len(names):
                bench.nodes[names[of]].link_error(time_ns, reason)

        bench.bus.link_error = report


class _Deaf:
    """Base of nodes that only send, during a span."""

    hears: frozenset[int] = frozenset()

    def __init__(self, name: str, span: Span, period_ns: int) -> None:
        self.name, self.period_ns, self._span = name, period_ns, span

    def receive(self, frame: Frame, now_ns: int) -> None:
        """Ignore the frame."""


class _Flooder(_Deaf):
    """Node that occupies a share of the bus with consecutive frames."""

    def __init__(self, name: str, frame: Frame, span: Span, per_s: float) -> None:
        super().__init__(name, span, 1_000_000)
        self._frame = frame
        self._per_tick = per_s * self.period_ns / SECOND_NS
        self._due = 0.0

    def tick(self, now_ns: int) -> Iterable[Frame]:
        """Send the frames that are due."""
        if not self._span.holds(now_ns):
            return ()
        self._due += self._per_tick
        count = int(self._due)
        self._due -= count
        return (self._frame,) * count


class Flood(Fault):
    """A node fills a share of the bus with frames of one identifier."""

    kind: Literal["flood"]
    identifier: Identifier  #: Identifier in hexadecimal, in candump's notation.
    #: Share of a bus of 250 kbit/s; above 1 the frames queue up.
    share: Annotated[float, Field(gt=0, le=3)]
    #: "extended", "standard" or "remote"; the last two are not passed to any node.
    format: Literal["extended", "standard", "remote"] = "extended"
    length: Annotated[int, Field(ge=0, le=FRAME_BYTES)] = FRAME_BYTES  #: Number of data bytes.

    @model_validator(mode="after")
    def _short(self) -> "Flood":
        if self.format == "standard" and int(self.identifier, 16) >= 1 << 11:
            refuse("", [("identifier", "must be below 800 in a standard frame")])
        return self

    def _place(self, bench: Bench, span: Span, seed: int) -> None:  # noqa: ARG002
        from utank_hil.runners import frame_bits

        # a standard identifier wins over the extended ones that begin with it
        number = int(self.identifier, 16)
        place = number << 18 if self.format == "standard" else number
        plain = Frame(place, bytes(self.length))
        frame = plain if self.format == "extended" else OtherFrame(*plain)
        if self.format != "extended" and bench.bus is not None:
            controller = bench.nodes["controller"]
            bench.bus.hear_others = lambda _: controller.other_frames(1)
        per_s = self.share * BIT_RATE / frame_bits(plain)
        bench.joining.append(_Flooder(f"flood {len(bench.joining)}", frame, span, per_s))

    def node_names(self) -> tuple[str, ...]:
        """None, or the controller, which counts frames of other formats."""
        return () if self.format == "extended" else ("controller",)


class _Sender(_Deaf):
    """Node that sends one message in its cycle, or once if it has none."""

    def __init__(self, name: str, fault: "Impostor", span: Span) -> None:
        kind, _, codec = load_catalogue().named(fault.message)
        super().__init__(name, span, codec.cycle_ns or 10_000_000)
        self._codec, self._ahead = codec, fault.ahead
        self._counter = fault.ahead - 1
        self.heard = Spoiled(Span(-NEVER_NS), self._follow, codec.can_id)
        self._message = kind(**values_of(kind, fault.values))
        self._done = False

    def _follow(self, frame: Frame, after_s: float) -> Iterable[Frame]:  # noqa: ARG002
        """Note the counter of the real sender's frame, up to the first own frame."""
        if not self._done and self._codec.protected and len(frame.data) > 1:
            self._counter = frame.data[1] + self._ahead - 1
        return (frame,)

    def tick(self, now_ns: int) -> Iterable[Frame]:
        """Send the message when due."""
        if not self._span.holds(now_ns) or (self._done and not self._codec.cycle_ns):
            return ()
        self._done = True
        self._counter = (self._counter + 1) & 15
        return (Frame(self._codec.can_id, self._codec.encode(self._message, self._counter)),)


class Impostor(Fault):
    """A second node also sends a message, in the right cycle and with a correct CRC."""

    kind: Literal["impostor"]
    message: Annotated[
        str, one_of("message", lambda: [each.codec.name for each in load_catalogue().messages])
    ]
    values: dict[str, float | bool | str | None]
    ahead: Annotated[int, Field(ge=0, le=15)] = 1
    """Lead of its first counter over the real sender's last one."""

    @model_validator(mode="after")
    def _known_values(self) -> "Impostor":
        named = load_catalogue().named(self.message)
        problems = value_problems(named, self.values)
        defaults: Any = getattr(named.kind, "_field_defaults", {})
        missing = [
            name for name in named.kind._fields if name not in self.values and name not in defaults
        ]
        problems += [(f"values.{name}", "is required but missing") for name in missing]
        refuse("", problems)
        return self

    def node_names(self) -> tuple[str, ...]:
        """None: nobody else need send the message."""
        return ()

    def _place(self, bench: Bench, span: Span, seed: int) -> None:  # noqa: ARG002
        sender = _Sender(f"impostor {len(bench.joining)}", self, span)
        real = bench.nodes.get(NODE_OF.get(load_catalogue().named(self.message).source, ""))
        if real is not None:
            real.spoiled.append(sender.heard)
        bench.joining.append(sender)


class SecondPanel(Fault):
    """A second operator's station, whose times count from its first frame of the controller."""

    kind: Literal["second_panel"]
    operator: tuple[TimedAction, ...] = ()  #: Actions at that station.

    def _place(self, bench: Bench, span: Span, seed: int) -> None:  # noqa: ARG002
        panel = OperatorPanel(
            load_catalogue(),
            configuration_version=bench.version,
            script=self.operator,
            station=Station.OPERATOR_2,
        )
        panel.name = f"second panel {len(bench.joining)}"
        node = FaultyNode(panel)
        node.hangs += [Span(-NEVER_NS, span.begin_ns), Span(span.end_ns)]
        bench.joining.append(node)
