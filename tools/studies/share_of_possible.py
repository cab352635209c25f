"""How far from the possible: roll in the storm hour beside the clairvoyant bound, over many seeds.

    python -m tools.studies.share_of_possible --seeds 8

The first ship, linear, in the storm hour; sensors, delay, lag and limiter as on the bus. Share is
the part of the way from the passive tank to the best pressure history known in advance, within the
same limits on pressure, rate, level (4 m) and power; with it the 95 % confidence interval of its
mean. Constrained laws differ in the sea they expect: the hour's own spectrum, one of hours before,
a JONSWAP spectrum of the hour's height and period, or none (white wave slope). What a step of each
costs says `utank-hil check`.

The causal bound is that of a law that knows the hour's spectrum as the shipped configuration has it
(8 states, floor 1.3e-3) and has the bench's sensors, over records of ten minutes. Takes about 7
minutes on two cores.
"""

import argparse
import dataclasses
import math

import numpy as np

from tools.printing import show
from tools.studies.causal_bound import CausalBound, CausalProblem, causal_bound
from tools.studies.sea_trial import (
    CLAIRVOYANT,
    NO_TANK,
    PASSIVE,
    Entrant,
    Trial,
    TrialFigures,
    TrialShip,
)
from tools.studies.trial_setup import (
    STORM_HOUR,
    entrant,
    expecting,
    limited,
    measured_hour,
    parsed,
    parser,
    run_shown,
    seeds_of,
    shipped,
)
from utank_hil.analysis.loop.robustness import robustness
from utank_hil.analysis.motion.confidence import mean_interval
from utank_hil.base.arrays import FloatArray
from utank_hil.configuration import ControllerConfig
from utank_hil.control import ConstrainedDesign, PumpLimits
from utank_hil.control.constrained.law import ConstrainedLaw
from utank_hil.sea import jonswap

BEFORE, LONG_BEFORE = "2019-02-10T04:40", "2019-02-10T02:40"
CAUSAL = "causal bound"
CAUSAL_RECORD_S = 600.0
WHITE_FLOOR = 100.0  # of the spectrum's maximum: the slope expected is white


def entrants(pump: PumpLimits) -> list[Entrant]:
    """All laws, each with the limits that stand behind it, pressure and power those of `pump`."""

    def config(name: str) -> ControllerConfig:
        found = shipped(name)
        limits = dataclasses.replace(
            found.limits, pressure_pa=pump.pressure_pa, power_w=pump.power_w
        )
        return limited(found, limits)

    hour, planned = measured_hour(STORM_HOUR), config("constrained_gpc")
    found = [
        entrant("GPC, roll", config("gpc")),
        entrant("DPC, roll and level", config("dpc")),
        entrant("LQG", config("lqg")),
        entrant("constrained, white slope", _white(expecting(planned, hour))),
    ]
    for name, sea in (
        ("constrained, 3 h before", measured_hour(LONG_BEFORE)),
        ("constrained, JONSWAP", jonswap(hour.hs_m, hour.tp_s)),
        ("constrained, 1 h before", measured_hour(BEFORE)),
        ("constrained, the hour", hour),
    ):
        found.append(entrant(name, expecting(planned, sea)))
    whole = found[-1]
    assert isinstance(whole.law, ConstrainedLaw)
    unplanned = Entrant(
        "the same, clipped", whole.law.unlimited(), whole.measured, config("gpc").limits
    )
    return [*found, unplanned]


def _white(config: ControllerConfig) -> ControllerConfig:
    design = config.law
    assert isinstance(design, ConstrainedDesign)
    sea = dataclasses.replace(design.sea, floor=WHITE_FLOOR)
    return config.model_copy(update={"law": dataclasses.replace(design, sea=sea)})


def best_causal(bound: PumpLimits, arguments: argparse.Namespace) -> CausalBound:
    """What no law can do that does not know the waves to come."""
    config = limited(shipped("constrained_gpc"), bound)
    assert isinstance(config.law, ConstrainedDesign)
    problem = CausalProblem(config.plant, config.law.sea)
    records = max(2, round(arguments.seeds * arguments.seconds / CAUSAL_RECORD_S))
    length_s = min(CAUSAL_RECORD_S, arguments.seconds)
    first = arguments.first_seed
    return causal_bound(
        problem, [problem.run(seed, length_s) for seed in range(first, first + records)]
    )


def rows(
    laws: list[Entrant], results: list[dict[str, TrialFigures]], causal: CausalBound
) -> dict[str, dict[str, float]]:
    """Figures of each law by name, the ends of the scale with them."""
    plant = shipped("gpc").plant

    def figures(name: str, field: str) -> FloatArray:
        return np.array([getattr(result[name], field) for result in results])

    passive, best = (figures(name, "roll_rms_rad") for name in (PASSIVE, CLAIRVOYANT))
    found = {
        name: {"roll_rms_deg": math.degrees(figures(name, "roll_rms_rad").mean())}
        for name in (NO_TANK, PASSIVE)
    }
    for law in laws:
        roll = figures(law.name, "roll_rms_rad")
        share = mean_interval((passive - roll) / (passive - best))
        report = robustness(law.law, plant, law.measured)
        found[law.name] = {
            "roll_rms_deg": math.degrees(roll.mean()),
            "share": share.mean,
            "share_half_width": share.half_width,
            "share_of_causal": share.mean / causal.share.mean,
            "level_peak_m": float(figures(law.name, "level_peak_m").max()),
            "pressure_rms_pa": float(figures(law.name, "pressure_rms_pa").mean()),
            "power_peak_w": float(figures(law.name, "power_peak_w").max()),
            "peak_sensitivity": report.nominal.peak_sensitivity,
            "worst_radius": report.worst_radius,
        }
    found[CAUSAL] = {
        "roll_rms_deg": math.degrees(passive.mean() / causal.passive_rad * causal.causal_rad),
        "share": causal.share.mean,
        "share_half_width": causal.share.half_width,
        "share_of_causal": 1.0,
    }
    found[CLAIRVOYANT] = {
        "roll_rms_deg": math.degrees(best.mean()),
        "level_peak_m": float(figures(CLAIRVOYANT, "level_peak_m").max()),
    }
    return found


def arguments_of_command_line() -> argparse.Namespace:
    """Read and check them."""
    made = parser(__doc__, seeds=8, first_seed=1)
    made.add_argument("--power-w", type=float, default=math.inf, help="limit on the water's power")
    made.add_argument("--pressure-pa", type=float, default=50e3, help="of the pump (%(default)g)")
    arguments = parsed(made)
    for name in ("power_w", "pressure_pa"):
        if not getattr(arguments, name) > 0:
            made.error(f"--{name.replace('_', '-')} must be positive")
    return arguments


def main() -> None:
    """Run all seeds and print the table."""
    arguments = arguments_of_command_line()
    planned = shipped("constrained_gpc")
    bound = PumpLimits(
        arguments.pressure_pa, level_m=planned.limits.level_m, power_w=arguments.power_w
    )
    laws = entrants(bound)
    hour, vessel = measured_hour(STORM_HOUR), TrialShip(planned.plant)
    trials = [
        Trial(hour, seed, vessel, tuple(laws), arguments.seconds, bound)
        for seed in seeds_of(arguments)
    ]
    results = run_shown({"storm": trials})["storm"]
    found = rows(laws, results, best_causal(bound, arguments))
    summary = {"seeds": arguments.seeds, "seconds": arguments.seconds, "rows": found}
    show(summary, arguments)


if __name__ == "__main__":
    main()
