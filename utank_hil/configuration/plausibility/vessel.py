"""Figures of ship, tank, pump and valve that a slip of unit or digit drives out of range."""

import math
from collections.abc import Iterator
from dataclasses import dataclass

from utank_hil.dynamics import GRAVITY_M_S2, RollModel, RollShip, Tank, coupled_matrices
from utank_hil.dynamics.nonlinear import righting_range
from utank_hil.dynamics.pump import Pump, pump_load, pump_speed
from utank_hil.dynamics.valves import Valve


@dataclass(frozen=True, slots=True)
class Figure:
    """A figure of a vessel; `low` and `high` say problem and remedy of a value out of range."""

    key: str  #: Key that is most likely wrong if the figure lies outside.
    value: float
    refused_below: float = 0.0
    warned_below: float = 0.0
    low: str = ""
    warned_above: float = math.inf
    refused_above: float = math.inf
    high: str = ""

    @property
    def words(self) -> str:
        """Problem and remedy in words."""
        words = self.low if self.value < self.warned_below else self.high
        return words or "gives a figure that overflows"  # The value is not a number.

    @property
    def refused(self) -> bool:
        """Whether the value is impossible."""
        return not self.refused_below <= self.value <= self.refused_above

    @property
    def warned(self) -> bool:
        """Whether the value is possible, but unusual."""
        return not self.refused and not self.warned_below <= self.value <= self.warned_above


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
    wide = f"is {tank.width_m:g} m, wider than any ship: it is in metres, not millimetres"
    yield Figure("tank.width_m", tank.width_m, warned_above=80, refused_above=100, high=wide)
    heavy = "is no liquid's density: water has 1000 to 1030"
    yield Figure("tank.density_kg_m3", tank.density_kg_m3, 500, 900, heavy, 1400, 3000, heavy)


def of_heights(tank: Tank) -> Iterator[Figure]:
    """Return figures of the reservoirs' height and headroom."""
    tall = f"is {tank.height_m:g} m in a tank of width_m {tank.width_m:g}: both are in metres"
    yield Figure("tank.height_m", tank.height_m / tank.width_m, 0.003, 0.03, tall, 1, 5, tall)
    if tank.headroom_m < math.inf:
        roof = (
            f"puts the roof {tank.headroom_m:g} m above still water of {tank.height_m:g} m, in a "
            f"tank {tank.width_m:g} m wide: all are in metres"
        )
        low = tank.headroom_m / tank.height_m
        yield Figure("tank.headroom_m", low, 0.005, 0.05, roof)
        high = (tank.height_m + tank.headroom_m) / tank.width_m
        yield Figure("tank.headroom_m", high, warned_above=1, high=roof)


def of_ship(ship: RollShip, tank: Tank) -> Iterator[Figure]:
    """Return roll period, damping and radius of gyration for a ship as wide as the tank."""
    frequency = ship.natural_frequency_rad_s
    period_s = 2 * math.pi / frequency
    beam = f"for a ship that holds a tank {tank.width_m:g} m wide"
    yield Figure(
        "ship.inertia_kg_m2",
        period_s / math.sqrt(tank.width_m),  # T = 0.8 B / sqrt(GM): GM is 0.25 of the width.
        0.35,
        1.6,
        f"gives a roll period of {period_s:.2g} s, short {beam}: inertia_kg_m2 is in kg m2 (in t "
        f"m2 it would be {period_s * _PER_1000:.3g} s), stiffness_nm_rad in N m",
    )
    yield Figure(
        "ship.stiffness_nm_rad",
        period_s / math.sqrt(tank.width_m),  # GM is 1.5 % of the width.
        warned_above=6.5,
        refused_above=25,
        high=f"gives a roll period of {period_s:.3g} s, long {beam}: stiffness_nm_rad is in N m "
        f"(in kN m it would be {period_s / _PER_1000:.3g} s), inertia_kg_m2 in kg m2",
    )
    critical = 2 * ship.inertia_kg_m2 * frequency
    swing = 8 / (3 * math.pi) * frequency * _ROLL_RAD  # of the linear damping of the same energy
    for name, ratio, unit in (
        ("damping_nms_rad", ship.damping_nms_rad / critical, "N m s"),
        ("quadratic_damping_nms2_rad2", swing * ship.quadratic_damping_nms2_rad2 / critical,
         "N m s2 per rad2"),
        ("lift_damping_ns2_rad", _SPEED_M_S * ship.lift_damping_ns2_rad / critical,
         "N m s per m/s"),
    ):  # fmt: skip
        words = (
            f"is a damping ratio of {ratio:.3g} at {math.degrees(_ROLL_RAD):.0f} degrees of roll "
            f"and {_SPEED_M_S:g} m/s; hulls have 0.005 to 0.15: it is in {unit}"
        )
        # Patti-B, the least damped of the shipped ships, has 0.002; zero is a choice.
        least = 1e-4 if ratio > 0 else 0.0
        yield Figure(f"ship.{name}", ratio, 0, least, words, 0.2, 1, words)
    yield from _righting(ship, tank)


def _righting(ship: RollShip, tank: Tank) -> Iterator[Figure]:
    """Return figures of the righting moment beyond its slope upright, and of steady moments."""
    stiffness = ship.stiffness_nm_rad
    if ship.restoring_odd_nm:
        cubic = abs(ship.restoring_odd_nm[0]) / stiffness
        words = (
            f"begins with {cubic:.2g} times stiffness_nm_rad; hulls have 0.1 to 10 times: it is in "
            "N m per rad3, rad5, ..."
        )
        yield Figure("ship.restoring_odd_nm", cubic, 0, 0.01, words, 15, math.inf, words)
    if ship.gz_m:
        gm_m = stiffness / ship.displacement_n
        slope_m = ship.gz_m[1] / ship.gz_step_rad
        levers = (
            f"begin with a slope of {slope_m:.3g} m, and GM is {gm_m:.3g} m: levers are in metres, "
            "gz_step_rad in radians, 10 degrees are 0.1745"
        )
        yield Figure("ship.gz_m", slope_m / gm_m, 0.1, 0.5, levers, 2, 10, levers)
    if ship.gz_m or ship.restoring_odd_nm:
        gone_rad = righting_range(RollModel(ship, tank)).vanishing_rad
        key = "gz_m" if ship.gz_m else "restoring_odd_nm"
        short = (
            f"leaves a ship that capsizes from {math.degrees(gone_rad):.0f} degrees on, with the "
            "tank's water: it is in N m per rad3, levers in metres"
        )
        yield Figure(f"ship.{key}", gone_rad, warned_below=_RIGHTING_RAD, low=short)
    for name in ("offset_moment_nm", "wind_moment_nm"):
        moment = abs(getattr(ship, name))
        heel_deg = math.degrees(moment / stiffness)
        steady = f"heels the ship {heel_deg:.2g} degrees: it is in N m"
        least = 0.01 if moment > 0 else 0.0
        yield Figure(f"ship.{name}", heel_deg, 0, least, steady, 15, math.inf, steady)


def of_weight(ship: RollShip, tank: Tank) -> Iterator[Figure]:
    """Return the radius of gyration, if the weight is known."""
    if ship.displacement_n <= 0:
        return
    gyration_m = math.sqrt(ship.inertia_kg_m2 * GRAVITY_M_S2 / ship.displacement_n)
    weight = (
        f"gives a radius of gyration of {gyration_m:.3g} m for a ship that holds a tank of "
        f"width_m {tank.width_m:g}; it is about 0.4 of the beam: displacement_n is a weight in "
        "newtons, not a mass"
    )
    share = gyration_m / tank.width_m
    yield Figure("ship.displacement_n", share, 0.05, 0.2, weight, 1.2, 5, weight)
    volume_m3 = ship.displacement_n / (GRAVITY_M_S2 * tank.density_kg_m3)
    yield Figure(
        "ship.displacement",
        volume_m3 / tank.width_m**3,  # about 1.5 beams cubed; a small tank has a third of the beam
        warned_above=50,
        refused_above=200,
        high=f"is {volume_m3:.3g} m3 of water for a ship that holds a tank {tank.width_m:g} m "
        "wide: displacement_n is a weight in newtons",
    )


def of_tank(ship: RollShip, tank: Tank) -> Iterator[Figure]:
    """Return figures of losses, place and water of the tank."""
    damping = tank.damping_ratio
    yield Figure(
        "tank.damping_ratio",
        damping,
        warned_above=0.6,
        refused_above=1,
        high=f"of {damping:g} lets the water creep instead of swing; tanks have 0.05 to 0.4: it is "
        "a share of critical damping, 10 % is 0.10",
    )
    if tank.quadratic_loss == 0:
        still = "of 0 lets the water swing for ever: give damping_ratio or quadratic_loss"
        yield Figure("tank.damping_ratio", damping, warned_below=1e-3, low=still)
    for name, most, end, toward in (("lz_m", 0.7, 1, "downwards"), ("lx_m", 4, 10, "forward")):
        distance_m = getattr(tank, name)
        share = abs(distance_m) / tank.width_m
        far = (
            f"puts the duct {distance_m:g} m from the ship's centre of gravity, positive "
            f"{toward}, and the tank is {tank.width_m:g} m wide: it is in metres"
        )
        least = _NOTHING if distance_m else 0.0
        yield Figure(f"tank.{name}", share, 0, least, far, most, end, far)
    yield from _water(ship, tank)


def _water(ship: RollShip, tank: Tank) -> Iterator[Figure]:
    """Return figures of the water's period, the duct and the free surface."""
    yield Figure(
        "tank.duct_area_m2",
        tank.duct_area_m2 / tank.reservoir_area_m2,
        warned_above=2,
        refused_above=20,
        high=f"is {tank.duct_area_m2:g} m2, {tank.duct_area_m2 / tank.reservoir_area_m2:.3g} times "
        "reservoir_area_m2: both are in m2, of one duct and of one reservoir",
    )
    roll_s = 2 * math.pi / ship.natural_frequency_rad_s
    water_s = 2 * math.pi / tank.natural_frequency_rad_s
    matched_m = 2 * GRAVITY_M_S2 / ship.natural_frequency_rad_s**2 - 2 * tank.height_m
    remedy = "check height_m and width_m too"
    if matched_m > 0:
        area_m2 = tank.width_m * tank.reservoir_area_m2 / matched_m
        remedy = f"about {area_m2:.3g} m2 would suit"
    out_of_tune = (
        f"gives the water a period of {water_s:.3g} s, and the ship rolls in {roll_s:.3g} s: "
        f"{remedy}; it is in m2, and reservoir_area_m2, {tank.reservoir_area_m2:g}, too"
    )
    ratio = water_s / roll_s
    yield Figure("tank.duct_area_m2", ratio, 0.05, 0.4, out_of_tune, 2.5, 8, out_of_tune)
    taken = free_surface_nm_rad(ship, tank) / ship.stiffness_nm_rad
    yield Figure(
        "tank.reservoir_area_m2",
        taken,
        0,
        0.02,
        f"takes {taken:.2%} of the ship's stability, and a tank that takes below 2 % does little: "
        "it is in m2, of one reservoir, displacement_t in tonnes, stiffness_nm_rad in N m",
        warned_above=0.3,
        high=f"takes {taken:.0%} of the ship's stability by its free surface, most tanks 2 to 20 "
        "%: lower it, or the distance of the reservoirs, width_m",
    )


def holding(pump: Pump) -> tuple[float, float, float]:
    """Return speed (rad/s), torque (N m) and power (W) that hold the pressure in still water."""
    coefficients = pump.coefficients
    speed = pump_speed(pump.max_pressure_pa, 0.0, coefficients)
    torque, _ = pump_load(speed, 0.0, coefficients)
    return speed, torque, speed * torque


def of_pump(tank: Tank, pump: Pump) -> Iterator[Figure]:
    """Return figures of pressure and size, relative to the tank."""
    pressure_pa = pump.max_pressure_pa
    head_m = pressure_pa / (tank.density_kg_m3 * GRAVITY_M_S2)
    head = (
        f"is {head_m:.2g} m of water, and a reservoir is full or empty at "
        f"{tank.level_limit_m:.3g} m: it is in Pa, 25 kPa is 25e3"
    )
    share = head_m / tank.level_limit_m
    yield Figure("pump.max_pressure_pa", share, 0.01, 0.05, head, 10, 100, head)
    areas = pump.duct_area_m2 / tank.duct_area_m2
    duct = (
        f"is {pump.duct_area_m2:g} m2, and the tank's duct has {tank.duct_area_m2:g} m2: the "
        "propeller fills the duct that it stands in, so make both the same or nearly so"
    )
    yield Figure("pump.duct_area_m2", areas, 0.1, 0.3, duct, 2, 5, duct)
    radius = pump.radius_m / math.sqrt(pump.duct_area_m2 / math.pi)
    blade = (
        f"is {pump.radius_m:g} m in a duct of {pump.duct_area_m2:g} m2, whose own radius is "
        f"{math.sqrt(pump.duct_area_m2 / math.pi):.3g} m; it is about 0.7 of that"
    )
    yield Figure("pump.radius_m", radius, 0.1, 0.35, blade, 1, 3, blade)
    lift = f"of {pump.lift:g} is no blade row's: a coefficient, about 1.4"
    yield Figure("pump.lift", pump.lift, 0.01, 0.3, lift, 5, 100, lift)
    drag = f"of {pump.friction:g} is no blade row's: a coefficient, about 0.005"
    yield Figure("pump.friction", pump.friction, 0, 5e-4, drag, 0.03, 1, drag)
    similar = Pump.for_duct(pump.duct_area_m2, pressure_pa).inertia_kg_m2
    rotor = (
        f"is {pump.inertia_kg_m2:.3g} kg m2; a rotor of this size with its water and motor has "
        f"about {similar:.3g}"
    )
    yield Figure("pump.inertia_kg_m2", pump.inertia_kg_m2 / similar, 0, 0.1, rotor, 8, 1e4, rotor)


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
        given = getattr(pump, name)
        low = (
            f"is {given / scale:.4g} {unit}, and to hold max_pressure_pa, "
            f"{pump.max_pressure_pa / 1e3:.3g} kPa, takes {needed / scale:.3g} {unit} even in "
            f"still water with a duct_area_m2 of {pump.duct_area_m2:g}: raise it, or lower "
            f"max_pressure_pa; {note}"
        )
        high = (
            f"is {given / scale:.4g} {unit}, {given / needed:.3g} times what the greatest pressure "
            f"takes in still water; {note}"
        )
        yield Figure(f"pump.{name}", given / needed, 0.03, 1, low, 10, 1e4, high)


def of_quickness(ship: RollShip, pump: Pump) -> Iterator[Figure]:
    """Return figures of the pump's speed of response, relative to the ship."""
    roll_s = 2 * math.pi / ship.natural_frequency_rad_s
    rise_s = pump.max_pressure_pa / pump.max_pressure_rate_pa_s
    yield Figure(
        "pump.max_pressure_rate_pa_s",
        rise_s / roll_s,
        warned_above=0.25,
        refused_above=2,
        high=f"takes {rise_s:.3g} s to the greatest pressure, and the ship rolls in {roll_s:.3g} "
        "s: it is in Pa/s, 500 kPa/s is 500e3",
    )
    yield Figure(
        "pump.max_pressure_rate_pa_s",
        rise_s / pump.lag_s,
        warned_below=0.3,
        low=f"takes {rise_s:.2g} s to the greatest pressure, and the pump's lag_s is "
        f"{pump.lag_s:g} s: it is in Pa/s",
    )
    spin_s = pump.inertia_kg_m2 * pump.max_speed_rad_s / pump.max_torque_nm
    yield Figure(
        "pump.inertia_kg_m2",
        spin_s / roll_s,
        warned_above=0.25,
        refused_above=2,
        high=f"takes {spin_s:.3g} s to max_speed_rad_s at max_torque_nm, and the ship rolls in "
        f"{roll_s:.3g} s: it is in kg m2, of rotor, motor and water",
    )
    late = f"is {pump.lag_s:g} s, and the ship rolls in {roll_s:.3g} s: it is in seconds"
    yield Figure("pump.lag_s", pump.lag_s / roll_s, 0, 0, "", 0.1, 1, late)
    # electric drives of pumps take 0.05 to 0.5 s
    yield Figure("pump.lag_s", pump.lag_s, warned_above=0.8, high=late)


def of_valve(ship: RollShip, tank: Tank, valve: Valve) -> Iterator[Figure]:
    """Return figures of a valve, relative to ship and tank."""
    roll_s = 2 * math.pi / ship.natural_frequency_rad_s
    slow = f"is {valve.opening_time_s:g} s, and the ship rolls in {roll_s:.3g} s"
    yield Figure(
        "valve.opening_time_s", valve.opening_time_s / roll_s, warned_above=0.25, high=slow
    )
    tight = f"of {valve.leakage:g} is no gate's: it is a share of the open area"
    yield Figure("valve.leakage", valve.leakage, warned_below=1e-3, low=tight)
    sharp = f"of {valve.discharge_coefficient:g} is no orifice's: about 0.6"
    key = "valve.discharge_coefficient"
    yield Figure(key, valve.discharge_coefficient, warned_below=0.2, low=sharp)
    if valve.pipe_area_m2 is not None:
        share = valve.pipe_area_m2 / tank.reservoir_area_m2
        pipe = f"is {valve.pipe_area_m2:g} m2 for a reservoir_area_m2 of {tank.reservoir_area_m2:g}"
        yield Figure("valve.pipe_area_m2", share, 1e-6, 1e-4, pipe, 0.5, 5, pipe)
