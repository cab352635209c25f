"""A constrained law as the answer of the retuner's process, and as a message.

The message holds model, predictor, knots and the plan that `condense` found. The predictions over
the horizon follow by `predictions`, on every processor bit for bit, in less time than their
transfer takes.
"""

import math
from dataclasses import dataclass, fields
from typing import Annotated, Final

import msgspec
import numpy as np

from utank_hil.base.arrays import FloatArray
from utank_hil.control import PumpLimits
from utank_hil.control.constrained.horizon import Horizon, Predictions, predictions
from utank_hil.control.constrained.law import ConstrainedLaw
from utank_hil.control.gentle_lqg import SHARES
from utank_hil.dynamics import STATES, LinearModel
from utank_hil.retuning.wire import refuse_shapes, refuse_sizes

MOST_STATES: Final = 64
MOST_KNOTS: Final = 40
MOST_SAMPLES: Final = 150
"""Largest sizes of a law, condensed in milliseconds. A shipped one has 58 states, 19 knots, 60
samples.
"""
_MOST_OUTPUTS: Final = len(STATES)
_MOST_ITERATIONS: Final = 200  # This is three times the budget of the shipped laws.

MOST_NUMBERS: Final = (
    MOST_STATES * (2 + len(SHARES) + 3 * MOST_STATES + 2 * _MOST_OUTPUTS + MOST_KNOTS)
    + MOST_KNOTS * (1 + MOST_KNOTS + MOST_SAMPLES * _MOST_OUTPUTS)
    + 2 * _MOST_OUTPUTS
)  #: Most numbers in the arrays of a message.


@dataclass(frozen=True, slots=True, eq=False)
class RenewedLaw:
    """A constrained law for the estimated waves and ship, with all margins."""

    law: ConstrainedLaw
    #: roll_rad, pressure_pa: root mean squares predicted in these waves, without limits.
    roll_rad: float
    pressure_pa: float
    passive_roll_rad: float  #: Predicted root mean square of the roll with the passive tank.


_CONDENSED: Final = {"knots", *Predictions._fields}
_OF_HORIZON: Final = [each.name for each in fields(Horizon) if each.name not in _CONDENSED]
_NOT_SENT: Final = ("horizon", "waves", "foresight")  # A renewed law takes no forecast.
_OF_LAW: Final = [each.name for each in fields(ConstrainedLaw) if each.name not in _NOT_SENT]
_PREDICTED: Final = [each.name for each in fields(RenewedLaw) if each.name != "law"]


class RenewedLawMessage(
    msgspec.Struct, frozen=True, eq=False, tag="renewed", forbid_unknown_fields=True
):
    """Message of a `RenewedLaw`; names and shapes as in `ConstrainedLaw` and `Horizon`."""

    model: LinearModel
    observer_gain: FloatArray
    knots: Annotated[tuple[int, ...], msgspec.Meta(min_length=1, max_length=MOST_KNOTS)]
    samples: Annotated[int, msgspec.Meta(ge=1, le=MOST_SAMPLES)]
    output_weight: FloatArray
    input_weight: float
    first_output: Annotated[int, msgspec.Meta(ge=0, le=MOST_SAMPLES)]
    terminal: FloatArray
    correction: FloatArray
    hessian: FloatArray
    unlimited_state: FloatArray
    unlimited_target: FloatArray
    limits: PumpLimits
    level_output: int | None
    level_penalty: float
    reservoir_area_m2: float
    steady_state: FloatArray
    steady_command: FloatArray
    iteration_limit: Annotated[int, msgspec.Meta(ge=1, le=_MOST_ITERATIONS)]
    gentler: FloatArray | None
    roll_rad: float
    pressure_pa: float
    passive_roll_rad: float

    @classmethod
    def of(cls, renewed: RenewedLaw) -> "RenewedLawMessage":
        """Return the message of a law."""
        law, horizon = renewed.law, renewed.law.horizon
        return cls(
            knots=tuple(horizon.knots.tolist()),
            samples=len(horizon.interpolation),
            **{name: getattr(horizon, name) for name in _OF_HORIZON},
            **{name: getattr(law, name) for name in _OF_LAW},
            **{name: getattr(renewed, name) for name in _PREDICTED},
        )

    @property
    def answer(self) -> RenewedLaw:
        """Return the law; raises ValueError if its parts do not fit together or are not finite."""
        a, b, c, d, sample_time_s = self.model
        n, m, rest, knots = len(a), len(c), len(self.terminal), len(self.knots)
        refuse_sizes(
            states=(n, 1, MOST_STATES), outputs=(m, 1, _MOST_OUTPUTS), rest=(rest, 0, MOST_STATES)
        )
        refuse_shapes(
            ("A", a, (n, n)),
            ("B", b, (n, 1)),
            ("C", c, (m, n)),
            ("D", d, (m, 1)),
            ("observer_gain", self.observer_gain, (n, m)),
            ("output_weight", self.output_weight, (m,)),
            ("terminal", self.terminal, (rest, n)),
            ("correction", self.correction, (n,)),
            ("hessian", self.hessian, (knots, knots)),
            ("unlimited_state", self.unlimited_state, (knots, n)),
            ("unlimited_target", self.unlimited_target, (self.samples, knots, m)),
            ("steady_state", self.steady_state, (n, n)),
            ("steady_command", self.steady_command, (n,)),
        )
        if self.gentler is not None:
            refuse_shapes(("gentler", self.gentler, (len(SHARES) - 1, n)))
        predicted = [getattr(self, name) for name in _PREDICTED]
        if not (sample_time_s > 0 and all(map(math.isfinite, (sample_time_s, *predicted)))):
            raise ValueError("the sample time or what is predicted is not finite")
        with np.errstate(all="ignore"):
            motions = predictions(self.model, self.knots, self.samples)
        if not all(np.isfinite(each).all() for each in motions):
            raise ValueError("the answer's law is not finite")
        parts = {name: getattr(self, name) for name in _OF_HORIZON}
        horizon = Horizon(np.array(self.knots), *motions, **parts)
        law = ConstrainedLaw(horizon=horizon, **{name: getattr(self, name) for name in _OF_LAW})
        return RenewedLaw(law, *predicted)
