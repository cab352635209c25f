"""Encounter frequency of a ship under way in deep water.

A wave of frequency omega has wave number k = omega^2 / g. A ship at speed U meets it at::

    omega_e = omega - k U cos(heading)

`heading` is the direction of wave travel relative to the ship's course: 0 following, pi head,
+pi/2 from port to starboard. In a following sea omega_e is zero for a wave of the ship's speed, and
negative for a wave that the ship overtakes.
"""

import numpy as np

from utank_hil.base.arrays import FloatArray
from utank_hil.base.elementary import sines_cosines
from utank_hil.dynamics.tank import GRAVITY_M_S2


def wavenumber_rad_m(omega_rad_s: FloatArray) -> FloatArray:
    """Deep-water wave number omega^2 / g in rad/m."""
    omega = np.asarray(omega_rad_s, dtype=float)
    wavenumber: FloatArray = omega * omega / GRAVITY_M_S2
    return wavenumber


def encounter_frequency(
    omega_rad_s: FloatArray, heading_rad: FloatArray | float, speed_m_s: float
) -> FloatArray:
    """Signed encounter frequency in rad/s; arguments broadcast.

    It is negative where the ship overtakes the wave, which then passes from bow to stern.
    """
    omega = np.asarray(omega_rad_s, dtype=float)
    return (
        omega
        - wavenumber_rad_m(omega)
        * speed_m_s
        * sines_cosines(np.asarray(heading_rad, dtype=float))[1]
    )
