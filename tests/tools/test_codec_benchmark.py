"""The benchmark of the codec runs."""

import pytest


@pytest.mark.evidence
def test_benchmark_prints_one_json_object_of_positive_ratios(tool):
    for name, result in tool("benchmarks.codec", "--json").found.items():
        assert min(result.values()) > 0, name
