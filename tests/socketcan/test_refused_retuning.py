"""A retuning that is refused on a real SocketCAN interface."""

from pathlib import Path

import pytest
from busy_machine import first_that_can_be_judged
from retuning_story import (
    IDENTIFY,
    IDLE,
    REFUSED,
    SHORT,
    Story,
    assert_nothing_was_disturbed,
    in_charge,
    tell_story,
)

pytestmark = [pytest.mark.socketcan, pytest.mark.timeout(1800)]


def test_refusal_is_shown_with_its_reason_and_the_old_law_goes_on(tmp_path: Path) -> None:
    def attempt(folder: Path) -> Story:
        # she rolls more than identification is allowed in
        return tell_story(folder, SHORT | {"roll_limit_rad": 0.01}, REFUSED)

    refused = first_that_can_be_judged(attempt, tmp_path)
    assert refused.states == [IDLE, IDENTIFY, REFUSED], refused.reasons
    assert "above the limit" in refused.reasons["REFUSED"]
    assert_nothing_was_disturbed(refused)
    since_s = min(f.time_s for f in refused.of("CTRL_STATUS") if f.signals["retuning"] == REFUSED)
    after = {f.signals["pressure_pa"] for f in in_charge(refused) if f.time_s > since_s + 0.5}
    assert len(after) > 10
