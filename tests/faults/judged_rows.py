"""The campaign's rows, an outcome that passes, and its verdict."""

from dataclasses import fields, replace
from pathlib import Path
from typing import Any

from firmware_sim.fault_campaign.campaign import Campaign
from firmware_sim.fault_campaign.trial import FLAGS, Outcome, Rolls, Said, Times
from firmware_sim.fault_campaign.verdict import Result, judged
from utank_hil.configuration import load_config

CAMPAIGN = load_config(Path("configs/faults/campaign.yaml"), Campaign)
ROWS = {row.id: row for row in CAMPAIGN.rows}

GOOD = Outcome(
    "both-signs-flipped", 1, Times(found=500.0, zero=520.0), mode="FAULT", code="MOTION_SIGN_FLIP",
    was_active=True, said=Said("FAULT MOTION_SIGN_FLIP", ("MOTION_SIGN_FLIP",)),
    rolls=Rolls(1.0, 1.0, 60.0), wire="differs",
)  # fmt: skip


def changed(outcome: Outcome, **values: Any) -> Outcome:
    """An outcome with other values of its fields, or of the fields of its parts."""
    for part in ("times", "said", "excess", "rolls"):
        whole = getattr(outcome, part)
        inner = {each.name: values.pop(each.name) for each in fields(whole) if each.name in values}
        outcome = replace(outcome, **{part: replace(whole, **inner)})
    return replace(outcome, **values)


def verdict(row: str, *outcomes: Outcome) -> Result:
    return judged(CAMPAIGN, ROWS[row], outcomes)


def said(row: str, outcome: Outcome) -> Outcome:
    """What a controller with this outcome says on the bus."""
    expect = ROWS[row].expect
    alarms = [outcome.code] if outcome.times.found is not None else []
    if outcome.times.alarm is not None:
        alarms += expect.codes
    flags = ("alarm", "degraded") if outcome.times.halved is not None else ()
    also = [name for name in expect.also if name not in FLAGS]
    return replace(outcome, said=Said(f"{outcome.mode} {outcome.code}", (*alarms, *also), flags))


def spoken(row: str, *outcomes: Outcome) -> Result:
    return verdict(row, *(said(row, each) for each in outcomes))
