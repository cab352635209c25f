"""Starter project: vessel, controller and scenario, from a naval architect's data."""

import math
from dataclasses import dataclass, replace
from typing import Any, Final, TypeVar

import yaml
from pydantic import BaseModel, ValidationError

from firmware_sim import starter_text
from firmware_sim.pooled_waves import pooled_wave_moment
from firmware_sim.scenario import Scenario
from firmware_sim.starter_ship import StarterShip
from utank_hil.analysis.loop.self_tuning import SelfTuned, SelfTunedDesign
from utank_hil.analysis.tank_prediction import RollPrediction, SeaState, predict_roll
from utank_hil.analysis.tank_sizing import (
    STABILITY_SHARE,
    PumpDemand,
    SizedTank,
    TankRoom,
    pump_demand,
    pump_level_m,
    size_pump,
    size_tank,
    usable_level_m,
    with_duct_loss,
)
from utank_hil.base.parameters import ParameterError
from utank_hil.configuration import ControllerConfig, Vessel
from utank_hil.configuration.files import problems_in_words
from utank_hil.configuration.ship_keys import WrittenShip
from utank_hil.dynamics.tank import GRAVITY_M_S2

ModelT = TypeVar("ModelT", bound=BaseModel)

SHIP, CONTROLLER, SCENARIO, README = "ship.yaml", "controller.yaml", "scenario.yaml", "README.md"
FILES: Final = (SHIP, CONTROLLER, SCENARIO, README)

EFFECTIVE_SLOPE: Final = 0.7
"""Effective slope of the sea as a share of the true wave slope. Chosen; no study."""
MOST_SLOPE_RAD: Final = math.radians(1.5)
"""Significant effective slope of the starter's sea, for which the pump is designed. Chosen; no
study."""
PERIODS_S: Final = (3.0, 18.0)
"""Peak periods in s of real seas; within them the starter's sea has the ship's roll period."""
_HEIGHT_PER_LENGTH: Final = 1 / 40
"""Height of a working sea per length of the ship, not of a survival sea. Chosen; no study."""
_HEIGHTS_M: Final = (0.5, 5.0)
"""Least and greatest height in m: below it no tank is needed, above it few ships are under way."""
_LEAST_LEVEL_CHANGE: Final = 0.01
"""Relative difference from the vessel's limit below which a level limit is not written."""


@dataclass(frozen=True, slots=True)
class StarterProject:
    """Project that can be checked and run on the bench."""

    vessel: Vessel
    sized: SizedTank
    demand: PumpDemand
    law: SelfTuned
    #: Roll in the scenario's sea; with the pump, for a gentle LQG law that stays within the limits.
    prediction: RollPrediction
    sea: dict[str, Any]
    texts: dict[str, str]  #: Contents of `FILES`.


def starter_sea(
    length_m: float, roll_period_s: float, hs_m: float | None = None, tp_s: float | None = None
) -> dict[str, Any]:
    """Sea as given, else at the roll period and as high as ship's length and pump permit."""
    shortest_s, longest_s = PERIODS_S
    period_s = tp_s or float(f"{min(max(roll_period_s, shortest_s), longest_s):.3g}")
    wavenumber = (2 * math.pi / period_s) ** 2 / GRAVITY_M_S2
    least_m, most_m = _HEIGHTS_M
    height_m = min(max(_HEIGHT_PER_LENGTH * length_m, least_m), most_m)
    height_m = min(height_m, 2 * MOST_SLOPE_RAD / (EFFECTIVE_SLOPE * wavenumber))
    return {
        "kind": "jonswap",
        "hs_m": hs_m or float(f"{height_m:.2g}"),
        "tp_s": period_s,
        "effective_slope": {"coefficient": EFFECTIVE_SLOPE},
    }


def make_starter(
    ship: StarterShip,
    room: TankRoom,
    stability_share: float = STABILITY_SHARE,
    hs_m: float | None = None,
    tp_s: float | None = None,
) -> StarterProject:
    """Size tank and pump, find a law, and write the files.

    The free surface may take `stability_share` of the stability, see `size_tank`. Raises
    `TankImpossibleError, NoLawError` if there is no tank or no law for this ship. Raises
    `ValueError` if a value is invalid.
    """
    written = WrittenShip(
        displacement_t=ship.displacement_t,
        gm_m=ship.gm_m,
        roll_period_s=float(f"{ship.period_s:.4g}"),
        damping_ratio=ship.damping[0],
    )
    bare = written.ship()
    sized = size_tank(bare, room, stability_share)
    sized = replace(sized, tank=with_duct_loss(bare, sized.tank))
    demand = pump_demand(bare, sized.tank, pump_level_m(bare, sized.tank))
    pump = size_pump(sized.tank, demand)
    texts = {SHIP: starter_text.ship_file(ship, written, room, sized, demand, pump)}
    # from here on with the rounded numbers of the files
    vessel = _valid(Vessel, yaml.safe_load(texts[SHIP]))
    usable_m = float(f"{usable_level_m(vessel.ship, vessel.tank):.3g}")
    limits = {}
    if usable_m < (1 - _LEAST_LEVEL_CHANGE) * vessel.default_limits["level_m"]:
        limits["level_m"] = usable_m
    sea = starter_sea(ship.length_m, ship.period_s, hs_m, tp_s)
    texts[CONTROLLER] = starter_text.controller_file(ship.name, sea, limits)
    written_law = yaml.safe_load(texts[CONTROLLER])
    config = _valid(ControllerConfig, written_law | {"vessel": vessel})
    texts[SCENARIO] = starter_text.scenario_file(ship.name, sea)
    parts = {"vessel": vessel, "controllers": {"self_tuned": config}}
    scenario = _valid(Scenario, yaml.safe_load(texts[SCENARIO]) | parts)
    state = SeaState.on(vessel.ship, pooled_wave_moment(scenario, vessel.ship))
    assert isinstance(config.law, SelfTunedDesign)
    law = config.law.tuned(config.plant)
    texts[README] = starter_text.readme(ship.name)
    prediction = predict_roll(config.plant, state)
    return StarterProject(vessel, sized, demand, law, prediction, sea, texts)


def _valid(model: type[ModelT], content: dict[str, Any]) -> ModelT:
    """Validate a part of the project; errors are reported at their key, as ``ship.gm_m``."""
    try:
        return model.model_validate(content)
    except ValidationError as error:
        found = problems_in_words(error, content, model)
        problems = [(".".join(map(str, key)), reason) for key, reason in found]
        raise ParameterError("starter", problems) from error
