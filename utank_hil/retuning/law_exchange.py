"""Exchange of a law for a better one while the loop runs: request, trial, acceptance or return.

`LawExchange` has the interface of every other controller; `update` advances its state machine
between two steps. These are its states and all transitions:

    state      pump command from      to         condition
    at rest    the accepted law       `_begin`   ordered, or due by itself; and permitted, engaged
                                                 for 30 s without interruption, and the retuner
                                                 alive
                                      REFUSED    the same, but the retuner has no heartbeat
                                      UNDONE     undo, if a law was accepted before this one
    DESIGN     the accepted law       TRIAL      a law was admitted and is warmed up
                                      REFUSED    a refusal, no answer in time, or not admitted
    TRIAL      the law on trial       RETUNED    the trial is over: the law is accepted
                                      REFUSED    worse, a command that is not finite, `reset`, or
                                                 not judged in half as long again
    either     (busy)                 IDLE       forbidden, or no longer engaged
                                      UNDONE     undo: from TRIAL back to the accepted law, from
                                                 DESIGN to the one before it (IDLE if none)

IDLE, RETUNED, REFUSED and UNDONE are the states at rest. They behave alike and differ only in what
they report. `LawBank` does the switching of laws that belongs to these transitions. What begins an
exchange, and what is asked, is the subclass's: `AdaptiveController`, `RenewingController`.

The limits on pressure, rate, level and power apply downstream.
"""

from abc import ABC, abstractmethod
from collections import deque
from typing import Final

import numpy as np

from utank_hil.base.arrays import FloatArray
from utank_hil.canbus import RetuningOrder, RetuningState
from utank_hil.canbus.events import ModelSummary, RetuningEvent
from utank_hil.retuning.answer import Answer, Refusal
from utank_hil.retuning.estimate import MotionEstimate
from utank_hil.retuning.law_bank import (
    WARM_UP_CHUNK,
    WARM_UP_SAMPLES,
    LawBank,
    MonitoredLaw,
    SampleHistory,
    WarmUp,
)
from utank_hil.retuning.retuner import Request, Retuner
from utank_hil.retuning.settings import EARLIEST_VERDICT_S, RetuningSettings, TrialSettings
from utank_hil.retuning.trial import MovingWindow, WindowStatistics, worsening

EARLY_FACTOR: Final = 1.5
"""A law this much worse than the trial allows is dropped before the end of the trial."""
TRIAL_PATIENCE: Final = 1.5
"""Times its length at which a trial without enough measurements is given up."""
MOST_EVENTS: Final = 1000  #: Number of events kept: two days of one retuning every three minutes.
RETRY_NS: Final = 600_000_000_000
"""Shortest time from a failed or undone exchange to the next one without an order."""
BUSY_NS: Final = 30_000_000_000
"""Time without a heartbeat for which a retuner may be busy with an estimate."""
ANOTHER_QUESTION: Final = "the retuner answered another question"

_REQUESTED: Final = "ordered by the operator"
_BUSY: Final = (RetuningState.IDENTIFY, RetuningState.DESIGN, RetuningState.TRIAL)
# in Python 3.11 a member costs eight times as much to read from its class as from the module
_, _DESIGN, _TRIAL = _BUSY


class LawExchange(ABC):
    """A controller whose law is replaced by a better one while it runs.

    There are `outputs` outputs; `roll` is the index of the roll among them. The record of commands
    and outputs has at least `history_samples`. No law is judged before `earliest_s`.
    """

    def __init__(
        self,
        first: MonitoredLaw,
        outputs: int,
        roll: int,
        settings: TrialSettings | RetuningSettings,
        retuner: Retuner,
        history_samples: int = 0,
        earliest_s: float = EARLIEST_VERDICT_S,
    ) -> None:
        self.sample_time_s = first.controller.sample_time_s
        self.state = RetuningState.IDLE
        self.events: deque[RetuningEvent] = deque(maxlen=MOST_EVENTS)  #: The last `MOST_EVENTS`.
        self._untaken = 0
        self.laws = LawBank(first)
        self._trial_settings = settings
        self._roll = roll
        self._retuner = retuner
        self._history = SampleHistory(
            max(history_samples, WARM_UP_SAMPLES + WARM_UP_CHUNK), outputs
        )
        self._warm_up: WarmUp | None = None
        trial = round(settings.trial_s / self.sample_time_s)
        self._least_samples = min(trial, round(earliest_s / self.sample_time_s))
        # The accepted law is recorded while engaged and without pulses.
        self._accepted_window, self._trial_window = MovingWindow(trial), MovingWindow(trial)
        self._baseline: WindowStatistics = self._accepted_window.statistics
        self._heel_rad = 0.0
        self._request_number = 0
        self._requested = False
        self._now_ns = self._submitted_ns = self._trial_since_ns = self._not_before_ns = 0
        self._idle_since_ns: int | None = None
        self._silent_since_ns = 0
        self._applied_pa = 0.0
        self._roll_rad = self._passive_roll_rad = 0.0
        self._fresh = self._engaged = False

    @property
    @abstractmethod
    def excused(self) -> bool:
        """Whether the roll is caused by pulses or a resting pump, not by the law."""

    @abstractmethod
    def note(self, estimate: MotionEstimate) -> None:
        """Take an estimate of waves and ship."""

    @abstractmethod
    def _automatic_reason(self) -> str:
        """Return the reason to begin without a request; empty if there is none."""

    @abstractmethod
    def _begin(self, reason: str) -> None:
        """Begin an exchange."""

    @abstractmethod
    def _admit(self, answer: Answer) -> WarmUp | str:
        """Return the warm-up of the answer's law, or the reason why it is not admitted."""

    @abstractmethod
    def _on_trial(self) -> str:
        """Describe in words what the law on trial was designed for."""

    def update(
        self,
        now_ns: int,
        order: RetuningOrder,
        *,
        engaged: bool,
        fresh: bool,
        passive_roll_rad: float = 0.0,
    ) -> None:
        """Advance the state machine; call once before every `step`.

        `engaged` says whether this controller's command drives the pump, `fresh` whether the
        outputs for `step` are new measurements, not held values. `passive_roll_rad` is the present
        roll of the ship if its tank were passive; not finite if unknown.
        """
        self._now_ns, self._engaged, self._fresh = now_ns, engaged, fresh
        self._passive_roll_rad = passive_roll_rad
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
        elif self.state in _BUSY:
            self._go_on()
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
            window = None
            if self.state is _TRIAL:
                window = self._trial_window
            elif self.state not in _BUSY:
                window = self._accepted_window
            if window is not None:
                window.add(self._roll_rad, self._applied_pa, self._passive_roll_rad)
        self._history.add(self._applied_pa, y, fresh=self._fresh)
        command = self.laws.step(y, reference)
        if self.state is _TRIAL and self.laws.on_trial is None:
            self._refuse(("the law's answer was not finite",))
        if self._warm_up is not None:
            self._warm_up.advance()
        return command

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
        """Begin if there is a reason, a baseline to compare with, and a live retuner."""
        self._requested = self._requested or ordered
        reason = _REQUESTED if self._requested else self._automatic_reason()
        if not reason:
            return
        if self._accepted_window.samples < self._least_samples:
            if ordered:
                charge = f"in charge for {self._least_samples * self.sample_time_s:.0f} s"
                why = f"begins when the law has been {charge} without a break, to compare with it"
                self._log_event((f"{reason}: {why}",))
            return
        if not self._retuner.alive:
            self._silent_since_ns = self._silent_since_ns or self._now_ns
            if self._now_ns - self._silent_since_ns < BUSY_NS:
                return
            self._silent_since_ns = 0
            self._requested = False
            self._not_before_ns = self._now_ns + RETRY_NS
            self._finish(
                RetuningState.REFUSED,
                f"{reason}, but the retuner shows no sign of life: try again later",
            )
            return
        self._silent_since_ns = 0
        self._requested = False
        self._baseline = self._accepted_window.statistics
        self._heel_rad = self._accepted_window.heel_rad
        self._accepted_window.clear()
        self._begin(reason)

    def _go_on(self) -> None:
        if self.state is _DESIGN:
            self._await_law()
        else:
            self._check_trial()

    def _submit(self, request: Request, *reasons: str) -> None:
        """Ask the retuner for a law."""
        self._request_number += 1
        self._submitted_ns = self._now_ns
        self._retuner.submit(self._request_number, request, self._now_ns)
        self._enter(_DESIGN, *reasons)

    def _await_law(self) -> None:
        if self._warm_up is not None:
            if self._warm_up.done:
                self._put_on_trial(self._warm_up.law)
            return
        answer = self._retuner.answer(self._request_number, self._now_ns)
        if isinstance(answer, Refusal):
            self._refuse(answer.reasons)
        elif answer is not None:
            warm_up = self._admit(answer)
            if isinstance(warm_up, str):
                self._refuse((warm_up,))
            else:
                self._warm_up = warm_up
        elif self._now_ns - self._submitted_ns > self._trial_settings.answer_within_s * 1e9:
            self._abort("no answer in time: the retuner hangs or is dead")

    def _put_on_trial(self, law: MonitoredLaw) -> None:
        law.controller.applied(np.full(1, self._applied_pa))
        self.laws.try_out(law)
        self._warm_up = None
        self._trial_window.clear()
        self._trial_since_ns = self._now_ns
        self._enter(_TRIAL, self._on_trial())

    def _check_trial(self) -> None:
        settings, tried = self._trial_settings, self._trial_window
        if self._now_ns - self._trial_since_ns > TRIAL_PATIENCE * settings.trial_s * 1e9:
            self._abort("the trial could not be judged: too many measurements were missing")
            return
        if tried.samples < self._least_samples:
            return
        factor = 1.0 if tried.full else EARLY_FACTOR
        worse = worsening(
            self._to_compare_with(tried.statistics),
            tried.statistics,
            factor * settings.roll_factor,
            factor * settings.effort_factor,
        )
        if worse:
            self._refuse(worse)
        elif tried.full:
            self.laws.keep()
            self._accepted_window, self._trial_window = tried, self._accepted_window
            self._accept()

    def _to_compare_with(self, tried: WindowStatistics) -> WindowStatistics:  # noqa: ARG002
        """Return the statistics that a law on trial is compared with."""
        return self._baseline

    def _accept(self) -> None:
        self._finish(RetuningState.RETUNED)

    def _undo(self) -> None:
        """Return to the previous law and end any exchange."""
        reason = "undone by the operator"
        if self.state is not _TRIAL:
            if self.laws.previous is None:
                self._cancel(f"{reason}: there was no law before this one to go back to")
                return
            self.laws.undo()
        self._accepted_window.clear()
        self._finish(RetuningState.UNDONE, reason)

    def _cancel(self, reason: str) -> None:
        self._finish(RetuningState.IDLE, reason)

    def _abort(self, reason: str) -> None:
        """End without a new law, for a reason unrelated to the law."""
        self._finish(RetuningState.REFUSED, reason)

    def _refuse(self, reasons: tuple[str, ...]) -> None:
        """End without a new law."""
        self._finish(RetuningState.REFUSED, *reasons)

    def _finish(self, state: RetuningState, *reasons: str) -> None:
        """Enter a state at rest with the accepted law."""
        if self.laws.on_trial is not None:
            self.laws.drop()
        self._warm_up = None
        self._idle_since_ns = self._now_ns
        self._enter(state, *reasons)

    def _enter(self, state: RetuningState, *reasons: str) -> None:
        self.state = state
        self._log_event(reasons, self._found)

    @property
    def _found(self) -> ModelSummary | None:
        """Return the identified ship of the present state, if any."""
        return None

    def _log_event(self, reasons: tuple[str, ...], found: ModelSummary | None = None) -> None:
        self.events.append(RetuningEvent(self._now_ns, self.state, reasons, found))
        self._untaken = min(self._untaken + 1, MOST_EVENTS)
