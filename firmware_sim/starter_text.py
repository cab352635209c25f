"""Texts of a starter project's files, with comments."""

import json
import math
from typing import Any

from firmware_sim.starter_ship import StarterShip
from utank_hil.analysis.tank_sizing import (
    DUCT_LOSS,
    LOADINGS,
    PUMP_SLOPE_RAD,
    PumpDemand,
    SizedTank,
    TankRoom,
    stability_taken,
)
from utank_hil.configuration.ship_keys import WrittenShip
from utank_hil.dynamics.pump import Pump


def number(value: float) -> str:
    """Number with four digits in YAML notation."""
    short = float(f"{value:.4g}")
    if short == 0 or 1e-3 <= abs(short) < 1e6:
        return repr(short)
    return f"{short:.3e}"


def ship_file(
    ship: StarterShip,
    written: WrittenShip,
    room: TankRoom,
    sized: SizedTank,
    demand: PumpDemand,
    pump: Pump,
) -> str:
    """File of the vessel: ship, tank and pump."""
    tank, bare = sized.tank, written.ship()
    water_t = tank.water_kg / 1e3
    share, taken = water_t / ship.displacement_t, stability_taken(bare, tank)
    damping_ratio, where_from = ship.damping
    period = "as given"
    if ship.roll_period_s is None:
        period = "weather criterion's formula (IS Code 2008, A 2.3.4): measure it"
    length_m, breadth_m = sized.reservoir_length_m, sized.reservoir_breadth_m
    slope_deg = math.degrees(PUMP_SLOPE_RAD)
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
  roll_period_s: {number(written.roll_period_s)}  # {period}
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
  # inlet and outlet have {DUCT_LOSS:g}, a throttle the rest: with it the damping ratio
  # is {swinging:.2g} at {demand.level_m:.2f} m, and less in less motion
  quadratic_loss: {number(tank.quadratic_loss)}
  headroom_m: {number(tank.headroom_m)}  # roof above the still water
# Moves the water by {demand.level_m:.2f} m, which holds a wave slope of {slope_deg:.1f} degrees,
# at {LOADINGS[0]:g} to {LOADINGS[-1]:g} of the roll period:
# {pressure_kpa:.1f} kPa, {flow:.2f} m3/s, {demand.duct_speed_m_s:.1f} m/s in the duct.
pump:
  max_pressure_pa: {number(pump.max_pressure_pa)}
  max_power_w: {number(pump.max_power_w)}
# A bench: no commissioning is asked for. On board take this line out, then commission.
emulated: true
"""


def controller_file(name: str, sea: dict[str, Any], limits: dict[str, float]) -> str:
    """File of the controller: a law that is designed for the scenario's sea."""
    level = f"level_m: {number(limits['level_m'])}, " if limits else ""
    remark = "# level_m: beyond it the water in the duct would be too fast\n" if limits else ""
    return f"""\
# A law that finds its numbers for ship, pump and sea, with all margins. Without the section sea it
# expects no sea in particular. mean_power_w in W, beside it, bounds what the pump spends.
name: {json.dumps(f"{name}, self-tuned")}
vessel: ship.yaml
law:
  kind: self_tuned
  sea: {{kind: jonswap, hs_m: {number(sea["hs_m"])}, tp_s: {number(sea["tp_s"])}, \
effective_slope: {number(sea["effective_slope"]["coefficient"])}}}
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
