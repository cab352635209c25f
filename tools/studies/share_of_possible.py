"""How far from the possible: roll in the storm hour beside the clairvoyant bound, over many seeds.

    python -m tools.studies.share_of_possible --seeds 8

The first ship, linear, in the storm hour; sensors, delay, lag and limiter as on the bus. Share is
the part of the way from the passive tank to the best pressure history known in advance, within the
same limits on pressure, rate and level (4 m); with it the 95 % confidence interval of its mean.
Constrained laws differ in the sea they expect: the hour's own spectrum, one of hours before, a
JONSWAP spectrum of the hour's height and period, or none (white wave slope). What a step of each
costs says `utank-hil check`.

All laws of a seed meet the same waves and the same sensor noise. The causal bound is that of a law
that knows the hour's spectrum as the shipped configuration has it (8 states, floor 1.3e-3) and has
the bench's sensors, over records of ten minutes. Takes about 7 minutes on two cores.
"""

import argparse
import math
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace
from functools import partial
from multiprocessing import get_context
from pathlib import Path
from typing import Final

import numpy as np

from tools.printing import command_line, show
from tools.studies.causal_bound import CausalBound, CausalProblem, causal_bound
from tools.studies.clairvoyant import clairvoyant_bound
from utank_hil.analysis.loop.loop_simulation import passive_motion, simulate_loop
from utank_hil.analysis.loop.margins import robustness
from utank_hil.analysis.loop.sea_response import roll_without_tank
from utank_hil.analysis.motion.statistics import mean_interval
from utank_hil.assembly import build_law
from utank_hil.base.arrays import FloatArray
from utank_hil.base.background import one_thread_each
from utank_hil.base.tick import TICK_S
from utank_hil.configuration import ControllerConfig, load_config
from utank_hil.control import BuiltLaw, ConstrainedDesign, PumpLimits
from utank_hil.control.constrained.law import ConstrainedLaw
from utank_hil.control.interface import DesignPlant, LinearLaw
from utank_hil.dynamics.linear import STATES
from utank_hil.sea import EffectiveSlope, Sea, Spectrum, jonswap, load_ndbc

CONFIGS: Final = Path(__file__).resolve().parents[2] / "configs"
STORM_HOUR, BEFORE, LONG_BEFORE = "2019-02-10T05:40", "2019-02-10T04:40", "2019-02-10T02:40"
NO_TANK, PASSIVE, CLAIRVOYANT, CAUSAL = "no tank", "passive", "clairvoyant", "causal bound"
PRESSURE_PA: Final = 50e3  #: Of the pump, for all laws and bounds; its power has no limit.
EFFECTIVE_SLOPE: Final = 0.5  #: As in the storm's scenario.
CAUSAL_RECORD_S: Final = 600.0
WHITE_FLOOR: Final = 100.0  #: Of the spectrum's maximum: the slope expected is white.
_BOUND_TICKS: Final = 20  # The clairvoyant law commands every 0.2 s.
_LEVEL, _SPEED = STATES.index("level_m"), STATES.index("level_rate_m_s")


@dataclass(frozen=True, slots=True)
class Entrant:
    """A law, also one that is linear within its limits only, and the limiter behind it."""

    law: LinearLaw
    measured: tuple[str, ...]  #: Names of `STATES` that it sees, in its order.
    limits: PumpLimits


@dataclass(frozen=True, slots=True)
class Figures:
    """One run in figures; the power is that into the water."""

    roll_rms_rad: float
    level_peak_m: float = 0.0
    pressure_rms_pa: float = 0.0
    power_peak_w: float = 0.0


def shipped(name: str) -> ControllerConfig:
    """A configuration of ``configs/controllers``."""
    return load_config(CONFIGS / "controllers" / f"{name}.yaml", ControllerConfig)


def measured_hour(time: str) -> Spectrum:
    """Spectrum of an hour of NDBC 41010, February 2019."""
    return load_ndbc(CONFIGS / "seas" / "ndbc_41010_2019-02_spectral_density.txt").at(time)


def expecting(config: ControllerConfig, sea: Spectrum) -> ControllerConfig:
    """A constrained law that expects a sea other than its own."""
    assert isinstance(config.law, ConstrainedDesign)
    model = replace(
        config.law.sea,
        frequency_hz=tuple(sea.frequency_hz.tolist()),
        density_m2_hz=tuple(sea.density.tolist()),
    )
    return config.model_copy(update={"law": replace(config.law, sea=model)})


def _with_pump(name: str) -> ControllerConfig:
    config = shipped(name)
    limits = replace(config.limits, pressure_pa=PRESSURE_PA, power_w=math.inf)
    return config.model_copy(update={"limits": limits})


def _entrant(config: ControllerConfig) -> Entrant:
    built: BuiltLaw = build_law(config)
    assert built.linear is not None
    return Entrant(built.linear, built.measured, config.limits)


def entrants() -> dict[str, Entrant]:
    """All laws, each with the limits that stand behind it."""
    hour, planned = measured_hour(STORM_HOUR), _with_pump("constrained_gpc")
    assert isinstance(planned.law, ConstrainedDesign)
    white = replace(planned.law, sea=replace(planned.law.sea, floor=WHITE_FLOOR))
    seas = {
        "3 h before": measured_hour(LONG_BEFORE),
        "JONSWAP": jonswap(hour.hs_m, hour.tp_s),
        "1 h before": measured_hour(BEFORE),
        "the hour": hour,
    }
    found = {
        "GPC, roll": _entrant(_with_pump("gpc")),
        "DPC, roll and level": _entrant(_with_pump("dpc")),
        "LQG": _entrant(_with_pump("lqg")),
        "constrained, white slope": _entrant(
            expecting(planned.model_copy(update={"law": white}), hour)
        ),
        **{f"constrained, {name}": _entrant(expecting(planned, sea)) for name, sea in seas.items()},
    }
    whole = found["constrained, the hour"]
    assert isinstance(whole.law, ConstrainedLaw)
    clipped = replace(whole, law=whole.law.unlimited(), limits=found["GPC, roll"].limits)
    return {**found, "the same, clipped": clipped}


def run_seed(
    plant: DesignPlant, laws: dict[str, Entrant], seconds: float, seed: int
) -> dict[str, Figures]:
    """Figures of `NO_TANK`, `PASSIVE`, the laws and `CLAIRVOYANT` in one realisation."""
    waves = Sea.irregular(measured_hour(STORM_HOUR), seed)
    moment = waves.roll_moment(plant.ship.stiffness_nm_rad, EffectiveSlope(EFFECTIVE_SLOPE))
    count = round(seconds / TICK_S) + 1
    passive = passive_motion(plant.ship, plant.tank, moment, TICK_S, count)
    bound = clairvoyant_bound(plant, passive[::_BOUND_TICKS])
    found = {
        NO_TANK: Figures(_rms(roll_without_tank(plant.ship, moment, TICK_S, count))),
        PASSIVE: _of_motion(passive),
        CLAIRVOYANT: _of_motion(bound.motion),
    }
    for name, each in laws.items():
        behind = replace(plant, limits=each.limits)
        run = simulate_loop(behind, passive, each.law.controller(), each.measured, seed=seed)
        power_w = run.pressure_pa * plant.tank.reservoir_area_m2 * run.motion[:, _SPEED]
        found[name] = replace(
            _of_motion(run.motion),
            pressure_rms_pa=_rms(run.pressure_pa),
            power_peak_w=float(power_w.max()),
        )
    return found


def _of_motion(motion: FloatArray) -> Figures:
    return Figures(_rms(motion[:, 0]), float(np.abs(motion[:, _LEVEL]).max()))


def _rms(values: FloatArray) -> float:
    return float(np.sqrt(np.mean(np.square(values))))


def best_causal(plant: DesignPlant, arguments: argparse.Namespace) -> CausalBound:
    """What no law can do that does not know the waves to come."""
    design = shipped("constrained_gpc").law
    assert isinstance(design, ConstrainedDesign)
    problem = CausalProblem(plant, design.sea)
    records = max(2, round(arguments.seeds * arguments.seconds / CAUSAL_RECORD_S))
    length_s = min(CAUSAL_RECORD_S, arguments.seconds)
    return causal_bound(problem, [problem.run(seed, length_s) for seed in range(1, 1 + records)])


def rows(
    laws: dict[str, Entrant], results: list[dict[str, Figures]], causal: CausalBound
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
    for name, each in laws.items():
        roll = figures(name, "roll_rms_rad")
        share = mean_interval((passive - roll) / (passive - best))
        report = robustness(each.law, plant, each.measured)
        found[name] = {
            "roll_rms_deg": math.degrees(roll.mean()),
            "share": share.mean,
            "share_half_width": share.half_width,
            "share_of_causal": share.mean / causal.share.mean,
            "level_peak_m": float(figures(name, "level_peak_m").max()),
            "pressure_rms_pa": float(figures(name, "pressure_rms_pa").mean()),
            "power_peak_w": float(figures(name, "power_peak_w").max()),
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


def main() -> None:
    """Run all seeds and print the table."""
    made = command_line(__doc__)
    made.add_argument("--seeds", type=int, default=8, help="realisations, 2 or more (%(default)s)")
    made.add_argument("--seconds", type=float, default=3600.0, help="of each run (%(default)s)")
    arguments = made.parse_args()
    if arguments.seeds < 2:
        made.error("--seeds must be 2 or more: one value has no confidence interval")
    if not (math.isfinite(arguments.seconds) and arguments.seconds >= 60):
        made.error("--seconds must be 60 or more")
    planned, laws = shipped("constrained_gpc"), entrants()
    limits = PumpLimits(PRESSURE_PA, level_m=planned.limits.level_m, power_w=math.inf)
    plant = replace(planned.plant, limits=limits)
    run = partial(run_seed, plant, laws, arguments.seconds)
    with one_thread_each(), ProcessPoolExecutor(mp_context=get_context("spawn")) as pool:
        results = list(pool.map(run, range(1, 1 + arguments.seeds)))
    found = rows(laws, results, best_causal(plant, arguments))
    show({"seeds": arguments.seeds, "seconds": arguments.seconds, "rows": found}, arguments)


if __name__ == "__main__":
    main()
