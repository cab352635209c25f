"""Encounter frequency of a ship under way in deep water.

A wave of frequency omega has wave number k = omega^2 / g. A ship at speed U meets it at::

    omega_e = omega - k U cos(heading)

`heading` is the direction of wave travel relative to the ship's course: 0 following, pi head,
+pi/2 from port to starboard. In a following sea omega_e is zero for a wave of the ship's speed, and
negative for a wave that the ship overtakes.
"""

import numpy as np

from utank_hil.arrays import FloatArray
from utank_hil.dynamics.tank import GRAVITY_M_S2


def wavenumber_rad_m(omega_rad_s: FloatArray) -> FloatArray:
    """Deep-water wave number omega^2 / g in rad/m."""
    wavenumber: FloatArray = np.asarray(omega_rad_s, dtype=float) ** 2 / GRAVITY_M_S2
    return wavenumber


def encounter_frequency(
    omega_rad_s: FloatArray, heading_rad: FloatArray | float, speed_m_s: float
) -> FloatArray:
    """Signed encounter frequency in rad/s.

    Negative where the ship overtakes the wave, which then passes from bow to stern. Broadcasts.
    """
    omega = np.asarray(omega_rad_s, dtype=float)
    return omega - wavenumber_rad_m(omega) * speed_m_s * np.cos(heading_rad)


def wave_frequencies(
    encounter_rad_s: float, heading_rad: float, speed_m_s: float
) -> tuple[float, ...]:
    """All wave frequencies with a given encounter frequency.

    One in head and beam seas, up to three in following seas, where an encounter spectrum therefore
    cannot be converted back to a wave spectrum.

    Parameters
    ----------
    encounter_rad_s : float
        Magnitude of the encounter frequency, greater than zero.

    Returns
    -------
    tuple of float
        Increasing, rad/s, each with ``abs(encounter_frequency(...)) == encounter_rad_s``.

    Raises
    ------
    ValueError
        If `encounter_rad_s` is not positive.
    """
    if not encounter_rad_s > 0:
        raise ValueError(f"encounter_rad_s must be positive, got {encounter_rad_s}")
    a = speed_m_s * np.cos(heading_rad) / GRAVITY_M_S2
    found = []
    for sign in (1.0, -1.0):  # a omega^2 - omega + sign omega_e = 0, stable for small a
        discriminant = 1 - 4 * a * sign * encounter_rad_s
        if discriminant < 0:
            continue
        root = np.sqrt(discriminant)
        found.append(2 * sign * encounter_rad_s / (1 + root))
        if a != 0:
            found.append((1 + root) / (2 * a))
    return tuple(sorted({float(omega) for omega in found if omega > 0}))
