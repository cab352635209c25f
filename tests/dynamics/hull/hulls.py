"""A hull of made-up numbers that any test can vary."""

import numpy as np

from utank_hil.dynamics.hull.hull_data import HullData


def made_up_hull(**other):
    random = np.random.default_rng(1)
    half = random.normal(size=(3, 6, 6))
    radiation = half @ np.swapaxes(half, 1, 2) + 6 * np.eye(6)
    excitation = random.normal(size=(2, 4, 6)) + 1j * random.normal(size=(2, 4, 6))
    fields = {
        "frequency_rad_s": [0.4, 0.6, 0.9],
        "added_mass": radiation,
        "damping": radiation / 3,
        "wave_frequency_rad_s": [0.3, 0.5, 0.7, 0.9],
        "heading_deg": [0.0, 90.0],
        "excitation": excitation,
        "hydrostatic": np.diag([0.0, 0.0, 5.0, 2.0, 9.0, 0.0]),
        "mass_kg": 4.0,
        "inertia_kg_m2": np.array([[3.0, 0.0, -0.5], [0.0, 7.0, 0.0], [-0.5, 0.0, 8.0]]),
        "gravity_centre_m": [0.7, 0.0, 1.1],
    }
    return HullData(**(fields | other))  # type: ignore[arg-type]
