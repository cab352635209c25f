"""A constrained law on an ARX model: without limits it is `design_gpc`, so that can be compared."""

import numpy as np

from utank_hil.control import ARX, PumpLimits
from utank_hil.control.constrained.horizon import condense
from utank_hil.control.constrained.law import ConstrainedLaw


def arx_law(
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
    reservoir_area_m2: float = 1.0,
    iteration_limit: int = 100,
) -> ConstrainedLaw:
    """The constrained law whose estimate is the ARX model's own prediction."""
    model = arx.matrices()
    n = len(model.A)
    return ConstrainedLaw(
        model=model,
        observer_gain=arx.alpha.reshape(n, arx.outputs),
        horizon=condense(
            model,
            tuple(range(control_horizon)),
            prediction_horizon,
            np.array(output_weight),
            input_weight,
            first_output=first_output,
        ),
        limits=limits,
        level_output=level_output,
        level_penalty=level_penalty or max(output_weight) or input_weight,
        reservoir_area_m2=reservoir_area_m2,
        steady_state=np.zeros((n, n)),
        steady_command=np.zeros(n),
        iteration_limit=iteration_limit,
    )
