"""The first ten minutes by each law, on twenty seeds that nothing was tuned on, bounds beside.

    python -m tools.studies.unseen_seeds --json     # --seeds, --only "quartering", --workers

The first ship, linear, in the seas of `renewed_seas`; ships of `init`, the bench's plant without
bus and nodes, in beam, bow, quartering and following waves and in other loadings. Limits, rate,
lag, delay and sensors' noise of the bench, laws armed at once. `first` is what a self-tuning
ship begins with, with the share of the pressure that pays; `renewed` is designed for these waves
and this ship, known. Both begin knowing nothing of the motion. Figures are of the time from 60 to
660 s; a window is that, or the first ten minutes. Share is of the clairvoyant bound within `SCALE`.
"""

import math
import sys
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from functools import cache, partial
from multiprocessing import get_context
from typing import Any, Final, NamedTuple

import numpy as np
import yaml

from firmware_sim.prediction import active_run, laws_of, loaded
from firmware_sim.run import RECORD_S, roll_at_zero_pressure
from firmware_sim.scenario import Scenario
from firmware_sim.scenario_sea import JonswapSea
from firmware_sim.ship_side import plant_of
from firmware_sim.starter import CONTROLLER, SCENARIO, SHIP, StarterShip, make_starter
from tools.printing import command_line, show
from tools.studies.clairvoyant import clairvoyant_bound
from tools.studies.less_pressure import Learning
from tools.studies.renewed_seas import GivenSea, seas
from tools.studies.share_of_possible import CONFIGS, shipped
from utank_hil.analysis.loop.linear_tuning import AutoDesign
from utank_hil.analysis.loop.loop_simulation import passive_motion, simulate_loop
from utank_hil.analysis.loop.self_tuning import SelfTunedDesign
from utank_hil.analysis.motion.statistics import mean_interval
from utank_hil.analysis.tank_sizing import TankRoom
from utank_hil.assembly import build_law
from utank_hil.base.arrays import FloatArray
from utank_hil.base.background import one_thread_each
from utank_hil.base.tick import TICK_S
from utank_hil.configuration import ControllerConfig, Vessel, load_config
from utank_hil.control import BuiltLaw
from utank_hil.control.constrained.law import ConstrainedController, ConstrainedLaw

FIRST_SEED: Final = 4001
SETTLE_S: Final = 60.0
WINDOW_S: Final = 600.0
BOUND_TICKS: Final = 20
PASSIVE, CLAIRVOYANT, FIRST_SHIP = "passive", "clairvoyant", "first ship"
OWN_LIMITS: Final = "clairvoyant, own limits"
SCALE: Final = {"level_m": 4.0, "rate_pa_s": 100e3}
"""Limits of the bound of which shares are given: one scale, whatever a law's own limits are."""
SHIPS: Final = {  # length, beam, draught, displacement, GM, roll period
    "patrol boat, 27 m": (27, 6.5, 1.9, 130, 0.9, 5.8),
    "ferry, 55 m": (55, 12.0, 3.0, 1000, 1.6, 8.0),
    "trawler, 75 m": (75, 14.0, 5.5, 3600, 0.9, 11.7),
    "coaster, 95 m": (95, 15.0, 5.8, 6000, 1.1, 11.5),
}
WAVES: Final = {  # factor on height, on period, heading in degrees, speed in m/s, load
    "beam, of the file": (1.0, 1.0, 90.0, 0.0, 1.0),
    "following, 10°, 8 m/s": (1.0, 1.0, 10.0, 8.0, 1.0),
    "quartering, 45°, 6 m/s": (1.0, 1.0, 45.0, 6.0, 1.0),
    "ship at 0.85 of its period": (1.0, 1.0, 90.0, 0.0, 0.85),
    "ship at 1.3 of its period": (1.0, 1.0, 90.0, 0.0, 1.3),
    "from the bow, 135°, 6 m/s": (1.0, 1.0, 135.0, 6.0, 1.0),
    "0.75 of the period": (1.0, 0.75, 90.0, 0.0, 1.0),
    "1.5 times height and period": (1.5, 1.5, 90.0, 0.0, 1.0),
}


class Case(NamedTuple):
    """A ship in a sea, loaded as she sails; the laws know the ship of `config`."""

    scenario: Scenario
    config: ControllerConfig
    ship: str


@cache
def starter(name: str) -> tuple[Scenario, ControllerConfig]:
    """What `init` writes for a ship."""
    length, beam, draught, displacement, gm, period = SHIPS[name]
    ship = StarterShip(name, length, beam, displacement, gm, period, draught)
    texts = make_starter(ship, TankRoom.in_hull(length, beam)).texts
    vessel = Vessel.model_validate(yaml.safe_load(texts[SHIP]))
    config = ControllerConfig.model_validate(yaml.safe_load(texts[CONTROLLER]) | {"vessel": vessel})
    parts = {"vessel": vessel, "controllers": {"self_tuned": config}}
    return Scenario.model_validate(yaml.safe_load(texts[SCENARIO]) | parts), config


@cache
def ship_of(name: str) -> tuple[ControllerConfig, BuiltLaw]:
    """Controller of a self-tuning ship, and her GPC."""
    if name == FIRST_SHIP:
        return shipped("self_tuning"), build_law(shipped("gpc"))
    _, config = starter(name)
    return config, AutoDesign("gpc", "auto", None).build(config.design_plant)


@cache
def case(name: str) -> Case:
    """The ship and sea of a name."""
    if name in seas():
        storm = load_config(CONFIGS / "scenarios" / "storm.yaml", Scenario)
        given = GivenSea(given=seas()[name], effective_slope=storm.sea.effective_slope)
        scenario = storm.model_copy(update={"sea": given})
        return Case(scenario, shipped("self_tuning"), FIRST_SHIP)
    ship, waves = name.split(": ")
    height, period, heading, speed, load = WAVES[waves]
    scenario, config = starter(ship)
    own = scenario.sea
    assert isinstance(own, JonswapSea)
    changed = {"hs_m": own.hs_m * height, "tp_s": own.tp_s * period}
    sea = own.model_copy(update=changed | {"heading_deg": heading, "speed_m_s": speed})
    return Case(loaded(scenario.model_copy(update={"sea": sea}), load), config, ship)


@cache
def begun(ship: str) -> dict[str, BuiltLaw]:
    """GPC, and the law that a self-tuning ship begins with; they depend on no waves."""
    config, gpc = ship_of(ship)
    assert isinstance(config.law, SelfTunedDesign)
    built = config.law.build(config.design_plant, first=True)
    law = built.linear
    assert isinstance(law, ConstrainedLaw)
    first = BuiltLaw(lambda: Learning(law.clipped(), config.plant), built.measured, law)
    return {"GPC": gpc, "first": first}


@cache
def laws(name: str) -> dict[str, BuiltLaw]:
    """Each law."""
    of = case(name)
    known = of.config.model_copy(update={"vessel": of.scenario.vessel})
    _, renewed = laws_of(of.scenario, known)
    if renewed is None:
        return begun(of.ship)

    def controller() -> Learning:
        planning = renewed.controller()
        assert isinstance(planning, ConstrainedController)
        return Learning(planning, known.plant)

    return begun(of.ship) | {"renewed": BuiltLaw(controller, renewed.measured, renewed.linear)}


def sailed(name: str, seed: int, *, with_bound: bool = True) -> dict[str, list[float]]:
    """Roll RMS in degrees of each law from 60 to 660 s, and of the first ten minutes."""
    if name in seas():
        return _linear(name, seed, with_bound=with_bound)
    of, count = case(name), round((SETTLE_S + WINDOW_S) / RECORD_S)
    plant = of.config.plant
    rolls = {PASSIVE: roll_at_zero_pressure(plant_of(of.scenario, seed), count)[0]}
    for law, built in laws(name).items():
        record, _ = active_run(of.scenario, plant, built, seed, count)
        rolls[law] = record["roll_rad"]
    return {law: _rms(roll, RECORD_S) for law, roll in rolls.items()}


def _linear(name: str, seed: int, *, with_bound: bool) -> dict[str, list[float]]:
    """The first ship, of which the tank's loss is linear."""
    of, count = case(name), round((SETTLE_S + WINDOW_S) / TICK_S)
    plant, sea = of.config.plant, of.scenario.sea
    moment = sea.roll_moment(sea.sea(seed), plant.ship.stiffness_nm_rad)
    passive = passive_motion(plant.ship, plant.tank, moment, TICK_S, count + 1)
    found = {PASSIVE: _rms(passive[:, 0], TICK_S)}
    if with_bound:
        scale = replace(plant, limits=replace(plant.limits, **SCALE))
        for bound, limited in {CLAIRVOYANT: scale, OWN_LIMITS: plant}.items():
            best = clairvoyant_bound(limited, passive[::BOUND_TICKS])
            found[bound] = _rms(best.motion[:, 0], BOUND_TICKS * TICK_S)
    for law, built in laws(name).items():
        run = simulate_loop(plant, passive, built.controller(), built.measured, seed=seed)
        found[law] = _rms(run.motion[:, 0], TICK_S)
    return found


def _rms(roll: FloatArray, step_s: float) -> list[float]:
    parts = roll[round(SETTLE_S / step_s) :], roll[: round(WINDOW_S / step_s)]
    return [math.degrees(np.sqrt(np.mean(np.square(part)))) for part in parts]


def row(runs: Sequence[dict[str, list[float]]]) -> dict[str, Any]:
    """Figures of one sea over all seeds, intervals of 95 % of the mean."""
    rolls = {name: np.array([run[name] for run in runs]) for name in runs[0]}
    passive = rolls[PASSIVE]
    found: dict[str, Any] = {"passive_deg": float(passive[:, 0].mean())}
    for name in [name for name in rolls if name != PASSIVE]:
        windows = rolls[name] / passive
        found[name] = {
            "below_passive": mean_interval(1 - windows[:, 0])._asdict(),
            "greatest_window": float(windows.max()),
            "of_seed": FIRST_SEED + int(windows.max(axis=1).argmax()),
        }
        for key, bound in (("share", CLAIRVOYANT), ("share_of_own_limits", OWN_LIMITS)):
            if bound in rolls:
                gain = passive[:, 0] - rolls[name][:, 0]
                best = passive[:, 0] - rolls[bound][:, 0]
                found[name][key] = mean_interval(gain / best)._asdict()
    return found


def main() -> None:
    """Run all and print."""
    parser = command_line(__doc__)
    parser.add_argument("--seeds", type=int, default=20, help="2 or more (%(default)s)")
    parser.add_argument("--only", default="", help="cases whose names hold this text")
    parser.add_argument("--no-bound", action="store_true", help="without the clairvoyant bound")
    parser.add_argument("--workers", type=int, default=2, help="processes (%(default)s)")
    arguments = parser.parse_args()
    if arguments.seeds < 2:
        parser.error("--seeds must be 2 or more: one value has no confidence interval")
    every = [*seas(), *(f"{ship}: {waves}" for ship in SHIPS for waves in WAVES)]
    names = [name for name in every if arguments.only in name]
    if not names:
        parser.error(f"--only {arguments.only!r}: no case's name; there are {'; '.join(every)}")
    seeds = range(FIRST_SEED, FIRST_SEED + arguments.seeds)
    found: dict[str, Any] = {}
    spawn = get_context("spawn")
    with one_thread_each(), ProcessPoolExecutor(arguments.workers, mp_context=spawn) as pool:
        run = partial(case_of_seeds, seeds=seeds, with_bound=not arguments.no_bound)
        for name, runs in zip(names, pool.map(run, names), strict=True):
            found[name] = row(runs)
            sys.stderr.write(f"{name}: {found[name]}\n")
    show(found, arguments)


def case_of_seeds(name: str, seeds: range, *, with_bound: bool) -> list[dict[str, list[float]]]:
    """`sailed` with each seed."""
    return [sailed(name, seed, with_bound=with_bound) for seed in seeds]


if __name__ == "__main__":
    main()
