"""Ship's side and controller on one simulated bus, in which faults can be placed."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial

from firmware_sim.fault_injection.bench_parts import (
    Bench,
    BreakableLaw,
    FaultyBus,
    FaultyNode,
    LawFailure,
)
from firmware_sim.fault_injection.kinds import AnyFault, place_all
from firmware_sim.scenario import Scenario
from firmware_sim.ship_side import ShipSide, build_ship_side
from utank_hil.assembly import build_controller_node, build_law
from utank_hil.base.arrays import FloatArray
from utank_hil.configuration import ControllerConfig
from utank_hil.control import BuiltLaw
from utank_hil.nodes.controller import ControllerNode
from utank_hil.nodes.panel import TimedAction
from utank_hil.retuning import Retuner
from utank_hil.runners import Lockstep, Node
from utank_hil.runners.lockstep import Trace, with_more

Tap = Callable[[ControllerNode], Node]
"""Function that wraps a controller in the node put on the bus."""


class FaultyBench:
    """Bench in lockstep in which faults can be placed, at the start or under way.

    Its scenario's own faults are left to the caller; a law that is not given is designed. `sink`
    takes a row of the controller's telemetry every `sink_every` ticks. A `retuner` is for a
    self-tuning controller, whose law cannot be made to fail. `tapped` wraps each controller before
    its faults do.

    `node` is the controller that currently runs.
    """

    def __init__(
        self,
        scenario: Scenario,
        config: ControllerConfig,
        law: BuiltLaw | None = None,
        *,
        seed: int,
        script: tuple[TimedAction, ...],
        trace: Trace | None = None,
        sink: Callable[[FloatArray], None] | None = None,
        sink_every: int = 1,
        retuner: Retuner | None = None,
        estimating: Retuner | None = None,
        commissioned: bool = True,
        tapped: Tap = lambda controller: controller,
    ) -> None:
        law, self._failures, self._seed = law or build_law(config), set[LawFailure](), seed
        if retuner is None:
            # a self-tuning controller exchanges its laws: a fault of one would not follow
            sound = law.controller
            law = replace(law, controller=lambda: BreakableLaw(sound(), self._failures))
        self._new_node = partial(
            build_controller_node,
            config,
            law,
            retuner=retuner,
            estimating=estimating,
            sink=sink,
            sink_every=sink_every,
            commissioned=commissioned,
        )
        self._tapped = tapped
        self.ship: ShipSide = build_ship_side(scenario, seed, script, config)
        self._controller = FaultyNode(self._new_controller())
        #: Sensors, drive, valve, panel and controller, as far as the ship has them.
        self.nodes = {node.name: FaultyNode(node) for node in self.ship.nodes}
        self.nodes["controller"] = self._controller
        self.bus = FaultyBus(config.bit_rate, seed)
        more = len(config.vessel.foreign.buses) - 1
        joined = with_more(self.bus, more, config.bit_rate)
        self.lockstep = Lockstep(list(self.nodes.values()), joined, trace)

    def _new_controller(self) -> Node:
        self.node = self._new_node()
        return self._tapped(self.node)

    def restart_controller(self) -> None:
        """Replace the controller by a new one, as after the death of its process."""
        self._controller.node = self._new_controller()

    def join(self, nodes: Sequence[Node]) -> None:
        """Add nodes to the bus from now on."""
        self.lockstep.join(nodes)

    def place(self, faults: Sequence[AnyFault]) -> None:
        """Place faults, whose times count from now."""
        ship = self.ship
        bench = Bench(
            self.nodes, ship.plant, ship.drive, ship.valve, ship.vessel.version,
            self.bus, self._failures, self.restart_controller,
        )  # fmt: skip
        place_all(faults, bench, self.lockstep.now_ns, self._seed)
        if bench.joining:
            self.join(bench.joining)

    def run(self, until_ns: int) -> None:
        """Run to a time."""
        self.lockstep.run_until(until_ns)
