"""The twin in the storm beside the passive ship's own run in the same waves."""

import math

import numpy as np
import pytest
from fault_bench import ARMED, SECOND, FaultBench, storm

from utank_hil.canbus import Frame, Mode
from utank_hil.nodes.panel import Action, TimedAction

pytestmark = pytest.mark.slow

SECONDS = 200


class LosesTicks:
    """A node whose loop is late now and then: it hears what came with the next tick."""

    def __init__(self, node, one_of):
        self.node, self.name, self.period_ns = node, node.name, node.period_ns
        self._one_of, self._ticks = one_of, 0
        self._waiting: list[Frame] = []

    def receive(self, frame, now_ns):
        self._waiting.append(frame)

    def tick(self, now_ns):
        self._ticks += 1
        if now_ns > 2 * SECOND and self._ticks % self._one_of == 0:
            return ()
        for frame in self._waiting:
            self.node.receive(frame, now_ns)
        self._waiting.clear()
        return self.node.tick(now_ns)


def recorded(script, controller="gpc", one_of=0, seconds=SECONDS):
    """A run and its ship's and twin's roll, once a second; shape (n, 2)."""
    bench = FaultBench(script=script, controller=controller)
    node = bench.node
    if one_of:
        bench.controller.node = LosesTicks(node, one_of)
    rows = []
    for second in range(1, seconds + 1):
        bench.run(second)
        rows.append((bench.ship.plant.roll_rad, node.safety.passive_roll_rad))
    bench.controller.node = node
    return bench, np.array(rows)


@pytest.fixture(scope="module")
def passive():
    """The passive ship's roll and her twin's."""
    bench, passive = recorded((TimedAction(1.0, Action.PASSIVE),))
    assert bench.mode is Mode.PASSIVE
    # without a pump the twin is the ship, later by the motion sensor's 20 ms and a tick
    assert np.abs(passive[60:, 0] - passive[60:, 1]).max() < math.radians(0.3)
    assert bench.node.safety.passive_roll_rms_rad == pytest.approx(
        bench.node.safety.roll_rms_rad, rel=0.02
    )
    return passive


@pytest.mark.evidence
@pytest.mark.parametrize(
    ("controller", "one_of"), [*((name, 0) for name in sorted(storm().controllers)), ("gpc", 10)]
)
def test_twin_rolls_as_the_passive_ship_does_within_three_percent(controller, one_of, passive):
    bench, active = recorded(ARMED, controller, one_of)
    assert bench.mode is Mode.ACTIVE
    assert active[60:, 0].std() < 0.9 * passive[60:, 0].std()
    assert active[60:, 1].std() == pytest.approx(passive[60:, 0].std(), rel=0.03)
    assert np.corrcoef(active[60:, 1], passive[60:, 0])[0, 1] > 0.99


@pytest.mark.evidence("100")
@pytest.mark.parametrize("one_of", [7, 100])
def test_sensors_look_sound_whatever_share_of_the_ticks_is_lost(one_of):
    bench, _ = recorded(ARMED, one_of=one_of, seconds=70)
    assert bench.mode is Mode.ACTIVE, bench.node.fault
    assert not bench.node.safety.situation.found
