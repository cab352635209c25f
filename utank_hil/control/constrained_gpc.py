"""Generalized predictive control of an ARX model within limits."""

import numpy as np

from utank_hil.control.arx import ARX
from utank_hil.control.constrained import ConstrainedLaw
from utank_hil.control.horizon import condense
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
    level_penalty: float = 1e14,
    iteration_limit: int = 100,
) -> ConstrainedLaw:
    """Generalized predictive control (`design_gpc`) within limits.

    Parameters
    ----------
    arx : ARX
        One input.
    limits : PumpLimits
        Of which pressure, rate and level count.
    control_horizon, prediction_horizon, output_weight, input_weight, first_output
        As in `design_gpc`; one weight for each output.
    level_output : int, optional
        Which output is the level in m; its limit is left out if not given.
    level_penalty : float
        Cost of a metre above the limit.
    iteration_limit : int
        Budget of a quadratic programme.

    Raises
    ------
    ValueError
        If a horizon or weight is out of its range or shape, or the ARX model has more inputs.
    """
    if not 1 <= control_horizon <= prediction_horizon:
        raise ValueError(
            "the horizons must hold 1 <= control_horizon <= prediction_horizon, got "
            f"{control_horizon} and {prediction_horizon}"
        )
    if len(output_weight) != arx.outputs:
        raise ValueError(f"output_weight must have {arx.outputs} numbers, got {output_weight}")
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
        limits=PumpLimits(limits.pressure_pa, limits.rate_pa_s, limits.level_m),
        level_output=level_output,
        level_penalty=level_penalty,
        reservoir_area_m2=1.0,
        steady_state=np.zeros((n, n)),
        steady_command=np.zeros(n),
        iteration_limit=iteration_limit,
    )
