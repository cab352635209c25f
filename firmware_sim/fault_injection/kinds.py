"""Kinds of faults in a configuration, and their placement in a bench."""

from collections.abc import Sequence
from typing import Annotated

from pydantic import Field

from firmware_sim.fault_injection import frames, nodes, signals, traffic
from firmware_sim.fault_injection.bench_parts import Bench

AnyFault = Annotated[
    signals.Stuck
    | signals.Offset
    | signals.Scale
    | signals.Drift
    | signals.Noise
    | signals.Spikes
    | signals.Sign
    | signals.Swapped
    | signals.Late
    | signals.Value
    | frames.Lost
    | frames.Frozen
    | frames.Replayed
    | frames.Doubled
    | frames.Inserted
    | frames.Counter
    | frames.Corrupted
    | frames.WrongDataId
    | frames.WrongLength
    | nodes.Silenced
    | nodes.Killed
    | nodes.LostIdentifier
    | nodes.Replaced
    | nodes.Link
    | nodes.Pump
    | nodes.Drive
    | nodes.Valve
    | nodes.Law
    | traffic.Disturbed
    | traffic.BitErrors
    | traffic.Flood
    | traffic.Impostor
    | traffic.SecondPanel,
    Field(discriminator="kind"),
]


def place_all(faults: Sequence[AnyFault], bench: Bench, start_ns: int, seed: int) -> None:
    """Place faults in a bench; their times count from `start_ns`."""
    for number, fault in enumerate(faults):
        fault.place(bench, start_ns, seed * 1000 + number)
