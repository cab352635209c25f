"""Figures of ship and tank that a slip of unit or digit drives out of range."""

import math
from collections.abc import Iterator

from utank_hil.configuration.plausibility.figure import Figure
from utank_hil.dynamics.linear import coupled_matrices
from utank_hil.dynamics.ship import RollShip
from utank_hil.dynamics.tank import GRAVITY_M_S2, Tank

_ROLL_RAD = math.radians(10)
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
    tall = f"is {tank.height_m:g} m in a tank {tank.width_m:g} m wide: both are in metres"
    height = tank.height_m / tank.width_m
    yield Figure("tank.height_m", height, warned_above=1, refused_above=5, high=tall)


def of_ship(ship: RollShip, tank: Tank) -> Iterator[Figure]:
    """Return roll period, damping and radius of gyration for a ship as wide as the tank."""
    frequency = ship.natural_frequency_rad_s
    period_s = 2 * math.pi / frequency
    beam = f"for a ship that holds a tank {tank.width_m:g} m wide"
    yield Figure(
        "ship.inertia_kg_m2",
        period_s / math.sqrt(tank.width_m),  # Ships' periods rise with the root of their size.
        0.35,
        0.9,
        f"gives a roll period of {period_s:.2g} s, short {beam}: inertia_kg_m2 is in kg m2 (in t "
        f"m2 it would be {period_s * _PER_1000:.3g} s), stiffness_nm_rad in N m",
    )
    yield Figure(
        "ship.stiffness_nm_rad",
        period_s / math.sqrt(tank.width_m),
        warned_above=12,
        refused_above=25,
        high=f"gives a roll period of {period_s:.3g} s, long {beam}: stiffness_nm_rad is in N m "
        f"(in kN m it would be {period_s / _PER_1000:.3g} s), inertia_kg_m2 in kg m2",
    )
    damping = ship.damping_nms_rad / (2 * ship.inertia_kg_m2 * frequency)
    yield Figure(
        "ship.damping_nms_rad",
        damping,
        warned_above=0.3,
        refused_above=1,
        high=f"is a damping ratio of {damping:.3g}; hulls have 0.005 to 0.15: it is in N m s",
    )
    slowed = 8 / (3 * math.pi) * ship.quadratic_damping_nms2_rad2 * _ROLL_RAD
    slowed /= 2 * ship.inertia_kg_m2
    yield Figure(
        "ship.quadratic_damping_nms2_rad2",
        slowed,
        warned_above=0.3,
        refused_above=3,
        high=f"is a damping ratio of {slowed:.3g} at 10 degrees of roll; hulls have up to 0.1 or "
        "so: it is in N m s2 per rad2",
    )


def of_weight(ship: RollShip, tank: Tank) -> Iterator[Figure]:
    """Return the radius of gyration, if the weight is known."""
    if ship.displacement_n <= 0:
        return
    gyration_m = math.sqrt(ship.inertia_kg_m2 * GRAVITY_M_S2 / ship.displacement_n)
    weight = (
        f"gives a radius of gyration of {gyration_m:.3g} m for a ship that holds a tank "
        f"{tank.width_m:g} m wide; it is about 0.4 of the "
        "beam: displacement_n is a weight in newtons, not a mass"
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
    side = "below" if tank.lz_m > 0 else "above"
    yield Figure(
        "tank.lz_m",
        abs(tank.lz_m) / tank.width_m,
        warned_above=0.7,
        refused_above=1,
        high=f"puts the duct {abs(tank.lz_m):g} m {side} the ship's centre of gravity, and the "
        f"tank is {tank.width_m:g} m wide: it is in metres, positive downwards",
    )
    along = (
        f"puts the tank {abs(tank.lx_m):g} m from the ship's centre of gravity, and it is "
        f"{tank.width_m:g} m wide: it is in metres, positive forward"
    )
    far = abs(tank.lx_m) / tank.width_m
    yield Figure("tank.lx_m", far, warned_above=4, refused_above=10, high=along)
    yield from _water(ship, tank)


def _water(ship: RollShip, tank: Tank) -> Iterator[Figure]:
    """Return figures of the water's period, the duct and the free surface."""
    yield Figure(
        "tank.duct_area_m2",
        tank.duct_area_m2 / tank.reservoir_area_m2,
        warned_above=2,
        refused_above=20,
        high=f"is {tank.duct_area_m2:g} m2, {tank.duct_area_m2 / tank.reservoir_area_m2:.3g} times "
        "a reservoir's area: both are in m2, of one duct and of one reservoir",
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
        f"{remedy}; it is in m2"
    )
    ratio = water_s / roll_s
    yield Figure("tank.duct_area_m2", ratio, 0.05, 0.4, out_of_tune, 2.5, 8, out_of_tune)
    taken = free_surface_nm_rad(ship, tank) / ship.stiffness_nm_rad
    yield Figure(
        "tank.reservoir_area_m2",
        taken,
        warned_above=0.3,
        high=f"takes {taken:.0%} of the ship's stability by its free surface, most tanks 2 to 20 "
        "%: lower it, or the distance of the reservoirs, width_m",
    )
