"""A law on trial, or one accepted, is taken back: by what it does, by the operator, by a fault."""

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
    states,
)

from utank_hil.canbus import RetuningState
from utank_hil.retuning.law_bank import FADE_SAMPLES

IDLE, IDENTIFY, DESIGN, TRIAL, RETUNED, REFUSED, UNDONE = RetuningState


@pytest.mark.parametrize(("roll_rad", "least", "most"), [(0.028, 0.99, 1.01), (0.2, 0.0, 0.85)])
def test_law_that_rolls_more_is_taken_back_at_the_end_of_its_trial_and_much_more_before(
    roll_rad: float, least: float, most: float
) -> None:
    worse: list[int] = []
    rig = Rig(
        ToyRetuner(candidate_of(9e4)),
        roll=lambda k, u: (roll_rad if worse else 0.02) * np.sin(0.1 * k),
    )
    rig.retune_until(TRIAL)
    worse.append(1)
    begin = rig.samples
    rig.run_until(REFUSED)
    assert least < (rig.samples - begin) * SAMPLE_TIME_S / SETTINGS.trial_s < most
    assert "roll rose" in rig.reasons


def test_law_that_takes_much_more_pressure_is_taken_back() -> None:
    rig = Rig(ToyRetuner(candidate_of(1e6)))
    rig.retune_until(REFUSED)
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


@pytest.mark.parametrize("moment", [IDENTIFY, DESIGN, TRIAL])
@pytest.mark.parametrize("how", ["forbidden", "disarmed"])
def test_forbidden_or_disarmed_it_gives_up_and_goes_back(moment: RetuningState, how: str) -> None:
    rig = Rig(ToyRetuner(candidate_of(1.5e5), looks=5))
    rig.retune_until(moment)
    if how == "forbidden":
        rig.order = QUIET._replace(forbid_retuning=True)
    else:
        rig.engaged = False
    rig.run(2)
    assert rig.controller.state is IDLE
    rig.run(100)
    assert rig.commands[-1] == pytest.approx(rig.answers_of_the_first_law()[-1], rel=1e-9)


@pytest.mark.parametrize("moment", [TRIAL, RETUNED])
def test_undo_goes_back_even_while_the_next_identification_runs(moment: RetuningState) -> None:
    rig = Rig(ToyRetuner(candidate_of(1.5e5)))
    configured = rig.controller.laws.accepted
    rig.retune_until(RETUNED)
    first = rig.controller.laws.accepted
    rig.retune_until(DESIGN, after=200)
    if moment is TRIAL:
        rig.run_until(TRIAL)
        rig.press(undo=True)
        assert rig.controller.laws.active is first
        rig.run(1)  # the button is let go
    rig.press(undo=True)
    assert rig.controller.state is UNDONE
    assert rig.controller.laws.active is configured


def test_undo_before_any_law_was_accepted_gives_up_what_goes_on() -> None:
    rig = Rig(ToyRetuner(None))
    rig.press(undo=True)
    assert states(rig) == []
    rig.run(300)
    rig.press(retune=True)
    rig.press(undo=True)
    assert states(rig) == [IDENTIFY, IDLE]
    assert "no law before" in rig.reasons


def test_heel_does_not_hide_that_she_rolls_more() -> None:
    worse: list[int] = []
    rig = Rig(
        ToyRetuner(candidate_of(9e4)),
        roll=lambda k, u: 0.09 + (0.06 if worse else 0.02) * np.sin(0.1 * k),
    )
    rig.retune_until(TRIAL, after=600)
    worse.append(1)
    rig.run_until(REFUSED)
    assert "roll rose" in rig.reasons


def test_heel_that_comes_on_trial_is_no_fault_of_the_law() -> None:
    heeled: list[int] = []
    rig = Rig(
        ToyRetuner(candidate_of(9e4)),
        replace(SETTINGS, effort_factor=100.0),
        roll=lambda k, u: (0.05 if heeled else 0.0) + 0.02 * np.sin(0.1 * k),
    )
    rig.retune_until(TRIAL, after=600)
    heeled.append(1)
    rig.run_until(RETUNED)


def test_law_that_leans_on_the_pump_is_taken_back() -> None:
    # as lively as the law before, but with 30 kPa on top: what that heels, no deviation tells
    rig = Rig(ToyRetuner(candidate_of(1e5)))
    rig.retune_until(TRIAL)
    law = rig.controller.laws.on_trial
    step = law.controller.step
    law.controller.step = lambda y, reference=None: step(y, reference) + 3e4  # type: ignore[method-assign]
    rig.run_until(REFUSED)
    assert "pressure rose" in rig.reasons


@pytest.mark.parametrize("after", ["goes on", "disarmed"])
def test_reset_while_on_trial_takes_the_law_back(after: str) -> None:
    rig = Rig(ToyRetuner(candidate_of(1.5e5)), roll=lambda k, u: 0.01)
    rig.run(300)
    steady, configured = rig.commands[-1], rig.controller.laws.accepted
    rig.press(retune=True)
    rig.run_until(TRIAL)
    rig.run(5)
    rig.controller.reset()
    assert rig.controller.state is REFUSED
    if after == "disarmed":
        rig.engaged = False
        rig.run(3)
        rig.engaged = True
    assert rig.controller.laws.active is configured
    rig.run(200)
    assert rig.commands[-1] == pytest.approx(steady, rel=1e-3)


def test_law_whose_answer_is_not_finite_is_dropped_before_anyone_hears_of_it() -> None:
    rig = Rig(ToyRetuner(candidate_of(9e4)))
    rig.retune_until(TRIAL)
    rig.run(5)
    law = rig.controller.laws.on_trial
    law.controller.step = lambda y, reference=None: np.full(1, np.nan)  # type: ignore[method-assign]
    rig.run(300)
    assert states(rig) == [IDENTIFY, DESIGN, TRIAL, REFUSED]
    assert rig.reasons == "the law's answer was not finite"
    assert np.isfinite(rig.commands).all()


def test_law_that_is_faded_from_is_cut_off_when_its_answer_is_not_finite() -> None:
    rig = Rig(ToyRetuner(candidate_of(9e4)))
    rig.retune_until(TRIAL)
    rig.run(60)
    law = rig.controller.laws.on_trial
    rig.engaged = False  # back to the accepted law, by a fade
    rig.run(3)
    law.controller.step = lambda y, reference=None: np.full(1, np.nan)  # type: ignore[method-assign]
    rig.run(50)
    assert states(rig) == [IDENTIFY, DESIGN, TRIAL, IDLE]
    assert np.isfinite(rig.commands).all()
