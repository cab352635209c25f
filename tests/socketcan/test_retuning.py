"""A controller that retunes itself on a real SocketCAN interface."""

import numpy as np
import pytest
from busy_machine import first_that_can_be_judged
from retuning_story import (
    DESIGN,
    IDENTIFY,
    IDLE,
    REFUSED,
    RETUNED,
    SHORT,
    TRIAL,
    UNJUDGED,
    assert_nothing_was_disturbed,
    assert_ship_is_found,
    in_charge,
    tell_story,
)

pytestmark = [pytest.mark.socketcan, pytest.mark.evidence, pytest.mark.timeout(1800)]

LATE_S = 0.035  # from one command to the next: more than a tick missed


@pytest.fixture(scope="module")
def retuned(tmp_path_factory):
    def attempt(folder):
        return tell_story(folder, SHORT, RETUNED)

    return first_that_can_be_judged(attempt, tmp_path_factory.mktemp("retuned"))


def command_gaps(story, state):
    """Seconds from command to command while the bus showed a state of retuning."""
    told = [f.time_s for f in story.of("CTRL_STATUS") if f.signals["retuning"] == state]
    times = [f.time_s for f in story.of("PUMP_CMD") if told[0] <= f.time_s <= told[-1]]
    return np.diff(times)


def test_bus_shows_identification_design_trial_and_the_retuned_law(retuned):
    assert retuned.states == [IDLE, IDENTIFY, DESIGN, TRIAL, RETUNED], retuned.reasons
    assert retuned.reasons["IDENTIFY"] == "ordered by the operator"


def test_ship_is_found_over_the_bus(retuned):
    assert_ship_is_found(retuned)


def test_pulses_and_the_new_law_reach_the_pump(retuned):
    shown = {(f.time_s, f.signals["retuning"]) for f in retuned.of("CTRL_STATUS")}
    for state in (IDENTIFY, TRIAL, RETUNED):
        times = [time_s for time_s, told in shown if told == state]
        pressures = [
            abs(f.signals["pressure_pa"])
            for f in retuned.of("SENSOR_PUMP")
            if min(times) <= f.time_s <= max(times)
        ]
        print(f"{state.name}: {max(pressures) / 1e3:.1f} kPa")
        assert max(pressures) > 5e3


def test_swap_makes_no_step_and_disturbs_nothing(retuned):
    assert_nothing_was_disturbed(retuned)


def test_refusal_is_shown_with_its_reason_and_the_old_law_goes_on(tmp_path):
    def attempt(folder):
        # she rolls more than identification is allowed in
        return tell_story(folder, SHORT | {"roll_limit_rad": 0.01}, REFUSED)

    refused = first_that_can_be_judged(attempt, tmp_path)
    assert refused.states == [IDLE, IDENTIFY, REFUSED], refused.reasons
    assert "above the limit" in refused.reasons["REFUSED"]
    assert_nothing_was_disturbed(refused)
    since_s = min(f.time_s for f in refused.of("CTRL_STATUS") if f.signals["retuning"] == REFUSED)
    after = {f.signals["pressure_pa"] for f in in_charge(refused) if f.time_s > since_s + 0.5}
    assert len(after) > 10


@pytest.mark.timeout(3600)  # twelve minutes in which no process is held up for 100 ms
def test_shipped_law_of_order_200_is_retuned_from_500_s_of_data(tmp_path):
    def attempt(folder):
        return tell_story(folder, UNJUDGED, RETUNED, "adaptive_gpc.yaml", 500.0 + 120.0)

    story = first_that_can_be_judged(attempt, tmp_path)
    assert story.states == [IDLE, IDENTIFY, DESIGN, TRIAL, RETUNED], story.reasons
    assert_ship_is_found(story, within=0.02)
    assert_nothing_was_disturbed(story)
    # while another process identifies and designs, commands come as they did before
    for state in (IDENTIFY, DESIGN, TRIAL):
        gaps = command_gaps(story, state)
        print(f"{state.name}: {len(gaps)} commands, {np.sum(gaps > LATE_S)} late")
        assert np.mean(gaps > LATE_S) < 0.05
