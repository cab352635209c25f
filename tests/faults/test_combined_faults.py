"""Whatever faults a configuration may list, together on one message or node: the bench runs on."""

from functools import cache
from pathlib import Path
from typing import Any, Final, get_args, get_type_hints

import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from pydantic import TypeAdapter

from firmware_sim.fault_injection.fault import LONGEST_FAULT_S, NODE_OF, sent_by_nodes
from firmware_sim.fault_injection.kinds import AnyFault
from firmware_sim.faulty_bench import FaultyBench
from firmware_sim.scenario import Scenario
from utank_hil.assembly import build_law
from utank_hil.canbus import DriveFault, load_catalogue
from utank_hil.canbus.codec import field_kind
from utank_hil.configuration import load_config
from utank_hil.configuration.vessel import PreviewSection
from utank_hil.nodes.panel import Action, TimedAction
from utank_hil.nodes.redundancy import Redundancy

pytestmark = pytest.mark.slow

END_NS: Final = 350_000_000
KINDS: Final = get_args(AnyFault)[0]
FAULTS: Final = TypeAdapter(list[AnyFault])
CATALOGUE: Final = load_catalogue()
Strategy = st.SearchStrategy[Any]


@cache
def ship():
    """With every node: pump, valve, second motion sensor, hard-wired inputs, preview station."""
    scenario = load_config(Path("configs/scenarios/semi_active.yaml"), Scenario)
    config = scenario.controllers["pump_with_valve"]
    both = Redundancy(second_motion_sensor=True, hardwired_inputs=True)
    seen_ahead = {"redundancy": both, "preview": PreviewSection()}
    vessel = config.vessel.model_copy(update=seen_ahead)
    config = config.model_copy(update={"vessel": vessel})
    return scenario.model_copy(update={"vessel": vessel}), config, build_law(config)


def run(faults):
    """A few tenths of a second with faults."""
    scenario, config, law = ship()
    script = (TimedAction(0.1, Action.ARM),)
    bench = FaultyBench(scenario, config, law, seed=1, script=script)
    bench.place(FAULTS.validate_python(faults))
    bench.run(END_NS)
    return bench


FEW: Final = st.sampled_from([1, 2, 3, 7])
SEVERAL: Final = st.sampled_from([2, 3])
NUMBER: Final = st.sampled_from([-1.7e308, -3.0, 0.0, 0.05, 1e6, 1.7e308])
SHARE: Final = st.sampled_from([0.3, 1.0])
DELAY: Final = st.sampled_from([5e-324, 0.004, 0.05, LONGEST_FAULT_S])
LAG: Final = st.sampled_from([0.0, 5e-324, 0.1, 1e300])
WHEN: Final = {
    "at_s": st.sampled_from([0.0, 0.003, 0.1, LONGEST_FAULT_S]),
    "for_s": st.sampled_from([None, 5e-324, 0.004, 0.15, LONGEST_FAULT_S]),
}


def values_of(hint, most):
    """What a signal may be written as, sensible or not."""
    kind = field_kind(hint)
    if kind is bool:
        return st.booleans()
    if kind is float:
        return st.none() | NUMBER
    if kind is int:
        return st.none() | st.sampled_from([-1e30, 0, 255, 1e30])
    return st.none() | st.integers(0, most) | st.sampled_from(list(kind.__members__))


def faults_of(message, node):
    """Keys of every kind of fault that the message, or the node, can have."""
    kind, _, codec = CATALOGUE.named(message)
    hints = get_type_hints(kind)
    values = {name: values_of(hint, codec.not_available[name]) for name, hint in hints.items()}
    numbers = [name for name, hint in hints.items() if hint is float]
    some = st.sampled_from(numbers or ["none"]).map(lambda name: [name])
    at_message = {
        "stuck": {"signals": st.just(list(hints))},
        "offset": {"signals": some, "by": NUMBER},
        "scale": {"signals": some, "times": NUMBER},
        "drift": {"signals": some, "by_per_s": NUMBER},
        "noise": {"signals": some, "deviation": st.sampled_from([5e-324, 1.0, 1.7e308])},
        "spikes": {"signals": some, "by": NUMBER, "every": SEVERAL},
        "sign": {"signals": some},
        "swapped": {"signals": st.just(numbers[:2])},
        "late": {"signals": some, "by_s": DELAY},
        "value": {"values": st.fixed_dictionaries(values), "every": FEW},
        "lost": {"share": SHARE},
        "frozen": {},
        "replayed": {"frames": SEVERAL},
        "doubled": {"times": SEVERAL},
        "inserted": {"back": FEW},
        "counter": {"step": st.integers(0, 15), "one_of": FEW},
        "corrupted": {"every": FEW, "byte": st.integers(0, 7)},
        "data_id": {"every": FEW},
        "length": {"every": FEW, "length": st.integers(0, 7)},
        "gateway": {
            "does": st.sampled_from(["loses", "doubles", "swaps"]), "share": SHARE
        },
        "impostor": {"values": st.fixed_dictionaries(values), "ahead": st.integers(0, 15)},
    }  # fmt: skip
    if not numbers:
        for kind in ("offset", "scale", "drift", "noise", "spikes", "sign", "late"):
            del at_message[kind]
    if len(numbers) < 2:
        del at_message["swapped"]
    at_node = {
        "hangs": {},
        "mute": {},
        "deaf": {},
        "link": {"reason": st.just("gone"), "warns": st.booleans()},
        "bit_errors": {"share": SHARE},
        "lost_identifier": {
            "id_11bit": st.sampled_from([0, 0x185, 0x7FF]), "keeps_one_of": st.none() | SEVERAL
        },
    }  # fmt: skip
    elsewhere = {
        "killed": {},
        "pump": {"times": NUMBER, "plus_pa": NUMBER, "lag_s": LAG, "off_too": st.booleans()},
        "drive": {"fault": st.sampled_from(list(DriveFault.__members__))},
        "valve": {"fails": st.sampled_from(["stuck", "powerless"])},
        "law": {"fails": st.sampled_from(["raises", "answers_nan", "opposite", "leans"])},
        "flood": {
            "identifier": st.sampled_from(["0", "7FF"]),
            "share": st.sampled_from([0.5, 3.0]),
            "format": st.sampled_from(["extended", "standard", "remote"]),
            "length": st.integers(0, 8),
        },
        "second_panel": {"operator": st.just([{"time_s": 0.0, "action": "stop"}])},
    }
    return {
        **{kind: {"message": st.just(message), **keys} for kind, keys in at_message.items()},
        **{kind: {"node": st.just(node), **keys} for kind, keys in at_node.items()},
        **elsewhere,
    }


@st.composite
def combined(draw):
    """Two or three faults of one message and the node that sends it."""
    message = draw(st.sampled_from(sent_by_nodes()))
    kinds = faults_of(message, NODE_OF[CATALOGUE.named(message).source])
    drawn = draw(st.lists(st.sampled_from(sorted(kinds)), min_size=2, max_size=3))
    return [
        {"kind": kind, **draw(st.fixed_dictionaries({**kinds[kind], **WHEN}))} for kind in drawn
    ]


def test_every_kind_of_fault_is_drawn():
    annotations = (each.model_fields["kind"].annotation for each in get_args(KINDS))
    known = {kind for annotation in annotations for kind in get_args(annotation)}
    # only a CANopen device has an identity, and says what ails it
    assert {*faults_of("SENSOR_MOTION", "sensors"), "replaced", "emergency"} == known


def pair(*faults):
    """Of the motion message, from the start."""
    return [{"message": "SENSOR_MOTION", **fault} for fault in faults]


@settings(max_examples=10)  # of 0.1 s each
@example(pair({"kind": "corrupted"}, {"kind": "counter", "step": 1}))
@example(pair({"kind": "length", "length": 2}, {"kind": "corrupted"}))
@example(pair({"kind": "length", "length": 0}, {"kind": "data_id"}))
@example([{"kind": "second_panel"}, {"kind": "second_panel"}])
@given(combined())
def test_no_combination_of_faults_ends_the_bench(faults):
    assert run(faults).lockstep.now_ns == END_NS
