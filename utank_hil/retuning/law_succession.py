"""The laws of a controller that retunes itself: which is in charge, and which may come back.

    accepted   the last that passed its trial; to begin with the configured one
    on trial   in charge in place of the accepted one, until it is kept or dropped
    previous   the one accepted before: what the operator's undo goes back to
    fading     the one that was in charge until just now

Nothing else is ever in charge. All of them are stepped and told what left, so that each takes over
with a memory of its own; where the one in charge changes, answers are faded from one to the other.
"""

import math
from dataclasses import dataclass
from typing import Final

import numpy as np

from utank_hil.arrays import FloatArray
from utank_hil.control import Controller
from utank_hil.retuning.change_monitor import ChangeMonitor

FADE_SAMPLES: Final = 15
_NOTHING: Final = np.zeros(1)


@dataclass(frozen=True, slots=True, eq=False)
class LawInService:
    """A law that is stepped, and what watches whether its model still fits the ship."""

    controller: Controller
    monitor: ChangeMonitor


class Laws:
    """The laws of one controller.

    Parameters
    ----------
    configured : LawInService
        To begin with.

    Attributes
    ----------
    accepted : LawInService
    on_trial, previous : LawInService or None
    """

    def __init__(self, configured: LawInService) -> None:
        self.accepted = configured
        self.on_trial: LawInService | None = None
        self.previous: LawInService | None = None
        self._fading: LawInService | None = None
        self._fade = FADE_SAMPLES
        self._stepped: tuple[LawInService, ...] = (configured,)

    @property
    def in_charge(self) -> LawInService:
        """Whose answer counts."""
        return self.accepted if self.on_trial is None else self.on_trial

    def try_out(self, law: LawInService) -> None:
        """Put a law on trial."""
        self.on_trial = law
        self._fade_from(self.accepted)

    def keep(self) -> None:
        """Accept the law on trial."""
        assert self.on_trial is not None
        self.previous, self.accepted, self.on_trial = self.accepted, self.on_trial, None
        self._arrange()

    def drop(self) -> None:
        """Go back from the law on trial to the accepted one."""
        dropped, self.on_trial = self.on_trial, None
        self._fade_from(dropped)

    def undo(self) -> None:
        """Go back from the accepted law to the one before it."""
        assert self.previous is not None
        undone, self.accepted, self.previous = self.accepted, self.previous, None
        self._fade_from(undone)

    def step(self, y: FloatArray, reference: FloatArray | None = None) -> FloatArray:
        """Step them all; the answer of the one in charge.

        A law on trial whose answer is not finite is dropped there and then, without a fade; so is
        one that answers are faded from.
        """
        charge = self.in_charge
        answer = accepted = outgoing = _NOTHING
        for law in self._stepped:
            one = law.controller.step(y, reference)
            if law is charge:
                answer = one
            if law is self.accepted:
                accepted = one
            if law is self._fading:
                outgoing = one
        if self.on_trial is not None and not math.isfinite(answer[0]):
            self.on_trial = None
            self._stop_fading()
            return accepted
        if self._fading is not None and not math.isfinite(outgoing[0]):
            self._stop_fading()  # there is nothing to fade from
        if self._fading is not None:
            self._fade += 1
            answer = outgoing + self._fade / FADE_SAMPLES * (answer - outgoing)
            if self._fade == FADE_SAMPLES:
                self._stop_fading()
        return answer

    def applied(self, u: FloatArray) -> None:
        """Tell them all the command that left."""
        for law in self._stepped:
            law.controller.applied(u)

    def reset(self) -> None:
        """Forget the past of them all, and drop a law on trial."""
        self.on_trial = None
        self._stop_fading()
        for law in self._stepped:
            law.controller.reset()

    def _fade_from(self, outgoing: LawInService | None) -> None:
        """Fade to the law in charge; half-way back, if it was just fading itself."""
        back = self._fading is self.in_charge
        self._fade = FADE_SAMPLES - self._fade if back else 0
        self._fading = outgoing if self._fade < FADE_SAMPLES else None
        self._arrange()

    def _stop_fading(self) -> None:
        self._fading = None
        self._fade = FADE_SAMPLES
        self._arrange()

    def _arrange(self) -> None:
        """Note which laws are to be stepped, each once."""
        every = (self.accepted, self.on_trial, self.previous, self._fading)
        self._stepped = tuple({id(law): law for law in every if law is not None}.values())
