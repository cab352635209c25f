"""Forces of the waves as rotating phasors, one for each component."""

from collections.abc import Callable, Sequence
from functools import partial
from typing import Final

import numpy as np

from utank_hil.base.arrays import ComplexArray, FloatArray
from utank_hil.base.elementary import angles_of, each, exp, log, phasors, sizes
from utank_hil.base.tick import TICK_S
from utank_hil.sea import Harmonics
from utank_hil.sea.sea import PassingSea, encounter_frequency

AHEAD_TICKS: Final = 2
"""Ticks by which the last of the plant's four interpolation points is ahead."""
RENEWED_TICKS: Final = 100
"""Ticks between updates of amplitude and frequency of encounter, 1 s; in between the amplitude is
interpolated smoothly."""
_LEAST: Final = 1e-12  # share of the largest amplitude: a ratio cannot start from zero


Response = Callable[[FloatArray, FloatArray], ComplexArray]
"""Complex amplitude per m of a wave's, shape (N,), of wave frequencies and headings."""


def _product(a: ComplexArray, b: ComplexArray) -> ComplexArray:
    """Return a b, whose terms numpy's product fuses where the processor can."""
    real = a.real * b.real - a.imag * b.imag
    result = np.empty(real.shape, dtype=np.complex128)
    result.real, result.imag = real, a.real * b.imag + a.imag * b.real
    return result


def beside(forces: Sequence[Harmonics], other: Harmonics, row: int) -> list[Harmonics]:
    """Return forces of common frequencies with components besides, which act on one of them."""
    frequency = np.concatenate([forces[0].frequency_rad_s, other.frequency_rad_s])
    nothing = np.zeros(len(other.amplitude))
    return [
        Harmonics(
            np.concatenate([force.amplitude, other.amplitude if place == row else nothing]),
            frequency,
            np.concatenate([force.phase_rad, other.phase_rad]),
        )
        for place, force in enumerate(forces)
    ]


class SteadyWaves:
    """Components of a ship that keeps course and speed; all forces have the same frequencies.

    The first is a roll moment in N m, the second, if any, a lateral acceleration over g.
    """

    def __init__(self, *forces: Harmonics) -> None:
        frequency = forces[0].frequency_rad_s
        self._rotations = np.array([phasors(1.0, frequency * TICK_S)] * len(forces))
        lead_rad = AHEAD_TICKS * frequency * TICK_S
        self._phasors = np.array(
            [phasors(force.amplitude, force.phase_rad - lead_rad) for force in forces]
        )

    def begin(self) -> tuple[ComplexArray, ComplexArray]:
        """Return the phasors and rotations at the start."""
        return self._phasors, self._rotations

    def at(self, tick: int) -> tuple[ComplexArray, ComplexArray]:  # noqa: ARG002, always the same
        """Return the same phasors and rotations at every tick."""
        return self._phasors, self._rotations


class PassingWaves:
    """Components of a changing sea, met by a ship that changes course and speed.

    The angle of each component at the ship is the integral of its frequency of encounter, so
    changes of course and speed cause no jump of the moment. `turn_rad` and `speed_m_s` are
    functions of time in s: clockwise turn of the ship since the start, and its speed. Each response
    gives a force's complex amplitude per m of the wave's. `gusts` act besides, whatever the course,
    on the force at `of_gusts`.
    """

    def __init__(
        self,
        sea: PassingSea,
        turn_rad: Callable[[float], float],
        speed_m_s: Callable[[float], float],
        *responses: Response,
        gusts: Harmonics | None = None,
        of_gusts: int = 0,
    ) -> None:
        self._sea, self._turn_rad, self._speed_m_s = sea, turn_rad, speed_m_s
        self._responses = responses
        lead_s = AHEAD_TICKS * TICK_S
        self._angle_rad = sea.phase_rad - lead_s * self._encounter_rad_s(0.0)
        self._amplitude = self._amplitudes(0.0)
        waves = _product(self._amplitude, phasors(1.0, self._angle_rad))
        rotation = phasors(1.0, TICK_S * self._encounter_rad_s(0.0))
        rotations = np.tile(rotation, (len(responses), 1))
        self._count = waves.shape[1]
        if gusts is not None:
            others, turns = SteadyWaves(gusts).begin()
            besides = np.zeros((len(waves), others.size), dtype=np.complex128)
            besides[of_gusts] = others
            waves = np.hstack([waves, besides])
            rotations = np.hstack([rotations, np.tile(turns, (len(waves), 1))])
        self._phasors, self._rotations = waves, rotations

    def begin(self) -> tuple[ComplexArray, ComplexArray]:
        """Return the phasors and rotations at the start."""
        self._angle_rad += 2 * AHEAD_TICKS * TICK_S * self._encounter_rad_s(0.0)
        return self._phasors, self._rotations

    def at(self, tick: int) -> tuple[ComplexArray, ComplexArray]:
        """Return the phasors and rotations at a tick."""
        if tick % RENEWED_TICKS == 0:
            self._renew((tick + AHEAD_TICKS) * TICK_S)
        return self._phasors, self._rotations

    def _renew(self, now_s: float) -> None:
        """Set the targets of amplitude and angle of each component one second later."""
        step_s = RENEWED_TICKS * TICK_S
        first, middle, last = (
            self._encounter_rad_s(now_s + share * step_s) for share in (0.0, 0.5, 1.0)
        )
        turn_rad = step_s / 6 * (first + 4 * middle + last)
        before, after = self._amplitude, self._amplitudes(now_s + step_s)
        # rounding does not accumulate
        self._phasors[:, : self._count] = _product(before, phasors(1.0, self._angle_rad))
        growth = each(log, sizes(after) / sizes(before)) / RENEWED_TICKS
        angle_rad = angles_of(_product(after, before.conj())) + turn_rad
        self._rotations[:, : self._count] = phasors(each(exp, growth), angle_rad / RENEWED_TICKS)
        self._angle_rad += turn_rad
        self._amplitude = after

    def _heading_rad(self, time_s: float) -> tuple[FloatArray, FloatArray]:
        amplitude_m, heading_rad = self._sea.at(time_s)
        return amplitude_m, heading_rad - self._turn_rad(time_s)

    def _encounter_rad_s(self, time_s: float) -> FloatArray:
        _, heading_rad = self._heading_rad(time_s)
        return encounter_frequency(self._sea.omega_rad_s, heading_rad, self._speed_m_s(time_s))

    def _amplitudes(self, time_s: float) -> ComplexArray:
        amplitude_m, heading_rad = self._heading_rad(time_s)
        omega_rad_s = self._sea.omega_rad_s
        rows = [amplitude_m * response(omega_rad_s, heading_rad) for response in self._responses]
        amplitude = np.array(rows)
        size = sizes(amplitude)
        least = _LEAST * np.maximum(size.max(axis=1, keepdims=True), 1.0)
        return np.where(size > least, amplitude, least)


def responses_of(forces: Response, count: int) -> list[Response]:
    """Responses of `forces`, shape (count, N), one each; computed anew where headings are new."""
    known: list[tuple[FloatArray, ComplexArray]] = []

    def row(place: int, omega_rad_s: FloatArray, heading_rad: FloatArray) -> ComplexArray:
        if not known or not np.array_equal(known[0][0], heading_rad):
            known[:] = [(heading_rad, forces(omega_rad_s, heading_rad))]
        found: ComplexArray = known[0][1][place]
        return found

    return [partial(row, place) for place in range(count)]


Waves = SteadyWaves | PassingWaves
"""Wave components at the ship: phasors of shape (k, N), one row for each force, that the caller
rotates in place, tick by tick. `begin` gives those `AHEAD_TICKS` before the start, `at` those
`AHEAD_TICKS` after a tick, and their rotation; it must be called for each tick from 0 on."""
