"""Figures of pump and motor that a slip of unit or digit drives out of range."""

import math
from collections.abc import Iterator

from utank_hil.configuration.plausibility.figure import Figure
from utank_hil.dynamics.pump import Pump, pump_load, pump_speed
from utank_hil.dynamics.ship import RollShip
from utank_hil.dynamics.tank import GRAVITY_M_S2, Tank


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
            f"still water: raise it, or lower max_pressure_pa; {note}"
        )
        high = (
            f"is {given / scale:.4g} {unit}, {given / needed:.3g} times what the greatest pressure "
            f"takes in still water; {note}"
        )
        yield Figure(f"pump.{name}", given / needed, 0.03, 1, low, 50, 1e4, high)


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
    spin_s = pump.inertia_kg_m2 * pump.max_speed_rad_s / pump.max_torque_nm
    yield Figure(
        "pump.inertia_kg_m2",
        spin_s / roll_s,
        warned_above=0.25,
        refused_above=2,
        high=f"takes {spin_s:.3g} s to the greatest speed at the greatest torque, and the ship "
        f"rolls in {roll_s:.3g} s: it is in kg m2, of rotor, motor and water",
    )
    yield Figure(
        "pump.lag_s",
        pump.lag_s / roll_s,
        warned_above=0.1,
        refused_above=1,
        high=f"is {pump.lag_s:g} s, and the ship rolls in {roll_s:.3g} s: it is in seconds",
    )
