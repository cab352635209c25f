"""Figures of ship and tank that a slip of unit or digit drives out of range."""

import math
from collections.abc import Iterator

from utank_hil.configuration.plausibility.figure import Figure
from utank_hil.dynamics import GRAVITY_M_S2, RollModel, RollShip, Tank, coupled_matrices
from utank_hil.dynamics.steady_heel import righting_range

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
