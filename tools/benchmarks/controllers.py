"""What one step of each controller costs, beside the interpreter's floor.

    python -m tools.benchmarks.controllers --steps 5000      # --json

Every controller runs in a closed loop on the linear ship in a storm (JONSWAP, 4.7 m, 10 s), with
sensor noise, limiter and drive, as in the campaigns; only its own step is timed. The process is
scheduled as the deployed loop is, as far as the system permits. The floor is the passive
controller, which does nothing. Memory: the most bytes that a step holds at once beyond
what was there before, and the bytes that it leaves behind (both mean of 200 steps). How the solver
of the constrained law compares with others says tools/peers.
"""

import math
import sys
import time
import tracemalloc
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from tools.printing import command_line, show
from tools.studies.trial_setup import shipped
from utank_hil.analysis.loop.loop_simulation import passive_motion, simulate_loop
from utank_hil.assembly import build_law
from utank_hil.base.arrays import FloatArray
from utank_hil.base.tick import TICK_S
from utank_hil.configuration import ControllerConfig
from utank_hil.control import (
    ClippedValve,
    Controller,
    DesignPlant,
    ErrorDynamics,
    IndirectFuzzy,
    OnOffValve,
    PassiveController,
    SmallGainFuzzy,
    design_lqr,
    level_brake,
)
from utank_hil.dynamics import RollModel
from utank_hil.dynamics.linear import STATES
from utank_hil.dynamics.valves import ValveRange
from utank_hil.runners.process_priority import real_time_scheduling
from utank_hil.sea import EffectiveSlope, Sea, jonswap

WARM_UP = 200
TRACED = 200
FLOOR = "passive (floor)"
# of configs/controllers, the linear laws first
SHIPPED = (
    "pd",
    "lqg",
    "dpc",
    "gpc",
    "constrained_gpc",
    "stimulate",
    "feedback_linearization",
    "fuzzy_robust",
)


@dataclass(frozen=True)
class Candidate:
    """A controller to be timed."""

    controller: Controller
    measured: tuple[str, ...]
    plant: DesignPlant  #: That it is run on.
    pumps: bool = True  #: Whether its answer is a pressure; a valve's is not.


class Timed:
    """A controller whose steps are timed, and what it saw."""

    def __init__(self, candidate: Candidate) -> None:
        self.sample_time_s = candidate.controller.sample_time_s
        self.took_ns: list[int] = []
        self.seen: list[FloatArray] = []
        self._controller, self._pumps = candidate.controller, candidate.pumps

    def step(self, y: FloatArray, reference: FloatArray | None = None) -> FloatArray:
        """Step, and note how long it took."""
        step = self._controller.step
        begin = time.perf_counter_ns()
        u = step(y, reference)
        self.took_ns.append(time.perf_counter_ns() - begin)
        self.seen.append(y)
        return u if self._pumps else np.zeros(1)

    def applied(self, u: FloatArray) -> None:
        """Pass on."""
        self._controller.applied(u)

    def reset(self) -> None:
        """Pass on."""
        self._controller.reset()


def candidates() -> dict[str, Callable[[], Candidate]]:
    """Everything that is timed, by name, the floor first."""
    plant = shipped("gpc").plant
    model = RollModel(plant.ship, plant.tank)
    coefficients = model.coefficients
    lqr = design_lqr(replace(plant, delay_s=0.0, lag_s=0.0).sampled(STATES, 0.2), 1e11)
    error, ranges = ErrorDynamics(1.5, 0.7, 2.5), (0.524, 0.524, 4.0, 4.0)
    gain = (
        -coefficients.coupling
        * coefficients.area
        / (coefficients.inertia * coefficients.level_inertia - coefficients.coupling**2)
    )
    small_gain = SmallGainFuzzy(error, ranges, gain, 0.9, 1.0, adaptation=0.1, leakage=20.0)
    indirect = IndirectFuzzy(
        error,
        ranges,
        gain,
        adaptation_f=0.02,
        adaptation_g=0.02,
        leakage=0.02,
        brake_pa_s_m=level_brake(model, 0.5),
    )
    valve = ValveRange(0.0, 3e5)

    def pump(build: Callable[[], Controller]) -> Callable[[], Candidate]:
        return lambda: Candidate(build(), STATES, plant)

    def throttle(build: Callable[[], Controller]) -> Callable[[], Candidate]:
        return lambda: Candidate(build(), STATES, plant, pumps=False)

    return {
        FLOOR: pump(PassiveController),
        "lqr": pump(lqr.controller),
        **{name: _of_file(shipped(name)) for name in SHIPPED},
        "fuzzy_small_gain": pump(small_gain.controller),
        "fuzzy_indirect": pump(indirect.controller),
        "on-off valve": throttle(lambda: OnOffValve(valve)),
        "clipped valve": throttle(lambda: ClippedValve(valve, lqr.controller())),
    }


def _of_file(config: ControllerConfig) -> Callable[[], Candidate]:
    def build() -> Candidate:
        law = build_law(config)
        return Candidate(law.controller(), law.measured, config.plant)

    return build


def costs(candidate: Candidate, waves: FloatArray) -> dict[str, float]:
    """Cost of each step in a closed loop, and its memory."""
    timed = Timed(candidate)
    with real_time_scheduling():
        simulate_loop(candidate.plant, waves, timed, candidate.measured)
    took_us = np.array(timed.took_ns[WARM_UP:]) / 1e3
    return {
        "p50_us": float(np.percentile(took_us, 50)),
        "p99_us": float(np.percentile(took_us, 99)),
        "max_us": float(took_us.max()),
        **memory(candidate.controller, timed.seen[-TRACED:]),
    }


def memory(controller: Controller, seen: list[FloatArray]) -> dict[str, float]:
    """Bytes that a step holds at most, and those that it leaves behind."""
    peaks = []
    tracemalloc.start()
    begin = tracemalloc.get_traced_memory()[0]
    for y in seen:
        before = tracemalloc.get_traced_memory()[0]
        tracemalloc.reset_peak()
        controller.step(y)
        peaks.append(tracemalloc.get_traced_memory()[1] - before)
    left = tracemalloc.get_traced_memory()[0] - begin - sys.getsizeof(peaks)
    tracemalloc.stop()
    return {"held_bytes": float(np.mean(peaks)), "kept_bytes": max(left, 0) / len(seen)}


def measure(steps: int) -> dict[str, dict[str, float]]:
    """Costs by controller, the floor first."""
    vessel = shipped("gpc").vessel
    sea = Sea.irregular(jonswap(4.7, 10.0), seed=1)
    moment = sea.roll_moment(vessel.ship.stiffness_nm_rad, EffectiveSlope(0.5))
    results = {}
    for name, build in candidates().items():
        candidate = build()
        ticks = (steps + WARM_UP) * math.ceil(candidate.controller.sample_time_s / TICK_S - 1e-9)
        waves = passive_motion(vessel.ship, vessel.tank, moment, TICK_S, ticks)
        results[name] = costs(candidate, waves)
    return results


def main() -> None:
    """Measure and print."""
    parser = command_line(__doc__)
    parser.add_argument("--steps", type=int, default=5000, help="of each controller (%(default)s)")
    arguments = parser.parse_args()
    if arguments.steps < 100:
        parser.error("--steps must be 100 or more: fewer have no 99th percentile")
    show(measure(arguments.steps), arguments)
    with real_time_scheduling() as report:
        refused = [each for each in report.measures if not each.granted]
    for each in refused:
        sys.stderr.write(f"measured without {each.name}: {each.detail}\n")


if __name__ == "__main__":
    main()
