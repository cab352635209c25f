"""Figure 2.7: moment of the stimulator per pump power, against the mass ratio.

The ship is held still and the pump swings the water at its roll frequency w. With tank angle tau::

    moment  K = (k_hh + m_hphi w^2) tau,     m_hphi = -rho L^2 At (H + Lz) / 2
    pump    M = abs(k_hh - m_hh w^2 + i b_hh w) tau,     power = M w tau / 2

The power is the apparent one, of the amplitudes: a propeller gives back nothing of what it puts
into the water. For a given moment K the moment per power is 2 (K/tau)^2 / (w K (M/tau)).
"""

import math
from collections.abc import Callable
from dataclasses import replace
from typing import Final

import numpy as np

from tools.thesis.figure import Check, Curve, Figure, Panel, Row, Verdict
from tools.thesis.ships import ROLL_RAD_S, first_ship, tuned_tank
from utank_hil.base.arrays import FloatArray
from utank_hil.dynamics.linear import coupled_matrices
from utank_hil.dynamics.ship import RollShip
from utank_hil.dynamics.tank import Tank

FRICTION: Final = 0.1
PRINTED_RANGE: Final = (0.02, 0.04)
_MOMENT_NM: Final = 0.02 * 4.81875e8  # As the static heel by 0.02 rad takes.
_SHARES: Final = np.geomspace(0.2, 3.0, 400)
_SMALL_M2: Final = 10.2  # Reservoirs whose best duct lies in the middle of the printed range.


def figure_2_7() -> Figure:
    """Three ways to change the mass ratio, and what each makes of moment per power."""
    ship, tank = first_ship(4.87e7, FRICTION)
    ways: dict[str, Callable[[float], Tank]] = {
        "duct varied, reservoirs 17.1 m²": lambda share: _duct(tank, share),
        f"duct varied, reservoirs {_SMALL_M2:g} m²": lambda share: _duct(
            replace(tank, reservoir_area_m2=_SMALL_M2), share
        ),
        "reservoirs varied, duct tuned": lambda share: _reservoirs(ship, tank, share),
        "the same, friction as (2.12)": lambda share: _printed_friction(ship, tank, share),
    }
    found = {name: _along(ship, way) for name, way in ways.items()}
    best = {name: float(mu[np.argmax(gain)]) for name, (mu, gain, _) in found.items()}
    inner = {
        name: bool(0 < np.argmax(gain) < len(gain) - 1) for name, (_, gain, _) in found.items()
    }
    falls = all(
        bool((np.diff(level[np.argsort(mu)]) < 0).all())
        for name, (mu, _, level) in found.items()
        if name.startswith(("reservoirs", "the same"))
    )
    spread = float(np.ptp(found["the same, friction as (2.12)"][1]))
    names = list(ways)
    return Figure(
        "linear model, ship held still, pump at its roll frequency; apparent power, for a moment "
        "of 0.02 rad times the ship's stiffness",
        "The source gives neither ship, power (mean or of the amplitudes), moment nor how the mass "
        "ratio is changed. Varied: by the duct with the printed and with smaller reservoirs, by "
        "the reservoirs with a tuned duct, and so with the print's friction, b_hh as At squared.",
        (
            Panel(
                "Moment per power",
                "Mass ratio",
                "Nm per W",
                tuple(Curve(name, mu, gain) for name, (mu, gain, _) in found.items()),
                span=PRINTED_RANGE,
                span_label="printed: 0.02 to 0.04",
            ),
            Panel(
                "Level needed for the moment",
                "Mass ratio",
                "Level (m)",
                tuple(Curve(name, mu, level) for name, (mu, _, level) in found.items()),
                span=PRINTED_RANGE,
                span_label="printed: 0.02 to 0.04",
            ),
        ),
        rows=(
            Row(
                "best mass ratio, printed reservoirs",
                "",
                PRINTED_RANGE,
                best[names[0]],
                "the best duct is the tuned one, where mu = k_hh / k_phiphi: the reservoirs, not "
                "the power, fix the mass ratio",
            ),
            Row(
                f"best mass ratio, reservoirs of {_SMALL_M2:g} m²",
                "",
                PRINTED_RANGE,
                best[names[1]],
                "reservoirs chosen for it",
            ),
        ),
        checks=(
            Check(
                "the mass ratio should be 0.02 to 0.04 for much moment per power",
                Verdict.PARTLY,
                f"there is a best mass ratio where the duct is varied: {best[names[0]]:.3f} with "
                f"the printed reservoirs, {best[names[1]]:.3f} with {_SMALL_M2:g} m²; with a tuned "
                "duct more reservoir is better without end"
                + (" (no inner best)" if not inner[names[2]] else "")
                + f", and with the print's friction it makes {spread:.0%} of difference",
            ),
            Check(
                "the lower the mass ratio, the higher the water level required",
                Verdict.of(falls),
                "for a given moment, tuned duct: the level falls all along the mass ratio",
            ),
            Check(
                "the stimulator should have the ship's roll frequency, or more pump power is "
                "required (2.6)",
                Verdict.of(inner[names[0]] and inner[names[1]]),
                f"off tune by 10 % the pump needs {_off_tune(ship, tank):.1f} times the power",
            ),
        ),
    )


def _duct(tank: Tank, share: float) -> Tank:
    return replace(tank, duct_area_m2=tank.duct_area_m2 * share)


def _reservoirs(ship: RollShip, tank: Tank, share: float) -> Tank:
    return tuned_tank(ship, replace(tank, reservoir_area_m2=tank.reservoir_area_m2 * share))


def _printed_friction(ship: RollShip, tank: Tank, share: float) -> Tank:
    """Friction b At² of (3.1): its ratio to the inertia grows with the area."""
    return replace(_reservoirs(ship, tank, share), damping_ratio=FRICTION * share)


def _per_angle(ship: RollShip, tank: Tank) -> tuple[float, float, float]:
    """Mass ratio; moment on the ship and moment of the pump per tank angle, N m."""
    mass, damping, stiffness = coupled_matrices(ship, tank)
    half, w = tank.width_m / 2, ROLL_RAD_S
    moment = abs(half * (stiffness[0, 1] - w**2 * mass[0, 1]))
    pump = half**2 * abs(stiffness[1, 1] - w**2 * mass[1, 1] + 1j * w * damping[1, 1])
    return float(mass[1, 1] * half**2 / mass[0, 0]), float(moment), float(pump)


def _along(
    ship: RollShip, way: Callable[[float], Tank]
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Mass ratio, moment per power (N m / W), and level (m)."""
    rows = []
    for share in _SHARES:
        tank = way(float(share))
        mu, moment, pump = _per_angle(ship, tank)
        angle = _MOMENT_NM / moment
        rows.append((mu, _MOMENT_NM / (pump * ROLL_RAD_S * angle**2 / 2), angle * tank.width_m / 2))
    mu, gain, level = np.array(rows).T
    shown = (mu > 0.005) & (mu < 0.1)
    return mu[shown], gain[shown], level[shown]


def _off_tune(ship: RollShip, tank: Tank) -> float:
    """Power for the same moment with water 10 % too fast, per that with tuned water."""
    tuned = tuned_tank(ship, tank)
    part_m = tuned.effective_length_m / 1.1**2 - 2 * tank.height_m
    faster = replace(tuned, duct_area_m2=tank.width_m * tank.reservoir_area_m2 / part_m)
    need = [pump / moment**2 for _, moment, pump in (_per_angle(ship, t) for t in (faster, tuned))]
    return math.fabs(need[0] / need[1])
