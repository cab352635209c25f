"""What the ship's nodes say they hear is all that they use."""

from collections.abc import Iterable
from pathlib import Path

from firmware_sim.scenario import Scenario
from firmware_sim.ship_side import build_ship_side
from utank_hil.assembly import build_controller_node
from utank_hil.canbus import Frame
from utank_hil.configuration import load_config
from utank_hil.nodes.panel import Action, TimedAction
from utank_hil.runners import Lockstep, Node
from utank_hil.runners.node import Selective

SECOND_NS = 1_000_000_000


class HearsEverything:
    """A node whose own list of what it hears is not told to the runner."""

    def __init__(self, node: Node) -> None:
        self.name, self.period_ns = node.name, node.period_ns
        self._node = node

    def receive(self, frame: Frame, now_ns: int) -> None:
        self._node.receive(frame, now_ns)

    def tick(self, now_ns: int) -> Iterable[Frame]:
        return self._node.tick(now_ns)


def test_ship_that_is_told_everything_does_the_same() -> None:
    scenario = load_config(Path("configs/scenarios/storm.yaml"), Scenario)
    traces = []
    for told_everything in (False, True):
        ship = build_ship_side(scenario, 1, (TimedAction(0.5, Action.ARM),))
        assert all(isinstance(node, Selective) for node in (ship.sensors, ship.drive))
        nodes = [HearsEverything(node) if told_everything else node for node in ship.nodes]
        trace: list[tuple[int, str, Frame]] = []
        controller = build_controller_node(scenario.controllers["gpc"], commissioned=True)
        run = Lockstep([*nodes, controller], trace=lambda *row, to=trace: to.append(row))
        run.run_until(5 * SECOND_NS)
        traces.append(trace)
    assert traces[0] == traces[1]
