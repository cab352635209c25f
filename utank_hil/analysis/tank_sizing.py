"""A tank and pump for a ship, from its stability, its roll period and the available room.

For a ship of displacement weight W, metacentric height GM and roll frequency w, and a tank of duct
length L, reservoir area At and still height H (`utank_hil.dynamics.tank`):

* The free surface takes the share s = rho g At L^2 / (2 W GM) of the stability. A tank tuned to the
  ship has the mass ratio s as well, so s determines its effect and its cost. It is chosen, and
  gives At.
* Frequency and damping are those of the passive optimum, thesis (3.2), which gives the duct's area.
* The level h lists a ship by s h / (L / 2): at the usable level the tank holds an effective wave
  slope of that angle, the wave slope capacity.
* The pressure that moves the water to a level h at a frequency w in the ship held still is
  |2 rho g - w^2 rho (2H + L At/Ap) + i w r| h, with the loss r. The pump is sized for it at the
  roll periods of `LOADINGS`, for the level that holds `PUMP_SLOPE_RAD`, together with the flow
  At w h.
"""

import math
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from utank_hil.base.parameters import Checked, Finite, Positive, Range, refuse
from utank_hil.control.optimal_tank import best_passive_tank, ship_ratios
from utank_hil.dynamics import GRAVITY_M_S2, RollShip, Tank
from utank_hil.dynamics.pump import Pump
from utank_hil.dynamics.ship import STIFFEST

STABILITY_SHARE: Final = 0.15  #: Default share of the ship's stability that the free surface takes.
LEAST_STABILITY_SHARE: Final = 0.03
"""Least share of stability worth the room; the first ship of the thesis has 0.05."""
MOST_STABILITY_SHARE: Final = 0.25
"""Greatest share of stability that the free surface may take. Chosen; no study."""
MOST_MASS_SHARE: Final = 0.04
"""Greatest mass of the water over the displacement. Chosen; no study."""
LEAST_GM_M: Final = 0.15  #: Metacentric height that must remain: IS Code 2008, part A, 2.2.4.
USABLE_SHARE: Final = 3.85 / 4.88
"""Usable level over the level at which a reservoir is full or empty, as on the first ship."""
MOST_DUCT_SPEED_M_S: Final = 45.0 / 6.22
"""Greatest speed of the water in the duct: the first ship's at its pump's greatest flow."""
PUMP_SLOPE_RAD: Final = math.radians(1.5)
"""Effective wave slope that a pump is sized for: its level holds the ship upright on it."""
LOADINGS: Final = (0.85, 1.0, 1.15)
"""Factors on the roll period at which the pump moves the water to the usable level."""
EFFICIENCY: Final = 2.25 / 3.6
"""Hydraulic power of a pump at its greatest pressure and flow over shaft power (`Pump.for_duct`).
"""

DUCT_LOSS: Final = 1.5
"""Loss coefficient of a plain duct: 0.5 at its inlet and 1 at its outlet, by Borda and Carnot."""
LINEAR_SHARE: Final = 0.02
"""Damping ratio of friction, which is laminar in small motions. Chosen; no study."""

_RESERVOIR_SHARE = 0.2  # greatest breadth of a reservoir over the room's
_DUCT_SHARE = 0.25  # greatest height of the duct over the room's
_STILL_SHARE = 0.25  # greatest share of the reservoirs in the water's effective length
_ROUNDS = 20  # Limit on the iterations. Chosen; no study.
_TOLERANCE = 1e-3  # Relative change at which the iteration ends. Chosen; no study.


class TankImpossibleError(ValueError):
    """No useful tank fits the ship or the room."""


@dataclass(frozen=True, slots=True)
class TankRoom(Checked, owner="tank room"):
    """Room for a U-tube tank across the ship; `ValueError` if a length is not positive."""

    breadth_m: Positive  #: Across the ship, between the outer walls of the reservoirs.
    height_m: Positive  #: From the duct's bottom to the reservoirs' roof.
    length_m: Positive  #: Along the ship.
    duct_below_cg_m: Finite = 0.0  #: Depth of the duct's centre below the ship's centre of gravity.

    @classmethod
    def in_hull(cls, length_m: float, beam_m: float) -> "TankRoom":
        """Return the usual room in a ship of that length and beam."""
        return cls(0.9 * beam_m, 0.4 * beam_m, 0.08 * length_m, 0.1 * beam_m)


@dataclass(frozen=True, slots=True)
class SizedTank:
    """A tank in its room."""

    tank: Tank
    #: reservoir_length_m, reservoir_breadth_m: dimensions of one reservoir, along and across the
    #: ship.
    reservoir_length_m: float
    reservoir_breadth_m: float
    duct_height_m: float  #: Height of a duct as long as the reservoirs along the ship.
    bound_by: str  #: Constraint that determined the size, in words.


@dataclass(frozen=True, slots=True)
class PumpDemand:
    """Requirements on a pump that moves the water to a level, in the ship held still."""

    level_m: float  #: Amplitude.
    #: pressure_pa, flow_m3_s: amplitudes, the greatest over `LOADINGS`.
    pressure_pa: float
    flow_m3_s: float
    duct_speed_m_s: float  #: Speed of the water at that flow.
    #: Shaft power at the ship's own roll period, where the pump balances the water's losses.
    mean_power_w: float


@dataclass(frozen=True, slots=True)
class TankCost:
    """Cost of a tank to the ship, and its capacity."""

    water_t: float
    #: Mass of the water over the displacement; None for a ship without a displacement.
    share_of_displacement: float | None
    stability_taken: float  #: Share of the stability that the free surface takes.
    gm_loss_m: float | None
    water_period_s: float  #: Of the water in the ship held still, as the next.
    damping_ratio: float  #: With the quadratic loss at the level of `pump_level_m`.
    usable_level_m: float  #: As the function `usable_level_m`.
    slope_capacity_rad: float  #: Effective wave slope that the usable level holds.


def size_tank(
    ship: RollShip, room: TankRoom, stability_share: float = STABILITY_SHARE
) -> SizedTank:
    """Size the tank with a share of the ship's stability, or the greatest feasible share below it.

    `ship` has its displacement; `stability_share` is 0.03 to 0.25. Raises `TankImpossibleError` if
    ship or room allow no tank of `LEAST_STABILITY_SHARE`, with the reason and a remedy. Raises
    `ValueError` if the share is out of its range or the ship has no displacement.
    """
    shares = Range(least=LEAST_STABILITY_SHARE, most=MOST_STABILITY_SHARE)
    if not shares.holds(stability_share):
        refuse("tank", [("stability_share", f"{shares.demand}, got {stability_share}")])
    if not ship.displacement_n > 0:
        refuse("ship", [("displacement_n", "is needed to size a tank")])
    gm_m = ship.stiffness_nm_rad / ship.displacement_n
    spare = 1 - LEAST_GM_M / gm_m
    if spare < LEAST_STABILITY_SHARE:
        raise TankImpossibleError(
            f"a GM of {gm_m:.2f} m can spare nothing for a free surface: {LEAST_GM_M} m must be "
            "left (IS Code 2008, part A, 2.2.4)"
        )
    wanted, bound_by = stability_share, "the share of stability asked for"
    if spare < wanted:
        wanted, bound_by = spare, f"GM: {LEAST_GM_M} m must be left of {gm_m:.2f} m"
    found, duct_m, tuned = None, math.inf, False
    for _ in range(_ROUNDS):
        found = _in_room(ship, room, wanted, duct_m, tuned=tuned)
        mass_kg = found.tank.water_kg
        heavy = mass_kg * GRAVITY_M_S2 / (MOST_MASS_SHARE * ship.displacement_n)
        long = found.reservoir_length_m / room.length_m
        excess = max(heavy, long)
        if excess > 1 + _TOLERANCE:
            wanted /= excess
            bound_by = f"the room's length, {room.length_m:.1f} m"
            if heavy > long:
                bound_by = f"the water's mass, {MOST_MASS_SHARE:.0%} of the displacement"
        elif abs(found.duct_height_m - duct_m) < _TOLERANCE * room.height_m:
            if tuned:
                break
            tuned = True  # The slow optimum is used only near the solution.
        duct_m = found.duct_height_m
    assert found is not None
    if wanted < LEAST_STABILITY_SHARE:
        raise TankImpossibleError(
            _too_stiff(ship, room)
            or f"{bound_by}, lets a tank take {wanted:.1%} of the stability, and below "
            f"{LEAST_STABILITY_SHARE:.0%} it does too little: a wider room (now "
            f"{room.breadth_m:.1f} m) or a longer one would help"
        )
    return replace(found, bound_by=bound_by)


def _too_stiff(ship: RollShip, room: TankRoom) -> str:
    """Why no room helps a ship that is far stiffer than others of her breadth; else empty."""
    gm_m = ship.stiffness_nm_rad / ship.displacement_n
    period_s = 2 * math.pi / ship.natural_frequency_rad_s
    least_s = STIFFEST * math.sqrt(room.breadth_m)
    if period_s >= least_s and gm_m <= room.breadth_m / 4:
        return ""
    return (
        f"a GM of {gm_m:.3g} m with a roll period of {period_s:.3g} s is of a ship too stiff for "
        f"one: others {room.breadth_m:.3g} m across have a GM below {room.breadth_m / 4:.2g} m and "
        f"roll in {least_s:.2g} s or more. Check both: metres, and seconds of a swing to both sides"
    )


def _in_room(
    ship: RollShip, room: TankRoom, stability_share: float, duct_m: float, *, tuned: bool
) -> SizedTank:
    """Tank of a share of stability, as fast as the ship or tuned to it, with a duct of length L."""
    way_m = 2 * GRAVITY_M_S2 / ship.natural_frequency_rad_s**2  # 2H + L At/Ap of a tuned tank
    duct_m = min(duct_m, _DUCT_SHARE * room.height_m)
    height_m = min((room.height_m - duct_m) / 2, _STILL_SHARE * way_m)
    duct_part_m = way_m - 2 * height_m
    # The duct's height is L b / duct_part, with the reservoirs' breadth b and the room's L + b.
    root = room.breadth_m**2 - 4 * _DUCT_SHARE * room.height_m * duct_part_m
    breadth_m = _RESERVOIR_SHARE * room.breadth_m
    if root > 0:
        breadth_m = min(breadth_m, (room.breadth_m - math.sqrt(root)) / 2)
    width_m = room.breadth_m - breadth_m
    area_m2 = 2 * stability_share * ship.stiffness_nm_rad / (1e3 * GRAVITY_M_S2 * width_m**2)
    tank = Tank(
        width_m=width_m,
        height_m=height_m,
        reservoir_area_m2=area_m2,
        duct_area_m2=width_m * area_m2 / duct_part_m,
        lz_m=room.duct_below_cg_m,
        headroom_m=height_m,
    )
    if tuned:
        try:
            with np.errstate(all="ignore"):  # a divergent optimum ends in the error below
                tank = best_passive_tank(ship, tank)
        except ValueError as error:
            raise TankImpossibleError(
                _too_stiff(ship, room)
                or f"no water in this room can be tuned to a roll period of "
                f"{2 * math.pi / ship.natural_frequency_rad_s:.3g} s: {error}"
            ) from error
    length_m = area_m2 / breadth_m
    return SizedTank(tank, length_m, breadth_m, tank.duct_area_m2 / length_m, "")


def with_duct_loss(ship: RollShip, tank: Tank) -> Tank:
    """Return a tank whose loss is that of its duct: the same damping, at one level, `pump_level_m`.

    Friction keeps `LINEAR_SHARE`, the rest is quadratic, and at least `DUCT_LOSS`.
    """
    rate = tank.natural_frequency_rad_s * pump_level_m(ship, tank)
    one = replace(tank, damping_ratio=0.0, quadratic_loss=1.0).linearized(rate).damping_ratio
    loss = max(DUCT_LOSS, (tank.damping_ratio - LINEAR_SHARE) / one)
    return replace(tank, damping_ratio=LINEAR_SHARE, quadratic_loss=loss)


def moving(ship: RollShip, tank: Tank) -> Tank:
    """Return the tank with the linear loss that it has at the pump's level."""
    return tank.linearized(tank.natural_frequency_rad_s * pump_level_m(ship, tank))


def stability_taken(ship: RollShip, tank: Tank) -> float:
    """Share of the ship's stability that the free surface takes."""
    moment = tank.density_kg_m3 * GRAVITY_M_S2 * tank.reservoir_area_m2 * tank.width_m**2 / 2
    return moment / ship.stiffness_nm_rad


def wave_slope_capacity_rad(ship: RollShip, tank: Tank, level_m: float) -> float:
    """Effective wave slope whose moment the water's weight balances at a level."""
    return stability_taken(ship, tank) * level_m / (tank.width_m / 2)


def usable_level_m(ship: RollShip, tank: Tank) -> float:
    """Greatest level a pump may reach: below the roof, and within the duct's speed limit."""
    _, roll_rad_s = ship_ratios(ship, tank)
    fastest_rad_s = roll_rad_s / min(LOADINGS)
    speed_per_level = fastest_rad_s * tank.reservoir_area_m2 / tank.duct_area_m2
    return min(USABLE_SHARE * tank.level_limit_m, MOST_DUCT_SPEED_M_S / speed_per_level)


def pump_level_m(ship: RollShip, tank: Tank) -> float:
    """Level that a pump is sized for: it holds `PUMP_SLOPE_RAD`, limited to the usable level."""
    holding_m = PUMP_SLOPE_RAD / wave_slope_capacity_rad(ship, tank, 1.0)
    return min(usable_level_m(ship, tank), holding_m)


def pump_demand(ship: RollShip, tank: Tank, level_m: float) -> PumpDemand:
    """Requirements on a pump that moves the water to a level."""
    _, roll_rad_s = ship_ratios(ship, tank)
    frequencies = [roll_rad_s / scale for scale in LOADINGS]
    flow_m3_s = tank.reservoir_area_m2 * max(frequencies) * level_m
    loss_pa_s_m = tank.linearized(roll_rad_s * level_m).loss_pa_per_m_s
    loss_w = tank.reservoir_area_m2 * loss_pa_s_m * (roll_rad_s * level_m) ** 2 / 2
    return PumpDemand(
        level_m=level_m,
        pressure_pa=max(_pressure_pa_per_m(tank.linearized(w * level_m), w) for w in frequencies)
        * level_m,
        flow_m3_s=flow_m3_s,
        duct_speed_m_s=flow_m3_s / tank.duct_area_m2,
        mean_power_w=loss_w / EFFICIENCY,
    )


def _pressure_pa_per_m(tank: Tank, frequency_rad_s: float) -> float:
    """Pressure amplitude per level amplitude in the ship held still."""
    stiffness = 2 * tank.density_kg_m3 * GRAVITY_M_S2
    inertia = tank.density_kg_m3 * tank.effective_length_m
    return abs(
        complex(stiffness - inertia * frequency_rad_s**2, frequency_rad_s * tank.loss_pa_per_m_s)
    )


def tank_cost(ship: RollShip, tank: Tank) -> TankCost:
    """Cost of a tank to the ship, and its capacity."""
    mass_kg, taken = tank.water_kg, stability_taken(ship, tank)
    level_m, weight_n = usable_level_m(ship, tank), ship.displacement_n
    weighed = weight_n > 0
    return TankCost(
        water_t=mass_kg / 1e3,
        share_of_displacement=mass_kg * GRAVITY_M_S2 / weight_n if weighed else None,
        stability_taken=taken,
        gm_loss_m=taken * ship.stiffness_nm_rad / weight_n if weighed else None,
        water_period_s=2 * math.pi / tank.natural_frequency_rad_s,
        damping_ratio=moving(ship, tank).damping_ratio,
        usable_level_m=level_m,
        slope_capacity_rad=wave_slope_capacity_rad(ship, tank, level_m),
    )


def size_pump(tank: Tank, demand: PumpDemand) -> Pump:
    """Size a pump of the tank's duct for a demand, similar to the first ship's.

    Its greatest flow is proportional to the root of its pressure, so the pressure is the greater of
    what the demand's pressure and its flow require. Motor and drive are sized for both at once.
    """
    by_speed_pa = 50e3 * (demand.duct_speed_m_s / MOST_DUCT_SPEED_M_S) ** 2
    pump = Pump.for_duct(tank.duct_area_m2, max(demand.pressure_pa, by_speed_pa))
    return replace(pump, max_power_w=pump.max_pressure_pa * demand.flow_m3_s / EFFICIENCY)
