"""A constrained law as the answer of the retuner's process, and as plain numbers.

The numbers are what the law is condensed from: model, predictor, knots, weights and what the motion
after the horizon costs. The predictions over the horizon follow from them (`condense`), bit for
bit, in less time than it takes to hand them over.
"""

import math
from dataclasses import dataclass
from typing import Final

import numpy as np

from utank_hil.base.arrays import FloatArray
from utank_hil.control.constrained.horizon import condense
from utank_hil.control.constrained.law import ConstrainedLaw
from utank_hil.control.limits import PumpLimits
from utank_hil.dynamics.linear import STATES
from utank_hil.dynamics.sampling import LinearModel
from utank_hil.retuning.number_reader import NumberReader

# a law of these sizes is condensed in a few milliseconds; a shipped one has 22 states, 19 knots and
# 60 samples
MOST_STATES: Final = 32
MOST_KNOTS: Final = 40
MOST_SAMPLES: Final = 150
_MOST_OUTPUTS: Final = len(STATES)
_MOST_ITERATIONS: Final = 200
_HEAD: Final = 19
_UNLIMITED: Final = -1.0

MOST_NUMBERS: Final = (
    _HEAD
    + 3 * MOST_STATES**2
    + MOST_STATES * (2 + 2 * _MOST_OUTPUTS)
    + 2 * _MOST_OUTPUTS
    + MOST_KNOTS
)
"""Of an answer that can be read."""


@dataclass(frozen=True, slots=True, eq=False)
class RenewedLaw:
    """A constrained law for the waves and the ship that were estimated, with all margins.

    Attributes
    ----------
    roll_rad, pressure_pa : float
        Root mean squares that are predicted in these waves, without limits.
    passive_roll_rad : float
        The same of the passive tank.
    """

    law: ConstrainedLaw
    roll_rad: float
    pressure_pa: float
    passive_roll_rad: float

    def numbers(self) -> FloatArray:
        """The answer as numbers, for another process."""
        law = self.law
        a, b, c, d, sample_time_s = law.model
        horizon, limits = law.horizon, law.limits
        head = [
            len(a),
            len(c),
            len(horizon.knots),
            len(horizon.interpolation),
            len(horizon.terminal),
            horizon.first_output,
            -1 if law.level_output is None else law.level_output,
            law.iteration_limit,
            sample_time_s,
            horizon.input_weight,
            law.level_penalty,
            law.reservoir_area_m2,
            self.roll_rad,
            self.pressure_pa,
            self.passive_roll_rad,
        ]
        most = (limits.pressure_pa, limits.rate_pa_s, limits.level_m, limits.power_w)
        arrays = (
            *(a, b, c, d, law.observer_gain, horizon.knots.astype(np.float64)),
            *(horizon.output_weight, horizon.terminal, law.steady_state, law.steady_command),
        )
        return np.concatenate(
            [head, [each if math.isfinite(each) else _UNLIMITED for each in most]]
            + [array.ravel() for array in arrays]
        )

    @classmethod
    def of_numbers(cls, numbers: FloatArray) -> "RenewedLaw":
        """The answer that `numbers` gave.

        Raises
        ------
        ValueError
            If they are of no law.
        """
        values = NumberReader(numbers)
        n, m = values.size(MOST_STATES), values.size(_MOST_OUTPUTS)
        j, samples = values.size(MOST_KNOTS), values.size(MOST_SAMPLES)
        rest, first_output = values.size(MOST_STATES, 0), values.size(MOST_SAMPLES, 0)
        level, iterations = values.size(m - 1, -1), values.size(_MOST_ITERATIONS)
        sample_time_s, input_weight, level_penalty, area_m2, *predicted = values.take(7).tolist()
        most = [math.inf if each == _UNLIMITED else each for each in values.take(4).tolist()]
        a, b, c, d = (values.array(*shape) for shape in ((n, n), (n, 1), (m, n), (m, 1)))
        observer_gain = values.array(n, m)
        knots = tuple(values.size(samples - 1, 0) for _ in range(j))
        weight, terminal = values.array(m), values.array(rest, n)
        steady_state, steady_command = values.array(n, n), values.array(n)
        values.end()
        if not sample_time_s > 0:
            raise ValueError(f"the answer's sample time is {sample_time_s}")
        model = LinearModel(a, b, c, d, sample_time_s)
        with np.errstate(all="ignore"):
            horizon = condense(
                model,
                knots,
                samples,
                weight,
                input_weight,
                first_output=first_output,
                terminal=terminal,
            )
        if not (np.isfinite(horizon.unlimited_state).all() and np.isfinite(horizon.hessian).all()):
            raise ValueError("the answer's law is not finite")
        law = ConstrainedLaw(
            model=model,
            observer_gain=observer_gain,
            horizon=horizon,
            limits=PumpLimits(*most),
            level_output=None if level < 0 else level,
            level_penalty=level_penalty,
            reservoir_area_m2=area_m2,
            steady_state=steady_state,
            steady_command=steady_command,
            iteration_limit=iterations,
        )
        return cls(law, *predicted)
