from dataclasses import replace

import numpy as np
import pytest
from retuning_toys import (
    SAMPLE_TIME_S,
    SETTINGS,
    SHIP,
    SUMMARY,
    Rig,
    ToyRetuner,
    candidate_of,
    law_of,
    states,
)

from utank_hil.base.arrays import FloatArray
from utank_hil.canbus import RetuningState, Verdict
from utank_hil.retuning import (
    Candidate,
    MotionEstimate,
    Refusal,
    law_exchange,
)
from utank_hil.retuning.law_bank import FADE_SAMPLES, WARM_UP_CHUNK, WARM_UP_SAMPLES
from utank_hil.retuning.law_exchange import TRIAL_PATIENCE

IDLE, IDENTIFY, DESIGN, TRIAL, RETUNED, REFUSED, UNDONE = RetuningState


KEPT = WARM_UP_SAMPLES + WARM_UP_CHUNK


def candidate_with(**gains: FloatArray) -> Candidate:
    """A candidate with other gains than it should have."""
    candidate = candidate_of(1e5)
    return replace(candidate, law=replace(candidate.law, **gains))


def test_without_an_order_it_is_the_law_it_was_given() -> None:
    rig = Rig(ToyRetuner())
    rig.run(200)
    assert rig.commands == rig.answers_of_the_first_law()
    assert states(rig) == []


def test_ordered_identified_designed_tried_and_kept() -> None:
    rig = Rig(ToyRetuner(candidate_of(9e4), looks=3))
    assert not rig.controller.excused
    rig.retune_until(IDENTIFY)
    assert rig.controller.excused  # the pulses roll the ship
    rig.run_until(RETUNED)
    assert not rig.controller.excused
    assert states(rig) == [IDENTIFY, DESIGN, TRIAL, RETUNED]
    rig.run(50)
    assert states(rig)[-1] is RETUNED


def test_pulses_go_out_alone_and_their_record_holds_what_left_and_what_was_seen() -> None:
    retuner = ToyRetuner()
    rig = Rig(retuner)
    begin = 300
    rig.retune_until(DESIGN, after=begin)
    count = len(rig.pulses_pa)
    (record,) = retuner.records
    assert rig.commands[begin : begin + count] == list(rig.pulses_pa)
    # row k: what left since the sample before, and the outputs of that sample
    assert record.shape == (count, 2)
    assert record[:, 0] == pytest.approx(rig.commands[begin - 1 : begin + count - 1])
    seen = [0.02 * np.sin(0.1 * k) for k in range(begin, begin + count)]
    assert record[:, 1] == pytest.approx(seen)


def test_pulses_can_be_added_to_the_law() -> None:
    rig = Rig(ToyRetuner(), replace(SETTINGS, alone=False), roll=lambda k, u: 0.01)
    rig.run(300)
    steady = rig.commands[-1]
    rig.press(retune=True)
    assert rig.commands[300] == pytest.approx(steady + rig.pulses_pa[0], rel=1e-6)


@pytest.mark.parametrize(
    ("pulse_roll_rad", "rms_rad", "part"),
    [
        (1e-4, 0.02, 1.0),
        (0.02, 0.02, np.sqrt(1.05**2 - 1)),
        (0.02, 1e-3, np.sqrt(1.05**2 - 1) * np.radians(0.25) / 0.02),
    ],
)
def test_pulses_add_five_per_cent_to_the_roll_before(
    pulse_roll_rad: float, rms_rad: float, part: float
) -> None:
    def roll(k: int, u: float) -> float:
        return rms_rad if k % 2 else -rms_rad

    first_pa = []
    for size_rad in (0.0, pulse_roll_rad):  # with nothing known of them they are not scaled
        rig = Rig(ToyRetuner(), replace(SETTINGS, alone=False), roll, pulse_roll_rad=size_rad)
        rig.run(300)
        rig.press(retune=True)
        first_pa.append(rig.commands[300])
    assert first_pa[0] - first_pa[1] == pytest.approx((1 - part) * rig.pulses_pa[0], abs=1e-6)


def test_samples_that_were_not_measured_are_gaps_in_the_record() -> None:
    retuner = ToyRetuner()
    rig = Rig(retuner)
    rig.run(300)
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
    rig.retune_until(TRIAL, after=1200)
    at = rig.samples
    rig.run(100)
    expected = rig.answers_of_the_first_law()
    assert rig.commands[at:] == pytest.approx(expected[at:], rel=1e-9)


def test_memory_is_filled_a_piece_at_a_sample_and_the_answers_are_faded_over() -> None:
    rig = Rig(ToyRetuner(candidate_of(2e5)), roll=lambda k, u: 0.01)
    rig.run(2 * WARM_UP_SAMPLES)
    steady = rig.commands[-1]
    rig.press(retune=True)
    rig.run_until(DESIGN)
    begin = rig.samples
    rig.run_until(TRIAL)
    assert rig.samples - begin == pytest.approx(WARM_UP_SAMPLES / WARM_UP_CHUNK, rel=0.1)
    at = rig.samples - 1
    rig.run(4 * FADE_SAMPLES)
    steps = np.abs(np.diff(rig.commands[at - 1 : at + 4 * FADE_SAMPLES]))
    change = abs(rig.commands[-1] - steady)
    assert change > 0.5 * abs(steady)
    assert steps.max() < 4 * change / FADE_SAMPLES


def test_refusal_is_passed_on_and_changes_nothing() -> None:
    rig = Rig(ToyRetuner(Refusal(("roll period 2.00 s is outside",))))
    rig.retune_until(REFUSED)
    rig.run(30)
    assert rig.reasons == "roll period 2.00 s is outside"
    assert rig.commands[-1] == rig.answers_of_the_first_law()[-1]


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
        (candidate_with(input_gains=np.full((3, 1, 1), 1e200)), "gains"),
        (candidate_with(input_gains=np.full((3, 1, 1), 1.7e308)), "gains"),
        (candidate_with(input_gains=np.full((3, 1, 1), np.nan)), "gains"),
        (candidate_with(output_gains=np.full((3, 1, 1), np.inf)), "gains"),
        (replace(candidate_of(1e5), summary=replace(SUMMARY, stiffness_nm_rad=-1.0)), "stiffness"),
    ],
)
def test_candidate_is_looked_at_once_more_before_it_is_taken(candidate, word: str) -> None:
    rig = Rig(ToyRetuner(candidate))
    rig.press(retune=True)
    rig.run_until(REFUSED)
    assert word in rig.reasons


def test_identification_is_given_up_when_the_roll_is_above_its_limit() -> None:
    rig = Rig(ToyRetuner(), roll=lambda k, u: 0.4 if k == 320 else 0.01)
    rig.retune_until(REFUSED)
    assert "roll is above" in rig.reasons
    assert rig.samples < 325


def test_an_estimate_is_no_answer_to_a_request_for_a_law() -> None:
    rig = Rig(ToyRetuner(MotionEstimate(Verdict.GOOD, Verdict.GOOD, SHIP)))
    rig.press(retune=True)
    rig.run_until(REFUSED)
    assert "another question" in rig.reasons


@pytest.mark.parametrize("fresh_of", [0, 3, 10])
def test_a_trial_that_can_not_be_judged_ends_in_half_as_long_again(fresh_of: int) -> None:
    rig = Rig(ToyRetuner(candidate_of(-3e5)))  # the roll would say that it is worse
    rig.retune_until(TRIAL)
    begin = rig.samples
    rig.roll = lambda k, u: 0.25 * np.sin(0.1 * k) if rig.fresh else 0.02 * np.sin(0.1 * k)
    while rig.controller.state is TRIAL:
        rig.fresh = fresh_of > 0 and rig.samples % fresh_of == 0
        rig.run(1)
        assert (rig.samples - begin) * SAMPLE_TIME_S <= TRIAL_PATIENCE * SETTINGS.trial_s + 1
    assert rig.controller.state is REFUSED
    assert "could not be judged" in rig.reasons
    assert rig.controller.laws.on_trial is None


def test_roll_above_its_limit_ends_an_identification_though_the_tanks_levels_are_old() -> None:
    rig = Rig(ToyRetuner())
    rig.run(300)
    rig.press(retune=True)
    rig.fresh = False
    rig.run(10)
    assert rig.controller.state is IDENTIFY
    rig.roll = lambda k, u: 0.31
    rig.run(2)
    assert rig.controller.state is REFUSED
    assert "roll is above" in rig.reasons


def test_the_last_events_are_kept_and_each_is_taken_once(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(law_exchange, "MOST_EVENTS", 5)
    rig = Rig(ToyRetuner())
    taken = []
    for number in range(1, 13):  # too early to begin, which is said each time
        rig.press(retune=True)
        rig.run(2)
        if number % 3 == 0:
            taken += rig.controller.take_events()
    assert len(taken) == len({event.time_ns for event in taken}) == 12
    assert rig.controller.take_events() == []
    assert list(rig.controller.events) == taken[-5:]
    for _ in range(7):
        rig.press(retune=True)
        rig.run(2)
    assert rig.controller.take_events() == list(rig.controller.events)


@pytest.mark.parametrize(("longer", "kept"), [(1.0, True), (1.04, True), (1.1, False)])
def test_a_ship_that_the_motion_contradicts_is_refused(longer: float, *, kept: bool) -> None:
    rig = Rig(ToyRetuner(candidate_of(9e4)), stiffness=lambda k: longer**-2)
    rig.retune_until(RETUNED if kept else REFUSED)
    if not kept:
        (reason,) = rig.controller.events[-1].reasons
        assert "found, 8.89 s, is not that of the motion, 9.77 s" in reason


@pytest.mark.parametrize(("told", "state"), [(Verdict.GOOD, RETUNED), (Verdict.OUTDATED, REFUSED)])
def test_an_answer_that_no_motion_confirms_is_refused(told: Verdict, state: RetuningState) -> None:
    rig = Rig(ToyRetuner(candidate_of(9e4)))
    rig.told = told
    rig.retune_until(state)
    if state is REFUSED:
        (reason,) = rig.controller.events[-1].reasons
        assert "the motion has not told the ship" in reason
