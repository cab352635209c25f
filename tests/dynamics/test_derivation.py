"""The symbolic derivation, the errata's table and `tank_wrench` say the same."""

import importlib.util
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
SCRIPT = ROOT / "tools" / "derive_tank_forces.py"


@pytest.mark.slow
def test_errata_hold_every_term_that_the_derivation_finds():
    done = subprocess.run(
        [sys.executable, SCRIPT, "--errata"], capture_output=True, text=True, check=True
    )
    rows = done.stdout.splitlines()
    assert len(rows) > 40
    errata = (ROOT / "docs" / "errata.md").read_text().splitlines()
    assert [row for row in rows if row not in errata] == []


@pytest.mark.slow
def test_derivation_agrees_with_tank_wrench():
    spec = importlib.util.spec_from_file_location("derive_tank_forces", SCRIPT)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    assert module.worst_difference(*module.derive(), states=50) < 1e-12
