"""Figures of ship, tank, pump and valve that a slip of unit or digit drives out of range."""

import math
from collections.abc import Iterator
from typing import NamedTuple

from utank_hil.dynamics import GRAVITY_M_S2, RollModel, RollShip, Tank, coupled_matrices
from utank_hil.dynamics.nonlinear import righting_range
from utank_hil.dynamics.pump import Pump, pump_load, pump_speed
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


def free_surface_nm_rad(ship: RollShip, tank: Tank) -> float:
    """Return the stiffness that the tank's free surface takes from the ship."""
    _, _, stiffness = coupled_matrices(ship, tank)
    return float(stiffness[0, 1] ** 2 / stiffness[1, 1])


def of_sizes(tank: Tank) -> Iterator[Figure]:
    """Return figures of the sizes that the other figures are relative to."""
    yield Figure(
        "tank.width_m", tank.width_m, 0, 0, 80, 100,
        f"is {tank.width_m:g} m, wider than any ship: it is in metres, not millimetres",
    )  # fmt: skip
    heavy = "is no liquid's density: water has 1000 to 1030"
    yield Figure("tank.density_kg_m3", tank.density_kg_m3, 500, 900, 1400, 3000, heavy)


def of_heights(tank: Tank) -> Iterator[Figure]:
    """Return figures of the reservoirs' height and headroom."""
    height_m, headroom_m, width_m = tank.height_m, tank.headroom_m, tank.width_m
    tall = f"is {height_m:g} m in a tank of width_m {width_m:g}: both are in metres"
    yield Figure("tank.height_m", height_m / width_m, 0.003, 0.03, 1, 5, tall)
    if headroom_m < math.inf:
        roof = (
            f"puts the roof {headroom_m:g} m above still water of {height_m:g} m, in a tank "
            f"{width_m:g} m wide: all are in metres"
        )
        yield Figure("tank.headroom_m", headroom_m / height_m, 0.005, 0.05, _ANY, _ANY, roof)
        yield Figure("tank.headroom_m", (height_m + headroom_m) / width_m, 0, 0, 1, _ANY, roof)


def of_ship(ship: RollShip, tank: Tank) -> Iterator[Figure]:
    """Return roll period, damping and radius of gyration for a ship as wide as the tank."""
    frequency = ship.natural_frequency_rad_s
    period_s = 2 * math.pi / frequency
    beam = f"for a ship that holds a tank {tank.width_m:g} m wide"
    # T = 0.8 B / sqrt(GM): GM is 0.25 of the width at 1.6, 1.5 % of it at 6.5
    of_width = period_s / math.sqrt(tank.width_m)
    yield Figure(
        "ship.inertia_kg_m2", of_width, 0.35, 1.6, _ANY, _ANY,
        f"gives a roll period of {period_s:.2g} s, short {beam}: inertia_kg_m2 is in kg m2 (in t "
        f"m2 it would be {period_s * _PER_1000:.3g} s), stiffness_nm_rad in N m",
    )  # fmt: skip
    yield Figure(
        "ship.stiffness_nm_rad", of_width, 0, 0, 6.5, 25,
        f"gives a roll period of {period_s:.3g} s, long {beam}: stiffness_nm_rad is in N m (in "
        f"kN m it would be {period_s / _PER_1000:.3g} s), inertia_kg_m2 in kg m2",
    )  # fmt: skip
    critical = 2 * ship.inertia_kg_m2 * frequency
    swing = 8 / (3 * math.pi) * frequency * _ROLL_RAD  # of the linear damping of the same energy
    for name, ratio, unit in (
        ("damping_nms_rad", ship.damping_nms_rad / critical, "N m s"),
        ("quadratic_damping_nms2_rad2", swing * ship.quadratic_damping_nms2_rad2 / critical,
         "N m s2 per rad2"),
        ("lift_damping_ns2_rad", _SPEED_M_S * ship.lift_damping_ns2_rad / critical,
         "N m s per m/s"),
    ):  # fmt: skip
        # Patti-B, the least damped of the shipped ships, has 0.002; zero is a choice.
        yield Figure(
            f"ship.{name}", ratio, 0, 1e-4 if ratio > 0 else 0, 0.2, 1,
            f"is a damping ratio of {ratio:.3g} at {math.degrees(_ROLL_RAD):.0f} degrees of roll "
            f"and {_SPEED_M_S:g} m/s; hulls have 0.005 to 0.15: it is in {unit}",
        )  # fmt: skip
    yield from _righting(ship, tank)


def _righting(ship: RollShip, tank: Tank) -> Iterator[Figure]:
    """Return figures of the righting moment beyond its slope upright, and of steady moments."""
    stiffness = ship.stiffness_nm_rad
    if ship.restoring_odd_nm:
        cubic = abs(ship.restoring_odd_nm[0]) / stiffness
        yield Figure(
            "ship.restoring_odd_nm", cubic, 0, 0.01, 15, _ANY,
            f"begins with {cubic:.2g} times stiffness_nm_rad; hulls have 0.1 to 10 times: it is "
            "in N m per rad3, rad5, ...",
        )  # fmt: skip
    if ship.gz_m:
        gm_m = stiffness / ship.displacement_n
        slope_m = ship.gz_m[1] / ship.gz_step_rad
        yield Figure(
            "ship.gz_m", slope_m / gm_m, 0.1, 0.5, 2, 10,
            f"begin with a slope of {slope_m:.3g} m, and GM is {gm_m:.3g} m: levers are in "
            "metres, gz_step_rad in radians, 10 degrees are 0.1745",
        )  # fmt: skip
    if ship.gz_m or ship.restoring_odd_nm:
        gone_rad = righting_range(RollModel(ship, tank)).vanishing_rad
        yield Figure(
            "ship.gz_m" if ship.gz_m else "ship.restoring_odd_nm",
            gone_rad, 0, _RIGHTING_RAD, _ANY, _ANY,
            f"leaves a ship that capsizes from {math.degrees(gone_rad):.0f} degrees on, with the "
            "tank's water: it is in N m per rad3, levers in metres",
        )  # fmt: skip
    for name in ("offset_moment_nm", "wind_moment_nm"):
        heel_deg = math.degrees(abs(getattr(ship, name)) / stiffness)
        steady = f"heels the ship {heel_deg:.2g} degrees: it is in N m"
        yield Figure(f"ship.{name}", heel_deg, 0, 0.01 if heel_deg else 0, 15, _ANY, steady)


def of_weight(ship: RollShip, tank: Tank) -> Iterator[Figure]:
    """Return the radius of gyration, if the weight is known."""
    if ship.displacement_n <= 0:
        return
    gyration_m = math.sqrt(ship.inertia_kg_m2 * GRAVITY_M_S2 / ship.displacement_n)
    yield Figure(
        "ship.displacement_n", gyration_m / tank.width_m, 0.05, 0.2, 1.2, 5,
        f"gives a radius of gyration of {gyration_m:.3g} m for a ship that holds a tank of width_m "
        f"{tank.width_m:g}; it is about 0.4 of the beam: displacement_n is a weight in newtons, "
        "not a mass",
    )  # fmt: skip
    volume_m3 = ship.displacement_n / (GRAVITY_M_S2 * tank.density_kg_m3)
    yield Figure(  # about 1.5 beams cubed; a small tank has a third of the beam
        "ship.displacement", volume_m3 / tank.width_m**3, 0, 0, 50, 200,
        f"is {volume_m3:.3g} m3 of water for a ship that holds a tank {tank.width_m:g} m wide: "
        "displacement_n is a weight in newtons",
    )  # fmt: skip


def of_tank(ship: RollShip, tank: Tank) -> Iterator[Figure]:
    """Return figures of losses, place and water of the tank."""
    damping = tank.damping_ratio
    yield Figure(
        "tank.damping_ratio", damping, 0, 0, 0.6, 1,
        f"of {damping:g} lets the water creep instead of swing; tanks have 0.05 to 0.4: it is a "
        "share of critical damping, 10 % is 0.10",
    )  # fmt: skip
    if tank.quadratic_loss == 0:
        still = "of 0 lets the water swing for ever: give damping_ratio or quadratic_loss"
        yield Figure("tank.damping_ratio", damping, 0, 1e-3, _ANY, _ANY, still)
    for name, most, end, toward in (("lz_m", 0.7, 1, "downwards"), ("lx_m", 4, 10, "forward")):
        distance_m = getattr(tank, name)
        yield Figure(
            f"tank.{name}", abs(distance_m) / tank.width_m, 0, _NOTHING if distance_m else 0, most,
            end,
            f"puts the duct {distance_m:g} m from the ship's centre of gravity, positive {toward}, "
            f"and the tank is {tank.width_m:g} m wide: it is in metres",
        )  # fmt: skip
    yield from _water(ship, tank)


def _water(ship: RollShip, tank: Tank) -> Iterator[Figure]:
    """Return figures of the water's period, the duct and the free surface."""
    area_m2 = tank.reservoir_area_m2
    ratio = tank.duct_area_m2 / area_m2
    yield Figure(
        "tank.duct_area_m2", ratio, 0, 0, 2, 20,
        f"is {tank.duct_area_m2:g} m2, {ratio:.3g} times reservoir_area_m2: both are in m2, of one "
        "duct and of one reservoir",
    )  # fmt: skip
    roll_s = 2 * math.pi / ship.natural_frequency_rad_s
    water_s = 2 * math.pi / tank.natural_frequency_rad_s
    matched_m = 2 * GRAVITY_M_S2 / ship.natural_frequency_rad_s**2 - 2 * tank.height_m
    remedy = "check height_m and width_m too"
    if matched_m > 0:
        remedy = f"about {tank.width_m * area_m2 / matched_m:.3g} m2 would suit"
    yield Figure(
        "tank.duct_area_m2", water_s / roll_s, 0.05, 0.4, 2.5, 8,
        f"gives the water a period of {water_s:.3g} s, and the ship rolls in {roll_s:.3g} s: "
        f"{remedy}; it is in m2, and reservoir_area_m2, {area_m2:g}, too",
    )  # fmt: skip
    taken = free_surface_nm_rad(ship, tank) / ship.stiffness_nm_rad
    yield Figure(
        "tank.reservoir_area_m2", taken, 0, 0.02, _ANY, _ANY,
        f"takes {taken:.2%} of the ship's stability, and a tank that takes below 2 % does little: "
        "it is in m2, of one reservoir, displacement_t in tonnes, stiffness_nm_rad in N m",
    )  # fmt: skip
    yield Figure(
        "tank.reservoir_area_m2", taken, 0, 0, 0.3, _ANY,
        f"takes {taken:.0%} of the ship's stability by its free surface, most tanks 2 to 20 %: "
        "lower it, or the distance of the reservoirs, width_m",
    )  # fmt: skip


def holding(pump: Pump) -> tuple[float, float, float]:
    """Return speed (rad/s), torque (N m) and power (W) that hold the pressure in still water."""
    coefficients = pump.coefficients
    speed = pump_speed(pump.max_pressure_pa, 0.0, coefficients)
    torque, _ = pump_load(speed, 0.0, coefficients)
    return speed, torque, speed * torque


def of_pump(tank: Tank, pump: Pump) -> Iterator[Figure]:
    """Return figures of pressure and size, relative to the tank."""
    pressure_pa, area_m2, level_m = pump.max_pressure_pa, pump.duct_area_m2, tank.level_limit_m
    head_m = pressure_pa / (tank.density_kg_m3 * GRAVITY_M_S2)
    own_m = math.sqrt(area_m2 / math.pi)
    similar = Pump.for_duct(area_m2, pressure_pa).inertia_kg_m2
    yield Figure(
        "pump.max_pressure_pa", head_m / level_m, 0.01, 0.05, 10, 100,
        f"is {head_m:.2g} m of water, and a reservoir is full or empty at {level_m:.3g} m: it is "
        "in Pa, 25 kPa is 25e3",
    )  # fmt: skip
    yield Figure(
        "pump.duct_area_m2", area_m2 / tank.duct_area_m2, 0.1, 0.3, 2, 5,
        f"is {area_m2:g} m2, and the tank's duct has {tank.duct_area_m2:g} m2: the propeller fills "
        "the duct that it stands in, so make both the same or nearly so",
    )  # fmt: skip
    yield Figure(
        "pump.radius_m", pump.radius_m / own_m, 0.1, 0.35, 1, 3,
        f"is {pump.radius_m:g} m in a duct of {area_m2:g} m2, whose own radius is {own_m:.3g} m; "
        "it is about 0.7 of that",
    )  # fmt: skip
    lift = f"of {pump.lift:g} is no blade row's: a coefficient, about 1.4"
    yield Figure("pump.lift", pump.lift, 0.01, 0.3, 5, 100, lift)
    drag = f"of {pump.friction:g} is no blade row's: a coefficient, about 0.005"
    yield Figure("pump.friction", pump.friction, 0, 5e-4, 0.03, 1, drag)
    yield Figure(
        "pump.inertia_kg_m2", pump.inertia_kg_m2 / similar, 0, 0.1, 8, 1e4,
        f"is {pump.inertia_kg_m2:.3g} kg m2; a rotor of this size with its water and motor has "
        f"about {similar:.3g}",
    )  # fmt: skip


def of_motor(pump: Pump) -> Iterator[Figure]:
    """Return figures of the motor, relative to the greatest pressure in still water."""
    needs = zip(
        ("max_speed_rad_s", "max_torque_nm", "max_power_w"),
        holding(pump),
        (("rad/s", 1.0, "rpm are 0.105 rad/s each"), ("kN m", 1e3, "it is in N m"),
         ("kW", 1e3, "it is in W, 225 kW is 225e3")),
        strict=True,
    )  # fmt: skip
    for name, needed, (unit, scale, note) in needs:
        key, given = f"pump.{name}", getattr(pump, name)
        yield Figure(
            key, given / needed, 0.03, 1, _ANY, _ANY,
            f"is {given / scale:.4g} {unit}, and to hold max_pressure_pa, "
            f"{pump.max_pressure_pa / 1e3:.3g} kPa, takes {needed / scale:.3g} {unit} even in "
            f"still water with a duct_area_m2 of {pump.duct_area_m2:g}: raise it, or lower "
            f"max_pressure_pa; {note}",
        )  # fmt: skip
        yield Figure(
            key, given / needed, 0, 0, 10, 1e4,
            f"is {given / scale:.4g} {unit}, {given / needed:.3g} times what the greatest pressure "
            f"takes in still water; {note}",
        )  # fmt: skip


def of_quickness(ship: RollShip, pump: Pump) -> Iterator[Figure]:
    """Return figures of the pump's speed of response, relative to the ship."""
    roll_s = 2 * math.pi / ship.natural_frequency_rad_s
    rolls = f"and the ship rolls in {roll_s:.3g} s"
    rise_s = pump.max_pressure_pa / pump.max_pressure_rate_pa_s
    yield Figure(
        "pump.max_pressure_rate_pa_s", rise_s / roll_s, 0, 0, 0.25, 2,
        f"takes {rise_s:.3g} s to the greatest pressure, {rolls}: it is in Pa/s, 500 kPa/s is "
        "500e3",
    )  # fmt: skip
    yield Figure(
        "pump.max_pressure_rate_pa_s", rise_s / pump.lag_s, 0, 0.3, _ANY, _ANY,
        f"takes {rise_s:.2g} s to the greatest pressure, and the pump's lag_s is {pump.lag_s:g} s: "
        "it is in Pa/s",
    )  # fmt: skip
    spin_s = pump.inertia_kg_m2 * pump.max_speed_rad_s / pump.max_torque_nm
    yield Figure(
        "pump.inertia_kg_m2", spin_s / roll_s, 0, 0, 0.25, 2,
        f"takes {spin_s:.3g} s to max_speed_rad_s at max_torque_nm, {rolls}: it is in kg m2, of "
        "rotor, motor and water",
    )  # fmt: skip
    late = f"is {pump.lag_s:g} s, {rolls}: it is in seconds"
    yield Figure("pump.lag_s", pump.lag_s / roll_s, 0, 0, 0.1, 1, late)
    # electric drives of pumps take 0.05 to 0.5 s
    yield Figure("pump.lag_s", pump.lag_s, 0, 0, 0.8, _ANY, late)


def of_valve(ship: RollShip, tank: Tank, valve: Valve) -> Iterator[Figure]:
    """Return figures of a valve, relative to ship and tank."""
    roll_s = 2 * math.pi / ship.natural_frequency_rad_s
    slow = f"is {valve.opening_time_s:g} s, and the ship rolls in {roll_s:.3g} s"
    yield Figure("valve.opening_time_s", valve.opening_time_s / roll_s, 0, 0, 0.25, _ANY, slow)
    tight = f"of {valve.leakage:g} is no gate's: it is a share of the open area"
    yield Figure("valve.leakage", valve.leakage, 0, 1e-3, _ANY, _ANY, tight)
    coefficient = valve.discharge_coefficient
    sharp = f"of {coefficient:g} is no orifice's: about 0.6"
    yield Figure("valve.discharge_coefficient", coefficient, 0, 0.2, _ANY, _ANY, sharp)
    if valve.pipe_area_m2 is not None:
        share = valve.pipe_area_m2 / tank.reservoir_area_m2
        pipe = f"is {valve.pipe_area_m2:g} m2 for a reservoir_area_m2 of {tank.reservoir_area_m2:g}"
        yield Figure("valve.pipe_area_m2", share, 1e-6, 1e-4, 0.5, 5, pipe)
