"""A law that came from the retuner, before its trial: looked at once more, its memory filled."""

from typing import Final

import numpy as np

from utank_hil.control import LinearLaw
from utank_hil.retuning.answer import Candidate
from utank_hil.retuning.change_monitor import ChangeMonitor
from utank_hil.retuning.history import SampleHistory
from utank_hil.retuning.law_succession import LawInService

FILL_SAMPLES: Final = 1000
"""Past samples a new law's memory is filled from: more than any law or washout remembers."""
FILL_AT_ONCE: Final = 50
GAIN_FACTOR: Final = 30.0
"""A law may have so many times the gains of the configured one."""


class Entrance:
    """What a law must be to be let in: of the same signals, and of bounded gains.

    A law's answer is at most its gains on past commands times the pump's limit, plus its gains on
    outputs times the outputs, because it is told what really left: bounded gains, finite answers.

    Parameters
    ----------
    configured : LinearLaw
        Whose gains are the measure.
    history : SampleHistory
        That the law's memory is filled from, and that its model predicts from.
    roll : int
        Index of the roll among the outputs.
    """

    def __init__(self, configured: LinearLaw, history: SampleHistory, roll: int) -> None:
        self._history = history
        self._roll = roll
        self._sample_time_s = configured.sample_time_s
        own, outputs = _gains(configured)
        self._most_own = GAIN_FACTOR * max(1.0, own)
        self._most_outputs = GAIN_FACTOR * outputs

    def let_in(self, candidate: Candidate) -> "IncomingLaw | str":
        """The law of a candidate, or why it is not let in."""
        outputs, model = self._history.outputs, candidate.model
        if candidate.law.output_gains.shape[1:] != (1, outputs):
            return "the law is for other signals"
        if (model.outputs, model.inputs) != (outputs, 1):
            return "the law's model is for other signals"
        if model.order > self._history.capacity:
            return (
                f"the law's model looks back {model.order} samples, {self._history.capacity} are "
                "kept"
            )
        try:
            law = candidate.whole_law()
        except ValueError as error:
            return str(error)
        if law.sample_time_s != self._sample_time_s:
            return f"the law's sample time is {law.sample_time_s} s"
        own, on_outputs = _gains(law)
        if not (own <= self._most_own and on_outputs <= self._most_outputs):
            return "the law's gains are out of bounds"
        service = LawInService(law.controller(), ChangeMonitor(model, self._roll))
        return IncomingLaw(service, self._history)


class IncomingLaw:
    """A law whose memory is filled from the past, a piece at each sample.

    Parameters
    ----------
    law : LawInService
    history : SampleHistory

    Attributes
    ----------
    law : LawInService
    """

    def __init__(self, law: LawInService, history: SampleHistory) -> None:
        self.law = law
        self._history = history
        self._filled = max(0, history.count - FILL_SAMPLES)

    @property
    def filled(self) -> bool:
        """Whether it remembers all there is."""
        return self._filled == self._history.count

    def fill(self) -> None:
        """Step it through the next piece."""
        controller, missing = self.law.controller, self._history.count - self._filled
        rows = self._history.latest(missing)[:FILL_AT_ONCE]
        for row in rows:
            controller.applied(row[:1])
            controller.step(row[1:])
        self._filled += len(rows)


def _gains(law: LinearLaw) -> tuple[float, float]:
    """Sums of a law's gains on past commands and on outputs, cheap enough for the loop.

    `matrices` gives predictive laws in observer form, with or without a washout: the command is the
    first state, so the first column is what past commands weigh.
    """
    model = law.matrices()
    with np.errstate(over="ignore", invalid="ignore"):
        own, outputs = float(np.abs(model.A[:, 0]).sum()), float(np.abs(model.B).sum())
    return own, outputs
