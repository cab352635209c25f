"""The page written from the catalogue is fresh, and the benchmark runs."""

import json
import subprocess
import sys
from pathlib import Path

TOOLS = Path(__file__).resolve().parents[2] / "tools"


def run(*arguments):
    return subprocess.run(
        [sys.executable, *arguments], check=True, timeout=100, capture_output=True, text=True
    ).stdout


def test_the_documented_catalogue_is_the_one_in_the_dbc():
    run(TOOLS / "document_catalogue.py", "--check")


def test_benchmark_prints_one_json_object_of_positive_ratios():
    for name, result in json.loads(run(TOOLS / "benchmark_codec.py", "--json")).items():
        assert min(result.values()) > 0, name
