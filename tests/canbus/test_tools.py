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


def test_our_codec_is_faster_than_cantools_in_the_same_run():
    for name, result in json.loads(run(TOOLS / "benchmark_codec.py", "--json")).items():
        assert result["encode_ratio"] > 3, name
        assert result["encode_raw_ratio"] > 1.5, name
        assert result["decode_ratio"] > 2, name
