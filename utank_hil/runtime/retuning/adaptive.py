"""The controller that retunes itself: identify, have a law designed, try it, keep it or not.

`AdaptiveController` stands where any other controller stands. Between the steps `update` moves it
on::

    IDLE -> IDENTIFY (pulses, recorded) -> DESIGN (elsewhere) -> TRIAL -> RETUNED
             |                              |                     |          |
             v                              v                     v          v
           REFUSED, or IDLE if given up   REFUSED              REFUSED     UNDONE

The new law's memory is first filled from what was kept of past commands and outputs, a piece at
each step; then its answer is faded in while the old one's fades out. The old law goes on being
stepped, so the way back is the same, at any time. Whatever is asked for, the limits on pressure,
rate, level and power apply to the sum of it all, after this.
"""

from dataclasses import dataclass
from typing import Final

import numpy as np

from utank_hil.arrays import FloatArray
from utank_hil.canbus import OperatorCommand, RetuningState
from utank_hil.control import ARX, Controller, LinearLaw
from utank_hil.runtime.retuning.answer import Candidate, Refusal
from utank_hil.runtime.retuning.history import SampleHistory
from utank_hil.runtime.retuning.monitor import ChangeMonitor
from utank_hil.runtime.retuning.retuner import Retuner
from utank_hil.runtime.retuning.settings import EARLIEST_VERDICT_S, RetuningSettings
from utank_hil.runtime.retuning.trial import Effort, MovingEffort, worsening

FADE_SAMPLES: Final = 15
FILL_SAMPLES: Final = 1000
"""Past samples a new law's memory is filled from: more than any law or washout remembers."""
FILL_AT_ONCE: Final = 50
EARLY_FACTOR: Final = 1.5
"""A law this much worse than the trial allows is taken back before the trial's end."""
GAIN_FACTOR: Final = 30.0
"""A law may have so many times the gains of the configured one."""

_BUSY: Final = (RetuningState.IDENTIFY, RetuningState.DESIGN, RetuningState.TRIAL)


@dataclass(frozen=True, slots=True)
class RetuningEvent:
    """One step in the life of a retuning controller.

    Attributes
    ----------
    time_ns : int
        On the node's clock.
    state : RetuningState
        Entered then.
    reasons : tuple of str
        Why.
    """

    time_ns: int
    state: RetuningState
    reasons: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class _Service:
    """A law in service, or one that was."""

    controller: Controller
    monitor: ChangeMonitor


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
        self._settings = settings
        self._roll = roll
        self._retuner = retuner
        self._pulses_pa = pulses_pa
        self._largest_gain = GAIN_FACTOR * _gain(law)
        self._current = _Service(law.controller(), ChangeMonitor(model, roll))
        self._other: _Service | None = None
        self._incoming: _Service | None = None
        self._filled = 0
        self._fade = FADE_SAMPLES
        self._history = SampleHistory(
            max(len(pulses_pa), FILL_SAMPLES + FILL_AT_ONCE), model.outputs
        )
        trial = round(settings.trial_s / law.sample_time_s)
        self._usual, self._tried = MovingEffort(trial), MovingEffort(trial)
        self._before: Effort | None = None
        self._pulse = 0
        self._number = 0
        self._since_ns = 0
        self._idle_since_ns: int | None = None
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
        self._engaged, self._fresh = engaged, fresh
        if self._idle_since_ns is None:
            self._idle_since_ns = now_ns
        forbidden = order is not None and order.forbid_retuning
        ordered = order is not None and order.retune and not self._retune_bit
        undo = order is not None and order.undo and not self._undo_bit
        if order is not None:
            self._retune_bit, self._undo_bit = order.retune, order.undo
        if self.state in _BUSY and (forbidden or not engaged):
            self._give_up(now_ns, "forbidden by the operator" if forbidden else "not in charge")
        elif undo and self.state in (RetuningState.TRIAL, RetuningState.RETUNED):
            self._take_back()
            self._finish(RetuningState.UNDONE, now_ns, ("undone by the operator",))
        elif self.state is RetuningState.IDENTIFY:
            self._identify(now_ns)
        elif self.state is RetuningState.DESIGN:
            self._await_law(now_ns)
        elif self.state is RetuningState.TRIAL:
            self._judge(now_ns)
        elif engaged and not forbidden:
            reason = "ordered by the operator" if ordered else self._own_reason(now_ns)
            if reason:
                self._begin(now_ns, reason)

    def step(self, y: FloatArray, reference: FloatArray | None = None) -> FloatArray:
        """Take the newest measurement and return the command; see `Controller`."""
        self._roll_rad = float(y[self._roll])
        if self._fresh and self._engaged:
            self._current.monitor.watch(self._history, self._applied_pa, self._roll_rad)
            effort = self._tried if self.state is RetuningState.TRIAL else self._usual
            if self.state not in (RetuningState.IDENTIFY, RetuningState.DESIGN):
                effort.add(self._roll_rad, self._applied_pa)
        self._history.add(self._applied_pa, y, fresh=self._fresh)
        answer = self._current.controller.step(y, reference)
        if self._other is not None:
            fading = self._other.controller.step(y, reference)
            if self._fade < FADE_SAMPLES:
                self._fade += 1
                answer = fading + self._fade / FADE_SAMPLES * (answer - fading)
            elif self.state not in (RetuningState.TRIAL, RetuningState.RETUNED):
                self._other = None
        self._fill_incoming()
        if self.state is RetuningState.IDENTIFY and self._pulse < len(self._pulses_pa):
            pulse_pa = self._pulses_pa[self._pulse]
            self._pulse += 1
            answer = np.full(1, pulse_pa) if self._settings.alone else answer + pulse_pa
        return answer

    def applied(self, u: FloatArray) -> None:
        """Take the command that left; see `Controller`."""
        self._applied_pa = float(u[0])
        self._current.controller.applied(u)
        if self._other is not None:
            self._other.controller.applied(u)

    def reset(self) -> None:
        """Forget the past of all laws; one on trial is taken back."""
        if self.state is RetuningState.TRIAL:
            self._take_back()
        self._current.controller.reset()
        if self._other is not None:
            self._other.controller.reset()

    def _own_reason(self, now_ns: int) -> str:
        """Why to retune without an order; empty if there is no reason."""
        settings = self._settings
        assert self._idle_since_ns is not None
        every_s = settings.every_s
        if every_s is not None and now_ns - self._idle_since_ns >= every_s * 1e9:
            return "on schedule"
        change = self._current.monitor.change
        if settings.change_factor is not None and change > settings.change_factor:
            return f"the ship has changed: prediction errors are off the normal {change:.2f} times"
        return ""

    def _begin(self, now_ns: int, reason: str) -> None:
        self._before = self._usual.effort
        self._pulse = 0
        self._since_ns = now_ns
        self._enter(RetuningState.IDENTIFY, now_ns, (reason,))

    def _identify(self, now_ns: int) -> None:
        if self._fresh and abs(self._roll_rad) > self._settings.roll_limit_rad:
            self._refuse(now_ns, ("the roll is above the limit for identification",))
        elif self._pulse == len(self._pulses_pa):
            self._number += 1
            self._since_ns = now_ns
            self._retuner.submit(self._number, self._history.record(self._pulse), now_ns)
            self._enter(RetuningState.DESIGN, now_ns, ())

    def _await_law(self, now_ns: int) -> None:
        if self._incoming is not None:
            if self._filled == self._history.count:
                self._put_on_trial(self._incoming, now_ns)
            return
        answer = self._retuner.answer(self._number, now_ns)
        if isinstance(answer, Refusal):
            self._refuse(now_ns, answer.reasons)
        elif answer is not None:
            self._take_in(answer, now_ns)
        elif now_ns - self._since_ns > self._settings.answer_within_s * 1e9:
            self._refuse(now_ns, ("no answer in time: the retuner hangs or is dead",))

    def _take_in(self, candidate: Candidate, now_ns: int) -> None:
        """Look once more at a candidate, which came from another process, and take it in."""
        law = candidate.whole_law()
        if law.sample_time_s != self.sample_time_s:
            self._refuse(now_ns, (f"the law's sample time is {law.sample_time_s} s",))
        elif candidate.law.output_gains.shape[1:] != (1, self._history.outputs):
            self._refuse(now_ns, ("the law is for other signals",))
        elif not _gain(law) <= self._largest_gain:
            self._refuse(now_ns, ("the law's gains are out of bounds",))
        else:
            self.candidate = candidate
            self._incoming = _Service(law.controller(), ChangeMonitor(candidate.model, self._roll))
            self._filled = max(0, self._history.count - FILL_SAMPLES)

    def _fill_incoming(self) -> None:
        """Step an incoming law through the past, some samples at a time."""
        if self._incoming is None:
            return
        controller, missing = self._incoming.controller, self._history.count - self._filled
        rows = self._history.latest(missing)[:FILL_AT_ONCE]
        for row in rows:
            controller.applied(row[:1])
            controller.step(row[1:])
        self._filled += len(rows)

    def _put_on_trial(self, incoming: _Service, now_ns: int) -> None:
        incoming.controller.applied(np.full(1, self._applied_pa))
        self._current, self._other, self._incoming = incoming, self._current, None
        self._fade = 0
        self._tried.clear()
        assert self.candidate is not None
        found = self.candidate.summary
        self._enter(
            RetuningState.TRIAL,
            now_ns,
            (
                f"roll period {found.roll_period_s:.2f} s; in the recorded waves "
                f"{found.roll_below_passive:.0%} less roll than passive",
            ),
        )

    def _judge(self, now_ns: int) -> None:
        settings, after = self._settings, self._tried.effort
        early = self._tried.samples * self.sample_time_s < EARLIEST_VERDICT_S
        if after is None or early:
            return
        worse: tuple[str, ...] = ()
        if self._before is not None:
            factor = 1.0 if self._tried.full else EARLY_FACTOR
            worse = worsening(
                self._before, after, factor * settings.roll_factor, factor * settings.effort_factor
            )
        if worse:
            self._take_back()
            self._refuse(now_ns, worse)
        elif self._tried.full:
            self._usual, self._tried = self._tried, self._usual
            self._finish(RetuningState.RETUNED, now_ns, ())

    def _take_back(self) -> None:
        """Fade over to the law before this one."""
        assert self._other is not None
        self._current, self._other = self._other, self._current
        self._fade = 0

    def _give_up(self, now_ns: int, reason: str) -> None:
        if self.state is RetuningState.TRIAL:
            self._take_back()
        self._finish(RetuningState.IDLE, now_ns, (reason,))

    def _refuse(self, now_ns: int, reasons: tuple[str, ...]) -> None:
        self._finish(RetuningState.REFUSED, now_ns, reasons)

    def _finish(self, state: RetuningState, now_ns: int, reasons: tuple[str, ...]) -> None:
        self._incoming = None
        self._idle_since_ns = now_ns
        self._current.monitor.restart()  # what is normal with the present law, in the present sea
        self._enter(state, now_ns, reasons)

    def _enter(self, state: RetuningState, now_ns: int, reasons: tuple[str, ...]) -> None:
        self.state = state
        self.events.append(RetuningEvent(now_ns, state, reasons))


def _gain(law: LinearLaw) -> float:
    """Sum of a law's gains on its outputs; cheap, for the loop."""
    return float(np.abs(law.matrices().B).sum())
