"""Figures 2.3 to 2.6, and 3.1: roll and water by the pump, and by waves, for several frictions."""

import math
from dataclasses import replace
from typing import Final

import numpy as np

from tools.thesis.figure import Check, Curve, Figure, Panel, Row, Verdict, panel_of, peaks
from tools.thesis.harmonic import HarmonicResponse, harmonic_response
from tools.thesis.ships import ROLL_RAD_S, first_ship, tuned_ship
from tools.thesis.simulate import simulate
from utank_hil.base.arrays import FloatArray
from utank_hil.control.optimal_tank import ship_ratios
from utank_hil.dynamics import RollModel
from utank_hil.dynamics.linear import coupled_matrices
from utank_hil.dynamics.ship import RollShip
from utank_hil.dynamics.tank import Tank

FRICTIONS: Final = (0.02, 0.1, 0.3, 1.0)
SIMULATED: Final = 0.1
_RATIO: Final = np.linspace(0.4, 1.6, 1201)
_MARKS: Final = np.array([0.6, 0.75, 0.85, 0.95, 1.0, 1.05, 1.15, 1.3, 1.5])
_SETTLE: Final = 60
_STEPS: Final = 256
_X: Final = "Pump frequency per roll frequency"
_METHOD: Final = (
    "closed form (2.25), (2.26) as corrected in the errata; dots: simulation of the nonlinear "
    "model at small amplitude"
)
_OPEN: Final = (
    "Chapter 2 gives no ship: here the first ship of 3.8 with 2.5 % roll damping and a duct of "
    "4.26 m² that gives the water its roll frequency. The frictions of the family are not known "
    "and varied from 0.02 to 1, as damping ratio of the water."
)


def _static(ship: RollShip, tank: Tank) -> tuple[float, float]:
    """Static tank angle per pressure k_hh form, P0 / k_hh, and roll per moment, K0 / k_phiphi."""
    _, _, stiffness = coupled_matrices(ship, tank)
    return float(tank.reservoir_area_m2 / stiffness[1, 1] * 2 / tank.width_m), float(
        1 / stiffness[0, 0]
    )


def _by_pump(friction: float, ratio: FloatArray = _RATIO) -> HarmonicResponse:
    """Response to a pressure that would hold the water at a tank angle of one."""
    ship, tank = tuned_ship(friction)
    unit_pa = 1 / _static(ship, tank)[0]
    return harmonic_response(ship, tank, ROLL_RAD_S * ratio, pressure_pa=unit_pa)


def _simulated(friction: float) -> tuple[FloatArray, FloatArray]:
    """Complex roll and tank angle of the simulation at the marked frequencies, as `_by_pump`."""
    ship, tank = tuned_ship(friction)
    small = 1e-4
    amplitude_pa = small / _static(ship, tank)[0]
    found = np.empty((2, len(_MARKS)), dtype=np.complex128)
    angle = math.tau * np.arange(_STEPS) / _STEPS
    for n, ratio in enumerate(_MARKS):
        step_s = math.tau / (ROLL_RAD_S * ratio) / _STEPS
        # held pressures: each that of the middle of its step
        held = amplitude_pa * np.cos(np.tile(angle + math.pi / _STEPS, _SETTLE + 1))
        run = simulate(RollModel(ship, tank), len(held) * step_s, pressure_pa=held, step_s=step_s)
        last = run.state[-_STEPS - 1 : -1, [0, 2]]
        first_harmonic = last.T @ np.exp(-1j * angle) * 2 / _STEPS / small
        found[:, n] = first_harmonic[0], first_harmonic[1] / (tank.width_m / 2)
    return found[0], found[1]


def _agreement(simulated: FloatArray, amplitude: FloatArray, phase_rad: FloatArray) -> str:
    exact = amplitude * np.exp(1j * phase_rad)
    worst = float(np.max(np.abs(simulated - exact) / np.abs(exact)))
    return f"closed form and simulation differ by {worst:.1e} at most"


def _two_to_one(what: str, curves: list[FloatArray]) -> Check:
    least, most = peaks(curves[0]), peaks(curves[-1])
    return Check(
        f"{what} shows two degrees of freedom at low friction and one at high friction",
        Verdict.of(least == 2 and most == 1),
        f"peaks over frequency: {least} at {FRICTIONS[0]:g}, {most} at {FRICTIONS[-1]:g}",
    )


def figure_2_3() -> Figure:
    """Magnitude of the roll by the pump."""
    family = [_by_pump(friction).roll_rad for friction in FRICTIONS]
    exact = _by_pump(SIMULATED, _MARKS)
    roll, _ = _simulated(SIMULATED)
    return Figure(
        _METHOD,
        _OPEN,
        (
            _family_panel("Roll by the pump", "Roll per P0/k_hh", family, log_y=True),
            Panel(
                f"Friction {SIMULATED:g}: closed form and simulation",
                _X,
                "Roll per P0/k_hh",
                (
                    Curve("closed form", _RATIO, family[1]),
                    Curve("simulation", _MARKS, np.abs(roll), marks=True),
                ),
                log_y=True,
            ),
        ),
        rows=(
            _reciprocity_row("duct of f = 1", None),
            _reciprocity_row("printed duct, f = 1.18", 6.22),
        ),
        checks=(
            _two_to_one("the roll by the pump", family),
            _reciprocity_check(),
            _less_pressure_check(),
            Check(
                "(2.22) to (2.26) describe the coupled model (implied)",
                Verdict.PARTLY,
                _agreement(roll, exact.roll_rad, exact.roll_phase_rad)
                + "; the print lacks f² in the pump terms (errata)",
            ),
        ),
    )


def _reciprocity(duct_area_m2: float | None) -> tuple[float, float, float]:
    """Ratio of roll by pump and tank angle by wave, per static ones; mass ratio; f squared."""
    ship, tank = tuned_ship(SIMULATED)
    if duct_area_m2 is not None:
        tank = replace(tank, duct_area_m2=duct_area_m2)
    mass, _, stiffness = coupled_matrices(ship, tank)
    per_pressure, per_moment = _static(ship, tank)
    w = ROLL_RAD_S * 0.9
    pump = harmonic_response(ship, tank, w, pressure_pa=1 / per_pressure)
    wave = harmonic_response(ship, tank, w, wave_moment_nm=1 / per_moment)
    mu = mass[1, 1] * (tank.width_m / 2) ** 2 / mass[0, 0]
    f2 = (tank.natural_frequency_rad_s**2) / (stiffness[0, 0] / mass[0, 0])
    return float(pump.roll_rad / wave.tank_angle_rad), float(mu), float(f2)


def _reciprocity_row(what: str, duct_area_m2: float | None) -> Row:
    ratio, mu, _ = _reciprocity(duct_area_m2)
    return Row(
        f"roll by pump over tank angle by wave, {what}",
        "",
        mu,
        ratio,
        "the ratio is mu f²; the print says mu, which is right for f = 1 only",
    )


def _reciprocity_check() -> Check:
    ratio, mu, f2 = _reciprocity(6.22)
    return Check(
        "the ratio of roll by the pump and tank angle by the wave is mu",
        Verdict.PARTLY,
        f"it is mu f²: with f² = {f2:.2f} it is {ratio:.4f} for mu = {mu:.4f}",
    )


def _less_pressure_check() -> Check:
    tuned = [_by_pump(friction, np.ones(1)) for friction in (FRICTIONS[0], FRICTIONS[2])]
    pressure = float(tuned[0].roll_rad[0] / tuned[1].roll_rad[0])
    level = [float(each.tank_angle_rad[0] / each.roll_rad[0]) for each in tuned]
    return Check(
        "lower friction needs less pump pressure and higher reservoirs (2.6)",
        Verdict.PARTLY,
        f"for the same roll friction {FRICTIONS[0]:g} needs {1 / pressure:.0%} of the pressure of "
        f"{FRICTIONS[2]:g}; the tank angle per roll is {level[0]:.2f} and {level[1]:.2f}: friction "
        "does not enter it, so the reservoirs need to be higher for the same pressure only",
    )


def figure_2_4() -> Figure:
    """Phase of the roll by the pump."""
    family = [np.degrees(np.unwrap(_by_pump(each).roll_phase_rad)) for each in FRICTIONS]
    exact = _by_pump(SIMULATED, _MARKS)
    roll, _ = _simulated(SIMULATED)
    across = [float(np.ptp(y[(_RATIO > 0.8) & (_RATIO < 1.25)])) for y in family]
    return Figure(
        _METHOD,
        _OPEN,
        (_family_panel("Roll by the pump", "Phase (°)", family),),
        checks=(
            Check(
                "two degrees of freedom at low friction, one at high friction",
                Verdict.of(across[0] > 270 and across[-1] < 225),
                f"the phase turns by {across[0]:.0f}° between 0.8 and 1.25 of the roll frequency "
                f"at {FRICTIONS[0]:g}, by {across[-1]:.0f}° at {FRICTIONS[-1]:g}",
            ),
            Check(
                "(2.26) gives the phase (implied)",
                Verdict.PARTLY,
                _agreement(roll, exact.roll_rad, exact.roll_phase_rad)
                + "; the printed arctangent has the wrong sign above q = f / sqrt(-G1) (errata)",
            ),
        ),
    )


def figure_2_5() -> Figure:
    """Magnitude of the water by the pump."""
    family = [_by_pump(friction).tank_angle_rad for friction in FRICTIONS]
    tops = [float(y.max()) for y in family]
    everywhere = np.mean(np.diff(np.array(family), axis=0).max(axis=0) < 0)
    return Figure(
        _METHOD,
        _OPEN,
        (_family_panel("Tank angle by the pump", "Tank angle per P0/k_hh", family, log_y=True),),
        checks=(
            _two_to_one("the water", family),
            Check(
                "the higher water height is generated at the lower friction",
                Verdict.of(tops == sorted(tops, reverse=True)),
                f"greatest tank angles {', '.join(f'{top:.3g}' for top in tops)}; at each single "
                f"frequency in {everywhere:.0%} of the band",
            ),
        ),
    )


def figure_2_6() -> Figure:
    """Phase of the water by the pump."""
    family = [np.degrees(np.unwrap(_by_pump(each).tank_phase_rad)) for each in FRICTIONS]
    exact = _by_pump(SIMULATED, _MARKS)
    _, tank = _simulated(SIMULATED)
    # the phase falls but where ship and water swing as one
    rise = [float((y - np.minimum.accumulate(y)).max()) for y in family]
    return Figure(
        _METHOD,
        _OPEN,
        (_family_panel("Tank angle by the pump", "Phase (°)", family),),
        checks=(
            Check(
                "two degrees of freedom at low friction, one at high friction",
                Verdict.PARTLY if rise[-1] > 0 else Verdict.of(rise[0] > 0),
                f"between the two peaks the phase rises by {rise[0]:.0f}° at {FRICTIONS[0]:g} and "
                f"still by {rise[-1]:.0f}° at {FRICTIONS[-1]:g}: the ship remains an absorber of "
                "the water at its own frequency",
            ),
            Check(
                "(2.26) gives the phase (implied)",
                Verdict.PARTLY,
                _agreement(tank, exact.tank_angle_rad, exact.tank_phase_rad)
                + "; the print takes the arctangent of a quotient (errata)",
            ),
        ),
    )


def _family_panel(title: str, y_label: str, family: list[FloatArray], **options: bool) -> Panel:
    """A curve for each friction."""
    named = {f"friction {each:g}": y for each, y in zip(FRICTIONS, family, strict=True)}
    return panel_of(title, _X, y_label, _RATIO, named, **options)


WAVE_FRICTIONS: Final = (0.05, 0.1, 0.2, 0.4)
CHOSEN: Final = 0.1
_BAND: Final = np.linspace(0.05, 2.0, 1501)


def _by_wave(ship: RollShip, tank: Tank, ratio: float | None = None) -> HarmonicResponse:
    """Response to a moment of 1 N m; along the band, or at one frequency ratio."""
    w = ship_ratios(ship, tank)[1] * (_BAND if ratio is None else np.array([ratio]))
    return harmonic_response(ship, tank, w, wave_moment_nm=1.0)


def figure_3_1() -> Figure:
    """Phases over frequency, and the parts of the tank's moment."""
    family = {f"friction {each:g}": _by_wave(*tuned_ship(each)) for each in WAVE_FRICTIONS}
    ship, tank = tuned_ship(CHOSEN)
    at_own = _by_wave(ship, tank, 1.0)
    roll_deg = -float(np.degrees(at_own.roll_phase_rad[0]))
    water_deg = abs(float(np.degrees(at_own.tank_phase_rad[0])))
    built = first_ship(4.87e7, CHOSEN)
    printed = _by_wave(*built, 1.0)
    slow, own = _parts(ship, tank, 0.05), _parts(ship, tank, 1.0)
    return Figure(
        "closed form (2.24), corrected",
        "Ship, friction and tuning are not given: the first ship with a duct of its own roll "
        "frequency, friction varied from 0.05 to 0.4 (numbers at 0.1), and with the printed duct.",
        tuple(
            panel_of(
                title,
                "Wave frequency per roll frequency",
                "Phase (°)",
                _BAND,
                {name: np.degrees(np.unwrap(getattr(y, part))) for name, y in family.items()},
            )
            for title, part in (("Roll", "roll_phase_rad"), ("Water", "tank_phase_rad"))
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
