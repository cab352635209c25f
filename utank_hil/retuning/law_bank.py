"""A bank of laws that run in parallel, with bumpless transfer from one active law to the next.

    accepted   the last law that passed its trial; at first the configured one
    on trial   active in place of the accepted law, until it is kept or dropped
    previous   the accepted law before this one: the operator's undo returns to it
    fading     the law that was active until the latest switch

Every law of the bank is stepped and receives the applied command, so that its memory is up to date
when it becomes active. At a switch the command is faded from the old law's to the new one's. A new
law is warmed up with the history of commands and outputs, as the laws received them.
"""

import math
from dataclasses import dataclass
from typing import Final

import numpy as np

from utank_hil.base.arrays import FloatArray
from utank_hil.canbus.events import ModelSummary
from utank_hil.control import Controller
from utank_hil.control.constrained.law import ConstrainedController
from utank_hil.retuning.estimate import ChangeMonitor, MotionEstimate, ShipFigures

FADE_SAMPLES: Final = 15
"""Length of a fade: 3 s at 0.2 s, a quarter of the first ship's roll period."""
_NOTHING: Final = np.zeros(1)


@dataclass(frozen=True, slots=True, eq=False)
class MonitoredLaw:
    """A law's controller, with a monitor of changes of its ship."""

    controller: Controller
    monitor: ChangeMonitor
    #: The identified ship that the law was designed for; None for the configured ship.
    found: ModelSummary | ShipFigures | None = None
    #: Estimate of the waves that it was designed for; None if they were not estimated.
    estimate: MotionEstimate | None = None


class LawBank:
    """The laws of one retuning controller."""

    def __init__(self, configured: MonitoredLaw) -> None:
        self.accepted = configured
        self.on_trial: MonitoredLaw | None = None
        self.previous: MonitoredLaw | None = None
        self._fading: MonitoredLaw | None = None
        self._fade = FADE_SAMPLES
        self.stepped: tuple[MonitoredLaw, ...] = (configured,)  #: Every law of the bank, once.

    @property
    def active(self) -> MonitoredLaw:
        """The law whose command is used."""
        return self.accepted if self.on_trial is None else self.on_trial

    def try_out(self, law: MonitoredLaw) -> None:
        """Make a law active, on trial."""
        self.on_trial = law
        self._fade_from(self.accepted)

    def keep(self) -> None:
        """Accept the law on trial."""
        assert self.on_trial is not None
        self.previous, self.accepted, self.on_trial = self.accepted, self.on_trial, None
        self._collect()

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
        """Step every law; return the command of the active one, faded after a switch.

        A law on trial is dropped at once, without a fade, when its command is not finite. A fade
        ends at once when the command of the law faded from is not finite.
        """
        active = self.active
        command = accepted = outgoing = _NOTHING
        for law in self.stepped:
            output = law.controller.step(y, reference)
            if law is active:
                command = output
            if law is self.accepted:
                accepted = output
            if law is self._fading:
                outgoing = output
        if self.on_trial is not None and not math.isfinite(command[0]):
            self.on_trial = None
            self._stop_fading()
            return accepted
        if self._fading is not None and not math.isfinite(outgoing[0]):
            self._stop_fading()
        if self._fading is not None:
            self._fade += 1
            command = outgoing + self._fade / FADE_SAMPLES * (command - outgoing)
            if self._fade == FADE_SAMPLES:
                self._stop_fading()
        return command

    def applied(self, u: FloatArray) -> None:
        """Give every law the command that was applied."""
        for law in self.stepped:
            law.controller.applied(u)

    def reset(self) -> None:
        """Reset every law, and drop a law on trial."""
        self.on_trial = None
        self._stop_fading()
        for law in self.stepped:
            law.controller.reset()

    def _fade_from(self, outgoing: MonitoredLaw | None) -> None:
        """Begin a fade to the active law; if that law was fading out, reverse its fade."""
        back = self._fading is self.active
        self._fade = FADE_SAMPLES - self._fade if back else 0
        self._fading = outgoing if self._fade < FADE_SAMPLES else None
        self._collect()

    def _stop_fading(self) -> None:
        self._fading = None
        self._fade = FADE_SAMPLES
        self._collect()

    def _collect(self) -> None:
        """Collect the laws to step, each once."""
        every = (self.accepted, self.on_trial, self.previous, self._fading)
        self.stepped = tuple({id(law): law for law in every if law is not None}.values())


WARM_UP_SAMPLES: Final = 1000
"""Past samples that a new law is stepped through: more than the memory of any law or washout."""
WARM_UP_CHUNK: Final = 50  #: Number of warm-up samples processed in one sample time.


class SampleHistory:
    """The latest `capacity` rows (command, outputs...), oldest first."""

    def __init__(self, capacity: int, outputs: int) -> None:
        self.capacity = capacity
        self.outputs = outputs
        self._rows = np.zeros((capacity, 1 + outputs))
        self._fresh = np.zeros(capacity, dtype=np.bool_)
        self.count = 0  #: Number of samples taken so far.

    def add(self, command_pa: float, y: FloatArray, *, fresh: bool) -> None:
        """Append a sample.

        `command_pa` is the mean command since the previous sample; `y`, shape (m,), are the
        outputs, held values if nothing was measured; `fresh` says whether they are a new
        measurement.
        """
        at = self.count % self.capacity
        row = self._rows[at]
        row[0] = command_pa
        row[1:] = y
        self._fresh[at] = fresh
        self.count += 1

    def latest(self, samples: int) -> FloatArray:
        """Return at most `samples` latest rows."""
        rows: FloatArray = self._rows[self._places(samples)]
        return rows

    def record(self, samples: int) -> FloatArray:
        """Return at most `samples` latest rows, with gaps as NaN."""
        places = self._places(samples)
        rows: FloatArray = self._rows[places]
        rows[~self._fresh[places], 1:] = np.nan
        return rows

    def _places(self, samples: int) -> np.ndarray:
        """Indices of the latest rows; taking them makes a copy."""
        first = self.count - min(samples, self.capacity, self.count)
        return np.arange(first, self.count) % self.capacity


class WarmUp:
    """Takes a new law through past samples, one chunk per sample time.

    A law that plans makes no plans meanwhile: in a storm those of a chunk may outlast a tick.
    """

    def __init__(self, law: MonitoredLaw, history: SampleHistory) -> None:
        self.law = law
        self._history = history
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
            if isinstance(controller, ConstrainedController):
                controller.observe(row[1:])
            else:
                controller.step(row[1:])
        self._stepped += len(rows)
