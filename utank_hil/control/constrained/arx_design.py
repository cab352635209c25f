"""Generalized predictive control of an ARX model within limits."""

import math

import numpy as np

from utank_hil.control.arx import ARX
from utank_hil.control.constrained.horizon import condense
from utank_hil.control.constrained.law import ConstrainedLaw
from utank_hil.control.limits import PumpLimits


def design_constrained_gpc(
    arx: ARX,
    limits: PumpLimits,
    control_horizon: int = 50,
    prediction_horizon: int = 50,
    output_weight: tuple[float, ...] = (1e14,),
    input_weight: float = 1.0,
    first_output: int = 0,
    *,
    level_output: int | None = None,
    level_penalty: float | None = None,
    reservoir_area_m2: float | None = None,
    iteration_limit: int = 100,
) -> ConstrainedLaw:
    """Generalized predictive control (`design_gpc`) within limits.

    Parameters
    ----------
    arx : ARX
        One input.
    limits : PumpLimits
        Of which pressure, rate, level and power count.
    control_horizon, prediction_horizon, output_weight, input_weight, first_output
        As in `design_gpc`; one weight for each output.
    level_output : int, optional
        Which output is the level in m; its limit is left out if not given.
    level_penalty : float, optional
        Cost of a metre above the limit, positive; that of a unit of the output with the greatest
        weight if not given. One much greater than what the plan weighs hides it behind rounding.
    reservoir_area_m2 : float, optional
        At, for a limit on the power: At times pressure and rate of the level.
    iteration_limit : int
        Budget of a quadratic programme, 1 or more.

    Raises
    ------
    ValueError
        If a horizon, weight or budget is out of its range or shape, the power is limited without
        level and area to compute it from, or the ARX model has more inputs.
    """
    if not 1 <= control_horizon <= prediction_horizon:
        raise ValueError(
            "the horizons must hold 1 <= control_horizon <= prediction_horizon, got "
            f"{control_horizon} and {prediction_horizon}"
        )
    if len(output_weight) != arx.outputs:
        raise ValueError(f"output_weight must have {arx.outputs} numbers, got {output_weight}")
    if not 0 <= first_output < prediction_horizon:
        raise ValueError(
            f"first_output must be 0 to {prediction_horizon - 1}, the last sample of the "
            f"prediction horizon, got {first_output}"
        )
    if reservoir_area_m2 is None and limits.power_w < math.inf:
        raise ValueError(
            f"a power limit, {limits.power_w:g} W, needs the reservoir_area_m2: give it, or set "
            "power_w to infinity"
        )
    if level_penalty is None:
        level_penalty = max(output_weight) or input_weight
    model = arx.matrices()
    # the deadbeat gain that makes this model's predictor the ARX predictor
    observer_gain = arx.alpha.reshape(len(model.A), arx.outputs)
    horizon = condense(
        model,
        tuple(range(control_horizon)),
        prediction_horizon,
        np.array(output_weight),
        input_weight,
        first_output=first_output,
    )
    n = len(model.A)
    return ConstrainedLaw(
        model=model,
        observer_gain=observer_gain,
        horizon=horizon,
        limits=limits,
        level_output=level_output,
        level_penalty=level_penalty,
        # without a power limit it counts for nothing
        reservoir_area_m2=1.0 if reservoir_area_m2 is None else reservoir_area_m2,
        steady_state=np.zeros((n, n)),
        steady_command=np.zeros(n),
        iteration_limit=iteration_limit,
    )
