import numpy as np
import pytest
from hulls import made_up_hull
from hypothesis import given
from hypothesis import strategies as st

from utank_hil.base.parameters import ParameterError
from utank_hil.dynamics.hull.hull_data import DEGREES, TO_BODY_AXES

POINT = st.tuples(*[st.floats(-20, 20)] * 3)


def response(hull):
    """Motions about the reference at 0.9 rad/s in the second heading."""
    w = 0.9
    return np.linalg.solve(
        -(w**2) * (hull.mass_matrix + hull.added_mass[2])
        + 1j * w * hull.damping[2]
        + hull.hydrostatic,
        hull.excitation[1, 3],
    )


@given(POINT)
def test_the_ship_moves_the_same_whichever_point_the_data_refer_to(point):
    """A point of a rigid body moves by the origin's motion plus rotation x lever."""
    hull = made_up_hull()
    here, there = response(hull), response(hull.about(point))
    expected = here[:3] + np.cross(here[3:], point)
    np.testing.assert_allclose(there[3:], here[3:], rtol=1e-6, atol=1e-9)
    np.testing.assert_allclose(there[:3], expected, rtol=1e-6, atol=1e-7)


@given(POINT)
def test_there_and_back_changes_nothing(point):
    hull = made_up_hull()
    back = hull.about(point).about([0, 0, 0])
    for name in ("added_mass", "damping", "excitation", "hydrostatic"):
        np.testing.assert_allclose(getattr(back, name), getattr(hull, name), atol=1e-9)


def test_about_the_centre_of_gravity_the_mass_matrix_has_no_coupling():
    hull = made_up_hull().about_gravity_centre()
    assert not np.any(hull.mass_matrix[:3, 3:])
    np.testing.assert_array_equal(hull.mass_matrix[3:, 3:], hull.inertia_kg_m2)
    # mass above the origin: sway acceleration to port heels the ship to starboard, m z
    assert made_up_hull().mass_matrix[3, 1] == pytest.approx(-4.0 * 1.1)


def test_body_axes_of_the_six_degree_model_are_the_same_ship_upside_down():
    """Starboard for port and down for up: a rotation of pi about x turns one into the other."""
    turn = np.diag([1.0, -1.0, -1.0])
    both = np.kron(np.eye(2), turn)
    np.testing.assert_array_equal(np.diag(both), TO_BODY_AXES)
    assert len(DEGREES) == 6


@pytest.mark.parametrize(
    ("field", "value", "words"),
    [
        ("added_mass", np.zeros((2, 6, 6)), r"added_mass has shape \(2, 6, 6\), must"),
        ("damping", np.full((3, 6, 6), np.nan), "damping holds numbers that are not finite"),
        ("frequency_rad_s", [0.4, 0.4, 0.9], "ascend without doubled rows"),
        ("frequency_rad_s", [0.0, 0.4, 0.9], "must be positive"),
        ("heading_deg", [180.0, 90.0], "heading_deg must ascend"),
        ("heading_deg", [0.0, 360.0], "covers the circle twice"),
        ("mass_kg", 0.0, "mass_kg must be positive, got 0"),
        ("inertia_kg_m2", np.diag([1.0, -1.0, 1.0]), "inertia_kg_m2 must be symmetric and pos"),
        ("hydrostatic", np.triu(np.ones((6, 6))), "hydrostatic is not symmetric: halves differ"),
        ("added_mass", np.tile(np.triu(np.ones((6, 6))), (3, 1, 1)), "added_mass is not symm"),
        ("speed_m_s", -1.0, "speed_m_s must be zero or more"),
    ],
)
def test_wrong_data_are_refused_with_their_field(field, value, words):
    with pytest.raises(ParameterError, match=words):
        made_up_hull(**{field: value})


def test_with_speed_radiation_may_couple_one_way():
    made_up_hull(speed_m_s=5.0, added_mass=np.tile(np.triu(np.ones((6, 6))), (3, 1, 1)))


def test_what_is_missing_is_named():
    hull = made_up_hull(inertia_kg_m2=None)
    assert hull.inertia_kg_m2 is None
    assert hull.mass_kg is not None
    with pytest.raises(ParameterError, match="fpso: inertia_kg_m2 is missing"):
        made_up_hull(inertia_kg_m2=None, source="fpso").mass_matrix  # noqa: B018


def test_data_can_not_be_changed_afterwards():
    with pytest.raises(ValueError, match="read-only"):
        made_up_hull().added_mass[0, 0, 0] = 1.0
