"""A controller that retunes itself: it identifies the ship by pulses and asks for a law for it.

`LawExchange` has the states. There is one more:

    state      pump command from      to         condition
    at rest    the accepted law       IDENTIFY   requested, scheduled, or the ship has changed
    IDENTIFY   the accepted law and   DESIGN     all pulses are given
               pulses, or the pulses  REFUSED    the roll is above its limit

The limits on pressure, rate, level and power apply to the sum of law and pulses.
"""

import math
from typing import Final, NamedTuple

import numpy as np

from utank_hil.base.arrays import FloatArray
from utank_hil.base.elementary import log
from utank_hil.canbus import RetuningState, Verdict
from utank_hil.canbus.events import ModelSummary
from utank_hil.control import (
    ARX,
    Controller,
    DesignPlant,
    LinearLaw,
    PredictiveLaw,
    PumpLimits,
    WashoutLaw,
)
from utank_hil.retuning.answer import Answer, Candidate
from utank_hil.retuning.estimate import SIGNIFICANT, ChangeMonitor, MotionEstimate, ShipFigures
from utank_hil.retuning.law_bank import MonitoredLaw, WarmUp
from utank_hil.retuning.law_exchange import ANOTHER_QUESTION, RETRY_NS, LawExchange
from utank_hil.retuning.retuner import Retuner
from utank_hil.retuning.settings import RetuningSettings

MOST_TRIES: Final = 3
"""Identifications tried for one change of the ship; if all fail, the new ship counts as normal."""
AGREES: Final = 1.05
"""Factor between roll periods found by pulses and from the motion up to which they agree: the
accuracy that a law's check asks of the period."""
GAIN_FACTOR: Final = 30.0  #: Largest gains of a candidate, relative to the configured law's.
MOST_COEFFICIENTS: Final = 1e9
"""Largest sum of the gains on a reference; it prevents an overflow. Chosen; no study."""

MOST_ADDED: Final = 1.05  #: Largest roll with pulses, relative to the law's before them.
LEAST_ROLL_RAD: Final = math.radians(0.25)
"""Root mean square of the roll before, at least, for `MOST_ADDED`: in a calm sea the pulses may add
what nobody notices. Chosen; no study.
"""

_NEW: Final = (RetuningState.TRIAL, RetuningState.RETUNED)
# in Python 3.11 a member costs eight times as much to read from its class as from the module
_IDENTIFY: Final = RetuningState.IDENTIFY


class Pulses(NamedTuple):
    """Excitation: pressure of each sample, and the RMS of the roll that it makes in still water."""

    pressure_pa: FloatArray  #: shape (N,)
    roll_rad: float


class AdaptiveController(LawExchange):
    """A controller that identifies its ship and has a law designed for it.

    `controller` is that of `law`, at rest; `ship` the one that the law was designed for; `roll` the
    index of the roll among the outputs. Pulses that are added to the law's pressure are scaled to
    the roll before them, so that they roll the ship 5 % more at most (`MOST_ADDED`).
    """

    def __init__(
        self,
        law: LinearLaw,
        controller: Controller,
        ship: ShipFigures,
        roll: int,
        settings: RetuningSettings,
        pulses: Pulses,
        retuner: Retuner,
    ) -> None:
        super().__init__(
            MonitoredLaw(controller, ChangeMonitor(ship)),
            law.matrices().B.shape[1],
            roll,
            settings,
            retuner,
            len(pulses.pressure_pa),
        )
        self.candidate: Candidate | None = None  #: Latest admitted candidate.
        self._settings = settings
        self._pulses, self._part = pulses, 1.0
        self._law = law
        self._seen: ShipFigures | None = None
        self._estimated = False
        self._pulses_given = 0
        self._tries = 0

    def step(self, y: FloatArray, reference: FloatArray | None = None) -> FloatArray:
        """Take the newest measurement and return the command; see `Controller`."""
        command = super().step(y, reference)
        if self.state is _IDENTIFY and self._pulses_given < len(self._pulses.pressure_pa):
            pulse_pa = self._part * self._pulses.pressure_pa[self._pulses_given]
            self._pulses_given += 1
            command = np.full(1, pulse_pa) if self._settings.alone else command + pulse_pa
        return command

    @property
    def excused(self) -> bool:
        """Whether the pulses roll the ship."""
        return self.state is _IDENTIFY

    def note(self, estimate: MotionEstimate) -> None:
        """Take an estimate of the ship."""
        self._estimated = True
        if estimate.of_ship is Verdict.GOOD:
            self._seen = estimate.ship
        elif estimate.of_ship is Verdict.OUTDATED:
            self._seen = None
        for law in self.laws.stepped:
            law.monitor.watch(estimate)

    def _begin(self, reason: str) -> None:
        self._pulses_given = 0
        if not self._settings.alone:
            self._part = bearable(self._pulses, self._baseline.roll_rad)
        self._enter(_IDENTIFY, reason)

    def _automatic_reason(self) -> str:
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
            return f"the ship has changed: its roll is another by a factor of {change:.2f}"
        return ""

    @property
    def _changed(self) -> bool:
        """Whether the ship has changed since the law was accepted."""
        factor = self._settings.change_factor
        return factor is not None and self.laws.accepted.monitor.change > factor

    def _go_on(self) -> None:
        if self.state is not _IDENTIFY:
            super()._go_on()
        # The roll is judged by its last known value, whatever else is outdated.
        elif abs(self._roll_rad) > self._settings.roll_limit_rad:
            self._abort("the roll is above the limit for identification")
        elif self._pulses_given == len(self._pulses.pressure_pa):
            self._submit(self._history.record(self._pulses_given))

    def _admit(self, answer: Answer) -> WarmUp | str:
        if not isinstance(answer, Candidate):
            return ANOTHER_QUESTION
        if answer.law.output_gains.shape[1:] != (1, self._history.outputs):
            return "the law is for other signals"
        try:
            law, found = answer.whole_law(), ShipFigures.identified(answer.summary)
        except ValueError as error:
            return str(error)
        if law.sample_time_s != self._law.sample_time_s:
            return f"the law's sample time is {law.sample_time_s} s"
        # Bounded gains mean bounded commands, as the applied commands and the outputs are bounded.
        (on_commands, on_outputs), (commands, outputs) = gains(law), gains(self._law)
        most = GAIN_FACTOR * max(1.0, commands)
        if not (on_commands <= most and on_outputs <= GAIN_FACTOR * outputs):
            return "the law's gains are out of bounds"
        if not _sum(answer.law.reference_gains) <= MOST_COEFFICIENTS:
            return "the law's gains on a reference are out of bounds"
        seen = self._seen
        if seen is None and self._estimated:
            return "the motion has not told the ship, so there is nothing to check the answer by"
        if seen is not None and abs(log(found.roll_period_s / seen.roll_period_s)) > max(
            log(AGREES), SIGNIFICANT * seen.period_deviation
        ):
            return (
                f"the roll period found, {found.roll_period_s:.2f} s, is not that of the motion,"
                f" {seen.roll_period_s:.2f} s"
            )
        self.candidate = answer
        service = MonitoredLaw(law.controller(), ChangeMonitor(found), answer.summary)
        return WarmUp(service, self._history)

    def _on_trial(self) -> str:
        assert self.candidate is not None
        found = self.candidate.summary
        return (
            f"roll period {found.roll_period_s:.2f} s; in the recorded waves "
            f"{found.roll_below_passive:.0%} less roll than passive"
        )

    def _accept(self) -> None:
        self._tries = 0
        super()._accept()

    def _undo(self) -> None:
        super()._undo()
        if self.state is RetuningState.UNDONE:
            self._relearn_normal()

    def _refuse(self, reasons: tuple[str, ...]) -> None:
        """End without a new law; a change of the ship is tried `MOST_TRIES` times."""
        if self._changed:
            self._tries += 1
            if self._tries == MOST_TRIES:
                self._relearn_normal()
                reasons = (
                    *reasons,
                    f"refused {MOST_TRIES} times: the present ship is the normal one",
                )
        super()._refuse(reasons)

    def _relearn_normal(self) -> None:
        """Take the present ship as normal for the accepted law."""
        self._tries = 0
        self.laws.accepted.monitor.restart()

    @property
    def _found(self) -> ModelSummary | None:
        return self.candidate.summary if self.candidate and self.state in _NEW else None


def gains(law: LinearLaw) -> tuple[float, float]:
    """Sums of a law's absolute gains on commands and outputs (observer form); takes many ticks."""
    share, inner = (law.share, law.law) if isinstance(law, WashoutLaw) else (0.0, law)
    assert isinstance(inner, PredictiveLaw)
    outputs = (1 - share) * _sum(inner.output_gains) + share * inner.output_gains.shape[2]
    return _sum(inner.input_gains), outputs


def _sum(values: FloatArray) -> float:
    """Sum of the absolute values; infinite if it overflows."""
    with np.errstate(over="ignore"):
        return float(np.abs(values).sum())


def make_pulses(settings: RetuningSettings, plant: DesignPlant, sample_time_s: float) -> Pulses:
    """Return an excitation within all limits of pump, roll and level.

    Roll and level are predicted for the pulses alone, in still water on the given plant. In service
    the limiter applies the level limit to the sum of waves, law and pulses.
    """
    # scipy.optimize is slow to import and needed with retuning only
    from utank_hil.identification import chirp, multisine, prbs, random_pulses, response_scale

    limits = plant.limits
    bounds = PumpLimits(
        pressure_pa=min(settings.pulse_pa, limits.pressure_pa), rate_pa_s=limits.rate_pa_s
    )
    length_s, seed, step_s = settings.identification_s, settings.seed, sample_time_s
    hold_s, band = settings.pulse_hold_s, settings.excitation.band
    match settings.excitation.kind:
        case "random_pulses":
            pulses = random_pulses(length_s, bounds, seed, hold_s, sample_time_s=step_s)
        case "prbs":
            pulses = prbs(length_s, bounds, seed, hold_s[0], sample_time_s=step_s)
        case "multisine":
            pulses = multisine(length_s, bounds, seed, band, sample_time_s=step_s)
        case "chirp":
            pulses = chirp(length_s, bounds, band, sample_time_s=step_s)
    sampled = plant.sampled(("roll_rad", "level_m"), sample_time_s)
    model = ARX.from_state_space(sampled, len(sampled.A))
    response_limits = np.array([settings.added_roll_rad, limits.level_m])
    pulses = pulses * response_scale(pulses, model, response_limits)
    return Pulses(pulses, float(np.std(model.simulate(pulses[:, None])[:, 0])))


def bearable(pulses: Pulses, roll_rad: float) -> float:
    """Part of the pulses that raises `roll_rad` RMS to `MOST_ADDED` times, as squares add up."""
    added_rad = math.sqrt(MOST_ADDED * MOST_ADDED - 1) * max(LEAST_ROLL_RAD, roll_rad)
    return min(1.0, added_rad / max(pulses.roll_rad, 1e-12))
