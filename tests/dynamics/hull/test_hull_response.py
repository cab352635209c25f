import numpy as np
import pytest
from beam_sea import motions, roll_resonance
from hulls import made_up_hull
from hypothesis import given
from hypothesis import strategies as st

from utank_hil.dynamics.hull.hull_data import (
    UncoveredError,
    excitation_at,
    free_roll,
    radiation_at,
    wave_number,
    with_roll_period,
)

MIRROR = np.array([1, -1, 1, -1, 1, -1])


@given(st.floats(0.05, 5), st.floats(1, 1e4))
def test_wave_number_meets_the_dispersion_relation(omega, depth):
    k = wave_number(np.array(omega), depth, 9.81)
    assert 9.81 * k * np.tanh(k * depth) == pytest.approx(omega**2, rel=1e-9)


def test_deep_water_is_the_limit_of_depth():
    assert wave_number(np.array(0.6), np.inf, 9.81) == pytest.approx(0.36 / 9.81)


def test_data_are_met_at_their_own_points_and_mirrored_on_the_other_side():
    hull = made_up_hull()
    np.testing.assert_allclose(excitation_at(hull, 0.7, 90.0), hull.excitation[1, 2])
    np.testing.assert_allclose(excitation_at(hull, 0.7, -90.0), MIRROR * hull.excitation[1, 2])
    np.testing.assert_allclose(excitation_at(hull, 0.7, 270.0), MIRROR * hull.excitation[1, 2])
    np.testing.assert_allclose(radiation_at(hull, 0.6)[0], hull.added_mass[1])


def test_between_near_headings_forces_are_interpolated_and_the_circle_closes():
    around = np.array([-150.0, -120, -90, -60, -30, 0, 30, 60, 90, 120, 150, 180])
    force = np.tile(np.arange(12.0)[:, None, None], (1, 4, 6))
    hull = made_up_hull(heading_deg=around, excitation=force)
    np.testing.assert_allclose(excitation_at(hull, 0.5, 45.0), 6.5)
    np.testing.assert_allclose(excitation_at(hull, 0.5, -165.0), 5.5)


def test_what_the_data_do_not_cover_is_refused():
    hull = made_up_hull()
    with pytest.raises(ValueError, match="does not cover 45 degrees, the nearest are 0 and 90"):
        excitation_at(hull, 0.7, 45.0)
    with pytest.raises(ValueError, match=r"wave_frequency_rad_s goes from 0\.3 to 0\.9, not 1"):
        excitation_at(hull, 1.0, 90.0)
    with pytest.raises(ValueError, match=r"frequency_rad_s goes from 0\.4"):
        radiation_at(hull, 0.3)


def ship(**other):
    """A hull without coupling: roll alone, at 0.6 rad/s."""
    added = np.tile(np.diag([1.0, 4, 4, 2, 7, 8]), (3, 1, 1))
    fields = {
        "added_mass": added,
        "damping": added * 0.05,
        "hydrostatic": np.diag([0.0, 0, 5, 0.36 * 5, 9, 0]),
        "inertia_kg_m2": np.diag([3.0, 7, 8]),
        "gravity_centre_m": [0.0, 0, 0],
    }
    return made_up_hull(**(fields | other))


def test_uncoupled_roll_is_the_oscillator_of_the_textbook():
    found = roll_resonance(ship(), 0.07)
    assert 2 * np.pi / found.period_s == pytest.approx(0.6, rel=1e-9)
    assert found.radiation_ratio == pytest.approx(0.05 * 2 / (2 * 0.6 * 5), rel=1e-9)
    assert found.viscous_ratio == pytest.approx(0.07)
    force = excitation_at(ship(), 0.6, 90.0)
    slope = 0.36 / 9.81
    assert found.effective_slope == pytest.approx(abs(force[3]) / (0.36 * 5 * slope), rel=1e-6)


def test_at_resonance_roll_is_effective_slope_over_twice_the_damping():
    found = roll_resonance(ship(), 0.07)
    moved = motions(ship(), 0.6, 90.0, 2 * 0.07 * 0.36 * 5 / 0.6)
    total = 2 * (found.radiation_ratio + found.viscous_ratio)
    assert abs(moved[3]) * 9.81 / 0.36 == pytest.approx(found.effective_slope / total, rel=1e-6)


def test_an_unstable_ship_has_no_roll_period():
    with pytest.raises(ValueError, match="GM must be positive"):
        free_roll(ship(hydrostatic=np.diag([0.0, 0, 5, -1, 9, 0])))


def with_grid(motions, waves):
    """The ship of one roll, with frequencies of motions and of waves."""
    n, random = len(motions), np.random.default_rng(2)
    added = np.tile(np.diag([1.0, 4, 4, 2, 7, 8]), (n, 1, 1))
    force = random.normal(size=(2, len(waves), 6))
    return ship(
        frequency_rad_s=motions, added_mass=added, damping=added / 20,
        wave_frequency_rad_s=waves, excitation=force,
    )  # fmt: skip


AROUND = [0.1, 0.58, 0.62, 2.0]


@pytest.mark.parametrize("grid", [[0.1, 0.2, 0.3], [0.7, 0.8, 0.9], [0.1, 0.45, 0.75, 2.0], [0.5]])
@pytest.mark.parametrize("name", ["frequency_rad_s", "wave_frequency_rad_s"])
def test_a_roll_that_the_frequencies_leave_out_is_refused(name, grid):
    """Outside of the data, or in a gap of them, waves push her otherwise, or not at all."""
    grids = {"frequency_rad_s": AROUND, "wave_frequency_rad_s": AROUND} | {name: grid}
    hull = with_grid(*grids.values())
    words = rf"hull: {name} has none near the free roll, 0\.6 rad/s \(10\.5 s\).*compute"
    for find in (free_roll, lambda hull: with_roll_period(hull, 2 * np.pi / 0.6)):
        with pytest.raises(UncoveredError, match=words):
            find(hull)


def test_a_roll_is_found_where_the_first_guess_is_outside_of_the_data():
    assert 2 * np.pi / free_roll(with_grid([0.58, 0.62], AROUND)).period_s == pytest.approx(0.6)
    assert 2 * np.pi / free_roll(with_grid([0.6], [0.6])).period_s == pytest.approx(0.6)
