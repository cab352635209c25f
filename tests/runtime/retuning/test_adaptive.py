from dataclasses import replace

import numpy as np
import pytest
from retuning_toys import (
    QUIET,
    SAMPLE_TIME_S,
    SETTINGS,
    Rig,
    ToyRetuner,
    candidate_of,
    law_of,
)

from utank_hil.canbus import RetuningState
from utank_hil.runtime.retuning import Refusal
from utank_hil.runtime.retuning.adaptive import FADE_SAMPLES, FILL_AT_ONCE, FILL_SAMPLES

IDLE, IDENTIFY, DESIGN, TRIAL, RETUNED, REFUSED, UNDONE = RetuningState


def states(rig: Rig) -> list[RetuningState]:
    return [event.state for event in rig.controller.events]


def test_without_an_order_it_is_the_law_it_was_given() -> None:
    rig, alone = Rig(ToyRetuner()), law_of(1e5).controller()
    rig.run(200)
    expected, applied = [], 0.0
    for k in range(200):
        if k:
            alone.applied(np.array([applied]))
        applied = float(alone.step(np.array([0.02 * np.sin(0.1 * k)]))[0])
        expected.append(applied)
    assert rig.commands == expected
    assert states(rig) == []


def test_ordered_identified_designed_tried_and_kept() -> None:
    rig = Rig(ToyRetuner(candidate_of(9e4), looks=3))
    rig.run(300)
    rig.press(retune=True)
    rig.run_until(RETUNED)
    assert states(rig) == [IDENTIFY, DESIGN, TRIAL, RETUNED]
    rig.run(50)
    assert states(rig)[-1] is RETUNED


def test_pulses_go_out_alone_and_their_record_holds_what_left_and_what_was_seen() -> None:
    retuner = ToyRetuner()
    rig = Rig(retuner)
    rig.run(100)
    rig.press(retune=True)
    rig.run_until(DESIGN)
    count = len(rig.pulses_pa)
    (record,) = retuner.records
    begin = 100
    assert rig.commands[begin : begin + count] == list(rig.pulses_pa)
    # row k: what left since the sample before, and the outputs of that sample
    assert record.shape == (count, 2)
    assert record[:, 0] == pytest.approx(rig.commands[begin - 1 : begin + count - 1])
    seen = [0.02 * np.sin(0.1 * k) for k in range(begin, begin + count)]
    assert record[:, 1] == pytest.approx(seen)


def test_pulses_can_be_added_to_the_law() -> None:
    rig = Rig(ToyRetuner(), replace(SETTINGS, alone=False), roll=lambda k, u: 0.01)
    rig.run(100)
    steady = rig.commands[-1]
    rig.press(retune=True)
    assert rig.commands[100] == pytest.approx(steady + rig.pulses_pa[0], rel=1e-6)


def test_samples_that_were_not_measured_are_gaps_in_the_record() -> None:
    retuner = ToyRetuner()
    rig = Rig(retuner)
    rig.press(retune=True)
    rig.run(10)
    rig.fresh = False
    rig.run(5)
    rig.fresh = True
    rig.run_until(DESIGN)
    (record,) = retuner.records
    assert np.flatnonzero(np.isnan(record[:, 1])).tolist() == list(range(13, 18))
    assert np.isfinite(record[:, 0]).all()


def test_new_law_takes_over_without_a_bump_from_a_memory_filled_with_the_past() -> None:
    # the candidate is the law in charge itself: nobody may notice that it was exchanged
    rig = Rig(ToyRetuner(candidate_of(1e5)))
    rig.run(1200)
    rig.press(retune=True)
    rig.run_until(TRIAL)
    at = rig.samples
    rig.run(100)
    untouched = law_of(1e5).controller()
    expected = []
    for k in range(rig.samples):
        if k:
            untouched.applied(np.array([rig.commands[k - 1]]))
        expected.append(float(untouched.step(np.array([0.02 * np.sin(0.1 * k)]))[0]))
    assert rig.commands[at:] == pytest.approx(expected[at:], rel=1e-9)


def test_memory_is_filled_a_piece_at_a_sample_and_the_answers_are_faded_over() -> None:
    rig = Rig(ToyRetuner(candidate_of(2e5)), roll=lambda k, u: 0.01)
    rig.run(2 * FILL_SAMPLES)
    steady = rig.commands[-1]
    rig.press(retune=True)
    rig.run_until(DESIGN)
    begin = rig.samples
    rig.run_until(TRIAL)
    assert rig.samples - begin == pytest.approx(FILL_SAMPLES / FILL_AT_ONCE, rel=0.1)
    at = rig.samples - 1
    rig.run(4 * FADE_SAMPLES)
    steps = np.abs(np.diff(rig.commands[at - 1 : at + 4 * FADE_SAMPLES]))
    change = abs(rig.commands[-1] - steady)
    assert change > 0.5 * abs(steady)
    assert steps.max() < 4 * change / FADE_SAMPLES


def test_refusal_is_passed_on_and_changes_nothing() -> None:
    rig = Rig(ToyRetuner(Refusal(("roll period 2.00 s is outside",))))
    rig.run(300)
    rig.press(retune=True)
    rig.run_until(REFUSED)
    rig.run(30)
    assert rig.reasons == "roll period 2.00 s is outside"
    untouched = law_of(1e5).controller()
    for k in range(rig.samples):
        if k:
            untouched.applied(np.array([rig.commands[k - 1]]))
        answer = float(untouched.step(np.array([0.02 * np.sin(0.1 * k)]))[0])
    assert rig.commands[-1] == answer


def test_no_answer_in_time_is_a_refusal() -> None:
    rig = Rig(ToyRetuner(None))
    rig.press(retune=True)
    rig.run_until(DESIGN)
    begin = rig.samples
    rig.run_until(REFUSED)
    assert (rig.samples - begin) * SAMPLE_TIME_S == pytest.approx(4.0, abs=0.5)
    assert "hangs or is dead" in rig.reasons


@pytest.mark.parametrize(
    ("candidate", "word"),
    [
        (candidate_of(1e8), "gains"),
        (candidate_of(1e5, outputs=2), "signals"),
        (
            replace(candidate_of(1e5), law=replace(law_of(1e5), sample_time_s=0.1)),
            "sample time",
        ),
    ],
)
def test_candidate_is_looked_at_once_more_before_it_is_taken(candidate, word: str) -> None:
    rig = Rig(ToyRetuner(candidate))
    rig.press(retune=True)
    rig.run_until(REFUSED)
    assert word in rig.reasons


def test_law_that_rolls_more_is_taken_back_at_the_end_of_its_trial() -> None:
    worse: list[int] = []
    rig = Rig(
        ToyRetuner(candidate_of(9e4)),
        roll=lambda k, u: (0.028 if worse else 0.02) * np.sin(0.1 * k),
    )
    rig.run(300)
    rig.press(retune=True)
    rig.run_until(TRIAL)
    worse.append(1)
    begin = rig.samples
    rig.run_until(REFUSED)
    assert (rig.samples - begin) * SAMPLE_TIME_S == pytest.approx(SETTINGS.trial_s, abs=0.5)
    assert "roll rose" in rig.reasons


def test_law_that_rolls_much_more_is_taken_back_before() -> None:
    worse: list[int] = []
    rig = Rig(
        ToyRetuner(candidate_of(9e4)),
        roll=lambda k, u: (0.2 if worse else 0.02) * np.sin(0.1 * k),
    )
    rig.run(300)
    rig.press(retune=True)
    rig.run_until(TRIAL)
    worse.append(1)
    begin = rig.samples
    rig.run_until(REFUSED)
    assert (rig.samples - begin) * SAMPLE_TIME_S < 0.85 * SETTINGS.trial_s


def test_law_that_takes_much_more_pressure_is_taken_back() -> None:
    rig = Rig(ToyRetuner(candidate_of(1e6)))
    rig.run(300)
    rig.press(retune=True)
    rig.run_until(REFUSED)
    assert "pressure rose" in rig.reasons
    rig.run(4 * FADE_SAMPLES)
    assert max(map(abs, rig.commands[-30:])) < 1.2 * max(map(abs, rig.commands[:300]))


@pytest.mark.parametrize("moment", [TRIAL, RETUNED])
def test_operator_takes_the_old_law_back(moment: RetuningState) -> None:
    rig = Rig(ToyRetuner(candidate_of(1.5e5)))
    rig.run(300)
    before = max(map(abs, rig.commands))
    rig.press(retune=True)
    rig.run_until(moment)
    rig.run(3 * FADE_SAMPLES)
    assert max(map(abs, rig.commands[-30:])) > 1.2 * before
    rig.press(undo=True)
    assert rig.controller.state is UNDONE
    rig.run(100)
    assert max(map(abs, rig.commands[-63:])) == pytest.approx(before, rel=0.02)
    rig.press(undo=True)  # there is nothing more to undo
    assert states(rig)[-1] is UNDONE
    assert states(rig).count(UNDONE) == 1


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


@pytest.mark.parametrize("moment", [IDENTIFY, DESIGN, TRIAL])
@pytest.mark.parametrize("how", ["forbidden", "disarmed"])
def test_forbidden_or_disarmed_it_gives_up_and_goes_back(moment: RetuningState, how: str) -> None:
    rig = Rig(ToyRetuner(candidate_of(1.5e5), looks=5))
    rig.run(300)
    rig.press(retune=True)
    rig.run_until(moment)
    if how == "forbidden":
        rig.order = QUIET._replace(forbid_retuning=True)
    else:
        rig.engaged = False
    rig.run(2)
    assert rig.controller.state is IDLE
    rig.run(100)
    untouched = law_of(1e5).controller()
    for k in range(rig.samples):
        if k:
            untouched.applied(np.array([rig.commands[k - 1]]))
        answer = float(untouched.step(np.array([0.02 * np.sin(0.1 * k)]))[0])
    assert rig.commands[-1] == pytest.approx(answer, rel=1e-9)


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


def test_changed_ship_is_noticed_and_a_higher_sea_is_not() -> None:
    def roll(k: int, u: float) -> float:
        # at first a wave of one period, then twice as high, then of half the period
        return float((0.02 if k < 6000 else 0.04) * np.sin((0.1 if k < 12000 else 0.3) * k))

    rig = Rig(ToyRetuner(Refusal(("no",))), replace(SETTINGS, change_factor=1.5), roll)
    rig.run(12000)
    assert states(rig) == []
    rig.run_until(IDENTIFY)
    assert "ship has changed" in rig.reasons


def test_identification_is_given_up_when_the_roll_is_above_its_limit() -> None:
    rig = Rig(ToyRetuner(), roll=lambda k, u: 0.4 if k == 320 else 0.01)
    rig.run(300)
    rig.press(retune=True)
    rig.run_until(REFUSED)
    assert "roll is above" in rig.reasons
    assert rig.samples < 325


def test_reset_while_on_trial_takes_the_law_back() -> None:
    rig = Rig(ToyRetuner(candidate_of(1.5e5)), roll=lambda k, u: 0.01)
    rig.run(300)
    steady = rig.commands[-1]
    rig.press(retune=True)
    rig.run_until(TRIAL)
    rig.controller.reset()
    rig.run(100)
    assert rig.commands[-1] == pytest.approx(steady, rel=1e-3)
