"""The symbolic derivation, the errata's table and `tank_wrench` say the same."""

import json
from pathlib import Path

import pytest

from tools.thesis.derive_tank_forces import derive, errata, worst_difference

pytestmark = pytest.mark.slow

ROWS = Path("docs/evidence/thesis_derivation.json")


@pytest.fixture(scope="module")
def derivation():
    return derive()


def test_errata_are_the_terms_that_the_derivation_finds(derivation):
    rows = errata(*derivation)
    assert len(rows) > 40
    assert rows == json.loads(ROWS.read_text())["result"]["errata"]


def test_derivation_agrees_with_tank_wrench(derivation):
    assert worst_difference(*derivation, states=50) < 1e-12
