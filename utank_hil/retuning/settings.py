"""Settings of retuning in a controller's configuration."""

import math
from dataclasses import dataclass, field
from itertools import count
from typing import Annotated, Final, Literal

from utank_hil.base.parameters import Positive, Problem, Range, range_problems, refuse
from utank_hil.dynamics.ship import RollLimit

EARLIEST_VERDICT_S: Final = 30.0
"""Shortest time after which a trial is judged: a few roll periods."""

_SWEPT: Final = ("multisine", "chirp")
_BAND_RAD_S: Final = (0.2, 1.2)  # As of `identification.excitation`, which loads scipy.

VALIDATION_SHARE: Final = 0.2  #: Share of the record, at its end, that validates the model.
LEAST_PREDICTIONS: Final = 100
"""Smallest number of predictions on validation data. Chosen; no study."""
LAGS: Final = 25  #: Largest lag of the whiteness test, in samples.
_OFFSET_AND_WAVE: Final = 3  # These are the disturbance functions that are fitted with the model.


@dataclass(frozen=True, slots=True)
class TrialSettings:
    """Settings of waiting for and trying a new law; `RetuningSettings` explains the keys."""

    trial_s: float
    roll_factor: float
    effort_factor: float
    answer_within_s: float


@dataclass(frozen=True, slots=True)
class Excitation:
    """Excitation signal of an identification: key ``excitation`` of the section.

    Raises `ValueError` if a value is out of its range, or a band is given for another kind.
    """

    #: A function of `utank_hil.identification.excitation`; the clock of ``prbs`` is the shortest
    #: pulse of `RetuningSettings.pulse_hold_s`.
    kind: Literal["random_pulses", "prbs", "multisine", "chirp"] = "random_pulses"
    #: Frequency band of multisine and chirp; None: 0.2 to 1.2 rad/s.
    band_rad_s: tuple[Positive, Positive] | None = None

    def __post_init__(self) -> None:
        problems = range_problems(self)
        if self.band_rad_s is not None:
            low, high = self.band_rad_s
            if self.kind not in _SWEPT:
                problems.append(("band_rad_s", f"is for {' and '.join(_SWEPT)}, not {self.kind}"))
            elif not low < high:
                problems.append(("band_rad_s", f"must rise, got {low} and {high}"))
        refuse("excitation", problems)

    @property
    def banded(self) -> bool:
        """Whether the signal has a band."""
        return self.kind in _SWEPT

    @property
    def band(self) -> tuple[float, float]:
        """The frequency band, with its default."""
        return self.band_rad_s or _BAND_RAD_S


@dataclass(frozen=True, slots=True)
class RetuningSettings:
    """Settings of retuning: section ``retuning`` of a controller.

    Raises `ValueError` if a value is out of its range.
    """

    #: Shortest and longest natural roll period of the ship's stability booklet; a model outside it
    #: is refused.
    roll_period_range_s: tuple[Positive, Positive]
    #: Order of the identified ARX model. 120 is enough where the waves are regular; in a sea the
    #: intervals of its ship are too narrow.
    order: Annotated[int, Range(least=2)] = 200
    identification_s: Positive = 500.0  #: Time for which pulses are given and recorded.
    pulse_pa: Positive = 30e3  #: Greatest pressure of the pulses.
    pulse_hold_s: tuple[Positive, Positive] = (1.0, 5.0)  #: Shortest and longest pulse.
    excitation: Excitation = field(default_factory=Excitation)  #: Signal type of the pulses.
    #: Whether the pulses replace the law's pressure instead of being added to it.
    alone: bool = False
    #: Greatest roll that the pulses alone may cause in still water, on the configured ship.
    added_roll_rad: Positive = 0.05
    #: Roll at which an identification is aborted; at most the largest of `SafetyLimits`.
    roll_limit_rad: RollLimit = 0.3
    #: Time from the end of a retuning to the next scheduled one, in a controller's file 600 s or
    #: more; None: no schedule.
    every_s: Positive | None = None
    #: Factor in roll period, or in the root of the stiffness, between the estimated ship and the
    #: law's, from which the law is retuned (`ChangeMonitor`); None: not monitored.
    change_factor: Annotated[float, Range(above=1)] | None = None
    #: Length of a trial and of the old law's window that it is compared with: from
    #: `EARLIEST_VERDICT_S` to one hour, for which a sea counts as stationary.
    trial_s: Annotated[float, Range(least=EARLIEST_VERDICT_S, most=3600)] = 120.0
    #: Factors by which a law on trial may exceed the old law's RMS of roll and pressure.
    roll_factor: Positive = 1.25
    #: Factors by which a law on trial may exceed the old law's RMS of roll and pressure.
    effort_factor: Positive = 2.0
    #: Timeout of identification and design, 600 s at most; they take seconds.
    answer_within_s: Annotated[float, Range(above=0, most=600)] = 60.0
    seed: Annotated[int, Range(least=0)] = 1  #: Seed of the pulses.

    def __post_init__(self) -> None:
        problems = range_problems(self)
        low, high = self.roll_period_range_s
        if not low < high:
            problems.append(("roll_period_range_s", f"must rise, got {low} and {high}"))
        if self.excitation.kind == "multisine":
            least_s = 2 * math.pi / (self.excitation.band[1] - self.excitation.band[0])
            if self.identification_s < least_s:  # The band holds at least one harmonic.
                reason = f"must be {least_s:.0f} or more for a multisine in the band"
                problems.append(("identification_s", f"{reason}, got {self.identification_s:g}"))
        refuse("retuning", problems)


def record_problems(
    order: int, samples: int, outputs: int, sample_time_s: float, shortest_period_s: float
) -> list[Problem]:
    """Return problems of a record's length and the model's order, known before any measurement.

    Configuration and retuner use the same checks, so no record is taken that would be refused.

    `order` is that of the ARX model, `samples` the length of the record, `shortest_period_s` the
    shortest roll period of the stability booklet. Returns key, "order" or "identification_s", and
    reason of each.
    """
    problems = []
    if order * sample_time_s < shortest_period_s:
        # Such a model is fitted to the waves, with small stated errors.
        reason = (
            f"{order} remembers {order * sample_time_s:g} s, less than the shortest roll period of "
            f"{shortest_period_s:g} s: raise it to {math.ceil(shortest_period_s / sample_time_s)} "
            "or more"
        )
        problems.append(("order", reason))
    least = least_samples(order, outputs)
    if samples < least:
        reason = (
            f"is too short: order {order} needs {least * sample_time_s:.0f} s, it has "
            f"{samples * sample_time_s:.0f}"
        )
        problems.append(("identification_s", reason))
    return problems


def least_samples(order: int, outputs: int) -> int:
    """Return the smallest record, in samples, for estimation and validation of a model."""
    skipped = max(order, LAGS)  # These samples at the start of each part have no prediction.
    columns = (order + 1) * (outputs + 1) - outputs + _OFFSET_AND_WAVE

    def enough(samples: int) -> bool:
        first = estimation_samples(samples)
        return first - order > columns and samples - first - skipped >= LEAST_PREDICTIONS

    return next(filter(enough, count()))


def estimation_samples(samples: int) -> int:
    """Return the number of samples that estimate the model; the rest validates it."""
    return round((1 - VALIDATION_SHARE) * samples)
