"""Encounter frequency of a ship under way in deep water.

A wave of frequency omega has wave number k = omega^2 / g. A ship at speed U meets it at::

    omega_e = omega - k U cos(heading)

`heading` is the direction the wave travels relative to the ship's course: 0 following, pi head,
+pi/2 from port to starboard. In a following sea omega_e falls to zero where the ship keeps up with
the phase and turns negative where she overtakes the wave.
"""

import numpy as np

from utank_hil.arrays import FloatArray
from utank_hil.dynamics.tank import GRAVITY_M_S2


def wavenumber_rad_m(omega_rad_s: FloatArray) -> FloatArray:
    """Deep-water wave number omega^2 / g."""
    wavenumber: FloatArray = np.asarray(omega_rad_s, dtype=float) ** 2 / GRAVITY_M_S2
    return wavenumber


def encounter_frequency(
    omega_rad_s: FloatArray, heading_rad: FloatArray | float, speed_m_s: float
) -> FloatArray:
    """Signed encounter frequency in rad/s.

    Negative where the ship overtakes the wave: the wave then passes from bow to stern and its phase
    runs backwards. Broadcasts.
    """
    omega = np.asarray(omega_rad_s, dtype=float)
    return omega - wavenumber_rad_m(omega) * speed_m_s * np.cos(heading_rad)


def wave_frequencies(
    encounter_rad_s: float, heading_rad: float, speed_m_s: float
) -> tuple[float, ...]:
    """Every wave frequency that a ship meets at a given encounter frequency.

    One in head and beam seas; in following seas up to three, which is why an encounter spectrum
    cannot be turned back into a wave spectrum there.

    Parameters
    ----------
    encounter_rad_s : float
        Magnitude of the encounter frequency, greater than zero.
    heading_rad : float
    speed_m_s : float

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
    for sign in (1.0, -1.0):  # a omega^2 - omega + sign omega_e = 0, in the form safe for small a
        discriminant = 1 - 4 * a * sign * encounter_rad_s
        if discriminant < 0:
            continue
        root = np.sqrt(discriminant)
        found.append(2 * sign * encounter_rad_s / (1 + root))
        if a != 0:
            found.append((1 + root) / (2 * a))
    return tuple(sorted({float(omega) for omega in found if omega > 0}))
