"""Whatever operator, ship and retuner do, in any order: what retuning promises holds."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, initialize, invariant, rule
from retuning_toys import QUIET, SETTINGS, Rig, ToyRetuner, candidate_of

from utank_hil.canbus import RetuningState
from utank_hil.control import PredictiveLaw
from utank_hil.retuning import Answer, Candidate, Refusal
from utank_hil.retuning.law_bank import MonitoredLaw

pytestmark = pytest.mark.slow

IDLE, IDENTIFY, DESIGN, TRIAL, RETUNED, REFUSED, UNDONE = RetuningState
BUSY = (IDENTIFY, DESIGN, TRIAL)
LIMIT_PA = 5e4


def candidate(gain: float, **wrong: object) -> Candidate:
    good = candidate_of(gain)
    return Candidate(
        PredictiveLaw(
            wrong.get("input_gains", good.law.input_gains),  # type: ignore[arg-type]
            wrong.get("output_gains", good.law.output_gains),  # type: ignore[arg-type]
            wrong.get("reference_gains", good.law.reference_gains),  # type: ignore[arg-type]
            wrong.get("sample_time_s", good.law.sample_time_s),  # type: ignore[arg-type]
        ),
        wrong.get("washout_rad_s", 0.0),  # type: ignore[arg-type]
        good.summary,
    )


GOOD = [candidate(gain) for gain in (8e4, 1e5, 1.3e5)]  # within what a trial allows
BAD = [candidate(-2e6), candidate(2.9e6), candidate(2e6, washout_rad_s=0.02)]
NONSENSE = [
    candidate(1e300),
    candidate(np.nan),
    candidate(1e5, input_gains=np.full((3, 1, 1), 1.7e308)),
    candidate(1e5, input_gains=np.full((3, 1, 1), np.nan)),
    candidate(1e5, reference_gains=np.full((3, 1, 1), 1e10)),
    candidate(1e5, sample_time_s=0.5),
    candidate_of(1e5, outputs=2),
]


class EveryWay(RuleBasedStateMachine):
    """A rig whose pump limits what it is told, as the limiter does, and what is true of it."""

    @initialize(heel_rad=st.sampled_from([0.0, 0.1]), own=st.booleans(), alone=st.booleans())
    def begin(self, heel_rad: float, own: bool, alone: bool) -> None:
        self.roll_rad = 0.02
        chosen = replace(
            SETTINGS,
            alone=alone,
            every_s=60.0 if own else None,
            change_factor=1.5 if own else None,
        )
        self.retuner = ToyRetuner(None)
        self.rig = Rig(
            self.retuner,
            chosen,
            roll=lambda k, u: heel_rad + self.roll_rad * np.sin(0.1 * k) + 1e-7 * u,
        )
        self.laws = self.rig.controller.laws
        self.configured = self.laws.accepted
        self.accepted = [self.configured]  # by the events alone: the way back, newest last
        self.on_trial: MonitoredLaw | None = None

    def step(self) -> None:
        """One sample, and what may have changed in it."""
        rig, controller = self.rig, self.rig.controller
        before, was_on_trial, state = self.laws.active, self.laws.on_trial, controller.state
        rig.run(1)
        answer = rig.commands[-1]
        assert np.isfinite(answer)
        rig.command_pa = float(np.clip(answer, -LIMIT_PA, LIMIT_PA))
        for event in controller.take_events():
            if "begins when" in "".join(event.reasons):
                assert controller.state is state
            elif event.state is TRIAL:
                assert state is DESIGN
                assert (event.found is None) == (self.laws.on_trial is None)
                self.on_trial = self.laws.on_trial or was_on_trial
            elif event.state is RETUNED and self.on_trial is not None:
                self.accepted = [self.accepted[-1], self.on_trial]
                self.on_trial = None
            elif event.state is UNDONE:
                # out of a trial it is the one before that comes back, else the one before that
                if self.on_trial is None:
                    self.accepted = self.accepted[:1]
                    assert before is not self.laws.active
                self.on_trial = None
            elif event.state in (IDLE, REFUSED):
                self.on_trial = None

    def run(self, samples: int) -> None:
        for _ in range(samples):
            self.step()

    @rule(samples=st.sampled_from([1, 2, 7, 20, 60, 160, 250]))
    def time_passes(self, samples: int) -> None:
        self.run(samples)

    @rule(button=st.sampled_from(["retune", "undo"]))
    def press(self, button: str) -> None:
        controller, way_back = self.rig.controller, list(self.accepted)
        state, on_trial = controller.state, self.on_trial
        self.rig.order = self.rig.order._replace(**{button: True})
        self.step()
        self.rig.order = self.rig.order._replace(**{button: False})
        if button == "undo" and self.rig.samples > 1:
            assert controller.state not in BUSY
            if state is TRIAL:
                assert self.laws.active is way_back[-1]
            elif len(way_back) == 2:
                assert on_trial is None
                assert self.laws.active is way_back[0]
        self.step()

    @rule(
        state=st.sampled_from([IDENTIFY, DESIGN, TRIAL, TRIAL, RETUNED, RETUNED]),
        reply=st.sampled_from([*GOOD * 5, *BAD, *NONSENSE, Refusal(("no",))]),
    )
    def sail_to(self, state: RetuningState, reply: Answer) -> None:
        """Let it get there if it will: the other rules are not only to meet the beginning."""
        self.rig.order = QUIET
        self.rig.engaged = self.rig.fresh = self.retuner.alive = True
        self.roll_rad = 0.02
        self.run(155)
        self.retuner.reply, self.retuner.looks = reply, 3
        self.press("retune")
        for _ in range(400):
            if self.rig.controller.state is state:
                break
            self.step()

    @rule(forbidden=st.booleans())
    def forbid_or_permit(self, forbidden: bool) -> None:
        self.rig.order = self.rig.order._replace(forbid_retuning=forbidden)
        self.step()
        if forbidden:
            assert self.rig.controller.state not in BUSY

    @rule(engaged=st.booleans())
    def engage_or_disengage(self, engaged: bool) -> None:
        self.rig.engaged = engaged
        self.step()
        if not engaged:
            assert self.rig.controller.state not in BUSY

    @rule(fresh=st.booleans())
    def sensors(self, fresh: bool) -> None:
        self.rig.fresh = fresh

    @rule()
    def reset(self) -> None:
        self.rig.controller.reset()
        self.on_trial = None
        assert self.rig.controller.state is not TRIAL

    @rule(roll_rad=st.sampled_from([0.0, 0.01, 0.02, 0.1, 0.4]))
    def sea(self, roll_rad: float) -> None:
        self.roll_rad = roll_rad

    @rule(
        reply=st.sampled_from([*GOOD, *GOOD, *BAD, *NONSENSE, Refusal(("no",)), None]),
        looks=st.sampled_from([0, 3, 19, 40]),
    )
    def retuner(self, reply: Answer | None, looks: int) -> None:
        """In time, late, or never: 20 looks are allowed."""
        self.retuner.reply, self.retuner.looks = reply, looks

    @rule(alive=st.booleans())
    def heart(self, alive: bool) -> None:
        self.retuner.alive = alive

    @invariant()
    def law_in_charge_is_the_accepted_one_or_the_one_on_trial(self) -> None:
        controller = self.rig.controller
        assert self.laws.accepted is self.accepted[-1]
        assert self.laws.active is (self.on_trial or self.accepted[-1])
        if controller.state is not TRIAL:
            assert self.laws.on_trial is None
            assert self.laws.active in self.accepted

    @invariant()
    def busy_only_in_charge_and_permitted(self) -> None:
        if self.rig.controller.state in BUSY and self.rig.samples:
            assert self.rig.engaged
            assert not self.rig.order.forbid_retuning

    @invariant()
    def few_are_stepped(self) -> None:
        assert len(self.laws.stepped) <= 4

    def teardown(self) -> None:
        """Left alone it comes to rest, and the accepted law alone drives."""
        self.rig.order = QUIET._replace(forbid_retuning=True)
        self.rig.engaged = self.rig.fresh = True
        self.roll_rad = 0.02
        self.run(60)
        assert self.rig.controller.state not in BUSY
        assert self.laws.active is self.accepted[-1]
        answers: list[float] = []
        step = self.laws.accepted.controller.step
        self.laws.accepted.controller.step = (  # type: ignore[method-assign]
            lambda y, reference=None: (
                answers.append(float(step(y, reference)[0])) or np.full(1, answers[-1])
            )
        )
        self.run(5)
        assert self.rig.commands[-5:] == answers


EveryWay.TestCase.settings = settings(stateful_step_count=30)
TestEveryWay = EveryWay.TestCase
