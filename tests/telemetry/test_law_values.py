"""Every number of a law is found, kept exactly, and named when one bit of it differs."""

import json
from pathlib import Path

import numpy as np
import pytest

from utank_hil.assembly import build_law
from utank_hil.configuration import ControllerConfig, load_config
from utank_hil.telemetry.law_values import decoded, differences, encoded, law_values

CONTROLLERS = Path("configs/controllers")


@pytest.fixture(scope="module")
def dpc() -> dict[str, np.ndarray]:
    config = load_config(CONTROLLERS / "dpc.yaml", ControllerConfig)
    return law_values(build_law(config).controller())


def test_gains_of_a_predictive_law_are_among_its_numbers(dpc: dict[str, np.ndarray]) -> None:
    assert dpc["gains"].shape == (1, 274)  # 92 commands, 182 outputs
    assert dpc["sample_time_s"] == 0.2


def test_numbers_survive_json_bit_for_bit(dpc: dict[str, np.ndarray]) -> None:
    again = decoded(json.loads(json.dumps(encoded(dpc))))
    assert differences(dpc, again) == []
    assert {name: value.tobytes() for name, value in again.items()} == {
        name: value.tobytes() for name, value in dpc.items()
    }


@pytest.mark.parametrize("bit", [0, 31, 63])
def test_one_bit_of_one_gain_is_named_with_both_values(
    dpc: dict[str, np.ndarray], bit: int
) -> None:
    gains = dpc["gains"].copy()
    gains.view(np.uint64)[0, 17] ^= np.uint64(1) << np.uint64(bit)
    (found,) = differences(dpc, dpc | {"gains": gains})
    assert found.name == "gains[0, 17]"
    assert float(found.recorded) == dpc["gains"][0, 17]
    assert float(found.replayed) == gains[0, 17]
    assert found.recorded != found.replayed


def test_numbers_that_only_one_side_has_are_named(dpc: dict[str, np.ndarray]) -> None:
    fewer = {name: value for name, value in dpc.items() if name != "gains"}
    (found,) = differences(dpc, fewer)
    assert str(found) == "gains: recorded float64 of shape (1, 274), replayed missing"


def test_a_law_that_holds_itself_has_its_numbers_once() -> None:
    class Ring:
        def __init__(self) -> None:
            self.gain = 2.5
            self.itself = self

    assert list(law_values(Ring())) == ["gain"]
