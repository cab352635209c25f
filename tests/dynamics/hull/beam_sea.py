"""Motions of a hull in regular waves, and roll at its resonance in a beam sea from starboard."""

import math
from dataclasses import dataclass

import numpy as np

from utank_hil.dynamics.hull.hull_data import excitation_at, free_roll, radiation_at, wave_number


@dataclass(frozen=True)
class RollResonance:
    """Damping ratios, and the size of the roll moment per stiffness times wave slope."""

    period_s: float
    radiation_ratio: float
    viscous_ratio: float
    effective_slope: float
    #: Lateral acceleration of the centre of gravity per minus g times slope: size and lead.
    sway_share: float
    sway_phase_rad: float


def motions(hull, omega_rad_s, heading_deg, roll_damping_nms_rad):
    """Motions about `hull.reference_m` per metre of wave at rest, shape (6,), m and rad."""
    added, damping = radiation_at(hull, omega_rad_s)
    damping = damping.copy()
    damping[3, 3] += roll_damping_nms_rad
    matrix = (
        -(omega_rad_s**2) * (hull.mass_matrix + added)
        + 1j * omega_rad_s * damping
        + hull.known("hydrostatic")
    )
    return np.linalg.solve(matrix, excitation_at(hull, omega_rad_s, heading_deg))


def roll_resonance(hull, viscous_ratio=None):
    """Roll at its resonance; without a ratio the damping beside radiation is that of the data."""
    ship, free = hull.about_gravity_centre(), free_roll(hull)
    stiffness, omega = ship.hydrostatic[3, 3], 2 * math.pi / free.period_s
    if viscous_ratio is None:
        viscous = float(np.interp(omega, ship.frequency_rad_s, ship.viscous_roll_nms_rad))
    else:
        viscous = 2 * viscous_ratio * stiffness / omega
    k = float(wave_number(np.array(omega), hull.water_depth_m, hull.gravity_m_s2))
    force = excitation_at(ship, omega, 90.0)[[1, 3, 5]]
    effective = (free.mode @ force) / (stiffness * -1j * k)
    sway = motions(ship, omega, 90.0, viscous)[1] * omega**2 / (hull.gravity_m_s2 * -1j * k)
    return RollResonance(
        free.period_s,
        free.radiation_ratio,
        omega * viscous / (2 * stiffness),
        abs(effective),
        abs(sway),
        float(np.angle(sway)),
    )
