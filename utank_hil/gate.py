"""The gate before the bus: a law is designed, and its margins and its step's time are judged."""

import math
import time
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final

import numpy as np

from utank_hil.analysis.loop.margins import Robustness, robustness
from utank_hil.assembly import build_law
from utank_hil.base.parameters import ParameterError, refuse
from utank_hil.base.tick import TICK_S
from utank_hil.configuration import ControllerConfig
from utank_hil.control import BuiltLaw
from utank_hil.control.constrained.law import ConstrainedLaw

MOST_STEP_S: Final = TICK_S / 2
"""Of a law: the other half of a tick is for everything else in it."""
STEPS_TIMED: Final = 5
"""Of which the fastest counts: it is the law's own, not another process's."""


@dataclass(frozen=True, slots=True)
class JudgedLaw:
    """A law with what its loop stands."""

    config: ControllerConfig
    law: BuiltLaw  #: Designed for it.
    robustness: Robustness | None  #: None where there is no loop, or none that can be judged.
    step_s: float  #: Time that a step of the law takes here, at rest.
    foreseeing: tuple[str, ...] = ()  #: What it misses with a perfect forecast of the waves.

    @property
    def failures(self) -> tuple[str, ...]:
        """What the law misses, in words; empty for one that may be armed."""
        found = [self.law.unjudged] if self.law.unjudged else []
        if self.step_s > MOST_STEP_S:
            found.append(
                f"a step takes {1e3 * self.step_s:.1f} ms, more than half a tick, "
                f"{1e3 * MOST_STEP_S:g} ms: the loop would miss deadlines and end at zero pressure"
            )
        if self.robustness is not None:
            found += self.robustness.failures()
        return (*found, *self.foreseeing)

    @property
    def foreseen_s(self) -> tuple[float, float] | None:
        """How far a forecast of the waves must reach, and what is used of it; None if none is."""
        linear = self.law.linear
        if not isinstance(linear, ConstrainedLaw) or linear.foresight is None:
            return None
        least, most = linear.foresight.reach
        return least * linear.sample_time_s, most * linear.sample_time_s

    @property
    def accepted(self) -> bool:
        """Whether it is let on the bus; only missed margins can be accepted."""
        if self.step_s > MOST_STEP_S:
            return False
        return self.config.accept_low_margins or not self.failures


def judge(config: ControllerConfig, *, with_delay_margin: bool = True) -> JudgedLaw:
    """Design a law and judge its loop; `ParameterError` names the key of what is wrong."""
    law = build_law(config)
    step_s = _step_time_s(law)
    if law.linear is None:
        return JudgedLaw(config, law, None, step_s)
    try:
        found = robustness(
            law.linear,
            config.design_plant,
            law.linear_measured,
            with_delay_margin=with_delay_margin,
        )
    except (ValueError, ArithmeticError) as error:
        raise ParameterError("", [("law", f"its margins can't be computed: {error}")]) from error
    figures = (found.nominal.radius, found.nominal.peak_sensitivity, found.worst_radius)
    if not all(map(math.isfinite, figures)):
        refuse("", [("law", "its margins can't be computed: they are not finite numbers")])
    return JudgedLaw(config, law, found, step_s, tuple(_foreseeing_failures(config, law)))


def _foreseeing_failures(config: ControllerConfig, law: BuiltLaw) -> Iterator[str]:
    """What a law that takes forecasts misses with the shortest and longest, perfectly known."""
    linear = law.linear
    if not isinstance(linear, ConstrainedLaw) or linear.foresight is None:
        return
    for samples in linear.foresight.reach:
        told = linear.foreseeing(samples)
        found = robustness(
            told, config.design_plant, law.linear_measured, with_delay_margin=False
        ).failures()
        ahead_s = samples * linear.sample_time_s
        yield from (f"with a perfect forecast of {ahead_s:.3g} s: {each}" for each in found)


def _step_time_s(law: BuiltLaw) -> float:
    """Least time of a few steps, the cost of the law itself on a machine with other work."""
    controller, y = law.controller(), np.zeros(len(law.measured))
    times = []
    for _ in range(STEPS_TIMED):
        begin_s = time.perf_counter()
        try:
            controller.step(y)
        except (Exception, SystemExit):  # judged by its impulse response, which names the step
            break
        times.append(time.perf_counter() - begin_s)
    return min(times, default=0.0)
