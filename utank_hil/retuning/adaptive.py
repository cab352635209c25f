"""The controller that retunes itself: identify, have a law designed, try it, keep it or not.

`AdaptiveController` stands where any other controller stands; `update` moves it on between its
steps. These are its states, and every way from one to another:

    state      what drives            to         when
    at rest    the accepted law       IDENTIFY   ordered, on schedule, or the ship has changed; and
                                                 allowed, in charge for 30 s without a break, and
                                                 the retuner alive
                                      REFUSED    the same, and the retuner shows no sign of life
                                      UNDONE     undo, if a law was accepted before this one
    IDENTIFY   the accepted law and   DESIGN     all pulses are given
               pulses, or the pulses  REFUSED    the roll is above its limit
    DESIGN     the accepted law       TRIAL      a law was let in and its memory is filled
                                      REFUSED    a refusal, no answer in time, a law not let in
    TRIAL      the law on trial       RETUNED    its time is over: it is accepted
                                      REFUSED    it is worse, its answer is not finite, or `reset`
    any of the three                  IDLE       forbidden, or not in charge any more
                                      UNDONE     undo: back to the accepted law from TRIAL, from
                                                 the others to the one before it (IDLE if none)

IDLE, RETUNED, REFUSED and UNDONE are at rest, and alike but for what they say. The laws themselves
change in four ways, those of `Laws`: into TRIAL one is put on trial, into RETUNED it is kept, out
of TRIAL by any other way it is dropped, and undo goes back to the one accepted before.

Whatever is asked for, the limits on pressure, rate, level and power apply to the sum of it all,
after this.
"""

from dataclasses import asdict, dataclass
from typing import Any, Final

import numpy as np

from utank_hil.arrays import FloatArray
from utank_hil.canbus import OperatorCommand, RetuningState
from utank_hil.control import ARX, LinearLaw
from utank_hil.retuning.answer import Candidate, ModelSummary, Refusal
from utank_hil.retuning.change_monitor import ChangeMonitor
from utank_hil.retuning.history import SampleHistory
from utank_hil.retuning.incoming import (
    FILL_AT_ONCE,
    FILL_SAMPLES,
    Entrance,
    IncomingLaw,
)
from utank_hil.retuning.law_succession import LawInService, Laws
from utank_hil.retuning.retuner import Retuner
from utank_hil.retuning.settings import EARLIEST_VERDICT_S, RetuningSettings
from utank_hil.retuning.trial import Effort, MovingEffort, worsening

EARLY_FACTOR: Final = 1.5
"""A law this much worse than the trial allows is taken back before the trial's end."""
MOST_TRIES: Final = 3
"""Identifications of one change of the ship; when all are refused, she counts as normal."""
RETRY_NS: Final = 600_000_000_000
"""Between the end of a retuning and the next because of a change: what the monitor learns in."""

_ORDERED: Final = "ordered by the operator"
_COMPARABLE: Final = (
    f"the law has been in charge for {EARLIEST_VERDICT_S:g} s without a break, to compare with it"
)
_NEW: Final = (RetuningState.TRIAL, RetuningState.RETUNED)
_BUSY: Final = (RetuningState.IDENTIFY, RetuningState.DESIGN, RetuningState.TRIAL)
# read once: in Python 3.11 a member costs eight times as much from its class as from here
_IDENTIFY, _DESIGN, _TRIAL = _BUSY


@dataclass(frozen=True, slots=True)
class RetuningEvent:
    """One step in the life of a retuning controller.

    Attributes
    ----------
    time_ns : int
        On the node's clock.
    state : RetuningState
        Entered then; that before, where there is only something to say.
    reasons : tuple of str
        Why.
    found : ModelSummary or None
        The ship that a law on trial, or one accepted, was made for.
    """

    time_ns: int
    state: RetuningState
    reasons: tuple[str, ...]
    found: ModelSummary | None = None

    def as_json(self, start_ns: int = 0) -> dict[str, Any]:
        """All of it, ready for `json.dumps`, at its time since the start."""
        return {
            "time_s": (self.time_ns - start_ns) * 1e-9,
            "state": self.state.name,
            "reasons": list(self.reasons),
            "found": None if self.found is None else asdict(self.found),
        }


class AdaptiveController:
    """A controller whose law is replaced by a better one while it runs.

    Parameters
    ----------
    law : LinearLaw
        To begin with.
    model : ARX
        What that law predicts with.
    roll : int
        Index of the roll among the outputs.
    settings : RetuningSettings
    pulses_pa : ndarray, shape (N,)
        Pressure of the pulses, one value a sample.
    retuner : Retuner
        Who identifies and designs.

    Attributes
    ----------
    sample_time_s : float
    state : RetuningState
    events : list of RetuningEvent
    candidate : Candidate or None
        The one last tried.
    laws : Laws
    """

    def __init__(
        self,
        law: LinearLaw,
        model: ARX,
        roll: int,
        settings: RetuningSettings,
        pulses_pa: FloatArray,
        retuner: Retuner,
    ) -> None:
        self.sample_time_s = law.sample_time_s
        self.state = RetuningState.IDLE
        self.events: list[RetuningEvent] = []
        self.candidate: Candidate | None = None
        self.laws = Laws(LawInService(law.controller(), ChangeMonitor(model, roll)))
        self._settings = settings
        self._roll = roll
        self._retuner = retuner
        self._pulses_pa = pulses_pa
        self._history = SampleHistory(
            max(len(pulses_pa), FILL_SAMPLES + FILL_AT_ONCE), model.outputs
        )
        self._entrance = Entrance(law, self._history, roll)
        self._incoming: IncomingLaw | None = None
        trial = round(settings.trial_s / law.sample_time_s)
        self._verdict = min(trial, round(EARLIEST_VERDICT_S / law.sample_time_s))
        # of the accepted law, in charge without a break and without pulses; and of that on trial
        self._usual, self._tried = MovingEffort(trial), MovingEffort(trial)
        self._before: Effort = self._usual.effort
        self._pulse = 0
        self._number = 0
        self._ordered = False
        self._tries = 0
        self._now_ns = self._since_ns = 0
        self._rest_since_ns: int | None = None
        self._retune_bit = self._undo_bit = True  # a bit that is set before we look is no edge
        self._applied_pa = 0.0
        self._roll_rad = 0.0
        self._fresh = self._engaged = False

    def update(
        self, now_ns: int, order: OperatorCommand | None, *, engaged: bool, fresh: bool
    ) -> None:
        """Move on; once before every `step`.

        Parameters
        ----------
        now_ns : int
        order : OperatorCommand or None
            The operator's buttons.
        engaged : bool
            Whether this controller's answer drives the pump.
        fresh : bool
            Whether the outputs that `step` will get were measured.
        """
        self._now_ns, self._engaged, self._fresh = now_ns, engaged, fresh
        if self._rest_since_ns is None:
            self._rest_since_ns = now_ns
        forbidden = order is not None and order.forbid_retuning
        ordered = order is not None and order.retune and not self._retune_bit
        undo = order is not None and order.undo and not self._undo_bit
        if order is not None:
            self._retune_bit, self._undo_bit = order.retune, order.undo
        if forbidden or undo or not engaged:
            self._ordered = False  # one that waits
        if not engaged:
            self._usual.clear()
        if undo and (self.state in _BUSY or self.laws.previous is not None):
            self._undo()
        elif self.state in _BUSY and (forbidden or not engaged):
            self._give_up("forbidden by the operator" if forbidden else "not in charge")
        elif self.state is _IDENTIFY:
            self._identify()
        elif self.state is _DESIGN:
            self._await_law()
        elif self.state is _TRIAL:
            self._judge()
        elif engaged and not forbidden:
            self._rest(ordered)

    def step(self, y: FloatArray, reference: FloatArray | None = None) -> FloatArray:
        """Take the newest measurement and return the command; see `Controller`."""
        self._roll_rad = float(y[self._roll])
        if self._fresh and self._engaged:
            if self.state is _TRIAL:
                self._tried.add(self._roll_rad, self._applied_pa)
            elif self.state not in _BUSY:
                self._usual.add(self._roll_rad, self._applied_pa)
                self.laws.accepted.monitor.watch(self._history, self._applied_pa, self._roll_rad)
        self._history.add(self._applied_pa, y, fresh=self._fresh)
        answer = self.laws.step(y, reference)
        if self.state is _TRIAL and self.laws.on_trial is None:
            self._refuse(("the law's answer was not finite",))
        if self._incoming is not None:
            self._incoming.fill()
        if self.state is _IDENTIFY and self._pulse < len(self._pulses_pa):
            pulse_pa = self._pulses_pa[self._pulse]
            self._pulse += 1
            answer = np.full(1, pulse_pa) if self._settings.alone else answer + pulse_pa
        return answer

    def applied(self, u: FloatArray) -> None:
        """Take the command that left; see `Controller`."""
        self._applied_pa = float(u[0])
        self.laws.applied(u)

    def reset(self) -> None:
        """Forget the past of all laws; one on trial is taken back."""
        self.laws.reset()
        if self.state is _TRIAL:
            self._end("the controller was reset during the trial")

    def _rest(self, ordered: bool) -> None:
        """Begin, if there is a reason to, something to compare with, and a retuner."""
        self._ordered = self._ordered or ordered
        reason = _ORDERED if self._ordered else self._own_reason()
        if not reason:
            return
        if self._usual.samples < self._verdict:
            if ordered:
                self._tell((f"{reason}: begins when {_COMPARABLE}",))
            return
        self._ordered = False
        if not self._retuner.alive:
            self._finish(
                RetuningState.REFUSED,
                f"{reason}, but the retuner shows no sign of life: try again later",
            )
            return
        self._before = self._usual.effort
        self._usual.clear()
        self._pulse = 0
        self._enter(_IDENTIFY, reason)

    def _own_reason(self) -> str:
        """Why to retune without an order; empty if there is no reason."""
        settings = self._settings
        assert self._rest_since_ns is not None
        rested_ns = self._now_ns - self._rest_since_ns
        if settings.every_s is not None and rested_ns >= settings.every_s * 1e9:
            return "on schedule"
        if rested_ns < RETRY_NS:
            return ""
        if not self._changed:
            self._tries = 0  # she is as she was: what comes next is another change
        else:
            change = self.laws.accepted.monitor.change
            return f"the ship has changed: prediction errors are off the normal {change:.2f} times"
        return ""

    @property
    def _changed(self) -> bool:
        """Whether the ship is no longer the one that the law was accepted for."""
        factor = self._settings.change_factor
        return factor is not None and self.laws.accepted.monitor.change > factor

    def _identify(self) -> None:
        if self._fresh and abs(self._roll_rad) > self._settings.roll_limit_rad:
            self._end("the roll is above the limit for identification")
        elif self._pulse == len(self._pulses_pa):
            self._number += 1
            self._since_ns = self._now_ns
            record = self._history.record(self._pulse)
            self._retuner.submit(self._number, record, self._now_ns)
            self._enter(_DESIGN)

    def _await_law(self) -> None:
        if self._incoming is not None:
            if self._incoming.filled:
                self._put_on_trial(self._incoming.law)
            return
        answer = self._retuner.answer(self._number, self._now_ns)
        if isinstance(answer, Refusal):
            self._refuse(answer.reasons)
        elif answer is not None:
            incoming = self._entrance.let_in(answer)
            if isinstance(incoming, str):
                self._refuse((incoming,))
            else:
                self.candidate, self._incoming = answer, incoming
        elif self._now_ns - self._since_ns > self._settings.answer_within_s * 1e9:
            self._end("no answer in time: the retuner hangs or is dead")

    def _put_on_trial(self, law: LawInService) -> None:
        law.controller.applied(np.full(1, self._applied_pa))
        self.laws.try_out(law)
        self._incoming = None
        self._tried.clear()
        assert self.candidate is not None
        found = self.candidate.summary
        self._enter(
            _TRIAL,
            f"roll period {found.roll_period_s:.2f} s; in the recorded waves "
            f"{found.roll_below_passive:.0%} less roll than passive",
        )

    def _judge(self) -> None:
        settings, tried = self._settings, self._tried
        if tried.samples < self._verdict:
            return
        factor = 1.0 if tried.full else EARLY_FACTOR
        worse = worsening(
            self._before,
            tried.effort,
            factor * settings.roll_factor,
            factor * settings.effort_factor,
        )
        if worse:
            self._refuse(worse)
        elif tried.full:
            self.laws.keep()
            self._usual, self._tried = tried, self._usual
            self._learn_anew()
            self._finish(RetuningState.RETUNED)

    def _undo(self) -> None:
        """As the operator orders: back to the law before, and nothing goes on."""
        reason = "undone by the operator"
        if self.state is not _TRIAL:
            if self.laws.previous is None:
                self._give_up(f"{reason}: there was no law before this one to go back to")
                return
            self.laws.undo()
        self._usual.clear()
        self._finish(RetuningState.UNDONE, reason)
        self._learn_anew()

    def _give_up(self, reason: str) -> None:
        self._finish(RetuningState.IDLE, reason)

    def _end(self, reason: str) -> None:
        """End without a new law, for a reason that says nothing of the ship."""
        self._finish(RetuningState.REFUSED, reason)

    def _refuse(self, reasons: tuple[str, ...]) -> None:
        """End without a new law; a change of the ship is remembered, for a number of tries."""
        if self._changed:
            self._tries += 1
            if self._tries == MOST_TRIES:
                self._learn_anew()
                reasons = (*reasons, f"refused {MOST_TRIES} times: the ship as she is is the usual")
        self._finish(RetuningState.REFUSED, *reasons)

    def _learn_anew(self) -> None:
        """Take ship and sea as they are for the usual ones of the law in charge."""
        self._tries = 0
        self.laws.accepted.monitor.restart()

    def _finish(self, state: RetuningState, *reasons: str) -> None:
        """Come to rest with the accepted law."""
        if self.laws.on_trial is not None:
            self.laws.drop()
        self._incoming = None
        self._rest_since_ns = self._now_ns
        self._enter(state, *reasons)

    def _enter(self, state: RetuningState, *reasons: str) -> None:
        self.state = state
        self._tell(reasons, self.candidate.summary if self.candidate and state in _NEW else None)

    def _tell(self, reasons: tuple[str, ...], found: ModelSummary | None = None) -> None:
        self.events.append(RetuningEvent(self._now_ns, self.state, reasons, found))
