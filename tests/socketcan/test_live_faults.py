"""The live rows, with the deployed programs on a real bus."""

import pytest
from two_processes import CHANNEL

from firmware_sim.live_faults.rows import ROWS, run_live

# with the shipped limits: on a machine that holds processes up the controller never gets in charge
pytestmark = [pytest.mark.socketcan, pytest.mark.evidence, pytest.mark.timeout(900)]


@pytest.mark.parametrize("name", ROWS)
def test_live_row_is_passed(name):
    assert run_live(ROWS[name], CHANNEL)[0] == []
