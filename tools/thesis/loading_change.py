"""Section 3.8: the roll period falls to 7.5 s, the ship is identified, the law designed anew.

On the linear ship, without bus: 0 to 200 s the law of the old ship, 200 to 700 s random pulses and
no control, then OKID, ERA of order four and the same design on what was found, 700 to 1000 s the
new law. A regular wave all the time.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Final

import numpy as np

from tools.thesis.linear_contest import SAMPLE_TIME_S, Entrant, held_model, radius
from utank_hil.base.arrays import FloatArray
from utank_hil.control.arx import ARX
from utank_hil.control.interface import PumpLimits
from utank_hil.control.predictive.law import PredictiveLaw
from utank_hil.dynamics.linear import STATES, state_matrices
from utank_hil.dynamics.sampling import LinearModel, transition_and_step
from utank_hil.dynamics.ship import RollShip
from utank_hil.dynamics.tank import Tank
from utank_hil.identification import era, find_disturbance_frequencies, okid, random_pulses

if TYPE_CHECKING:
    from control import StateSpace

NEW_PERIOD_S: Final = 7.5
PULSES_S, NEW_LAW_S, END_S = 200.0, 700.0, 1000.0
SYSTEM_ORDER: Final = 4
_STEP_S: Final = 0.02
_STEPS: Final = round(SAMPLE_TIME_S / _STEP_S)
_SEED: Final = 4


@dataclass(frozen=True, slots=True)
class Wave:
    """A regular wave."""

    frequency_rad_s: float
    slope_rad: float  #: Its moment per stiffness of the changed ship.


@dataclass(frozen=True, slots=True)
class Adaptation:
    """An adaptive law."""

    design: Callable[[ARX], PredictiveLaw]  #: From a model to the law.
    measured: tuple[str, ...]  #: `roll_rad`, after `level_m` if that is fed back.
    order: int  #: Of the identified ARX model.
    pulse_pa: float = 20e3  #: Greatest pressure of the pulses.
    pulse_s: tuple[float, float] = (1.0, 5.0)  #: Shortest and longest pulse.

    def excitation(self) -> FloatArray:
        """The pulses, pressures at the samples."""
        limits = PumpLimits(pressure_pa=self.pulse_pa, rate_pa_s=10 * self.pulse_pa)
        return random_pulses(
            NEW_LAW_S - PULSES_S, limits, _SEED, self.pulse_s, sample_time_s=SAMPLE_TIME_S
        )

    def old_law(self, ship: RollShip, tank: Tank) -> PredictiveLaw:
        """The law designed on the ship before the change."""
        return self.law(held_model(ship, tank, self.measured))

    def law(self, system: "StateSpace | LinearModel") -> PredictiveLaw:
        """The law for a sampled model of order four."""
        return self.design(ARX.from_state_space(system, SYSTEM_ORDER // len(self.measured)))


@dataclass(frozen=True, slots=True)
class Voyage:
    """What happened."""

    time_s: FloatArray  #: shape (n,)
    #: roll_rad, level_m, pressure_pa: shape (n,): at the samples.
    roll_rad: FloatArray
    level_m: FloatArray
    pressure_pa: FloatArray
    #: before_rad, after_rad: roll amplitudes under the old and the new law, over their last 100 s.
    before_rad: float
    after_rad: float
    #: found_rad_s, true_rad_s: frequencies of the identified and of the true modes, rising.
    found_rad_s: tuple[float, ...]
    true_rad_s: tuple[float, ...]


def changed(ship: RollShip) -> RollShip:
    """The ship with a roll period of 7.5 s."""
    return replace(ship, stiffness_nm_rad=ship.inertia_kg_m2 * (math.tau / NEW_PERIOD_S) ** 2)


def voyage(ship: RollShip, tank: Tank, adaptation: Adaptation, wave: Wave) -> Voyage:
    """Sail the whole of it, with the ship as it is before the change."""
    measured = adaptation.measured
    sea = _Sea(changed(ship), tank, wave)
    before, pressure = sea.controlled(adaptation.old_law(ship, tank), measured, PULSES_S)
    u = adaptation.excitation()
    during = sea.driven(u)
    system = _identified(adaptation, u, during)
    after, new_pressure = sea.controlled(adaptation.law(system), measured, END_S - NEW_LAW_S)
    states = np.vstack([before, during, after])
    late = round(100.0 / SAMPLE_TIME_S)
    return Voyage(
        np.arange(len(states), dtype=np.float64) * SAMPLE_TIME_S,
        states[:, 0],
        states[:, 2],
        np.concatenate([pressure, u, new_pressure]),
        float(np.abs(before[-late:, 0]).max()),
        float(np.abs(after[-late:, 0]).max()),
        _modes(np.asarray(system.A)),
        _modes(held_model(changed(ship), tank, measured).A),
    )


def with_noise(
    ship: RollShip, tank: Tank, adaptation: Adaptation, wave: Wave, noise: float
) -> tuple[tuple[float, ...], float]:
    """Frequencies found from noisy sensors, rad/s, and the greatest eigenvalue of the new loop.

    `noise` is the standard deviation of the white noise, per that of each signal.
    """
    sea = _Sea(changed(ship), tank, wave)
    sea.controlled(adaptation.old_law(ship, tank), adaptation.measured, PULSES_S)
    u = adaptation.excitation()
    system = _identified(adaptation, u, sea.driven(u), noise)
    entrant = Entrant(adaptation.law(system), adaptation.measured, SAMPLE_TIME_S)
    return _modes(np.asarray(system.A)), radius(changed(ship), tank, entrant)


def _identified(
    adaptation: Adaptation, u: FloatArray, states: FloatArray, noise: float = 0.0
) -> "StateSpace":
    """OKID with the waves found in the record, ERA of order four."""
    y = states[:, [STATES.index(name) for name in adaptation.measured]]
    random = np.random.default_rng(_SEED).standard_normal(y.shape)
    y = y + noise * y.std(axis=0) * random
    waves = find_disturbance_frequencies(u, y, sample_time_s=SAMPLE_TIME_S)
    found = okid(
        u, y, adaptation.order, disturbance_frequencies_rad_s=waves, sample_time_s=SAMPLE_TIME_S
    )
    return era(found.markov, SYSTEM_ORDER, sample_time_s=SAMPLE_TIME_S)


def _modes(a: FloatArray) -> tuple[float, ...]:
    """Natural frequencies of a sampled model, rad/s, rising."""
    poles = np.log(np.linalg.eigvals(a).astype(complex)) / SAMPLE_TIME_S
    return tuple(sorted(float(abs(pole)) for pole in poles if pole.imag > 0))


class _Sea:
    """The changed ship in its wave, sailed part by part."""

    def __init__(self, ship: RollShip, tank: Tank, wave: Wave) -> None:
        self._a, self._b = transition_and_step(*state_matrices(ship, tank), _STEP_S)
        self._moment_nm = wave.slope_rad * ship.stiffness_nm_rad
        self._wave_rad_s = wave.frequency_rad_s
        self._state = np.zeros(len(STATES))
        self._step = 0

    def controlled(
        self, law: PredictiveLaw, measured: tuple[str, ...], duration_s: float
    ) -> tuple[FloatArray, FloatArray]:
        """States and pressures at the samples; u(k) is made of y(k-1)."""
        controller = law.controller()
        columns = [STATES.index(name) for name in measured]
        seen = self._state[columns]
        count = round(duration_s / SAMPLE_TIME_S)
        states, pressure = np.empty((count, len(STATES))), np.empty(count)
        for k in range(count):
            states[k] = self._state
            now = self._state[columns]
            pressure[k] = controller.step(seen)[0]
            seen = now
            self._advance(pressure[k])
        return states, pressure

    def driven(self, pressure_pa: FloatArray) -> FloatArray:
        """States at the samples under given pressures."""
        states = np.empty((len(pressure_pa), len(STATES)))
        for k, held in enumerate(pressure_pa):
            states[k] = self._state
            self._advance(held)
        return states

    def _advance(self, pressure_pa: float) -> None:
        for _ in range(_STEPS):
            wave = self._moment_nm * math.sin(self._wave_rad_s * _STEP_S * (self._step + 0.5))
            self._state = self._a @ self._state + self._b @ (pressure_pa, wave)
            self._step += 1
