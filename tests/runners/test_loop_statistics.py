import json

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from utank_hil.runners import Histogram, LoopStatistics

durations = st.lists(st.integers(0, 100) | st.integers(0, 2**36 - 1), min_size=1, max_size=200)


def histogram_of(values):
    histogram = Histogram()
    for value in values:
        histogram.add(value)
    return histogram


@given(durations, st.sampled_from([0.0, 0.5, 0.9, 0.99, 0.999, 1.0]))
def test_percentile_is_never_below_the_true_one_and_at_most_a_32nd_above(values, fraction):
    true_ns = int(np.percentile(values, 100 * fraction, method="inverted_cdf"))
    found_ns = histogram_of(values).percentile_ns(fraction)
    assert true_ns <= found_ns <= true_ns + true_ns // 32
    assert np.argmax(histogram_of([true_ns]).counts) == np.argmax(histogram_of([found_ns]).counts)


@given(durations)
def test_nothing_is_lost_and_the_longest_of_all_and_of_late_are_exact(values):
    histogram = histogram_of(values)
    assert histogram.counts.sum() == len(values)
    assert histogram.recent_ns == histogram.max_ns == max(values)
    histogram.recent_ns = 0
    histogram.add(values[0])
    assert (histogram.max_ns, histogram.recent_s) == (max(values), values[0] * 1e-9)


def test_values_below_32_are_exact_and_bins_have_no_gaps():
    for value in range(32):
        assert histogram_of([value, 2**40]).percentile_ns(0.5) == value
    used = [int(np.argmax(histogram_of([value]).counts)) for value in range(5000)]
    assert set(np.diff(used)) == {0, 1}


def test_longer_than_the_last_bin_still_counts():
    histogram = histogram_of([1, 2**50])
    assert histogram.counts[-1] == 1
    assert histogram.max_ns == 2**50
    assert len(histogram.counts) == np.argmax(histogram_of([2**36 - 1]).counts) + 1


def test_percentiles_of_nothing_are_zero():
    assert Histogram().summary() == dict.fromkeys(
        ["count", "p50_ns", "p99_ns", "p99_9_ns", "max_ns"], 0
    )


def test_adding_takes_no_memory():
    histogram = Histogram()
    counts = histogram.counts
    for value in range(1000):
        histogram.add(value)
    assert histogram.counts is counts
    with pytest.raises(AttributeError):
        histogram.more = 1


def test_summary_names_every_counter_and_is_json():
    statistics = LoopStatistics(ticks=3, skipped=2)
    statistics.lateness.add(7)
    summary = json.loads(json.dumps(statistics.summary()))
    assert summary["ticks"] == 3
    assert summary["skipped"] == 2
    assert summary["lateness"]["max_ns"] == 7
    assert set(summary) == set(LoopStatistics.__slots__)
