"""What the monitors take for granted of sway, against hulls computed by three codes."""

import math
from pathlib import Path

import numpy as np
import pytest
from beam_sea import motions, roll_resonance
from others import others_file

from utank_hil.configuration.hull_files.parts import Given
from utank_hil.configuration.hull_files.reader import read_hull
from utank_hil.safety.monitors.sway import LEAST_SLOPE, SPREAD

HULLS = {
    "wigley": ("tests/dynamics/data/wigley.nc", Given(gyration_m=(4.56, 15.0, 15.0))),
    "fpso": (
        "hulls/wamit-fpso/fpso.1",
        Given(density_kg_m3=1025.0, mass_kg=1025 * 97960.9, gravity_centre_m=(0.788631, 0.0, -1.0)),
    ),
    "supply": ("hulls/shipx-supply/input.re7", None),
}
AROUND = np.linspace(0.75, 1.25, 21)


def shares(name, viscous_ratio):
    """Share k of sway, complex, and the slope that the roll tells, around roll resonance."""
    file, given = HULLS[name]
    hull = read_hull(Path(file) if name == "wigley" else others_file(file), given)
    roll = roll_resonance(hull, viscous_ratio)
    resonance = 2 * math.pi / roll.period_s
    ship = hull.about_gravity_centre()
    damping = 2 * viscous_ratio * float(ship.known("hydrostatic")[3, 3]) / resonance
    ratio = roll.radiation_ratio + viscous_ratio
    moved = np.array([motions(ship, f * resonance, 90.0, damping) for f in AROUND])
    told = (1 - AROUND**2 + 2j * ratio * AROUND) * moved[:, 3]
    return (AROUND * resonance) ** 2 * moved[:, 1] / (hull.gravity_m_s2 * told), told


@pytest.mark.parametrize("name", HULLS)
@pytest.mark.parametrize("viscous_ratio", [0.03, 0.05, 0.1])
def test_sway_is_a_nearly_constant_share_in_phase_with_the_roll_moment(name, viscous_ratio):
    share, told = shares(name, viscous_ratio)
    power = abs(told) ** 2
    constant = float(np.sum(share.real * power) / np.sum(power))
    assert 1.0 <= constant <= 1 / LEAST_SLOPE
    left = math.sqrt(float(np.sum(abs(share - constant) ** 2 * power) / np.sum(power)))
    assert left <= SPREAD / LEAST_SLOPE
