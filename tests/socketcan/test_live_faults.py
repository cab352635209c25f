"""The live rows of the fault campaign, with the deployed programs on a real bus."""

from pathlib import Path

import pytest
from two_processes import CHANNEL

from firmware_sim.fault_campaign.campaign import Campaign
from firmware_sim.fault_campaign.live import run_live
from utank_hil.configuration import load_config

# with the shipped limits: on a machine that holds processes up the controller never gets in charge
pytestmark = [pytest.mark.socketcan, pytest.mark.evidence, pytest.mark.timeout(900)]

CAMPAIGN = load_config(Path("configs/faults/campaign.yaml"), Campaign)
ROWS = {row.id: row for row in CAMPAIGN.live if row.does}


@pytest.mark.parametrize("name", ROWS)
def test_live_row_is_passed(name: str) -> None:
    told = run_live(ROWS[name], CHANNEL, "")
    assert not told["problems"]
    assert told["verdict"] == "pass"
