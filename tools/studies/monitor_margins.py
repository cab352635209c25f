"""How near the monitors come to a false alarm: largest statistic over threshold, run by run.

    python -m tools.studies.monitor_margins configs/scenarios/storm.yaml --minutes 600
    python -m tools.studies.monitor_margins configs/scenarios/*.yaml --minutes 10

In lockstep, with bus, nodes, sensors, retuning and the scenario's operator. One is the threshold. A
gain's margin is its distance from 1 over the distance at which it is found. `found_s` has what the
monitors found, and the fault that ended control, which may be none of theirs (a high-level switch).
"""

import math
import sys
from collections.abc import Iterable
from pathlib import Path

from firmware_sim.run import SECOND_NS
from firmware_sim.scenario import Scenario
from firmware_sim.ship_side import build_ship_side
from tools.printing import command_line, show
from utank_hil.assembly import build_controller_node, works_of
from utank_hil.base.tick import TICK_NS
from utank_hil.canbus import Frame, Mode
from utank_hil.configuration import ConfigError, load_config
from utank_hil.nodes.controller import ControllerNode
from utank_hil.retuning import SimulatedRetuner
from utank_hil.runners import Lockstep, SimulatedBus
from utank_hil.safety.monitoring import Monitors
from utank_hil.safety.monitors.finding import Finding
from utank_hil.safety.monitors.tank_equation import STUCK_GAIN

LOOK_TICKS = 5
AFTER_S = 60.0
"""A run ends so long after control has: nothing is left that could be a false alarm."""


def shares(monitors: Monitors) -> dict[str, float]:
    """Each statistic of now over its threshold; NaN where it is not known."""
    limits, equation, twin = monitors.thresholds, monitors.equation, monitors.twin
    watch = monitors.watches[monitors.used]
    return {
        "drift": abs(watch.motion.unexplained_rad) / limits.drift_rad,
        "roll noise": math.sqrt(watch.motion.noise.power / 6) / limits.roll_noise_rad,
        "rate noise": math.sqrt(watch.rate_noise.power / 6) / limits.rate_noise_rad_s,
        "volume": abs(monitors.volume.sum_m) / limits.volume_m,
        "signs": equation.doubt,
        "level stuck": (1 - equation.level_gain) / (1 - STUCK_GAIN),
        "motion late": equation.late_s / limits.motion_late_s,
        "drive": monitors.drive.late_pa / limits.pressure_error_pa,
        "roll over twin": twin.share,
    }


class Onlooker:
    """Keeps the largest share of each monitor, and when each finding and the fault came first."""

    name = "onlooker"
    period_ns = LOOK_TICKS * TICK_NS

    def __init__(self, node: ControllerNode) -> None:
        assert node.safety.monitors is not None
        self._node, self._monitors = node, node.safety.monitors
        self.largest: dict[str, float] = {}
        self.found_s: dict[str, float] = {}

    def receive(self, frame: Frame, now_ns: int) -> None:
        """Nothing on the bus is of interest."""

    def tick(self, now_ns: int) -> Iterable[Frame]:
        """Look at the monitors."""
        for name, share in shares(self._monitors).items():
            if share > self.largest.setdefault(name, 0.0):
                self.largest[name] = share
        for name, bit in vars(Finding).items():
            if name.isupper() and bit & self._monitors.found:
                self.found_s.setdefault(name, now_ns / SECOND_NS)
        if self._node.mode is Mode.FAULT:
            self.found_s.setdefault(self._node.fault.name, now_ns / SECOND_NS)
        return ()


def controller_of(scenario: Scenario, name: str) -> ControllerNode:
    """A commissioned controller of a scenario, with what retunes it and estimates for it."""
    config = scenario.controllers[name]
    retuner, estimating = (work and SimulatedRetuner(work[0]) for work in works_of(config))
    return build_controller_node(config, commissioned=True, retuner=retuner, estimating=estimating)


def margins(scenario: Scenario, name: str, seed: int, seconds: float) -> dict[str, object]:
    """Margins of one run."""
    node = controller_of(scenario, name)
    onlooker = Onlooker(node)
    ship = build_ship_side(scenario, seed, scenario.operator)
    bus = SimulatedBus(bit_rate=scenario.controllers[name].bit_rate)
    lockstep = Lockstep([*ship.nodes, node, onlooker], bus)
    end_ns, step_ns = round(seconds * SECOND_NS), round(AFTER_S * SECOND_NS)
    ended = False
    while lockstep.now_ns < end_ns and not ended:
        ended = node.mode is Mode.FAULT
        lockstep.run_until(min(lockstep.now_ns + step_ns, end_ns))
    return {
        "scenario": scenario.name,
        "controller": name,
        "seed": seed,
        "seconds": seconds,
        "mode": node.mode.name,
        "fault": node.fault.name,
        "found_s": onlooker.found_s,
        "largest": onlooker.largest,
    }


def main() -> int:
    """Run the study."""
    parser = command_line(__doc__)
    parser.add_argument("scenarios", type=Path, nargs="+")
    parser.add_argument("--minutes", type=float, required=True)
    parser.add_argument("--seed", type=int, default=1)
    options = parser.parse_args()
    try:
        scenarios = [load_config(path, Scenario) for path in options.scenarios]
    except ConfigError as error:
        parser.error(str(error))
    runs = [
        margins(scenario, name, options.seed, 60 * options.minutes)
        for scenario in scenarios
        for name in scenario.controllers
    ]
    show({"runs": runs}, options)
    return 0


if __name__ == "__main__":
    sys.exit(main())
