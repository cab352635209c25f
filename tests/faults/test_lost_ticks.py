"""Ticks that the controller's loop loses now and then: an alarm, and nothing looks wrong."""

from collections.abc import Iterable

import numpy as np
import pytest
from fault_bench import ARMED, SECOND, FaultBench

from firmware_sim.ship_side import PASSIVE_SCRIPT
from utank_hil.canbus import Frame, Mode
from utank_hil.runners import Node


class LosesTicks:
    """A node whose loop is late now and then: it hears what came with the next tick."""

    def __init__(self, node: Node, one_of: int) -> None:
        self.node, self.name, self.period_ns = node, node.name, node.period_ns
        self._one_of, self._ticks = one_of, 0
        self._waiting: list[Frame] = []

    def receive(self, frame: Frame, now_ns: int) -> None:
        self._waiting.append(frame)

    def tick(self, now_ns: int) -> Iterable[Frame]:
        self._ticks += 1
        if now_ns > 2 * SECOND and self._ticks % self._one_of == 0:
            return ()
        for frame in self._waiting:
            self.node.receive(frame, now_ns)
        self._waiting.clear()
        return self.node.tick(now_ns)


def recorded(seconds: int, one_of: int, script=ARMED) -> tuple[FaultBench, np.ndarray]:
    """A run and its ship's and twin's roll, ten times a second; shape (n, 2)."""
    bench = FaultBench(script=script)
    node = bench.node
    if one_of:
        bench.controller.node = LosesTicks(node, one_of)
    rows = []
    for tenth in range(1, 10 * seconds + 1):
        bench.run(tenth / 10)
        rows.append((bench.ship.plant.roll_rad, node.safety.passive_roll_rad))
    bench.controller.node = node
    return bench, np.array(rows)


@pytest.mark.parametrize("one_of", [7, 20, 100])
def test_sensors_look_sound_whatever_share_of_the_ticks_is_lost(one_of: int) -> None:
    bench, _ = recorded(70, one_of)
    assert bench.mode is Mode.ACTIVE, bench.node.fault
    assert not bench.node.safety.situation.found


def test_the_twin_is_the_passive_ship_where_every_tenth_tick_is_lost() -> None:
    _, passive = recorded(200, 0, PASSIVE_SCRIPT)
    _, active = recorded(200, 10)
    true, twin = passive[400:, 0], active[400:, 1]
    assert active[400:, 0].std() < 0.9 * true.std()
    assert twin.std() == pytest.approx(true.std(), rel=0.03)
    assert np.corrcoef(twin, true)[0, 1] > 0.99
