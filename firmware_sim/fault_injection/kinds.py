"""Kinds of faults in a configuration, and their placement in a bench."""

from collections.abc import Sequence
from functools import reduce
from operator import or_
from typing import TYPE_CHECKING, Annotated

from pydantic import Field

from firmware_sim.fault_injection import frames, nodes, signals, traffic
from firmware_sim.fault_injection.bench_parts import Bench
from firmware_sim.fault_injection.fault import Fault

if TYPE_CHECKING:
    AnyFault = Fault
else:
    _classes = [x for each in (signals, frames, nodes, traffic) for x in vars(each).values()]
    _kinds = [x for x in _classes if "kind" in getattr(x, "model_fields", ())]
    AnyFault = Annotated[reduce(or_, _kinds), Field(discriminator="kind")]


def place_all(faults: Sequence[AnyFault], bench: Bench, start_ns: int, seed: int) -> None:
    """Place faults in a bench; their times count from `start_ns`."""
    for number, fault in enumerate(faults):
        fault.place(bench, start_ns, seed * 1000 + number)
