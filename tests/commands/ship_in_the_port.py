"""A port with the emulated ship behind it, for the command `run` where there is no CAN."""

import time
from collections.abc import Sequence
from pathlib import Path

from firmware_sim.scenario import Scenario
from firmware_sim.ship_side import build_ship_side
from utank_hil.canbus import Frame
from utank_hil.configuration import load_config
from utank_hil.nodes.panel import Action, TimedAction
from utank_hil.runners.group import OUTSIDE, NodeGroup

STORM = Path("configs/scenarios/storm.yaml")


class ShipInThePort:
    """Ticks the ship's nodes as often as the clock says when it is read."""

    others = 0

    def __init__(self, channel: str, script: tuple[TimedAction, ...] | None = None) -> None:
        script = script or (TimedAction(0.8, Action.ARM),)
        self._group = NodeGroup(build_ship_side(load_config(STORM, Scenario), 1, script).nodes)
        self._start_ns = 0
        self._frames: list[Frame] = []
        self._sent: list[tuple[int, Frame]] = []

    def receive(self) -> Sequence[Frame]:
        now_ns = time.monotonic_ns()
        self._start_ns = self._start_ns or now_ns
        while self._group.next_tick_ns <= now_ns - self._start_ns:
            self._group.tick(self._group.next_tick_ns, self._on_bus)
            for sender, frame in self._sent:
                self._group.deliver(sender, frame, now_ns - self._start_ns)
            self._frames += [frame for _, frame in self._sent]
            self._sent.clear()
        frames, self._frames = self._frames, []
        return frames

    def _on_bus(self, sender: int, frame: Frame, now_ns: int) -> None:
        self._sent.append((sender, frame))

    def send(self, frame: Frame) -> None:
        self._group.deliver(OUTSIDE, frame, time.monotonic_ns() - self._start_ns)

    def close(self) -> None:
        pass
