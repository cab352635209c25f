"""What the benchmark of retuning computes beside what it runs."""

import pytest

from tools.benchmarks.retuning import interval


def test_interval_of_a_count_is_that_of_the_tables() -> None:
    # exact Poisson limits, as in any table of them
    assert interval(0) == pytest.approx((0.0, 3.689), abs=1e-3)
    assert interval(10) == pytest.approx((4.795, 18.390), abs=1e-3)


def test_wrong_arguments_are_refused_with_the_remedy(tool) -> None:
    done = tool("benchmarks.retuning", "--turns", "0")
    assert done.code == 2
    assert "--turns must be 2 or more" in done.errors
