"""Closed-form response of ship and tank to sinusoidal pump pressure and wave moment, (2.22)-(2.26).

The equations are those of the thesis, with the tank angle tau = 2 h / L and in real arithmetic, as
an independent check of complex arithmetic on the matrices. Errors of the print are corrected
(docs/thesis.md):

* every pump term carries f^2, P0 / k_hh -> f^2 P0 / k_hh (A, B, C, D and (2.25));
* (2.24) has no mass ratio in the roll's phase: atan2(2 q b_hh / C_c, f^2 - q^2);
* (2.24), (2.26): atan2(-sin, -cos) holds only where f^2 G_2 - q^2 G_1 > 0.
"""

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from utank_hil.base.arrays import FloatArray
from utank_hil.dynamics.linear import coupled_matrices
from utank_hil.dynamics.ship import RollShip
from utank_hil.dynamics.tank import Tank


class HarmonicResponse(NamedTuple):
    """Steady oscillation ``amplitude cos(omega t + phase)`` of roll and tank."""

    #: All of shape (n,): roll amplitude and phase, the phase in (-pi, pi].
    roll_rad: FloatArray
    roll_phase_rad: FloatArray
    #: Amplitudes of the tank angle and of the starboard level, and their common phase.
    tank_angle_rad: FloatArray
    level_m: FloatArray
    tank_phase_rad: FloatArray


def harmonic_response(
    ship: RollShip,
    tank: Tank,
    frequency_rad_s: npt.ArrayLike,
    *,
    pressure_pa: float = 0.0,
    pressure_phase_rad: float = 0.0,
    wave_moment_nm: float = 0.0,
    wave_phase_rad: float = 0.0,
) -> HarmonicResponse:
    """Steady response of the linear coupled model to sinusoidal inputs, thesis (2.22) corrected.

    With one amplitude zero it is the wave response (2.23), (2.24) or pump response (2.25), (2.26).
    `frequency_rad_s` has shape (n,); `pressure_pa` and `wave_moment_nm` are amplitudes.
    """
    mass, damping, stiffness = coupled_matrices(ship, tank)
    half = tank.width_m / 2  # level per tank angle; turns the level's force into a moment
    m_tt, b_tt, k_tt = (half**2 * matrix[1, 1] for matrix in (mass, damping, stiffness))
    m_rt, k_rt = (half * matrix[0, 1] for matrix in (mass, stiffness))
    m_rr, b_rr, k_rr = (matrix[0, 0] for matrix in (mass, damping, stiffness))

    ship_frequency = np.sqrt(k_rr / m_rr)
    mu = m_tt / m_rr
    f = np.sqrt(k_tt / m_tt) / ship_frequency
    q = np.asarray(frequency_rad_s, dtype=np.float64) / ship_frequency
    c_c = 2 * m_tt * ship_frequency
    tank_real, tank_imag = f**2 - q**2, 2 * q * b_tt / c_c
    ship_real, ship_imag = 1 - q**2, 2 * q * mu * b_rr / c_c
    coupling = f**2 * k_rt / k_tt - q**2 * m_rt / m_tt

    pump = f**2 * half * tank.reservoir_area_m2 * pressure_pa / k_tt
    wave = wave_moment_nm / k_rr
    pump_cos, pump_sin = pump * np.cos(pressure_phase_rad), pump * np.sin(pressure_phase_rad)
    wave_cos, wave_sin = wave * np.cos(wave_phase_rad), wave * np.sin(wave_phase_rad)
    a = ship_real * pump_cos - ship_imag * pump_sin - coupling * wave_cos
    c = ship_real * pump_sin + ship_imag * pump_cos - coupling * wave_sin
    b = tank_real * wave_cos - tank_imag * wave_sin - mu * coupling * pump_cos
    d = tank_real * wave_sin + tank_imag * wave_cos - mu * coupling * pump_sin
    d_real = tank_real * ship_real - tank_imag * ship_imag - mu * coupling**2
    d_imag = tank_real * ship_imag + ship_real * tank_imag

    magnitude = np.hypot(d_real, d_imag)
    tank_angle = np.hypot(a, c) / magnitude
    return HarmonicResponse(
        roll_rad=np.hypot(b, d) / magnitude,
        roll_phase_rad=_phase_difference(np.arctan2(d, b), np.arctan2(d_imag, d_real)),
        tank_angle_rad=tank_angle,
        level_m=half * tank_angle,
        tank_phase_rad=_phase_difference(np.arctan2(c, a), np.arctan2(d_imag, d_real)),
    )


def _phase_difference(phase: FloatArray, reference: FloatArray) -> FloatArray:
    """Phase difference in (-pi, pi]."""
    return np.asarray(np.pi - (np.pi - (phase - reference)) % (2 * np.pi), dtype=np.float64)
