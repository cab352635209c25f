"""Waves that a ship met, from its recorded roll and level, as components of a beam sea.

The roll equation of `utank_hil.dynamics.nonlinear` is solved for the wave moment. The water's
motion is measured, so neither pressure nor losses of the duct are needed. Derivatives are those of
the Fourier series of the whole record: a smoother without delay.
"""

from typing import Final

import numpy as np
from scipy.fft import irfft, rfft, rfftfreq

from utank_hil.base.arrays import ComplexArray, FloatArray
from utank_hil.base.elementary import sines_cosines
from utank_hil.dynamics.nonlinear import RollModel, forces
from utank_hil.sea import Sea
from utank_hil.sea.sea import BEAM_RAD, wavenumber_rad_m

BAND_RAD_S: Final = (0.05, 3.0)
"""Waves from 2 to 126 s. What is slower is heel; the plant interpolates waves to 3 rad/s."""
_EXTENDED_S: Final = 60.0  #: Reflected at either end, so that the series has no step there.
_ROLL_OFF_RAD_S: Final = 2.0  #: Above the band; a sharp end of it rings through the record.
_TAPERED_S: Final = 20.0  #: The sea begins and ends calm within it, so that it may repeat.
_LEFT_OUT: Final = 1e-6  #: Share of the variance in the components left out: 0.1 % of the slope.


def wave_slope(
    roll_rad: FloatArray, level_m: FloatArray, step_s: float, model: RollModel
) -> tuple[FloatArray, float]:
    """Return the effective wave slope in rad, shape (N,), and the steady heeling moment in N m.

    The slope is the wave moment over the ship's stiffness, positive starboard down. `roll_rad` and
    `level_m`, shape (N,), are samples `step_s` apart without gaps. A ship that sways
    (`sway_of_slope`) moves the water by the slope as well.
    """
    c, ship = model.coefficients, model.ship
    phi, phi_1, phi_2 = _derivatives(roll_rad, step_s)
    h, h_1, h_2 = _derivatives(level_m, step_s)
    sin, cos = sines_cosines(phi)
    righting = model.restoring.moment_nm(phi)
    inertia, moment, _ = forces(c, righting, sin, cos, phi_1, h, h_1, 0.0, 0.0, 0.0, 0.0)
    sway = ship.sway_of_slope or 0.0
    _, swaying, _ = forces(c, righting, sin, cos, phi_1, h, h_1, 0.0, sway, 0.0, 0.0)
    waves_nm = inertia * phi_2 + c.coupling * h_2 - moment
    steady_nm = float(waves_nm.mean())
    return (waves_nm - steady_nm) / (ship.stiffness_nm_rad + swaying - moment), steady_nm


def beam_sea(slope_rad: FloatArray, step_s: float, coefficient: float = 1.0) -> Sea:
    """Return components from port whose slope, times the coefficient, is that given in the band.

    They repeat after the record. It rises from calm and falls to calm within 20 s.
    """
    ramp = np.minimum(np.arange(len(slope_rad)) * step_s / _TAPERED_S, 1.0)
    taper = np.sin(np.pi / 2 * np.minimum(ramp, ramp[::-1])) ** 2
    series: ComplexArray = rfft(slope_rad * taper) * (2 / len(slope_rad))
    omega: FloatArray = 2 * np.pi * rfftfreq(len(slope_rad), step_s)
    energy = np.where((omega >= BAND_RAD_S[0]) & (omega <= BAND_RAD_S[1]), np.abs(series) ** 2, 0.0)
    order = np.argsort(energy)
    least = energy[order][np.cumsum(energy[order]) > _LEFT_OUT * energy.sum()]
    kept = np.flatnonzero(energy >= (least[0] if least.size else np.inf))
    amplitude_m = np.abs(series[kept]) / (coefficient * wavenumber_rad_m(omega[kept]))
    # The slope to starboard leads the crest by a quarter of a period.
    phase_rad = np.angle(series[kept]) - np.pi / 2
    return Sea(amplitude_m, omega[kept], np.full(len(kept), BEAM_RAD), phase_rad)


def _derivatives(values: FloatArray, step_s: float) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return the values without noise above the band, and their first and second derivatives."""
    more = min(round(_EXTENDED_S / step_s), len(values) - 1)
    before = 2 * values[0] - values[more:0:-1]
    after = 2 * values[-1] - values[-2 : -more - 2 : -1]
    whole = np.concatenate([before, values, after])
    omega: FloatArray = 2 * np.pi * rfftfreq(len(whole), step_s)
    above = np.clip((omega - BAND_RAD_S[1]) / _ROLL_OFF_RAD_S, 0, 1)
    spectrum = rfft(whole) * np.cos(np.pi / 2 * above) ** 2
    one, two, three = (
        irfft(spectrum * (1j * omega) ** order, len(whole))[more : more + len(values)]
        for order in range(3)
    )
    return one, two, three
