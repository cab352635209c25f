"""What a configuration says about retuning."""

import math
from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class RetuningSettings:
    """When and how the controller may retune itself: section ``retuning`` of a controller.

    Attributes
    ----------
    roll_period_range_s : tuple of float
        Shortest and longest natural roll period of the ship's stability booklet; a model outside
        it is refused.
    order : int
        Of the identified ARX model.
    identification_s : float
        Time for which pulses are given and recorded.
    pulse_pa : float
        Greatest pressure of the pulses.
    pulse_hold_s : tuple of float
        Shortest and longest pulse.
    alone : bool
        Give the pulses without the law's pressure instead of adding them to it.
    added_roll_rad : float
        Greatest roll that the pulses alone may cause in still water, on the configured ship.
    roll_limit_rad : float
        Roll at which identification is given up.
    every_s : float or None
        Retune by itself so long after the last time; None: never on schedule.
    change_factor : float or None
        Retune by itself when the running model's prediction errors, compared with the roll, have
        changed by this factor since it was taken into service; None: not watched.
    trial_s : float
        Time for which a new law is on trial, and the old one's is remembered for comparison.
    roll_factor, effort_factor : float
        A new law is taken back when roll or pressure, root mean square over the trial, exceed the
        old law's by this factor.
    answer_within_s : float
        Longest time identification and design may take.
    seed : int
        Of the pulses.

    Raises
    ------
    ValueError
        If a value is out of its range.
    """

    roll_period_range_s: tuple[float, float]
    order: int = 120
    identification_s: float = 500.0
    pulse_pa: float = 30e3
    pulse_hold_s: tuple[float, float] = (1.0, 5.0)
    alone: bool = False
    added_roll_rad: float = 0.05
    roll_limit_rad: float = 0.3
    every_s: float | None = None
    change_factor: float | None = None
    trial_s: float = 120.0
    roll_factor: float = 1.25
    effort_factor: float = 2.0
    answer_within_s: float = 60.0
    seed: int = 1

    def __post_init__(self) -> None:
        low, high = self.roll_period_range_s
        if not 0 < low < high < math.inf:
            raise ValueError(
                f"retuning roll_period_range_s must rise from above zero, got [{low}, {high}]"
            )
        if self.order < 2:
            raise ValueError(f"retuning order must be 2 or more, got {self.order}")
        for name in (
            "identification_s",
            "pulse_pa",
            "added_roll_rad",
            "roll_limit_rad",
            "trial_s",
            "roll_factor",
            "effort_factor",
            "answer_within_s",
        ):
            value = getattr(self, name)
            if not (math.isfinite(value) and value > 0):
                raise ValueError(f"retuning {name} must be positive and finite, got {value}")
        if self.every_s is not None and not self.every_s > 0:
            raise ValueError(f"retuning every_s must be positive, got {self.every_s}")
        if self.change_factor is not None and not self.change_factor > 1:
            raise ValueError(f"retuning change_factor must be above 1, got {self.change_factor}")
