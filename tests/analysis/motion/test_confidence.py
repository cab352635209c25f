"""Confidence intervals: against a table, and as often right as they promise."""

import numpy as np
import pytest

from utank_hil.analysis.motion.statistics import clustered_interval, mean_interval


def test_half_width_is_that_of_the_table_of_student_s_distribution():
    # t for 95 %, four degrees of freedom, from any textbook: 2.776
    found = mean_interval([1.0, 2.0, 3.0, 4.0, 5.0])
    assert found.mean == 3.0
    assert found.half_width == pytest.approx(2.776 * np.sqrt(2.5 / 5), rel=1e-3)


def test_interval_holds_the_true_mean_as_often_as_it_says():
    draws = np.random.default_rng(0).normal(7.0, 3.0, size=(4000, 4))
    hits = sum(abs(mean - 7.0) <= half for mean, half in map(mean_interval, draws))
    assert hits / 4000 == pytest.approx(0.95, abs=0.015)


def test_one_value_is_refused():
    with pytest.raises(ValueError, match="two or more values, got 1"):
        mean_interval([1.0])


def test_values_of_one_unit_count_once():
    """Each unit twice: the interval is that of the units alone, not narrower."""
    values = np.array([1.0, 2.0, 3.0, 4.0, 5.0])
    twice = clustered_interval([*values, *values], [*"abcde", *"abcde"])
    assert twice == pytest.approx(mean_interval(values))
    assert clustered_interval(values, [-2, -1, 0, 1, 2]) == pytest.approx(mean_interval(values))
    with pytest.raises(ValueError, match="two or more values, got 1"):
        clustered_interval(values, [1] * 5)
