"""Figures of pump and motor that a slip of unit or digit drives out of range."""

import math
from collections.abc import Iterator

from utank_hil.configuration.plausibility.figure import Figure
from utank_hil.dynamics import GRAVITY_M_S2, RollShip, Tank
from utank_hil.dynamics.pump import Pump, pump_load, pump_speed
from utank_hil.dynamics.valves import Valve


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
