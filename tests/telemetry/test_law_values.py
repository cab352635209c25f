"""Every number of a law is found, kept exactly, and named when one bit of it differs."""

import json
from pathlib import Path

import numpy as np
import pytest

from utank_hil.assembly import build_law
from utank_hil.configuration import ControllerConfig, load_config
from utank_hil.telemetry.law_values import (
    LawValuesError,
    decoded,
    differences,
    encoded,
    law_values,
    restored,
)

CONTROLLERS = Path("configs/controllers")


@pytest.fixture(scope="module")
def dpc():
    config = load_config(CONTROLLERS / "dpc.yaml", ControllerConfig)
    return law_values(build_law(config).controller())


def test_gains_of_a_predictive_law_are_among_its_numbers(dpc):
    assert dpc["gains"].shape == (1, 274)  # 92 commands, 182 outputs
    assert dpc["sample_time_s"] == 0.2


def test_numbers_survive_json_bit_for_bit(dpc):
    again = decoded(json.loads(json.dumps(encoded(dpc))))
    assert differences(dpc, again) == []
    assert {name: value.tobytes() for name, value in again.items()} == {
        name: value.tobytes() for name, value in dpc.items()
    }


@pytest.mark.parametrize("bit", [0, 31, 63])
def test_one_bit_of_one_gain_is_named_with_both_values(dpc, bit):
    gains = dpc["gains"].copy()
    gains.view(np.uint64)[0, 17] ^= np.uint64(1) << np.uint64(bit)
    (found,) = differences(dpc, dpc | {"gains": gains})
    assert found.name == "gains[0, 17]"
    assert float(found.recorded) == dpc["gains"][0, 17]
    assert float(found.designed) == gains[0, 17]
    assert found.recorded != found.designed
    largest = np.abs(dpc["gains"]).max()
    assert found.deviation == abs(gains[0, 17] - dpc["gains"][0, 17]) / largest


def test_numbers_that_only_one_side_has_are_named(dpc):
    fewer = {name: value for name, value in dpc.items() if name != "gains"}
    (found,) = differences(dpc, fewer)
    assert str(found) == "gains: recorded float64 of shape (1, 274), designed here missing"


def shipped(name):
    return load_config(CONTROLLERS / f"{name}.yaml", ControllerConfig)


def like_another_processor_s(values):
    """The same law but for rounding: gains and models that differ from the eighth digit on."""
    other = {}
    for name, value in values.items():
        moves = value.dtype.kind == "f" and value.ndim > 0
        shift = 1 + 1e-8 * np.cos(np.arange(value.size)).reshape(value.shape)
        other[name] = value * shift if moves else value
    return other


def answers_of(controller, measured):
    """What a controller commands for a swell that takes a planning law to its limits."""
    swing = 0.3 * np.sin(0.12 * np.arange(300))[:, None] * np.cos(np.arange(measured))
    return [controller.step(y).tobytes() for y in swing]


@pytest.mark.parametrize(
    "name",
    ["constrained_gpc", "dpc", "feedback_linearization", "fuzzy_robust", "gpc", "lqg", "pd",
     "pump_with_valve", "stimulate", "valve_clipped", "valve_on_off"],
)  # fmt: skip
def test_a_law_of_every_kind_takes_recorded_numbers_and_answers_as_recorded(name):
    law = build_law(shipped(name))
    before = law_values(law.controller())
    kept = {each: value.copy() for each, value in before.items()}
    other = like_another_processor_s(before)
    moved = restored(law.controller(), other)
    assert differences(other, law_values(moved)) == []
    again = restored(moved, kept)
    assert differences(kept, law_values(again)) == []
    plain, changed, back = (
        answers_of(each, len(law.measured)) for each in (law.controller(), moved, again)
    )
    assert back == plain
    assert differences(kept, before) == []  # nothing of the law itself was written to
    if any(value.ndim for value in before.values()) and name != "fuzzy_robust":
        assert changed != plain


def test_numbers_of_another_law_are_not_taken(dpc):
    gpc = build_law(shipped("gpc")).controller()
    with pytest.raises(LawValuesError, match=r"gains is float64 of shape \(1, 274\) there and"):
        restored(gpc, dpc)
    with pytest.raises(LawValuesError, match=r"more is float64 of shape .* there and missing here"):
        restored(gpc, law_values(gpc) | {"more": np.zeros(3)})


def test_a_law_that_holds_itself_has_its_numbers_once():
    class Ring:
        def __init__(self):
            self.gain = 2.5
            self.itself = self

    assert list(law_values(Ring())) == ["gain"]
