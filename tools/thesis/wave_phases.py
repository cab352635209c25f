"""Figure 3.1: phases of roll and water with the passive tank, against the wave's moment."""

from typing import Final

import numpy as np

from tools.thesis.figure import Check, Curve, Figure, Panel, Row, Verdict
from tools.thesis.harmonic import HarmonicResponse, harmonic_response
from tools.thesis.ships import first_ship
from tools.thesis.stimulation import tuned_tank
from utank_hil.control.optimal_tank import ship_ratios
from utank_hil.dynamics.linear import coupled_matrices
from utank_hil.dynamics.ship import RollShip
from utank_hil.dynamics.tank import Tank

FRICTIONS: Final = (0.05, 0.1, 0.2, 0.4)
CHOSEN: Final = 0.1
_RATIO: Final = np.linspace(0.05, 2.0, 1501)


def _tuned(friction: float) -> tuple[RollShip, Tank]:
    ship, tank = first_ship(4.87e7, friction)
    return ship, tuned_tank(ship, tank)


def _by_wave(ship: RollShip, tank: Tank, ratio: float | None = None) -> HarmonicResponse:
    """Response to a moment of 1 N m; along the band, or at one frequency ratio."""
    w = ship_ratios(ship, tank)[1] * (_RATIO if ratio is None else np.array([ratio]))
    return harmonic_response(ship, tank, w, wave_moment_nm=1.0)


def figure_3_1() -> Figure:
    """Phases over frequency, and the parts of the tank's moment."""
    family = [_by_wave(*_tuned(friction)) for friction in FRICTIONS]
    ship, tank = _tuned(CHOSEN)
    at_own = _by_wave(ship, tank, 1.0)
    roll_deg = -float(np.degrees(at_own.roll_phase_rad[0]))
    water_deg = abs(float(np.degrees(at_own.tank_phase_rad[0])))
    built = first_ship(4.87e7, CHOSEN)
    printed = _by_wave(*built, 1.0)
    slow, own = _parts(ship, tank, 0.05), _parts(ship, tank, 1.0)
    labels = [f"friction {friction:g}" for friction in FRICTIONS]
    return Figure(
        "closed form (2.24), corrected",
        "Ship, friction and tuning are not given: the first ship with a duct of its own roll "
        "frequency, friction varied from 0.05 to 0.4 (numbers at 0.1), and with the printed duct.",
        tuple(
            Panel(
                title,
                "Wave frequency per roll frequency",
                "Phase (°)",
                tuple(
                    Curve(label, _RATIO, np.degrees(np.unwrap(phase)))
                    for label, phase in zip(labels, phases, strict=True)
                ),
            )
            for title, phases in (
                ("Roll", [each.roll_phase_rad for each in family]),
                ("Water", [each.tank_phase_rad for each in family]),
            )
        ),
        rows=(
            Row(
                "roll's lag at the roll frequency",
                "°",
                90.0,
                roll_deg,
                "the phase of a damped pair passes 90° beside q = 1",
            ),
            Row("water's phase shift there", "°", 180.0, water_deg, "as above"),
            Row(
                "roll's lag there, printed duct",
                "°",
                90.0,
                -float(np.degrees(printed.roll_phase_rad[0])),
                "the printed tank is 18 % too fast: f = 1.18",
            ),
            Row(
                "water's phase shift there, printed duct",
                "°",
                180.0,
                abs(float(np.degrees(printed.tank_phase_rad[0]))),
                "as above",
            ),
        ),
        checks=(
            Check(
                "at the roll frequency the roll lags by 90° and the water by 180°",
                Verdict.of(abs(roll_deg - 90) < 5 and abs(water_deg - 180) < 5),
                f"{roll_deg:.0f}° and {water_deg:.0f}° with a tuned duct",
            ),
            Check(
                "at low frequency the tank's moment comes of roll angle and water height",
                Verdict.of(slow["roll"] + slow["level"] > 0.95),
                _told(slow),
            ),
            Check(
                "at the roll frequency it comes of water height and its acceleration",
                Verdict.of(own["level"] + own["level acceleration"] > 0.9),
                _told(own),
            ),
        ),
    )


def _parts(ship: RollShip, tank: Tank, ratio: float) -> dict[str, float]:
    """Shares of the four parts of the tank's moment, by their amplitudes."""
    mass, _, stiffness = coupled_matrices(ship, tank)
    w = ship_ratios(ship, tank)[1] * ratio
    answer = harmonic_response(ship, tank, w, wave_moment_nm=1.0)
    roll, level = float(answer.roll_rad), float(answer.level_m)
    parts = {
        "level": abs(stiffness[0, 1]) * level,
        "level acceleration": abs(mass[0, 1]) * w**2 * level,
        "roll": abs(stiffness[0, 0] - ship.stiffness_nm_rad) * roll,
        "roll acceleration": (mass[0, 0] - ship.inertia_kg_m2) * w**2 * roll,
    }
    whole = sum(parts.values())
    return {name: float(part / whole) for name, part in parts.items()}


def _told(parts: dict[str, float]) -> str:
    return ", ".join(f"{name} {part:.0%}" for name, part in parts.items())
