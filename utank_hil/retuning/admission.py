"""Admission of a candidate law before its trial: bounds on its gains, and warm-up of its memory."""

from collections.abc import Callable
from typing import Final

import numpy as np

from utank_hil.base.arrays import FloatArray
from utank_hil.control import LinearLaw, PredictiveLaw, WashoutLaw
from utank_hil.retuning.answer import Answer, Candidate
from utank_hil.retuning.change_monitor import ChangeMonitor
from utank_hil.retuning.estimate import ShipFigures
from utank_hil.retuning.history import SampleHistory
from utank_hil.retuning.law_bank import MonitoredLaw

WARM_UP_SAMPLES: Final = 1000
"""Past samples that a new law is stepped through: more than the memory of any law or washout."""
WARM_UP_CHUNK: Final = 50  #: Number of warm-up samples processed in one sample time.
GAIN_FACTOR: Final = 30.0  #: Largest gains of a candidate, relative to the configured law's.
ANOTHER_QUESTION: Final = "the retuner answered another question"
MOST_COEFFICIENTS: Final = 1e9
"""Largest sum of the gains on a reference; it prevents an overflow. Chosen; no study."""


class Admission:
    """Conditions on a candidate: the same signals and sample time, and bounded gains.

    Bounded gains mean bounded commands: the law feeds back the applied commands, which the pump
    limits, and the outputs. `configured` is the reference for the bounds on the gains; `history`
    has the samples for the warm-up.
    """

    def __init__(self, configured: LinearLaw, history: SampleHistory) -> None:
        self._history = history
        self._sample_time_s = configured.sample_time_s
        on_commands, outputs = _gains(configured)
        self._most_on_commands = GAIN_FACTOR * max(1.0, on_commands)
        self._most_on_outputs = GAIN_FACTOR * outputs

    def admit(self, candidate: Answer) -> "WarmUp | str":
        """Return the warm-up of the candidate's law, or the reason why it is not admitted."""
        if not isinstance(candidate, Candidate):
            return ANOTHER_QUESTION
        if candidate.law.output_gains.shape[1:] != (1, self._history.outputs):
            return "the law is for other signals"
        try:
            law, figures = candidate.whole_law(), ShipFigures.identified(candidate.summary)
        except ValueError as error:
            return str(error)
        if law.sample_time_s != self._sample_time_s:
            return f"the law's sample time is {law.sample_time_s} s"
        on_commands, on_outputs = _candidate_gains(candidate.law, law)
        if not (on_commands <= self._most_on_commands and on_outputs <= self._most_on_outputs):
            return "the law's gains are out of bounds"
        if not _sum(candidate.law.reference_gains) <= MOST_COEFFICIENTS:
            return "the law's gains on a reference are out of bounds"
        service = MonitoredLaw(law.controller(), ChangeMonitor(figures), candidate.summary)
        return WarmUp(service, self._history)


class WarmUp:
    """Steps a new law through past samples, one chunk per sample time.

    `observe` replaces the law's `step` for a law whose answers are not used.
    """

    def __init__(
        self,
        law: MonitoredLaw,
        history: SampleHistory,
        observe: Callable[[FloatArray], object] | None = None,
    ) -> None:
        self.law = law
        self._history = history
        self._observe = observe or law.controller.step
        self._stepped = max(0, history.count - WARM_UP_SAMPLES)

    @property
    def done(self) -> bool:
        """Whether the law has been stepped through all samples."""
        return self._stepped == self._history.count

    def advance(self) -> None:
        """Step the law through the next chunk."""
        controller, missing = self.law.controller, self._history.count - self._stepped
        rows = self._history.latest(missing)[:WARM_UP_CHUNK]
        for row in rows:
            controller.applied(row[:1])
            self._observe(row[1:])
        self._stepped += len(rows)


def _gains(law: LinearLaw) -> tuple[float, float]:
    """Sums of a law's absolute gains on past commands and on outputs.

    `matrices` gives predictive laws in observer form, with or without a washout. The command is the
    first state there, so the first column of A holds the gains on past commands.
    """
    model = law.matrices()
    return _sum(model.A[:, 0]), _sum(model.B)


def _candidate_gains(inner: PredictiveLaw, whole: LinearLaw) -> tuple[float, float]:
    """Return `_gains` of a predictive law without its matrices, which take many ticks."""
    share = whole.share if isinstance(whole, WashoutLaw) else 0.0
    outputs = (1 - share) * _sum(inner.output_gains) + share * inner.output_gains.shape[2]
    return _sum(inner.input_gains), outputs


def _sum(values: FloatArray) -> float:
    """Sum of the absolute values; infinite if it overflows."""
    with np.errstate(over="ignore"):
        return float(np.abs(values).sum())
