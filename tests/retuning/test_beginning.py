"""When an identification begins, and when it does not."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from retuning_toys import (
    QUIET,
    SAMPLE_TIME_S,
    SETTINGS,
    SUMMARY,
    Rig,
    ToyRetuner,
    candidate_of,
    states,
)

from utank_hil.canbus import RetuningState
from utank_hil.retuning import Refusal
from utank_hil.retuning.adaptive import MOST_TRIES
from utank_hil.retuning.law_exchange import BUSY_NS, RETRY_NS

CHANGE = replace(SETTINGS, change_factor=1.05)
IDLE, IDENTIFY, DESIGN, TRIAL, RETUNED, REFUSED, UNDONE = RetuningState


def test_retune_bit_that_was_set_before_the_start_is_no_order() -> None:
    rig = Rig(ToyRetuner())
    rig.order = QUIET._replace(retune=True)
    rig.run(20)
    assert states(rig) == []


def test_held_button_orders_once() -> None:
    rig = Rig(ToyRetuner(Refusal(("no",))))
    rig.run(5)
    rig.order = QUIET._replace(retune=True)
    rig.run(300)
    assert states(rig).count(IDENTIFY) == 1


def test_forbidden_it_takes_no_order() -> None:
    rig = Rig(ToyRetuner(), replace(SETTINGS, every_s=5.0))
    rig.order = QUIET._replace(forbid_retuning=True)
    rig.run(100)
    rig.order = QUIET._replace(forbid_retuning=True, retune=True)
    rig.run(100)
    assert states(rig) == []


def test_not_in_charge_it_takes_no_order() -> None:
    rig = Rig(ToyRetuner())
    rig.engaged = False
    rig.run(5)
    rig.press(retune=True)
    assert states(rig) == []


def test_on_schedule_it_begins_by_itself_and_again_so_long_after_the_end() -> None:
    rig = Rig(ToyRetuner(Refusal(("no",))), replace(SETTINGS, every_s=60.0))
    rig.run_until(IDENTIFY)
    assert rig.samples * SAMPLE_TIME_S == pytest.approx(60.0, abs=0.5)
    assert rig.reasons == "on schedule"
    rig.run_until(REFUSED)
    ended = rig.samples
    rig.run_until(IDENTIFY)
    assert (rig.samples - ended) * SAMPLE_TIME_S == pytest.approx(60.0, abs=0.5)


def test_a_dead_retuner_is_looked_at_every_ten_minutes_however_short_the_schedule() -> None:
    rig = Rig(ToyRetuner(alive=False), replace(SETTINGS, every_s=0.5))
    rig.run(round(3600 / SAMPLE_TIME_S))
    assert len(states(rig)) == 6
    assert set(states(rig)) == {REFUSED}
    rig.press(retune=True)  # an order is answered soon all the same
    rig.run(round(BUSY_NS * 1e-9 / SAMPLE_TIME_S))
    assert len(states(rig)) == 7


@pytest.mark.parametrize("busy_s", [20.0, 29.0])
def test_a_retuner_that_is_busy_is_waited_for(busy_s: float) -> None:
    """Its heart does not beat while it works on an estimate."""
    retuner = ToyRetuner(None)
    rig = Rig(retuner)
    rig.run(1000)
    for _ in range(2):  # each time anew
        retuner.alive = False
        rig.press(retune=True)
        rig.run(round(busy_s / SAMPLE_TIME_S) - 2)
        assert REFUSED not in states(rig)
        assert rig.controller.state is not IDENTIFY
        retuner.alive = True
        rig.run_until(IDENTIFY)
        rig.order = QUIET._replace(forbid_retuning=True)
        rig.run(3)
        rig.order = QUIET
        rig.run(1000)


@pytest.mark.parametrize("factor", [0.8, 1.25])
def test_changed_ship_is_noticed_and_another_sea_is_not(factor: float) -> None:
    def roll(k: int, u: float) -> float:
        # at first a wave of one period, then twice as high, then of a third of the period
        return float((0.02 if k < 3000 else 0.04) * np.sin((0.1 if k < 6000 else 0.3) * k))

    def stiffness(k: int) -> float:
        return 1.0 if k < 12000 else factor

    rig = Rig(ToyRetuner(Refusal(("no",))), CHANGE, roll, stiffness)
    rig.run(12000)
    assert states(rig) == []
    rig.run_until(IDENTIFY)
    assert "ship has changed" in rig.reasons


def test_order_right_after_arming_waits_for_something_to_compare_with_and_says_so() -> None:
    rig = Rig(ToyRetuner())
    rig.engaged = False
    rig.run(300)
    rig.engaged = True
    rig.press(retune=True)
    assert "begins when the law has been in charge for 30 s" in rig.reasons
    assert rig.controller.state is IDLE
    rig.run_until(IDENTIFY)
    assert (rig.samples - 300) * SAMPLE_TIME_S == pytest.approx(30.0, abs=0.5)


@pytest.mark.parametrize("how", ["forbidden", "disarmed", "undo"])
def test_order_that_waits_can_be_withdrawn(how: str) -> None:
    rig = Rig(ToyRetuner())
    rig.run(5)
    rig.press(retune=True)
    rig.order = QUIET._replace(forbid_retuning=how == "forbidden", undo=how == "undo")
    rig.engaged = how != "disarmed"
    rig.run(2)
    rig.order, rig.engaged = QUIET, True
    rig.run(500)
    assert states(rig) == [IDLE]


def test_on_schedule_it_waits_for_something_to_compare_with_too() -> None:
    worse: list[int] = []
    rig = Rig(
        ToyRetuner(candidate_of(9e4)),
        replace(SETTINGS, every_s=20.0),
        roll=lambda k, u: (0.25 if worse else 0.02) * np.sin(0.1 * k),
    )
    rig.engaged = False
    rig.run(300)
    rig.engaged = True
    rig.run_until(TRIAL)
    worse.append(1)
    rig.run_until(REFUSED)
    assert "roll rose" in rig.reasons


def test_interruption_counts_anew_what_the_trial_is_compared_with() -> None:
    rig = Rig(ToyRetuner())
    rig.run(140)
    rig.engaged = False
    rig.run(1)
    rig.engaged = True
    rig.press(retune=True)
    rig.run(100)
    assert rig.controller.state is IDLE


def changing(rig_flags: list[int]) -> Callable[[int, float], float]:
    """A wave; one roll above the limit for each flag."""

    def roll(k: int, u: float) -> float:
        if rig_flags and rig_flags[0] == 1:
            rig_flags.pop(0)
            return 0.31
        return float(0.02 * np.sin(0.1 * k))

    return roll


def stiffer(k: int) -> float:
    """A ship that is loaded after 40 minutes."""
    return 1.0 if k < 12000 else 1.25


CANDIDATE = replace(candidate_of(9e4), summary=replace(SUMMARY, stiffness_nm_rad=1.25e9))
"""For the ship after it was loaded."""


@pytest.mark.slow
def test_change_is_not_forgotten_after_a_refusal_and_tried_a_bounded_number_of_times() -> None:
    retuner = ToyRetuner(Refusal(("no",)))
    rig = Rig(retuner, CHANGE, changing([]), stiffer)
    rig.run(40000)
    begun = [event for event in rig.controller.events if event.state is IDENTIFY]
    assert len(begun) == MOST_TRIES
    assert all("ship has changed" in event.reasons[0] for event in begun)
    gaps_ns = np.diff([event.time_ns for event in begun])
    assert gaps_ns.min() >= RETRY_NS
    assert f"refused {MOST_TRIES} times" in rig.reasons


@pytest.mark.slow
def test_identifications_that_told_nothing_of_the_ship_do_not_count() -> None:
    flags: list[int] = []
    rig = Rig(ToyRetuner(CANDIDATE), CHANGE, changing(flags), stiffer)
    for _ in range(MOST_TRIES + 1):  # rolls above the limit, each time
        rig.run_until(IDENTIFY, 20000)
        flags[:] = [1]
        rig.run_until(REFUSED)
    rig.run_until(RETUNED, 10000)


@pytest.mark.evidence
def test_change_that_went_away_leaves_the_next_one_all_its_tries() -> None:
    def stiffness(k: int) -> float:
        # 12,000 samples are 40 minutes
        return 1.25 if k in range(12000, 14500) or k > 40000 else 1.0

    rig = Rig(ToyRetuner(Refusal(("no",))), CHANGE, stiffness=stiffness)
    rig.run(40000)
    before = states(rig).count(IDENTIFY)
    assert 0 < before < MOST_TRIES
    rig.run(30000)
    assert states(rig).count(IDENTIFY) == before + MOST_TRIES


def test_change_is_tried_again_after_a_refusal_and_found() -> None:
    flags: list[int] = [0]
    retuner = ToyRetuner(CANDIDATE)
    rig = Rig(retuner, CHANGE, changing(flags), stiffer)
    rig.run_until(IDENTIFY, 20000)
    flags[:] = [1]
    rig.run_until(REFUSED)
    rig.run_until(RETUNED, 10000)
    assert states(rig) == [IDENTIFY, REFUSED, IDENTIFY, DESIGN, TRIAL, RETUNED]


@pytest.mark.parametrize("how", ["forbidden", "disarmed"])
def test_change_is_not_forgotten_when_an_identification_is_given_up(how: str) -> None:
    rig = Rig(ToyRetuner(CANDIDATE), CHANGE, changing([]), stiffer)
    rig.run_until(IDENTIFY, 20000)
    rig.order = QUIET._replace(forbid_retuning=how == "forbidden")
    rig.engaged = how != "disarmed"
    rig.run(3)
    rig.order, rig.engaged = QUIET, True
    rig.run_until(RETUNED, 10000)
    assert states(rig) == [IDENTIFY, IDLE, IDENTIFY, DESIGN, TRIAL, RETUNED]


def test_dead_retuner_gets_no_pulses_until_it_lives_again() -> None:
    retuner = ToyRetuner(None, alive=False)
    rig = Rig(retuner, replace(SETTINGS, every_s=60.0))
    rig.run(1000)
    assert set(states(rig)) == {REFUSED}
    assert "no sign of life" in rig.reasons
    rig.press(retune=True)
    rig.run(round(BUSY_NS * 1e-9 / SAMPLE_TIME_S))
    assert "ordered by the operator, but" in rig.reasons
    assert rig.commands == rig.answers_of_the_first_law()
    retuner.alive = True
    rig.run_until(IDENTIFY)
