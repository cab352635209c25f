"""The campaign's rows, an outcome that passes, and its verdict."""

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

from firmware_sim.fault_campaign.campaign import Campaign
from firmware_sim.fault_campaign.trial import FLAGS, Outcome
from firmware_sim.fault_campaign.verdict import judged
from utank_hil.configuration import load_config

CAMPAIGN = load_config(Path("configs/faults/campaign.yaml"), Campaign)
ROWS = {row.id: row for row in CAMPAIGN.rows}

GOOD = Outcome(
    "both-signs-flipped", 1, found=500.0, zero=520.0, mode="FAULT", code="MOTION_SIGN_FLIP",
    was_active=True, status="FAULT MOTION_SIGN_FLIP", alarms=("MOTION_SIGN_FLIP",),
    variance=1.0, passive_variance=1.0, window_s=60.0, wire="differs",
)  # fmt: skip


def verdict(row, *outcomes):
    told = judged(CAMPAIGN, ROWS[row], outcomes)
    return SimpleNamespace(**told, passed=told["verdict"] == "pass", told=told, outcomes=outcomes)


def said(row, outcome):
    """What a controller with this outcome says on the bus."""
    expect = ROWS[row].expect
    alarms = [outcome.code] if outcome.found is not None else []
    if outcome.alarm is not None:
        alarms += expect.codes
    flags = ("alarm", "degraded") if outcome.halved is not None else ()
    also = [name for name in expect.also if name not in FLAGS]
    status = f"{outcome.mode} {outcome.code}"
    return replace(outcome, status=status, alarms=(*alarms, *also), flags=flags)


def spoken(row, *outcomes):
    return verdict(row, *(said(row, each) for each in outcomes))
