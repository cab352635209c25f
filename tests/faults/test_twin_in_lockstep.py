"""The twin in the storm beside the passive ship's own run in the same waves."""

import math

import numpy as np
import pytest
from fault_bench import ARMED, FaultBench, storm

from firmware_sim.ship_side import PASSIVE_SCRIPT
from utank_hil.canbus import Mode

SECONDS = 300


def recorded(script, controller: str) -> tuple[FaultBench, np.ndarray]:
    """A run and its ship's and twin's roll, once a second; shape (n, 2)."""
    bench = FaultBench(script=script, controller=controller)
    rows = []
    for second in range(1, SECONDS + 1):
        bench.run(second)
        rows.append((bench.ship.plant.roll_rad, bench.node.safety.passive_roll_rad))
    return bench, np.array(rows)


@pytest.fixture(scope="module")
def passive() -> np.ndarray:
    """The passive ship's roll and her twin's."""
    bench, passive = recorded(PASSIVE_SCRIPT, "gpc")
    assert bench.mode is Mode.PASSIVE
    # without a pump the twin is the ship, later by the motion sensor's 20 ms and a tick
    assert np.abs(passive[60:, 0] - passive[60:, 1]).max() < math.radians(0.3)
    assert bench.node.safety.passive_roll_rms_rad == pytest.approx(
        bench.node.safety.roll_rms_rad, rel=0.02
    )
    return passive


@pytest.mark.slow
@pytest.mark.evidence("dpc", "self-tuning")
@pytest.mark.parametrize("controller", sorted(storm().controllers))
def test_twin_rolls_as_the_passive_ship_does_within_three_percent(
    controller: str, passive: np.ndarray
) -> None:
    bench, active = recorded(ARMED, controller)
    assert bench.mode is Mode.ACTIVE
    assert active[60:, 0].std() < 0.9 * passive[60:, 0].std()
    assert active[60:, 1].std() == pytest.approx(passive[60:, 0].std(), rel=0.03)
    assert np.corrcoef(active[60:, 1], passive[60:, 0])[0, 1] > 0.99
