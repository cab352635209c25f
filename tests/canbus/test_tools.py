"""The benchmark runs."""

import json
import subprocess
import sys


def run(*arguments):
    return subprocess.run(
        [sys.executable, "-m", *arguments], check=True, timeout=100, capture_output=True, text=True
    ).stdout


def test_benchmark_prints_one_json_object_of_positive_ratios():
    for name, result in json.loads(run("tools.benchmarks.codec", "--json")).items():
        assert min(result.values()) > 0, name
