"""Starter project: vessel, controller and scenario, from a naval architect's data."""

import json
import math
from dataclasses import dataclass, replace
from textwrap import wrap
from typing import Annotated, Any, Final, TypeVar

import yaml
from pydantic import BaseModel, ValidationError

from firmware_sim.scenario import Scenario
from utank_hil.analysis import tank_sizing
from utank_hil.analysis.loop.self_tuning import SelfTuned, SelfTunedDesign
from utank_hil.analysis.tank_response import expected_sea
from utank_hil.base import parameters
from utank_hil.configuration import ControllerConfig, Vessel
from utank_hil.configuration.files import problems_in_words
from utank_hil.configuration.ship_keys import WrittenShip, weather_criterion_period_s
from utank_hil.dynamics.pump import Pump
from utank_hil.dynamics.roll_damping import HullForm, estimated_roll_damping
from utank_hil.dynamics.tank import GRAVITY_M_S2
from utank_hil.retuning.estimator import SHIP_PERIODS, EstimateSettings

USUAL_DAMPING_RATIO: Final = 0.05
"""Damping ratio of a ship that nothing is known of. Chosen; no study."""
ESTIMATED_AT_RAD: Final = math.radians(5)
"""Amplitude of the estimate: a tank leaves a few degrees."""
_LEAST_DAMPING, _MOST_DAMPING = 0.004, 0.3
"""Range of an estimate; a bare tanker's measured damping below 5 degrees is the least."""
_GYRATION_PER_BEAM: Final = (0.1, 1.2)
"""Plausible radius of gyration per beam; usual ships have about 0.4."""
_DEPTH_PER_BEAM: Final = (0.01, 1.0)
"""Plausible ratio of displaced volume to length times squared beam."""

_BLOCK: Final = (0.15, 1.0)
"""Plausible block coefficient."""


@dataclass(frozen=True, slots=True)
class StarterShip:
    """Ship as a naval architect knows it, without the tank's water.

    Raises `ValueError` if a value is out of its range, neither period nor draught is given, or
    displacement and length, or GM and period, are inconsistent.
    """

    name: str
    length_m: parameters.Positive
    beam_m: parameters.Positive
    displacement_t: parameters.Positive
    gm_m: parameters.Positive
    #: Roll period; by default from the weather criterion's formula, which needs the draught.
    roll_period_s: parameters.Positive | None = None
    draught_m: parameters.Positive | None = None
    #: Of the roll; by default estimated from the draught, without it `USUAL_DAMPING_RATIO`.
    roll_damping_ratio: Annotated[float, parameters.Range(above=0, most=0.3)] | None = None
    #: Of radiated waves, of hull data; in place of the estimate's part by waves.
    radiated_ratio: float | None = None

    def __post_init__(self) -> None:
        problems = parameters.range_problems(self)
        if self.roll_period_s is None and self.draught_m is None:
            reason = "is needed, or else the draught for the weather criterion's period"
            problems.append(("roll_period_s", reason))
        least, given = self.radiated_ratio or 0.0, self.roll_damping_ratio
        if given is not None and given < least:
            reason = f"is {given:g}, and waves alone take {least:.3g} from this hull: raise it"
            problems.append(("roll_damping_ratio", reason))
        parameters.refuse("ship", problems or self._shape_problems())

    def _shape_problems(self) -> list[parameters.Problem]:
        """Implausible combinations for the beam: displacement and length, GM, period and GM."""
        if self.beam_m >= self.length_m:
            reason = f"is {self.beam_m:g} m, and the length {self.length_m:g} m: swap the two"
            return [("beam_m", reason)]
        depth_m = self.displacement_t / (self.length_m * self.beam_m)  # in fresh water
        least, most = _DEPTH_PER_BEAM
        if not least <= depth_m / self.beam_m <= most:
            reason = (
                f"is {depth_m:.3g} m of water on {self.length_m:g} m by {self.beam_m:g} m: the "
                "displacement is in tonnes, length and beam in metres"
            )
            return [("displacement_t", reason)]
        block = depth_m / 1.025 / (self.draught_m or math.inf)
        least, most = _BLOCK
        if self.draught_m is not None and not least <= block <= most:
            reason = (
                f"of {self.draught_m:g} m makes a block coefficient of {block:.2g} with length, "
                "beam and displacement; ships have 0.35 to 0.9: it is in metres"
            )
            return [("draught_m", reason)]
        draught_m = self.draught_m or depth_m / 1.025 / _BLOCK[0]
        most_m = draught_m + self.beam_m**2 / (12 * depth_m)  # KB and BM
        if self.gm_m > most_m:
            reason = f"is {self.gm_m:g} m, and the metacentre {most_m:.3g} m above the keel at most"
            return [("gm_m", f"{reason}: it is in metres")]
        gyration_m = self.period_s / (2 * math.pi) * math.sqrt(GRAVITY_M_S2 * self.gm_m)
        least, most = _GYRATION_PER_BEAM
        if least <= gyration_m / self.beam_m <= most:
            return []
        reason = (
            f"gives a radius of gyration of {gyration_m:.3g} m at a roll period of "
            f"{self.period_s:.3g} s; it is about 0.4 of the beam, {0.4 * self.beam_m:.3g} m: GM is "
            "in metres, the period in seconds"
        )
        return [("gm_m", reason)]

    @property
    def damping(self) -> tuple[float, str]:
        """Damping ratio of the roll, and where it comes from."""
        if self.roll_damping_ratio is not None:
            return self.roll_damping_ratio, "as given"
        if self.draught_m is None:
            return USUAL_DAMPING_RATIO, "assumed, --draught estimates it"
        hull, frequency = self.form, 2 * math.pi / self.period_s
        stiffness = 1e3 * self.displacement_t * GRAVITY_M_S2 * self.gm_m
        found = estimated_roll_damping(hull, ESTIMATED_AT_RAD, frequency)
        computed = self.radiated_ratio is not None
        viscous = found.total - (found.wave if computed else 0.0)
        ratio = viscous * hull.unit_nms_rad * frequency / (2 * stiffness)
        ratio += self.radiated_ratio or 0.0
        outside = hull.outside(frequency)
        words = (
            f"estimated at {math.degrees(ESTIMATED_AT_RAD):g} degrees, Ikeda's method by "
            f"regression, usual bilge keels: a factor of {2 if outside else 1.5:g} either way"
        )
        if outside:
            words += f" ({'; '.join(outside)})"
        return min(max(ratio, _LEAST_DAMPING), _MOST_DAMPING), words

    @property
    def period_source(self) -> str:
        """Where the roll period comes from."""
        if self.roll_period_s is not None:
            return "as given"
        return "weather criterion's formula (IS Code 2008, A 2.3.4): measure it"

    @property
    def form(self) -> HullForm:
        """The usual form of these main particulars, which need the draught."""
        assert self.draught_m is not None
        return HullForm.usual(
            self.length_m, self.beam_m, self.draught_m, self.displacement_t, self.gm_m
        )

    @property
    def period_s(self) -> float:
        """Roll period, given or by formula."""
        if self.roll_period_s is not None:
            return self.roll_period_s
        assert self.draught_m is not None
        return weather_criterion_period_s(self.beam_m, self.draught_m, self.length_m, self.gm_m)


ModelT = TypeVar("ModelT", bound=BaseModel)

HULL = "hull.nc"
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
    sized: tank_sizing.SizedTank
    demand: tank_sizing.PumpDemand
    law: SelfTuned
    sea: dict[str, Any]
    texts: dict[str, str]  #: Contents of `FILES`.


def starter_sea(
    length_m: float,
    roll_period_s: float,
    hs_m: float | None = None,
    tp_s: float | None = None,
    effective_slope: float = EFFECTIVE_SLOPE,
) -> dict[str, Any]:
    """Sea as given, else at the roll period and as high as ship's length and pump permit."""
    shortest_s, longest_s = PERIODS_S
    period_s = tp_s or float(f"{min(max(roll_period_s, shortest_s), longest_s):.3g}")
    wavenumber = (2 * math.pi / period_s) ** 2 / GRAVITY_M_S2
    least_m, most_m = _HEIGHTS_M
    height_m = min(max(_HEIGHT_PER_LENGTH * length_m, least_m), most_m)
    height_m = min(height_m, 2 * MOST_SLOPE_RAD / (effective_slope * wavenumber))
    return {
        "kind": "jonswap",
        "hs_m": hs_m or float(f"{height_m:.2g}"),
        "tp_s": period_s,
        "effective_slope": {"coefficient": effective_slope},
    }


def make_starter(
    ship: StarterShip,
    room: tank_sizing.TankRoom,
    stability_share: float = tank_sizing.STABILITY_SHARE,
    hs_m: float | None = None,
    tp_s: float | None = None,
    effective_slope: float | None = None,
) -> StarterProject:
    """Size tank and pump, find a law, and write the files.

    The free surface may take `stability_share` of the stability, see `size_tank`. Raises
    `TankImpossibleError, NoLawError` if there is no tank or no law for this ship. Raises
    `ValueError` if a value is invalid. With an effective slope of hull data the files take these
    from `HULL`.
    """
    written = WrittenShip(
        displacement_t=ship.displacement_t,
        gm_m=ship.gm_m,
        roll_period_s=float(f"{ship.period_s:.4g}"),
        damping_ratio=ship.damping[0],
    )
    bare = written.ship()
    sized = tank_sizing.size_tank(bare, room, stability_share)
    sized = replace(sized, tank=tank_sizing.with_duct_loss(bare, sized.tank))
    demand = tank_sizing.pump_demand(bare, sized.tank, tank_sizing.pump_level_m(bare, sized.tank))
    pump = tank_sizing.size_pump(sized.tank, demand)
    texts = {SHIP: ship_file(ship, written, room, sized, demand, pump)}
    # from here on with the rounded numbers of the files
    vessel = _valid(Vessel, yaml.safe_load(texts[SHIP]))
    usable_m = float(f"{tank_sizing.usable_level_m(vessel.ship, vessel.tank):.3g}")
    limits = {}
    if usable_m < (1 - _LEAST_LEVEL_CHANGE) * vessel.default_limits["level_m"]:
        limits["level_m"] = usable_m
    slope = EFFECTIVE_SLOPE if effective_slope is None else float(f"{effective_slope:.2g}")
    sea = starter_sea(ship.length_m, ship.period_s, hs_m, tp_s, slope)
    texts[CONTROLLER] = controller_file(ship.name, written.roll_period_s, sea, limits)
    written_law = yaml.safe_load(texts[CONTROLLER])
    config = _valid(ControllerConfig, written_law | {"vessel": vessel})
    texts[SCENARIO] = scenario_file(ship.name, sea)
    parts = {"vessel": vessel, "controllers": {"self_tuned": config}}
    scenario = _valid(Scenario, yaml.safe_load(texts[SCENARIO]) | parts)
    expected_sea(vessel.ship, scenario.pooled_wave_moment())  # it rolls the ship
    assert isinstance(config.law, SelfTunedDesign)
    law = config.law.tuned(config.design_plant, first=True)
    texts[README] = readme(ship.name)
    if effective_slope is not None:
        remark = "a usual form, see docs/dynamics.md; better: utank-hil hull MESH"
        hull = f"\n  hull: ./{HULL}  # {remark}\n# Room:"
        texts[SHIP] = texts[SHIP].replace("\n# Room:", hull, 1)
        lines = [line for line in texts[SCENARIO].splitlines() if "effective_slope" not in line]
        plant = "plant: sway_roll_yaw  # waves act by the hull's data"
        texts[SCENARIO] = "\n".join([*lines, plant, ""])
    return StarterProject(vessel, sized, demand, law, sea, texts)


def _valid(model: type[ModelT], content: dict[str, Any]) -> ModelT:
    """Validate a part of the project; errors are reported at their key, as ``ship.gm_m``."""
    try:
        return model.model_validate(content)
    except ValidationError as error:
        found = problems_in_words(error, content, model)
        problems = [(".".join(map(str, key)), reason) for key, reason in found]
        raise parameters.ParameterError("starter", problems) from error


def number(value: float) -> str:
    """Number with four digits in YAML notation."""
    short = float(f"{value:.4g}")
    if short == 0 or 1e-3 <= abs(short) < 1e6:
        return repr(short)
    return f"{short:.3e}"


def ship_file(
    ship: StarterShip,
    written: WrittenShip,
    room: tank_sizing.TankRoom,
    sized: tank_sizing.SizedTank,
    demand: tank_sizing.PumpDemand,
    pump: Pump,
) -> str:
    """File of the vessel: ship, tank and pump."""
    tank, bare = sized.tank, written.ship()
    water_t = tank.water_kg / 1e3
    share, taken = water_t / ship.displacement_t, tank_sizing.stability_taken(bare, tank)
    damping_ratio, where_from = ship.damping
    where_from = "\n  # ".join(wrap(where_from, 96))
    length_m, breadth_m = sized.reservoir_length_m, sized.reservoir_breadth_m
    slope_deg = math.degrees(tank_sizing.PUMP_SLOPE_RAD)
    rate_m_s = tank.natural_frequency_rad_s * demand.level_m
    swinging = tank.linearized(rate_m_s).damping_ratio
    pressure_kpa, flow = demand.pressure_pa / 1e3, demand.flow_m3_s
    return f"""\
# {_line(ship.name)}, {ship.length_m:g} m by {ship.beam_m:g} m.
# Written by `utank-hil init`: change what you know better.
name: {json.dumps(ship.name)}
ship:  # without the tank's water
  displacement_t: {number(ship.displacement_t)}
  gm_m: {number(ship.gm_m)}
  roll_period_s: {number(written.roll_period_s)}  # {ship.period_source}
  damping_ratio: {number(damping_ratio)}  # of the roll: a decay test tells
  # {where_from}
# Room: {room.breadth_m:.2f} m across, {room.height_m:.2f} m high, {length_m:.2f} m along the ship.
# Size by {sized.bound_by}.
# Water {water_t:.1f} t, {share:.1%} of the displacement.
# Its free surface takes {taken * ship.gm_m:.2f} m of the GM, {taken:.0%}.
tank:
  width_m: {number(tank.width_m)}  # between the reservoirs' centre lines
  height_m: {number(tank.height_m)}  # still water above the duct
  # one reservoir, {length_m:.2f} m along and {breadth_m:.2f} m across the ship
  reservoir_area_m2: {number(tank.reservoir_area_m2)}
  # {sized.duct_height_m:.2f} m high; it tunes the water to the ship
  duct_area_m2: {number(tank.duct_area_m2)}
  lz_m: {number(tank.lz_m)}  # duct below the centre of gravity
  damping_ratio: {number(tank.damping_ratio)}  # friction in small motions: a guess
  # inlet and outlet have {tank_sizing.DUCT_LOSS:g}, a throttle the rest: with it the damping ratio
  # is {swinging:.2g} at {demand.level_m:.2f} m, and less in less motion
  quadratic_loss: {number(tank.quadratic_loss)}
  headroom_m: {number(tank.headroom_m)}  # roof above the still water
# Moves the water by {demand.level_m:.2f} m, which holds a wave slope of {slope_deg:.1f} degrees,
# at {tank_sizing.LOADINGS[0]:g} to {tank_sizing.LOADINGS[-1]:g} of the roll period:
# {pressure_kpa:.1f} kPa, {flow:.2f} m3/s, {demand.duct_speed_m_s:.1f} m/s in the duct.
pump:
  max_pressure_pa: {number(pump.max_pressure_pa)}
  max_power_w: {number(pump.max_power_w)}
# A bench: no commissioning is asked for. On board take this line out, then commission.
emulated: true
"""


def controller_file(
    name: str, roll_period_s: float, sea: dict[str, Any], limits: dict[str, float]
) -> str:
    """File of the controller: a law that is renewed under way."""
    slope = number(sea["effective_slope"]["coefficient"])
    level = f"level_m: {number(limits['level_m'])}, " if limits else ""
    remark = "# level_m: beyond it the water in the duct would be too fast\n" if limits else ""
    least_s = math.ceil(SHIP_PERIODS * roll_period_s)
    record = f"record_s: {least_s}, " if least_s > EstimateSettings().record_s else ""
    return f"""\
# A law that finds its numbers for ship and pump, with all margins. It begins with no waves in
# particular, and the tank's loss in those of the section sea. Ship and waves are estimated from the
# motion, and the law is renewed for them, first after fifteen roll periods. mean_power_w in W,
# beside sea, bounds what the pump spends.
name: {json.dumps(f"{name}, self-tuned")}
vessel: ship.yaml
law:
  kind: self_tuned
  sea: {{kind: jonswap, hs_m: {number(sea["hs_m"])}, tp_s: {number(sea["tp_s"])}, \
effective_slope: {slope}}}
sea_estimate: {{renew: true, {record}effective_slope: {slope}}}
# the plan keeps the limits itself: the level barrier behind it acts late and hard
{remark}limits: {{{level}brake_share: 1.0, sharpness: 4.0}}
"""


def scenario_file(name: str, sea: dict[str, Any]) -> str:
    """File of the scenario: a beam sea near the ship's roll period."""
    return f"""\
# A beam sea near the roll period, where a ship rolls most.
name: {json.dumps(f"{name} in a beam sea")}
vessel: ship.yaml
sea:
  kind: jonswap
  hs_m: {number(sea["hs_m"])}
  tp_s: {number(sea["tp_s"])}
  effective_slope: {{coefficient: {number(sea["effective_slope"]["coefficient"])}}}
controllers:
  self_tuned: controller.yaml
operator:
  - {{time_s: 5.0, action: arm}}
duration_s: 900
settle_s: 60
seed: 1
"""


def readme(name: str) -> str:
    """Instructions for the use of the files."""
    return f"""\
# {_line(name)}

| file | holds |
|---|---|
| `ship.yaml` | ship, tank and pump |
| `controller.yaml` | the law |
| `scenario.yaml` | the sea, and who arms when |

```sh
utank-hil check controller.yaml      # is the law robust enough for this ship
utank-hil bench scenario.yaml        # without tank, passive, active: table, picture, recording
utank-hil design tank ship.yaml --scenario scenario.yaml    # would another tank be better
```

After a change in `ship.yaml` run `check` again: a law that misses its margins is refused.
"""


def _line(name: str) -> str:
    return " ".join(name.split())
