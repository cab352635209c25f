"""A controller that retunes itself: identify, request a design, try the new law, accept or drop it.

`AdaptiveController` has the interface of every other controller; `update` advances its state
machine between two steps. These are its states and all transitions:

    state      pump command from      to         condition
    at rest    the accepted law       IDENTIFY   requested, scheduled, or the ship has changed; and
                                                 permitted, engaged for 30 s without interruption,
                                                 and the retuner alive
                                      REFUSED    the same, but the retuner has no heartbeat
                                      UNDONE     undo, if a law was accepted before this one
    IDENTIFY   the accepted law and   DESIGN     all pulses are given
               pulses, or the pulses  REFUSED    the roll is above its limit
    DESIGN     the accepted law       TRIAL      a candidate was admitted and is warmed up
                                      REFUSED    a refusal, no answer in time, or not admitted
    TRIAL      the law on trial       RETUNED    the trial is over: the law is accepted
                                      REFUSED    worse, a command that is not finite, `reset`, or
                                                 not judged in half as long again
    any of the three                  IDLE       forbidden, or no longer engaged
                                      UNDONE     undo: from TRIAL back to the accepted law, from
                                                 the others to the one before it (IDLE if none)

IDLE, RETUNED, REFUSED and UNDONE are the states at rest. They behave alike and differ only in what
they report. `LawBank` does the switching of laws that belongs to these transitions.

The limits on pressure, rate, level and power apply to the sum of law and pulses, downstream.
"""

from collections import deque
from dataclasses import asdict, dataclass
from typing import Any, Final, NamedTuple

import numpy as np

from utank_hil.arrays import FloatArray
from utank_hil.canbus import RetuningState
from utank_hil.control import LinearLaw
from utank_hil.retuning.admission import (
    WARM_UP_CHUNK,
    WARM_UP_SAMPLES,
    Admission,
    WarmUp,
)
from utank_hil.retuning.answer import Candidate, ModelSummary, Refusal
from utank_hil.retuning.change_monitor import ChangeMonitor
from utank_hil.retuning.estimate import MotionEstimate, ShipFigures
from utank_hil.retuning.history import SampleHistory
from utank_hil.retuning.law_bank import LawBank, MonitoredLaw
from utank_hil.retuning.retuner import Retuner
from utank_hil.retuning.settings import EARLIEST_VERDICT_S, RetuningSettings
from utank_hil.retuning.trial import MovingWindow, WindowStatistics, worsening

EARLY_FACTOR: Final = 1.5
"""A law this much worse than the trial allows is dropped before the end of the trial."""
TRIAL_PATIENCE: Final = 1.5
"""A trial that lasts so many times its length, for want of measurements, is given up."""
MOST_EVENTS: Final = 1000
"""That are kept: two days of a retuning every three minutes."""
MOST_TRIES: Final = 3
"""Identifications of one change of the ship; if all are refused, the new ship counts as normal."""
RETRY_NS: Final = 600_000_000_000
"""Least time from one retuning to the next because of a change, and to the next without an order
after the retuner was found dead.
"""

_REQUESTED: Final = "ordered by the operator"
_COMPARABLE: Final = (
    f"the law has been in charge for {EARLIEST_VERDICT_S:g} s without a break, to compare with it"
)
_NEW: Final = (RetuningState.TRIAL, RetuningState.RETUNED)
_BUSY: Final = (RetuningState.IDENTIFY, RetuningState.DESIGN, RetuningState.TRIAL)
# in Python 3.11 a member costs eight times as much to read from its class as from the module
_IDENTIFY, _DESIGN, _TRIAL = _BUSY


class RetuningOrder(NamedTuple):
    """What the operator ordered since the last sample.

    Attributes
    ----------
    retune, undo : bool
        The button was pressed.
    forbidden : bool
        Retuning is forbidden, or was for a moment.
    """

    retune: bool = False
    undo: bool = False
    forbidden: bool = False


@dataclass(frozen=True, slots=True)
class RetuningEvent:
    """A state change of the retuning controller, or a message without one.

    Attributes
    ----------
    time_ns : int
        Time on the node's clock.
    state : RetuningState
        State entered; the present state for a message.
    reasons : tuple of str
        Why, in words.
    found : ModelSummary or None
        Identified ship that the law on trial, or the accepted law, was designed for.
    """

    time_ns: int
    state: RetuningState
    reasons: tuple[str, ...]
    found: ModelSummary | None = None

    def as_json(self, start_ns: int = 0) -> dict[str, Any]:
        """The event, ready for `json.dumps`; `time_s` counts from `start_ns`."""
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
        First law.
    ship : ShipFigures
        The ship that it was designed for.
    roll : int
        Index of the roll among the outputs.
    settings : RetuningSettings
    pulses_pa : ndarray, shape (N,)
        Excitation pressure, one value a sample.
    retuner : Retuner
        Identifies and designs.

    Attributes
    ----------
    sample_time_s : float
    state : RetuningState
    events : deque of RetuningEvent
        The last `MOST_EVENTS`.
    candidate : Candidate or None
        Latest admitted candidate.
    laws : LawBank
    """

    def __init__(
        self,
        law: LinearLaw,
        ship: ShipFigures,
        roll: int,
        settings: RetuningSettings,
        pulses_pa: FloatArray,
        retuner: Retuner,
    ) -> None:
        self.sample_time_s = law.sample_time_s
        self.state = RetuningState.IDLE
        self.events: deque[RetuningEvent] = deque(maxlen=MOST_EVENTS)
        self._untaken = 0
        self.candidate: Candidate | None = None
        self.laws = LawBank(MonitoredLaw(law.controller(), ChangeMonitor(ship)))
        self._settings = settings
        self._roll = roll
        self._retuner = retuner
        self._pulses_pa = pulses_pa
        self._history = SampleHistory(
            max(len(pulses_pa), WARM_UP_SAMPLES + WARM_UP_CHUNK), law.matrices().B.shape[1]
        )
        self._admission = Admission(law, self._history)
        self._warm_up: WarmUp | None = None
        trial = round(settings.trial_s / law.sample_time_s)
        self._least_samples = min(trial, round(EARLIEST_VERDICT_S / law.sample_time_s))
        # the accepted law, engaged without interruption and without pulses; and the law on trial
        self._accepted_window, self._trial_window = MovingWindow(trial), MovingWindow(trial)
        self._baseline: WindowStatistics = self._accepted_window.statistics
        self._pulses_given = 0
        self._request_number = 0
        self._requested = False
        self._tries = 0
        self._now_ns = self._submitted_ns = self._trial_since_ns = self._not_before_ns = 0
        self._idle_since_ns: int | None = None
        self._applied_pa = 0.0
        self._roll_rad = 0.0
        self._fresh = self._engaged = False

    def update(self, now_ns: int, order: RetuningOrder, *, engaged: bool, fresh: bool) -> None:
        """Advance the state machine; call once before every `step`.

        Parameters
        ----------
        now_ns : int
        order : RetuningOrder
        engaged : bool
            Whether this controller's command drives the pump.
        fresh : bool
            Whether the outputs for `step` are new measurements, not held values.
        """
        self._now_ns, self._engaged, self._fresh = now_ns, engaged, fresh
        if self._idle_since_ns is None:
            self._idle_since_ns = now_ns
        ordered, undo, forbidden = order
        if forbidden or undo or not engaged:
            self._requested = False
        if not engaged:
            self._accepted_window.clear()
        if undo and (self.state in _BUSY or self.laws.previous is not None):
            self._undo()
        elif self.state in _BUSY and (forbidden or not engaged):
            self._cancel("forbidden by the operator" if forbidden else "not in charge")
        elif self.state is _IDENTIFY:
            self._identify()
        elif self.state is _DESIGN:
            self._await_candidate()
        elif self.state is _TRIAL:
            self._check_trial()
        elif engaged and not forbidden:
            self._begin_if_due(ordered)

    def take_events(self) -> list[RetuningEvent]:
        """Return the events since the last call."""
        if not self._untaken:
            return []
        taken, self._untaken = list(self.events)[-self._untaken :], 0
        return taken

    def step(self, y: FloatArray, reference: FloatArray | None = None) -> FloatArray:
        """Take the newest measurement and return the command; see `Controller`."""
        self._roll_rad = float(y[self._roll])
        if self._fresh and self._engaged:
            if self.state is _TRIAL:
                self._trial_window.add(self._roll_rad, self._applied_pa)
            elif self.state not in _BUSY:
                self._accepted_window.add(self._roll_rad, self._applied_pa)
        self._history.add(self._applied_pa, y, fresh=self._fresh)
        command = self.laws.step(y, reference)
        if self.state is _TRIAL and self.laws.on_trial is None:
            self._refuse(("the law's answer was not finite",))
        if self._warm_up is not None:
            self._warm_up.advance()
        if self.state is _IDENTIFY and self._pulses_given < len(self._pulses_pa):
            pulse_pa = self._pulses_pa[self._pulses_given]
            self._pulses_given += 1
            command = np.full(1, pulse_pa) if self._settings.alone else command + pulse_pa
        return command

    def note(self, estimate: MotionEstimate) -> None:
        """Take what the motion tells of the ship."""
        for law in self.laws.stepped:
            law.monitor.watch(estimate)

    def applied(self, u: FloatArray) -> None:
        """Take the command that was applied; see `Controller`."""
        self._applied_pa = float(u[0])
        self.laws.applied(u)

    def reset(self) -> None:
        """Reset all laws; a law on trial is dropped."""
        self.laws.reset()
        if self.state is _TRIAL:
            self._abort("the controller was reset during the trial")

    def _begin_if_due(self, ordered: bool) -> None:
        """Start a retuning if there is a reason, a baseline to compare with, and a live retuner."""
        self._requested = self._requested or ordered
        reason = _REQUESTED if self._requested else self._automatic_reason()
        if not reason:
            return
        if self._accepted_window.samples < self._least_samples:
            if ordered:
                self._log_event((f"{reason}: begins when {_COMPARABLE}",))
            return
        self._requested = False
        if not self._retuner.alive:
            self._not_before_ns = self._now_ns + RETRY_NS
            self._finish(
                RetuningState.REFUSED,
                f"{reason}, but the retuner shows no sign of life: try again later",
            )
            return
        self._baseline = self._accepted_window.statistics
        self._accepted_window.clear()
        self._pulses_given = 0
        self._enter(_IDENTIFY, reason)

    def _automatic_reason(self) -> str:
        """Reason to retune without a request; empty if there is none."""
        settings = self._settings
        assert self._idle_since_ns is not None
        if self._now_ns < self._not_before_ns:
            return ""
        idle_ns = self._now_ns - self._idle_since_ns
        if settings.every_s is not None and idle_ns >= settings.every_s * 1e9:
            return "on schedule"
        if idle_ns < RETRY_NS:
            return ""
        if not self._changed:
            self._tries = 0  # back to normal: the next change is a new one
        else:
            change = self.laws.accepted.monitor.change
            return f"the ship has changed: her roll is another by a factor of {change:.2f}"
        return ""

    @property
    def _changed(self) -> bool:
        """Whether the ship has changed since the law was accepted."""
        factor = self._settings.change_factor
        return factor is not None and self.laws.accepted.monitor.change > factor

    def _identify(self) -> None:
        # whatever else is old: the roll is judged as it was last known
        if abs(self._roll_rad) > self._settings.roll_limit_rad:
            self._abort("the roll is above the limit for identification")
        elif self._pulses_given == len(self._pulses_pa):
            self._request_number += 1
            self._submitted_ns = self._now_ns
            record = self._history.record(self._pulses_given)
            self._retuner.submit(self._request_number, record, self._now_ns)
            self._enter(_DESIGN)

    def _await_candidate(self) -> None:
        if self._warm_up is not None:
            if self._warm_up.done:
                self._put_on_trial(self._warm_up.law)
            return
        answer = self._retuner.answer(self._request_number, self._now_ns)
        if isinstance(answer, Refusal):
            self._refuse(answer.reasons)
        elif isinstance(answer, MotionEstimate):
            self._abort("the retuner answered another question")
        elif answer is not None:
            warm_up = self._admission.admit(answer)
            if isinstance(warm_up, str):
                self._refuse((warm_up,))
            else:
                self.candidate, self._warm_up = answer, warm_up
        elif self._now_ns - self._submitted_ns > self._settings.answer_within_s * 1e9:
            self._abort("no answer in time: the retuner hangs or is dead")

    def _put_on_trial(self, law: MonitoredLaw) -> None:
        law.controller.applied(np.full(1, self._applied_pa))
        self.laws.try_out(law)
        self._warm_up = None
        self._trial_window.clear()
        self._trial_since_ns = self._now_ns
        assert self.candidate is not None
        found = self.candidate.summary
        self._enter(
            _TRIAL,
            f"roll period {found.roll_period_s:.2f} s; in the recorded waves "
            f"{found.roll_below_passive:.0%} less roll than passive",
        )

    def _check_trial(self) -> None:
        settings, tried = self._settings, self._trial_window
        if self._now_ns - self._trial_since_ns > TRIAL_PATIENCE * settings.trial_s * 1e9:
            self._abort("the trial could not be judged: too many measurements were missing")
            return
        if tried.samples < self._least_samples:
            return
        factor = 1.0 if tried.full else EARLY_FACTOR
        worse = worsening(
            self._baseline,
            tried.statistics,
            factor * settings.roll_factor,
            factor * settings.effort_factor,
        )
        if worse:
            self._refuse(worse)
        elif tried.full:
            self.laws.keep()
            self._accepted_window, self._trial_window = tried, self._accepted_window
            self._tries = 0
            self._finish(RetuningState.RETUNED)

    def _undo(self) -> None:
        """Go back to the law before, and end whatever is under way."""
        reason = "undone by the operator"
        if self.state is not _TRIAL:
            if self.laws.previous is None:
                self._cancel(f"{reason}: there was no law before this one to go back to")
                return
            self.laws.undo()
        self._accepted_window.clear()
        self._finish(RetuningState.UNDONE, reason)
        self._relearn_normal()

    def _cancel(self, reason: str) -> None:
        self._finish(RetuningState.IDLE, reason)

    def _abort(self, reason: str) -> None:
        """End without a new law and without counting a try; see `_refuse`."""
        self._finish(RetuningState.REFUSED, reason)

    def _refuse(self, reasons: tuple[str, ...]) -> None:
        """End without a new law; a change of the ship is tried again, `MOST_TRIES` times in all."""
        if self._changed:
            self._tries += 1
            if self._tries == MOST_TRIES:
                self._relearn_normal()
                reasons = (
                    *reasons,
                    f"refused {MOST_TRIES} times: the present ship is the normal one",
                )
        self._finish(RetuningState.REFUSED, *reasons)

    def _relearn_normal(self) -> None:
        """Take the present ship as normal for the accepted law."""
        self._tries = 0
        self.laws.accepted.monitor.restart()

    def _finish(self, state: RetuningState, *reasons: str) -> None:
        """Enter a state at rest, with the accepted law."""
        if self.laws.on_trial is not None:
            self.laws.drop()
        self._warm_up = None
        self._idle_since_ns = self._now_ns
        self._enter(state, *reasons)

    def _enter(self, state: RetuningState, *reasons: str) -> None:
        self.state = state
        self._log_event(
            reasons, self.candidate.summary if self.candidate and state in _NEW else None
        )

    def _log_event(self, reasons: tuple[str, ...], found: ModelSummary | None = None) -> None:
        self.events.append(RetuningEvent(self._now_ns, self.state, reasons, found))
        self._untaken = min(self._untaken + 1, MOST_EVENTS)
