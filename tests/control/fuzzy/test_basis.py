"""Fuzzy basis: sums to one, equals the rules multiplied out."""

import itertools

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from utank_hil.control.fuzzy.law import FuzzyBasis

RANGES = (np.pi / 6, np.pi / 6, 1.0, 1.0)
inputs = st.lists(st.floats(allow_nan=False, allow_infinity=False), min_size=4, max_size=4)


@given(inputs.map(np.array))
def test_basis_sums_to_one_and_is_never_negative_for_any_finite_input(x):
    xi = FuzzyBasis(RANGES)(x)
    assert xi.shape == (81,)
    assert xi.sum() == pytest.approx(1.0, abs=1e-12)
    assert (xi >= 0).all()


@given(st.lists(st.floats(-3, 3), min_size=4, max_size=4).map(np.array))
def test_basis_is_the_81_rules_multiplied_out(x):
    width = 1 / np.sqrt(8 * np.log(2))  # neighbours cross at one half

    def membership(value, centre):
        if (centre < 0 and value < centre) or (centre > 0 and value > centre):
            return 1.0
        return np.exp(-0.5 * ((value - centre) / width) ** 2)

    rules = [
        np.prod([membership(v / r, c) for v, r, c in zip(x, RANGES, centres, strict=True)])
        for centres in itertools.product((-1, 0, 1), repeat=4)
    ]
    expected = np.array(rules) / np.sum(rules)
    np.testing.assert_allclose(FuzzyBasis(RANGES)(x), expected, rtol=1e-9, atol=1e-15)


@given(inputs.map(np.array))
def test_square_is_the_squared_length_of_the_basis(x):
    basis = FuzzyBasis(RANGES)
    assert basis.square(x) == pytest.approx(float(basis(x) @ basis(x)), rel=1e-12)


def test_each_rule_leads_at_its_own_centre():
    basis = FuzzyBasis((0.5, 2.0))
    for number, centre in enumerate(itertools.product((-0.5, 0.0, 0.5), (-2.0, 0.0, 2.0))):
        assert basis(np.array(centre)).argmax() == number


@pytest.mark.parametrize("ranges", [(), (1.0, 0.0), (np.inf,)])
def test_ranges_that_make_no_sets_are_refused(ranges):
    with pytest.raises(ValueError, match="ranges"):
        FuzzyBasis(ranges)
