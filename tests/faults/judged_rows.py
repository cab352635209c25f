"""The campaign's rows, an outcome that passes, and its verdict."""

from dataclasses import replace
from pathlib import Path

from firmware_sim.fault_campaign.campaign import Campaign
from firmware_sim.fault_campaign.trial import Outcome
from firmware_sim.fault_campaign.verdict import Result, judged
from utank_hil.configuration import load_config

CAMPAIGN = load_config(Path("configs/faults/campaign.yaml"), Campaign)
ROWS = {row.id: row for row in CAMPAIGN.rows}

GOOD = Outcome(
    "roll-sign-flipped", 1, found_ms=500.0, zero_ms=520.0, mode="FAULT", code="MOTION_SIGN_FLIP",
    was_active=True, roll_variance=1.0, passive_variance=1.0, window_s=60.0, wire="differs",
    shown="FAULT MOTION_SIGN_FLIP", told=("MOTION_SIGN_FLIP",),
)  # fmt: skip


def verdict(row: str, *outcomes: Outcome) -> Result:
    return judged(ROWS[row], CAMPAIGN.setups[ROWS[row].setup], "", outcomes)


def said(row: str, outcome: Outcome) -> Outcome:
    """What a controller with this outcome says on the bus."""
    told = [outcome.code] if outcome.found_ms is not None else []
    if outcome.alarm_ms is not None:
        told += ROWS[row].codes
    return replace(
        outcome,
        shown=f"{outcome.mode} {outcome.code}",
        told=(*told, *ROWS[row].alarms),
        flags=("alarm", "degraded") if outcome.halved_ms is not None else (),
    )


def spoken(row: str, *outcomes: Outcome) -> Result:
    return verdict(row, *(said(row, each) for each in outcomes))
