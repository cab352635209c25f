"""Whether a controller that runs for a week stays what it was: memory, handles, cost of a tick.

    python -m tools.studies.week [--days 7] [--json]

In lockstep, the storm scenario of the load change. Every ten minutes one thing goes wrong (sensors
silent for a second, the link lost, the levels' switch closed, a burst of strange frames), and the
operator resets and arms again; every four hours the cargo is moved and a retuning is ordered. Each
hour is a sample. The verdict compares the last quarter of the samples with the second quarter. The
retuner has a process of its own, as on a ship.
"""

import gc
import os
import random
import resource
import time
from array import array
from collections import Counter
from collections.abc import Iterable
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from multiprocessing import get_context
from pathlib import Path
from statistics import median
from typing import Any

from firmware_sim.scenario import Scenario
from firmware_sim.ship_side import build_ship_side
from tools.printing import command_line, show
from utank_hil.assembly import build_controller_node, retuner_work
from utank_hil.base.background import one_thread_each
from utank_hil.canbus import Frame
from utank_hil.configuration import ControllerConfig, load_config
from utank_hil.nodes.panel import Action, TimedAction
from utank_hil.retuning import RetuneFunction, RetuningSettings, SimulatedRetuner
from utank_hil.retuning.settings import EARLIEST_VERDICT_S
from utank_hil.runners import Lockstep, Node

SCENARIO = Path("configs/scenarios/load_change.yaml")
SECOND_NS = 1_000_000_000
EPISODE_S = 600.0
SAMPLE_S = 3600.0
LEAST_HOURS = 8
CARGO_S = 4 * 3600.0
MOST_GROWTH_MB = 4.0
MOST_OBJECTS = 1.01
MOST_COST = 1.1  #: Last quarter over the second: objects kept, and median cost of the node's tick.


class Mutable:
    """A node whose frames may be kept from the bus."""

    def __init__(self, node: Node) -> None:
        self._node = node
        self.name, self.period_ns = node.name, node.period_ns
        self.mute = False

    def receive(self, frame: Frame, now_ns: int) -> None:
        """Hear what the node hears."""
        self._node.receive(frame, now_ns)

    def tick(self, now_ns: int) -> Iterable[Frame]:
        """Say what the node says, or nothing."""
        frames = self._node.tick(now_ns)
        return () if self.mute else frames


class Timed(Mutable):
    """A node whose ticks are timed."""

    def __init__(self, node: Node) -> None:
        super().__init__(node)
        self.costs_ns = array("q")  # ints would scatter over the heap

    def tick(self, now_ns: int) -> Iterable[Frame]:
        """Note what the node's tick takes."""
        begin_ns = time.perf_counter_ns()
        frames = self._node.tick(now_ns)
        self.costs_ns.append(time.perf_counter_ns() - begin_ns)
        return frames


@dataclass(frozen=True)
class Sample:
    """State of the process after an hour of the ship's time."""

    hours: float
    resident_mb: float
    objects: int
    descriptors: int
    tick_us: float


def sample(node: Timed, hours: float) -> Sample:
    """Look at this process."""
    gc.collect()
    pages = int(Path("/proc/self/statm").read_text().split()[1])
    taken = Sample(
        hours,
        pages * resource.getpagesize() / 1e6,
        len(gc.get_objects()),
        len(os.listdir("/proc/self/fd")),
        median(node.costs_ns) / 1e3,
    )
    del node.costs_ns[:]
    return taken


def law_of(scenario: Scenario) -> ControllerConfig:
    """The controller that sails."""
    return scenario.controllers["gpc"]


def sail(
    seconds: float,
    sample_s: float,
    retune: RetuneFunction,
    seed: int = 1,
    *,
    settings: RetuningSettings | None = None,
    episode_s: float = EPISODE_S,
    cargo_s: float = CARGO_S,
) -> tuple[list[Sample], Counter[str]]:
    """Run, and take samples; what happened besides, counted.

    Samples are `sample_s` of ship time apart, faults `episode_s`, load changes `cargo_s`.
    `settings` of the retuning replace the configuration's.
    """
    draw, counts = random.Random(seed), Counter[str]()
    scenario = load_config(SCENARIO, Scenario)
    config = law_of(scenario)
    if settings is not None:
        config = config.model_copy(update={"retuning": settings})
    retuner = SimulatedRetuner(retune)
    side = build_ship_side(scenario, seed, (TimedAction(1.0, Action.ARM),))
    ships = scenario.vessel.ship, scenario.sailing_ship
    plant: Any = side.plant
    plant._ship_at = lambda time_s: ships[int(time_s / cargo_s) % 2]  # again and again
    node = build_controller_node(config, commissioned=True, retuner=retuner)
    timed, sensors = Timed(node), Mutable(side.sensors)
    others = [each for each in side.nodes if each is not side.sensors]
    lockstep = Lockstep([sensors, *others, timed])
    panel, samples = side.panel, []

    def run(span_s: float) -> None:
        end_ns = min(lockstep.now_ns + round(span_s * SECOND_NS), round(seconds * SECOND_NS))
        lockstep.run_until(end_ns)

    def silence() -> None:
        sensors.mute = True
        run(draw.uniform(0.01, 1.5))
        sensors.mute = False

    def lost_link() -> None:
        node.link_error(lockstep.now_ns, "down")
        run(0.1)

    def strange_frames() -> None:
        for _ in range(200):
            frame = Frame(draw.getrandbits(29), draw.randbytes(draw.randrange(9)))
            node.receive(frame, lockstep.now_ns)
        run(0.1)

    next_cargo_s = next_sample_s = 0.0
    while lockstep.now_ns < seconds * SECOND_NS:
        episode = draw.choice((silence, lost_link, strange_frames))
        counts[episode.__name__] += 1
        episode()
        run(draw.uniform(1, 20))
        counts[f"then {node.mode.name}"] += 1
        for action in (Action.STANDBY, Action.RESET, Action.ARM):
            panel.press(action)
            run(1.0)
        now_s = lockstep.now_ns / SECOND_NS
        if now_s >= next_cargo_s + 0.2 * cargo_s:
            next_cargo_s += cargo_s
            run(EARLIEST_VERDICT_S + 5)  # in charge so long, a law can be compared with
            panel.press(Action.RETUNE)
        run(episode_s)
        if lockstep.now_ns / SECOND_NS >= next_sample_s + sample_s:
            next_sample_s += sample_s
            samples.append(sample(timed, lockstep.now_ns / SECOND_NS / 3600))
            for event in node.law.events[-50:]:
                counts[f"last 50 events: {event.state.name}"] += 1
    return samples, counts


def verdict(samples: list[Sample]) -> dict[str, float | bool]:
    """The last quarter of the samples beside the second."""
    quarter = len(samples) // 4
    before, after = samples[quarter : 2 * quarter], samples[-quarter:]
    growth_mb = median(s.resident_mb for s in after) - median(s.resident_mb for s in before)
    objects = median(s.objects for s in after) / median(s.objects for s in before)
    cost = median(s.tick_us for s in after) / median(s.tick_us for s in before)
    handles = max(s.descriptors for s in after) - max(s.descriptors for s in before)
    return {
        "resident_growth_mb": round(growth_mb, 2),
        "objects_ratio": round(objects, 4),
        "tick_cost_ratio": round(cost, 3),
        "more_descriptors": handles,
        "flat": growth_mb <= MOST_GROWTH_MB
        and objects <= MOST_OBJECTS
        and cost <= MOST_COST
        and handles <= 0,
    }


def main() -> None:
    """Sail, and print the verdict and the samples."""
    parser = command_line(__doc__)
    parser.add_argument("--days", type=float, default=7.0)
    arguments = parser.parse_args()
    if arguments.days * 24 < LEAST_HOURS:
        parser.error(f"--days: at least {LEAST_HOURS} hours, for samples to compare")
    work = retuner_work(law_of(load_config(SCENARIO, Scenario)))
    assert work is not None
    identify_and_design, *_ = work
    with one_thread_each(), ProcessPoolExecutor(1, mp_context=get_context("spawn")) as apart:
        samples, counts = sail(
            arguments.days * 86400,
            SAMPLE_S,
            lambda record: apart.submit(identify_and_design, record).result(),
        )
    rows = [[round(value, 3) for value in vars(each).values()] for each in samples]
    table = {"head": list(vars(samples[0])), "rows": rows}
    show({"verdict": verdict(samples), "counts": dict(counts), "samples": table}, arguments)


if __name__ == "__main__":
    main()
