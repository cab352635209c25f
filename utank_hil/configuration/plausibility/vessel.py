"""Figures of ship, tank, pump and valve that a slip of unit or digit drives out of range."""

import math
from collections.abc import Iterator
from typing import NamedTuple

from utank_hil.dynamics import GRAVITY_M_S2, RollModel, RollShip, Tank, coupled_matrices
from utank_hil.dynamics.nonlinear import righting_range
from utank_hil.dynamics.pump import Pump
from utank_hil.dynamics.pump_curve import pump_load, pump_speed
from utank_hil.dynamics.ship import STIFFEST
from utank_hil.dynamics.valves import Valve


class Figure(NamedTuple):
    """A figure of a vessel with its range."""

    key: str  #: Key that is most likely wrong if the figure lies outside.
    value: float
    refused_below: float
    warned_below: float
    warned_above: float
    refused_above: float
    said: str  #: Problem and remedy of a value out of range.

    @property
    def words(self) -> str:
        """Problem and remedy in words."""
        return "gives a figure that overflows" if math.isnan(self.value) else self.said

    @property
    def refused(self) -> bool:
        """Whether the value is impossible."""
        return not self.refused_below <= self.value <= self.refused_above

    @property
    def warned(self) -> bool:
        """Whether the value is possible, but unusual."""
        return not self.refused and not self.warned_below <= self.value <= self.warned_above


_ANY = math.inf
_ROLL_RAD = math.radians(10)
_SPEED_M_S = 10.0  # a usual service speed
_RIGHTING_RAD = math.radians(15)
"""Half of the 30 degrees at which the IS Code 2008 (part A, 2.2.2) asks for a righting lever."""
_NOTHING = 1e-3  # Share of the tank's width below which a distance that is given has no effect.
_PER_1000 = math.sqrt(1000)  # period factor if inertia or stiffness is in thousands


def stages(
    ship: RollShip, tank: Tank, pump: Pump | None, valve: Valve | None
) -> Iterator[list[Figure]]:
    """Yield the parts of a vessel in an order in which each is judged with those before it."""
    yield _of_sizes(tank)
    yield _of_heights(tank)
    yield _of_ship(ship, tank) + _of_righting(ship, tank)
    yield _of_weight(ship, tank) if ship.displacement_n > 0 else []
    yield _of_tank(tank)
    yield _of_water(ship, tank)
    yield _of_loss(tank)
    if pump is not None:
        yield _of_pump(tank, pump)
        yield _of_motor(pump)
        yield _of_quickness(ship, pump)
    if valve is not None:
        yield _of_valve(ship, tank, valve)


def free_surface_nm_rad(ship: RollShip, tank: Tank) -> float:
    """Return the stiffness that the tank's free surface takes from the ship."""
    _, _, stiffness = coupled_matrices(ship, tank)
    return float(stiffness[0, 1] ** 2 / stiffness[1, 1])


def holding(pump: Pump) -> tuple[float, float, float]:
    """Return speed (rad/s), torque (N m) and power (W) that hold the pressure in still water."""
    coefficients = pump.coefficients
    speed = pump_speed(pump.max_pressure_pa, 0.0, coefficients)
    torque, _ = pump_load(speed, 0.0, coefficients)
    return speed, torque, speed * torque


def _of_sizes(tank: Tank) -> list[Figure]:
    """Return figures of the sizes that the other figures are relative to."""
    return [
        Figure("tank.width_m", tank.width_m, 0, 0, 80, 100,
               f"is {tank.width_m:g} m, wider than any ship: it is in metres, not millimetres"),
        Figure("tank.density_kg_m3", tank.density_kg_m3, 500, 900, 1400, 3000,
               "is no liquid's density: water has 1000 to 1030"),
    ]  # fmt: skip


def _of_heights(tank: Tank) -> list[Figure]:
    height_m, headroom_m, width_m = tank.height_m, tank.headroom_m, tank.width_m
    tall = f"is {height_m:g} m in a tank of width_m {width_m:g}: both are in metres"
    found = [Figure("tank.height_m", height_m / width_m, 0.003, 0.03, 1, 5, tall)]
    if headroom_m < math.inf:
        roof = (
            f"puts the roof {headroom_m:g} m above still water of {height_m:g} m, in a tank "
            f"{width_m:g} m wide: all are in metres"
        )
        over = (height_m + headroom_m) / width_m
        found += [
            Figure("tank.headroom_m", headroom_m / height_m, 0.005, 0.05, _ANY, _ANY, roof),
            Figure("tank.headroom_m", over, 0, 0, 1, _ANY, roof),
        ]
    return found


def _of_ship(ship: RollShip, tank: Tank) -> list[Figure]:
    """Return roll period and damping for a ship as wide as the tank."""
    frequency = ship.natural_frequency_rad_s
    period_s = 2 * math.pi / frequency
    beam = f"for a ship that holds a tank {tank.width_m:g} m wide"
    # T = 0.8 B / sqrt(GM): GM is 1.5 % of the width at 6.5
    of_width = period_s / math.sqrt(tank.width_m)
    critical = 2 * ship.inertia_kg_m2 * frequency
    swing = 8 / (3 * math.pi) * frequency * _ROLL_RAD  # of the linear damping of the same energy
    quadratic = swing * ship.quadratic_damping_nms2_rad2 / critical
    dampings = (
        ("damping_nms_rad", ship.damping_nms_rad / critical, "N m s"),
        ("quadratic_damping_nms2_rad2", quadratic, "N m s2 per rad2"),
        ("lift_damping_ns2_rad", _SPEED_M_S * ship.lift_damping_ns2_rad / critical,
         "N m s per m/s"),
    )  # fmt: skip
    total = sum(ratio for _, ratio, _ in dampings)
    return [
        Figure("ship.damping_nms_rad", total, 0, 0.004 if total > 0 else 0, _ANY, _ANY,
               f"makes a damping ratio of {total:.2g} with all other damping of the ship; hulls "
               "have 0.005 to 0.15: it is in N m s"),
        Figure("ship.inertia_kg_m2", of_width, 0.35, STIFFEST, _ANY, _ANY,
               f"gives a roll period of {period_s:.2g} s, short {beam}: inertia_kg_m2 is in kg m2 "
               f"(in t m2 it would be {period_s * _PER_1000:.3g} s), stiffness_nm_rad in N m"),
        Figure("ship.stiffness_nm_rad", of_width, 0, 0, 6.5, 25,
               f"gives a roll period of {period_s:.3g} s, long {beam}: stiffness_nm_rad is in N m "
               f"(in kN m it would be {period_s / _PER_1000:.3g} s), inertia_kg_m2 in kg m2"),
        # Patti-B, the least damped of the shipped ships, has 0.002; zero is a choice.
        *(Figure(f"ship.{name}", ratio, 0, 1e-4 if ratio > 0 else 0, 0.15, 1,
                 f"is a damping ratio of {ratio:.3g} at {math.degrees(_ROLL_RAD):.0f} degrees of "
                 f"roll and {_SPEED_M_S:g} m/s; hulls have 0.005 to 0.15: it is in {unit}")
          for name, ratio, unit in dampings),
    ]  # fmt: skip


def _of_righting(ship: RollShip, tank: Tank) -> list[Figure]:
    """Return figures of the righting moment beyond its slope upright, and of steady moments."""
    stiffness, found = ship.stiffness_nm_rad, []
    if ship.restoring_odd_nm:
        cubic = abs(ship.restoring_odd_nm[0]) / stiffness
        said = (
            f"begins with {cubic:.2g} times stiffness_nm_rad; hulls have 0.1 to 10 times: it is "
            "in N m per rad3, rad5, ..."
        )
        found.append(Figure("ship.restoring_odd_nm", cubic, 0, 0.01, 15, _ANY, said))
    if ship.gz_m:
        gm_m = stiffness / ship.displacement_n
        slope_m = ship.gz_m[1] / ship.gz_step_rad
        said = (
            f"begin with a slope of {slope_m:.3g} m, and GM is {gm_m:.3g} m: levers are in "
            "metres, gz_step_rad in radians, 10 degrees are 0.1745"
        )
        found.append(Figure("ship.gz_m", slope_m / gm_m, 0.1, 0.5, 2, 10, said))
    if ship.gz_m or ship.restoring_odd_nm:
        gone_rad = righting_range(RollModel(ship, tank)).vanishing_rad
        said = (
            f"leaves a ship that capsizes from {math.degrees(gone_rad):.0f} degrees on, with the "
            "tank's water: it is in N m per rad3, levers in metres"
        )
        key = "ship.gz_m" if ship.gz_m else "ship.restoring_odd_nm"
        found.append(Figure(key, gone_rad, 0, _RIGHTING_RAD, _ANY, _ANY, said))
    for name in ("offset_moment_nm", "wind_moment_nm"):
        heel_deg = math.degrees(abs(getattr(ship, name)) / stiffness)
        said = f"heels the ship {heel_deg:.2g} degrees: it is in N m"
        found.append(Figure(f"ship.{name}", heel_deg, 0, 0.01 if heel_deg else 0, 15, _ANY, said))
    return found


def _of_weight(ship: RollShip, tank: Tank) -> list[Figure]:
    gyration_m = math.sqrt(ship.inertia_kg_m2 * GRAVITY_M_S2 / ship.displacement_n)
    volume_m3 = ship.displacement_n / (GRAVITY_M_S2 * tank.density_kg_m3)
    return [
        Figure("ship.displacement_n", gyration_m / tank.width_m, 0.05, 0.2, 1.2, 5,
               f"gives a radius of gyration of {gyration_m:.3g} m for a ship that holds a tank of "
               f"width_m {tank.width_m:g}; it is about 0.4 of the beam: displacement_n is a weight "
               "in newtons, not a mass"),
        # about 1.5 beams cubed; a small tank has a third of the beam
        Figure("ship.displacement", volume_m3 / tank.width_m**3, 0, 0, 50, 200,
               f"is {volume_m3:.3g} m3 of water for a ship that holds a tank {tank.width_m:g} m "
               "wide: displacement_n is a weight in newtons"),
    ]  # fmt: skip


def _of_tank(tank: Tank) -> list[Figure]:
    """Return figures of losses and place of the tank."""
    damping = tank.damping_ratio
    found = [
        Figure("tank.damping_ratio", damping, 0, 0, 0.6, 1,
               f"of {damping:g} lets the water creep instead of swing; tanks have 0.05 to 0.4: it "
               "is a share of critical damping, 10 % is 0.10"),
    ]  # fmt: skip
    if tank.quadratic_loss == 0:
        still = "of 0 lets the water swing for ever: give damping_ratio or quadratic_loss"
        found.append(Figure("tank.damping_ratio", damping, 0, 1e-3, _ANY, _ANY, still))
    for name, most, end, toward in (("lz_m", 0.7, 1, "downwards"), ("lx_m", 4, 10, "forward")):
        distance_m, width_m = getattr(tank, name), tank.width_m
        said = (
            f"puts the duct {distance_m:g} m from the ship's centre of gravity, positive {toward}, "
            f"and the tank is {width_m:g} m wide: it is in metres"
        )
        least = _NOTHING if distance_m else 0
        found.append(Figure(f"tank.{name}", abs(distance_m) / width_m, 0, least, most, end, said))
    return found


def _of_water(ship: RollShip, tank: Tank) -> list[Figure]:
    """Return figures of the water's period, the duct and the free surface."""
    area_m2 = tank.reservoir_area_m2
    ratio = tank.duct_area_m2 / area_m2
    roll_s = 2 * math.pi / ship.natural_frequency_rad_s
    water_s = 2 * math.pi / tank.natural_frequency_rad_s
    matched_m = 2 * GRAVITY_M_S2 / ship.natural_frequency_rad_s**2 - 2 * tank.height_m
    remedy = "check height_m and width_m too"
    if matched_m > 0:
        remedy = f"about {tank.width_m * area_m2 / matched_m:.3g} m2 would suit"
    taken = free_surface_nm_rad(ship, tank) / ship.stiffness_nm_rad
    return [
        Figure("tank.duct_area_m2", ratio, 0, 0, 2, 20,
               f"is {tank.duct_area_m2:g} m2, {ratio:.3g} times reservoir_area_m2: both are in m2, "
               "of one duct and of one reservoir"),
        Figure("tank.duct_area_m2", water_s / roll_s, 0.05, 0.4, 2.5, 8,
               f"gives the water a period of {water_s:.3g} s, and the ship rolls in {roll_s:.3g} s"
               f": {remedy}; it is in m2, and reservoir_area_m2, {area_m2:g}, too"),
        Figure("tank.reservoir_area_m2", taken, 0, 0.02, _ANY, _ANY,
               f"takes {taken:.2%} of the ship's stability, and a tank that takes below 2 % does "
               "little: it is in m2, of one reservoir, displacement_t in tonnes, stiffness_nm_rad "
               "in N m"),
        Figure("tank.reservoir_area_m2", taken, 0, 0, 0.3, _ANY,
               f"takes {taken:.0%} of the ship's stability by its free surface, most tanks 2 to "
               "20 %: lower it, or the distance of the reservoirs, width_m"),
    ]  # fmt: skip


def _of_loss(tank: Tank) -> list[Figure]:
    """Return figures of the loss at inlet, outlet and throttle."""
    loss, level_m = tank.quadratic_loss, tank.level_limit_m / 2
    if loss == 0:
        return []
    ratio = tank.linearized(tank.natural_frequency_rad_s * level_m).damping_ratio
    return [
        Figure("tank.quadratic_loss", ratio, 0, 0, 1, 10,
               f"of {loss:g} makes a damping ratio of {ratio:.3g} at a level of {level_m:.2g} m, "
               "half of what the tank holds; tanks have 0.05 to 0.4: it is a coefficient of loss "
               "of the speed in the duct, inlet and outlet together 1.5"),
        Figure("tank.quadratic_loss", loss, 0, 0.3, _ANY, _ANY,
               f"of {loss:g} is less than that of any inlet and outlet, which have 1 to 1.5"),
    ]  # fmt: skip


def _of_pump(tank: Tank, pump: Pump) -> list[Figure]:
    """Return figures of pressure and size, relative to the tank."""
    pressure_pa, area_m2, level_m = pump.max_pressure_pa, pump.duct_area_m2, tank.level_limit_m
    head_m = pressure_pa / (tank.density_kg_m3 * GRAVITY_M_S2)
    own_m = math.sqrt(area_m2 / math.pi)
    similar = Pump.for_duct(area_m2, pressure_pa).inertia_kg_m2
    return [
        Figure("pump.max_pressure_pa", head_m / level_m, 0.01, 0.05, 10, 100,
               f"is {head_m:.2g} m of water, and a reservoir is full or empty at {level_m:.3g} m: "
               "it is in Pa, 25 kPa is 25e3"),
        Figure("pump.duct_area_m2", area_m2 / tank.duct_area_m2, 0.1, 0.3, 2, 5,
               f"is {area_m2:g} m2, and the tank's duct has {tank.duct_area_m2:g} m2: the "
               "propeller fills the duct that it stands in, so make both the same or nearly so"),
        Figure("pump.radius_m", pump.radius_m / own_m, 0.1, 0.35, 1, 3,
               f"is {pump.radius_m:g} m in a duct of {area_m2:g} m2, whose own radius is "
               f"{own_m:.3g} m; it is about 0.7 of that"),
        Figure("pump.lift", pump.lift, 0.01, 0.3, 5, 100,
               f"of {pump.lift:g} is no blade row's: a coefficient, about 1.4"),
        Figure("pump.friction", pump.friction, 0, 5e-4, 0.03, 1,
               f"of {pump.friction:g} is no blade row's: a coefficient, about 0.005"),
        Figure("pump.inertia_kg_m2", pump.inertia_kg_m2 / similar, 0, 0.1, 8, 1e4,
               f"is {pump.inertia_kg_m2:.3g} kg m2; a rotor of this size with its water and motor "
               f"has about {similar:.3g}"),
    ]  # fmt: skip


def _of_motor(pump: Pump) -> list[Figure]:
    """Return figures of the motor, relative to the greatest pressure in still water."""
    speed, torque, power = holding(pump)
    found = []
    for name, needed, unit, scale, note in (
        ("max_speed_rad_s", speed, "rad/s", 1.0, "rpm are 0.105 rad/s each"),
        ("max_torque_nm", torque, "kN m", 1e3, "it is in N m"),
        ("max_power_w", power, "kW", 1e3, "it is in W, 225 kW is 225e3"),
    ):
        given = getattr(pump, name)
        found += [
            Figure(f"pump.{name}", given / needed, 0.03, 1, _ANY, _ANY,
                   f"is {given / scale:.4g} {unit}, and to hold max_pressure_pa, "
                   f"{pump.max_pressure_pa / 1e3:.3g} kPa, takes {needed / scale:.3g} {unit} even "
                   f"in still water with a duct_area_m2 of {pump.duct_area_m2:g}: raise it, or "
                   f"lower max_pressure_pa; {note}"),
            Figure(f"pump.{name}", given / needed, 0, 0, 10, 1e4,
                   f"is {given / scale:.4g} {unit}, {given / needed:.3g} times what the greatest "
                   f"pressure takes in still water; {note}"),
        ]  # fmt: skip
    return found


def _of_quickness(ship: RollShip, pump: Pump) -> list[Figure]:
    """Return figures of the pump's speed of response, relative to the ship."""
    roll_s = 2 * math.pi / ship.natural_frequency_rad_s
    rolls = f"and the ship rolls in {roll_s:.3g} s"
    rise_s = pump.max_pressure_pa / pump.max_pressure_rate_pa_s
    spin_s = pump.inertia_kg_m2 * pump.max_speed_rad_s / pump.max_torque_nm
    late = f"is {pump.lag_s:g} s, {rolls}: it is in seconds"
    return [
        Figure("pump.max_pressure_rate_pa_s", rise_s / roll_s, 0, 0, 0.25, 2,
               f"takes {rise_s:.3g} s to the greatest pressure, {rolls}: it is in Pa/s, 500 kPa/s "
               "is 500e3"),
        Figure("pump.max_pressure_rate_pa_s", rise_s / pump.lag_s, 0, 0.3, _ANY, _ANY,
               f"takes {rise_s:.2g} s to the greatest pressure, and the pump's lag_s is "
               f"{pump.lag_s:g} s: it is in Pa/s"),
        Figure("pump.inertia_kg_m2", spin_s / roll_s, 0, 0, 0.25, 2,
               f"takes {spin_s:.3g} s to max_speed_rad_s at max_torque_nm, {rolls}: it is in kg m2"
               ", of rotor, motor and water"),
        Figure("pump.lag_s", pump.lag_s / roll_s, 0, 0, 0.1, 1, late),
        # electric drives of pumps take 0.05 to 0.5 s
        Figure("pump.lag_s", pump.lag_s, 0, 0, 0.8, _ANY, late),
    ]  # fmt: skip


def _of_valve(ship: RollShip, tank: Tank, valve: Valve) -> list[Figure]:
    roll_s = 2 * math.pi / ship.natural_frequency_rad_s
    coefficient = valve.discharge_coefficient
    found = [
        Figure("valve.opening_time_s", valve.opening_time_s / roll_s, 0, 0, 0.25, _ANY,
               f"is {valve.opening_time_s:g} s, and the ship rolls in {roll_s:.3g} s"),
        Figure("valve.discharge_coefficient", coefficient, 0, 0.2, _ANY, _ANY,
               f"of {coefficient:g} is no orifice's: about 0.6"),
    ]  # fmt: skip
    if valve.pipe_area_m2 is not None:
        share = valve.pipe_area_m2 / tank.reservoir_area_m2
        pipe = f"is {valve.pipe_area_m2:g} m2 for a reservoir_area_m2 of {tank.reservoir_area_m2:g}"
        found.append(Figure("valve.pipe_area_m2", share, 1e-6, 1e-4, 0.5, 5, pipe))
    return found
