"""Faults of a message's signals; counter, CRC and cycle stay correct."""

import random
from abc import abstractmethod
from collections import deque
from collections.abc import Callable, Iterable, Mapping, Sequence
from enum import IntEnum
from typing import Annotated, Any, ClassVar, Literal, get_type_hints

from pydantic import Field, model_validator

from firmware_sim.fault_injection import fault
from firmware_sim.fault_injection.bench_parts import Spoil
from utank_hil.base.parameters import Finite, Positive, refuse
from utank_hil.canbus import Frame, load_catalogue
from utank_hil.canbus.catalogue import NamedMessage
from utank_hil.canbus.codec import field_kind

Change = Callable[[Sequence[Any], float], Sequence[Any]]
"""Function of the true values and the time in s since the fault that gives the faulty values."""


class SignalFault(fault.MessageFault):
    """Fault of some signals of a message."""

    signals: Annotated[tuple[str, ...], Field(min_length=1)]
    measured: ClassVar[bool] = True  #: Whether the signals must be physical quantities.

    @model_validator(mode="after")
    def _known_numbers(self) -> "SignalFault":
        problems = fault.signal_problems(self.named, self.signals)
        hints = get_type_hints(self.named.kind)
        problems += [
            (f"signals.{place}", f"is no measured quantity (got {name!r})")
            for place, name in enumerate(self.signals)
            if not problems and self.measured and hints[name] is not float
        ]
        refuse("", problems)
        return self

    @abstractmethod
    def _change(self, seed: int) -> Change:
        """Return the function that changes the values."""

    def _spoil(self, seed: int) -> Spoil:
        kind = self.named.kind
        places = [kind._fields.index(name) for name in self.signals]
        change = self._change(seed)

        def changed(message: Any, since_s: float) -> Any:
            values = list(message)
            new = change([values[place] for place in places], since_s)
            for place, value in zip(places, new, strict=True):
                values[place] = value
            return kind(*values)

        return _altered(self.named, changed)


def _altered(named: NamedMessage, change: Callable[[Any, float], Any]) -> Spoil:
    """Return a function that changes a message, keeps its counter and computes its CRC again."""
    codec = named.codec

    def alter(frame: Frame, since_s: float) -> Iterable[Frame]:
        message = load_catalogue().decoded(frame)
        if message is None:  # another fault has damaged it
            return (frame,)
        data = codec.encode(change(message, since_s), frame.data[1] & 15)
        return (Frame(codec.can_id, data),)

    return alter


class Stuck(SignalFault):
    """The signals keep their values from the start of the fault."""

    measured = False
    kind: Literal["stuck"]

    def _change(self, seed: int) -> Change:  # noqa: ARG002
        held: list[Sequence[Any]] = []

        def stay(values: Sequence[Any], _: float) -> Sequence[Any]:
            held.append(values) if not held else None
            return held[0]

        return stay


class Offset(SignalFault):
    """The signals have a constant offset."""

    kind: Literal["offset"]
    by: Finite  #: Offset of each signal in its unit.

    def _change(self, seed: int) -> Change:  # noqa: ARG002
        return lambda values, _: [value + self.by for value in values]


class Scale(SignalFault):
    """The signals are too great or too small by a factor."""

    kind: Literal["scale"]
    times: Finite  #: Factor on each signal.

    def _change(self, seed: int) -> Change:  # noqa: ARG002
        return lambda values, _: [value * self.times for value in values]


class Drift(SignalFault):
    """The signals drift."""

    kind: Literal["drift"]
    by_per_s: Finite  #: Drift of each signal in its unit per second.

    def _change(self, seed: int) -> Change:  # noqa: ARG002
        return lambda values, since_s: [value + self.by_per_s * since_s for value in values]


class Noise(SignalFault):
    """White Gaussian noise is added to the signals."""

    kind: Literal["noise"]
    deviation: Positive  #: Standard deviation in the signals' unit.

    def _change(self, seed: int) -> Change:
        draw = random.Random(seed).gauss
        return lambda values, _: [value + draw(0.0, self.deviation) for value in values]


class Spikes(SignalFault):
    """One sample in `every` has an offset."""

    kind: Literal["spikes"]
    by: Finite  #: Offset of that sample in the signal's unit.
    every: Annotated[int, Field(ge=2)]

    def _change(self, seed: int) -> Change:  # noqa: ARG002
        strikes = fault.one_in(self.every)
        return lambda values, _: [value + self.by for value in values] if strikes() else values


class Sign(SignalFault):
    """The signals have the wrong sign."""

    kind: Literal["sign"]

    def _change(self, seed: int) -> Change:  # noqa: ARG002
        return lambda values, _: [-value for value in values]


class Swapped(SignalFault):
    """Two signals are exchanged."""

    kind: Literal["swapped"]
    signals: Annotated[tuple[str, ...], Field(min_length=2, max_length=2)]

    def _change(self, seed: int) -> Change:  # noqa: ARG002
        return lambda values, _: values[::-1]


class Late(SignalFault):
    """The signals are delayed."""

    kind: Literal["late"]
    by_s: fault.FaultSpan  #: Delay, rounded up to whole cycles of the message.

    def _change(self, seed: int) -> Change:  # noqa: ARG002
        cycles = -(-round(self.by_s * fault.SECOND_NS) // self.named.codec.cycle_ns)
        line: deque[Sequence[Any]] = deque(maxlen=max(1, cycles) + 1)

        def delay(values: Sequence[Any], _: float) -> Sequence[Any]:
            line.append(values)
            return line[0]

        return delay


def value_of(hint: Any, written: float | bool | str | None) -> Any:
    """Signal's value by a number, a name of its table, or None; `ValueError` if it can't be."""
    kind = field_kind(hint)
    if isinstance(written, str):
        members = getattr(kind, "__members__", {})
        if written not in members:
            raise ValueError(f"must be one of {', '.join(members) or 'its numbers'}")
        return members[written]
    if isinstance(written, bool) is not (kind is bool):
        raise ValueError("must be true or false" if kind is bool else "must not be true or false")
    if kind is float:
        return float("nan") if written is None else float(written)
    if written is None or kind is bool:
        return written
    if written != int(written):
        raise ValueError("must be a whole number")
    return int(written)


def values_of(kind: type, written: Mapping[str, Any]) -> dict[str, Any]:
    """Signals' values of a message from their configuration."""
    hints = get_type_hints(kind)
    return {name: value_of(hints[name], value) for name, value in written.items()}


class Value(fault.MessageFault):
    """The signals have fixed values; an empty value means "not available"."""

    kind: Literal["value"]
    values: Annotated[dict[str, float | bool | str | None], Field(min_length=1)]
    every: Annotated[int, Field(ge=1)] = 1  #: Only one message in this number has these values.

    @model_validator(mode="after")
    def _known_values(self) -> "Value":
        refuse("", value_problems(self.named, self.values))
        return self

    def _spoil(self, seed: int) -> Spoil:  # noqa: ARG002
        values = values_of(self.named.kind, self.values)
        speaks = fault.one_in(self.every)
        return _altered(
            self.named, lambda message, _: message._replace(**values) if speaks() else message
        )


def value_problems(named: Any, values: dict[str, Any]) -> list[tuple[str, str]]:
    """Problems of the values configured for a message."""
    problems = fault.signal_problems(named, values)
    hints = get_type_hints(named.kind)
    for name, written in values.items():
        try:
            if name in hints:
                value = value_of(hints[name], written)
                most = named.codec.not_available[name]
                # a number may be outside the table, but must fit; others are clipped in encoding
                if issubclass(field_kind(hints[name]), IntEnum) and not 0 <= (value or 0) <= most:
                    raise ValueError(f"must be 0 to {most}")
        except ValueError as error:
            problems.append((f"values.{name}", f"{error} (got {written!r})"))
    return problems
