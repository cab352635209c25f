"""The retuner hangs, dies or answers nonsense: the controller goes on with the law it has."""

from dataclasses import dataclass, field, replace

import numpy as np
import pytest
from fault_bench import CATALOGUE, SECOND, Listener, storm

from firmware_sim.ship_side import build_ship_side
from utank_hil.assembly import build_controller_node
from utank_hil.canbus import ControllerStatus, Fault, Mode, PumpCommand, RetuningState
from utank_hil.control import PredictiveLaw
from utank_hil.nodes.controller import ControllerNode
from utank_hil.nodes.panel import Action, TimedAction
from utank_hil.retuning import Answer, Candidate, ModelSummary, Refusal, RetuningSettings
from utank_hil.runners import Lockstep

pytestmark = pytest.mark.slow

SETTINGS = RetuningSettings(
    (6.0, 20.0), identification_s=20.0, answer_within_s=5.0, trial_s=60.0, pulse_pa=10e3
)
ORDERED_S = 40.0
SCRIPT = (TimedAction(1.0, Action.ARM), TimedAction(ORDERED_S, Action.RETUNE))
SUMMARY = ModelSummary(8.0, 0.01, 2e9, 1e9, 5e7, 0.1, 0.99, 1.2, 0.3)


@dataclass
class Broken:
    """Answers the same to every look, or nothing."""

    reply: Answer | None = None
    alive: bool = True
    submitted: list[int] = field(default_factory=list)

    def submit(self, number, record, now_ns):
        self.submitted.append(number)

    def answer(self, number, now_ns):
        return self.reply


def adaptive_config():
    return storm().controllers["gpc"].model_copy(update={"retuning": SETTINGS})


def law_of(gain):
    """Pressure in proportion to the roll, `gain` Pa/rad: a negative one drives the roll up."""
    gains = np.zeros((2, 1, 1))
    gains[0] = gain
    return Candidate(
        PredictiveLaw(np.zeros((2, 1, 1)), gains, np.zeros((1, 1, 1)), 0.2), 0.0, SUMMARY
    )


class Voyage:
    """The storm with a retuner."""

    def __init__(self, retuner, script=SCRIPT):
        self.config = adaptive_config()
        ship = build_ship_side(storm(), 1, script)
        self.node: ControllerNode = build_controller_node(
            self.config, commissioned=True, retuner=retuner
        )
        self.heard = Listener()
        self.statuses: list[tuple[int, ControllerStatus]] = []
        self._status = CATALOGUE.receiver(ControllerStatus)
        self.drive = ship.drive
        self._lockstep = Lockstep([*ship.nodes, self.node], trace=self._trace)

    def _trace(self, time_ns, sender, frame):
        self.heard(time_ns, sender, frame)
        if frame.can_id == self._status.can_id:
            status = self._status.accept(frame)
            assert status is not None
            self.statuses.append((time_ns, status))

    def run(self, until_s):
        self._lockstep.run_until(round(until_s * SECOND))
        return self

    @property
    def states(self):
        return [event.state for event in self.node.law.events]

    @property
    def shown(self):
        """States of retuning on the bus, each once in a row."""
        seen: list[RetuningState | None] = []
        for _, status in self.statuses:
            if not seen or seen[-1] is not status.retuning:
                seen.append(status.retuning)
        return seen

    def pressures(self, begin_s=0.0):
        return np.array([c.pressure_pa for t, c in self.heard.commands if t >= begin_s * SECOND])


IDLE, IDENTIFY, DESIGN, TRIAL, RETUNED, REFUSED, UNDONE = RetuningState


@pytest.mark.evidence
def test_hung_or_dead_retuner_is_noticed_in_time_and_changes_nothing():
    hung = Voyage(Broken(None)).run(90)
    refusing = Voyage(Broken(Refusal(("no",)))).run(90)
    assert hung.states == [IDENTIFY, DESIGN, REFUSED]
    assert "hangs or is dead" in hung.node.law.events[-1].reasons[0]
    assert hung.shown == [IDLE, IDENTIFY, DESIGN, REFUSED]
    design, refused = (event.time_ns for event in hung.node.law.events[1:])
    assert refused - design == pytest.approx(SETTINGS.answer_within_s * SECOND, abs=0.5 * SECOND)
    assert hung.heard.commands == refusing.heard.commands
    assert (hung.node.mode, hung.node.fault) == (Mode.ACTIVE, Fault.NONE)


@pytest.mark.evidence
def test_after_a_refusal_the_law_is_the_one_it_was():
    # with pulses of no pressure a refused identification leaves no trace at all
    def silent(retuner):
        voyage = Voyage(retuner)
        if retuner is not None:
            adaptive = voyage.node.law.law
            adaptive._pulses.pressure_pa[:] = 0.0
        return voyage.run(80)

    tried = silent(Broken(Refusal(("no",))))
    assert tried.states == [IDENTIFY, DESIGN, REFUSED]
    assert tried.heard.commands == silent(None).heard.commands


@pytest.mark.evidence("nonsense0", "nonsense1", "nonsense3", "nonsense4")
@pytest.mark.parametrize(
    "nonsense",
    [
        replace(law_of(1e5), law=replace(law_of(1e5).law, sample_time_s=0.5)),
        law_of(1e12),
        law_of(float("nan")),
        replace(law_of(1e5), law=replace(law_of(1e5).law, input_gains=np.full((2, 1, 1), 1.7e308))),
        replace(
            law_of(1e5),
            law=PredictiveLaw(np.zeros((2, 1, 1)), np.zeros((2, 1, 2)), np.zeros((1, 1, 2)), 0.2),
        ),
    ],
)
def test_nonsense_that_looks_like_a_law_is_refused(nonsense):
    # the storm's GPC measures roll alone, so a law for two outputs is one for another ship
    voyage = Voyage(Broken(nonsense)).run(80)
    assert voyage.states == [IDENTIFY, DESIGN, REFUSED]
    assert voyage.node.mode is Mode.ACTIVE


@pytest.mark.evidence("on trial")
@pytest.mark.parametrize("failing", ["on trial", "all"])
def test_law_that_fails_on_trial_is_never_in_charge_again(failing):
    script = (*SCRIPT, TimedAction(75.0, Action.DISARM), TimedAction(77.0, Action.RESET),
              TimedAction(80.0, Action.ARM))  # fmt: skip
    voyage = Voyage(Broken(law_of(1e5)), script).run(66)
    adaptive = voyage.node.law.law
    assert adaptive.state is TRIAL
    configured, bad = adaptive.laws.accepted, adaptive.laws.on_trial
    good = configured.controller.step
    bad.controller.step = nan = lambda y, reference=None: np.full(1, np.nan)
    if failing == "all":
        configured.controller.step = nan
        voyage.run(70)
        assert voyage.node.fault is Fault.INTERNAL
        configured.controller.step = good
    voyage.run(100)
    assert voyage.states == [IDENTIFY, DESIGN, TRIAL, REFUSED]
    assert adaptive.laws.active is configured
    assert (voyage.node.mode, voyage.node.fault) == (Mode.ACTIVE, Fault.NONE)
    assert np.isfinite(voyage.pressures()).all()


def test_law_that_drives_the_roll_up_is_taken_back_within_its_limits():
    voyage = Voyage(Broken(law_of(-1e6))).run(140)
    assert voyage.states == [IDENTIFY, DESIGN, TRIAL, REFUSED]
    assert "roll rose" in voyage.node.law.events[-1].reasons[0]
    config = voyage.config
    pressures = voyage.pressures()
    assert np.abs(pressures).max() <= config.limits.pressure_pa + 8.0
    step_pa = config.limits.rate_pa_s * 0.02
    assert np.abs(np.diff(pressures)).max() <= step_pa + 8.0  # and the bus rounds to 8 Pa
    assert voyage.drive.refused == 0


@pytest.mark.evidence
def test_swap_makes_no_step_beyond_the_rate_limit_even_to_the_opposite_law():
    config = adaptive_config()
    voyage = Voyage(Broken(law_of(-2e5))).run(100)
    assert TRIAL in voyage.states
    step_pa = config.limits.rate_pa_s * 0.02
    assert np.abs(np.diff(voyage.pressures(ORDERED_S))).max() <= step_pa + 8.0


@pytest.mark.evidence
def test_disarmed_while_identifying_it_ends_at_zero_and_stays_there():
    script = (*SCRIPT, TimedAction(50.0, Action.STOP))
    voyage = Voyage(Broken(law_of(1e5)), script).run(70)
    assert voyage.states == [IDENTIFY, IDLE]
    assert set(voyage.pressures(50.3)) == {0.0}


def test_operator_forbids_and_undoes_over_the_bus():
    running = storm().controllers["gpc"].law.law(storm().controllers["gpc"].plant)
    same = replace(law_of(0.0), law=running.law, washout_rad_s=running.corner_rad_s)
    script = (*SCRIPT, TimedAction(70.0, Action.UNDO), TimedAction(80.0, Action.FORBID),
              TimedAction(82.0, Action.RETUNE))  # fmt: skip
    voyage = Voyage(Broken(same), script).run(90)
    assert voyage.states == [IDENTIFY, DESIGN, TRIAL, UNDONE]
    assert voyage.shown == [IDLE, IDENTIFY, DESIGN, TRIAL, UNDONE]


def test_without_a_retuner_the_status_says_so():
    voyage = Voyage(None).run(3)
    assert voyage.shown == [None]
    assert all(isinstance(command, PumpCommand) for _, command in voyage.heard.commands)
