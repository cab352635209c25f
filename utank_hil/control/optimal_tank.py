"""The best passive tank, thesis 3.2: frequency and damping ratio by min-max of the roll response.

With the tank angle tau = h / (L/2), frequency ratios to the ship's roll frequency w_s (water f,
wave q), mass ratio mu = m_hh / m_phiphi and coupling ratio G1 = 2 (H + Lz) / (2H + L At/Ap)::

    D = (f^2 - q^2 + 2 i q f xi_h)(1 - q^2 + 2 i q xi_phi) - mu (c - q^2 G1)^2
    phi / phi_st = (f^2 - q^2 + 2 i q f xi_h) / D,        phi_st = K_wave / k_phiphi

The static coupling c is f^2 for a tank built with the frequency ratio f. A pump that changes the
water's stiffness does not change c.
"""

import math
from dataclasses import dataclass, replace
from typing import Annotated

import numpy as np

from utank_hil.base.arrays import ComplexArray, FloatArray
from utank_hil.base.parameters import Checked, Finite, NotNegative, Range
from utank_hil.dynamics import GRAVITY_M_S2, RollShip, Tank, coupled_matrices

_WAVES = np.geomspace(0.05, 5.0, 4000)
"""Wave frequencies over the roll frequency. Chosen; no study."""


@dataclass(frozen=True, slots=True)
class ShipTankRatios(Checked, owner="ship and tank"):
    """Ratios that determine the roll response, besides frequency and damping of the water."""

    mass_ratio: Annotated[float, Range(above=0, below=1)]  #: mu, between 0 and 1.
    coupling_ratio: Finite  #: G1.
    roll_damping_ratio: NotNegative = 0.0  #: xi_phi of the ship without its tank.
    static_coupling: Finite | None = None  #: c of an existing tank; f^2 by default.


@dataclass(frozen=True, slots=True)
class PassiveOptimum:
    """Best tank for a ship."""

    frequency_ratio: float  #: Natural frequency of the water over the ship's roll frequency.
    damping_ratio: float  #: Damping ratio of the water.
    peak: float  #: Greatest roll over static roll, over all wave frequencies.


def ship_ratios(ship: RollShip, tank: Tank) -> tuple[ShipTankRatios, float]:
    """Ratios of a ship with its tank, and its roll frequency w_s (rad/s) with the water at rest."""
    mass, damping, stiffness = coupled_matrices(ship, tank)
    frequency = math.sqrt(stiffness[0, 0] / mass[0, 0])
    ratios = ShipTankRatios(
        # coupled_matrices uses the level; the tank angle is used here
        mass_ratio=float(mass[1, 1] * (tank.width_m / 2) ** 2 / mass[0, 0]),
        coupling_ratio=2 * (tank.height_m + tank.lz_m) / tank.effective_length_m,
        roll_damping_ratio=float(damping[0, 0] / (2 * mass[0, 0] * frequency)),
        static_coupling=(tank.natural_frequency_rad_s / frequency) ** 2,
    )
    return ratios, frequency


def roll_magnification(
    wave_ratio: FloatArray, frequency_ratio: float, damping_ratio: float, ratios: ShipTankRatios
) -> ComplexArray:
    """Roll over static roll phi / phi_st at wave frequency ratios q, shape (N,)."""
    q, f = np.asarray(wave_ratio), frequency_ratio
    static = f**2 if ratios.static_coupling is None else ratios.static_coupling
    coupling = static - q**2 * ratios.coupling_ratio
    tank: ComplexArray = f**2 - q**2 + 2j * q * f * damping_ratio
    ship = 1 - q**2 + 2j * q * ratios.roll_damping_ratio
    ratio: ComplexArray = tank / (tank * ship - ratios.mass_ratio * coupling**2)
    return ratio


def passive_optimum(ratios: ShipTankRatios) -> PassiveOptimum:
    """Frequency and damping ratio of the water that minimize the greatest roll.

    A search on a grid of waves starts Newton's method at its two peaks, which the best tank makes
    equal and of opposite slopes over frequency and damping. So rounding does not move the result.
    A response with one peak alone leaves the search's result, which is good to 1e-8 of the peak.
    """
    from scipy.optimize import minimize, root

    def peak(logs: FloatArray) -> float:
        f, xi = np.exp(logs)
        return float(np.abs(roll_magnification(_WAVES, f, xi, ratios)).max())

    def optimality(x: FloatArray) -> FloatArray:
        f, xi = np.exp(x[2:])
        (one, by_f, by_xi), (other, f_too, xi_too) = _slopes(x[:2], f, xi, ratios).T
        first, second = np.log(np.abs(roll_magnification(x[:2], f, xi, ratios)))
        return np.array([one, other, first - second, by_f * xi_too - by_xi * f_too])

    found = minimize(
        peak,
        np.log([1.0, math.sqrt(ratios.mass_ratio / 2)]),
        method="Nelder-Mead",
        options={"xatol": 1e-8, "fatol": 1e-10, "maxfev": 2000},
    )
    (f, xi), most = np.exp(found.x), float(found.fun)
    roll = np.abs(roll_magnification(_WAVES, f, xi, ratios))
    tops = np.flatnonzero((roll[1:-1] >= roll[:-2]) & (roll[1:-1] > roll[2:])) + 1
    tops = np.sort(tops[np.argsort(-roll[tops])[:2]])
    if len(tops) == 2:
        exact = root(optimality, [*_WAVES[tops], *found.x], tol=1e-13)
        # beside the search's result, whose grid misses a peak by up to its spacing squared
        if np.abs(exact.fun).max() < 1e-10 and np.abs(exact.x[2:] - found.x).max() < 0.05:
            f, xi = np.exp(exact.x[2:])
            most = float(np.abs(roll_magnification(exact.x[:1], f, xi, ratios))[0])
    return PassiveOptimum(float(f), float(xi), most)


def _slopes(q: FloatArray, f: float, xi: float, ratios: ShipTankRatios) -> FloatArray:
    """Slopes of log |phi / phi_st| over q, log f and log xi; shape (3, N)."""
    xi_phi, given = ratios.roll_damping_ratio, ratios.static_coupling
    coupling = (f**2 if given is None else given) - q**2 * ratios.coupling_ratio
    by_f = 2 * f**2 if given is None else 0.0
    coupling_slopes = np.array([-2 * q * ratios.coupling_ratio, 0 * q + by_f, 0 * q])
    tank, ship = f**2 - q**2 + 2j * q * f * xi, 1 - q**2 + 2j * q * xi_phi
    swing = 2j * q * f * xi
    tank_slopes = np.array([-2 * q + 2j * f * xi, 2 * f**2 + swing, swing])
    ship_slopes = np.array([-2 * q + 2j * xi_phi, 0 * q, 0 * q])
    determinant = tank * ship - ratios.mass_ratio * coupling**2
    slopes = tank_slopes * ship + tank * ship_slopes
    slopes -= 2 * ratios.mass_ratio * coupling * coupling_slopes
    return np.asarray((tank_slopes / tank - slopes / determinant).real)


@dataclass(frozen=True, slots=True)
class TankFigures:
    """Dimensionless numbers of a tank."""

    mass_ratio: float  #: As in `ShipTankRatios`, and the next.
    coupling_ratio: float
    frequency_ratio: float  #: Natural frequency of the water over the ship's roll frequency.
    damping_ratio: float  #: Damping ratio of the water.
    peak: float  #: Greatest roll over static roll, over all wave frequencies.
    duct_area_m2: float


def tank_figures(ship: RollShip, tank: Tank) -> TankFigures:
    """Dimensionless numbers of a ship's existing tank."""
    ratios, roll_rad_s = ship_ratios(ship, tank)
    frequency_ratio = tank.natural_frequency_rad_s / roll_rad_s
    roll = roll_magnification(_WAVES, frequency_ratio, tank.damping_ratio, ratios)
    return TankFigures(
        mass_ratio=ratios.mass_ratio,
        coupling_ratio=ratios.coupling_ratio,
        frequency_ratio=frequency_ratio,
        damping_ratio=tank.damping_ratio,
        peak=float(np.abs(roll).max()),
        duct_area_m2=tank.duct_area_m2,
    )


def best_passive_tank(ship: RollShip, tank: Tank) -> Tank:
    """Return the tank with the duct area and damping ratio of the passive optimum, thesis (3.2).

    Reservoirs, width, height and place are kept. The duct's area changes mass and coupling ratio
    too, so area and optimum are iterated to agreement. Raises `ValueError` if the reservoirs alone
    already make the water slower than the optimum.
    """
    for _ in range(50):
        ratios, roll_rad_s = ship_ratios(ship, tank)
        best = passive_optimum(replace(ratios, static_coupling=None))  # built, not pumped
        duct_part_m = 2 * GRAVITY_M_S2 / (best.frequency_ratio * roll_rad_s) ** 2
        duct_part_m -= 2 * tank.height_m
        if duct_part_m <= 0:
            raise ValueError(
                f"a tank of height_m {tank.height_m} can't be as fast as the best, "
                f"{best.frequency_ratio * roll_rad_s:.3g} rad/s: lower it"
            )
        area_m2 = tank.width_m * tank.reservoir_area_m2 / duct_part_m
        change = abs(area_m2 / tank.duct_area_m2 - 1)
        tank = replace(tank, duct_area_m2=area_m2, damping_ratio=best.damping_ratio,
                       quadratic_loss=0.0)  # fmt: skip
        if change < 1e-6:
            break
    return tank
