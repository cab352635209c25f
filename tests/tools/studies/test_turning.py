"""Formulas of the comparison with fins and rudder, against closed forms."""

import math

import pytest

from tools.studies.turning import above_keel_m, lift_slope


def test_a_foil_lifts_between_slender_and_plane():
    assert lift_slope(0.2) == pytest.approx(math.pi / 2 * 0.2, rel=0.06)  # Jones, slender
    assert lift_slope(1e4) == pytest.approx(1.8 * math.pi, rel=1e-3)  # plane flow, as measured


def test_a_box_has_its_metacentre_where_geometry_says():
    mass_kg = 1025.0 * 100 * 20 * 5
    metacentre = 5 / 2 + 20**2 / (12 * 5)
    assert above_keel_m(100, 20, 5, mass_kg, 0.0) == pytest.approx(metacentre, rel=0.07)
