"""Linearization of a nonlinear law at rest.

A law that is unstable for the smallest roll is unstable, so its slope about rest must have the
margins of a linear law. A law that adapts is linearized with its initial parameters.
"""

from collections.abc import Callable
from typing import Final

import numpy as np

from utank_hil.control.gain import GainLaw
from utank_hil.control.interface import Controller

STEP: Final = 1e-6
"""Step to either side, in the unit of each input; far below the noise of a sensor."""


def slope_at_rest(controller: Callable[[], Controller], inputs: int) -> GainLaw:
    """Linearize a law at rest, as a law of constant gain.

    The first command of the controller must depend on its first measurement alone. ValueError is
    raised if the slope is not finite.
    """
    columns = []
    for push in STEP * np.eye(inputs):
        up, down = (controller().step(sign * push) for sign in (1.0, -1.0))
        columns.append((up - down) / (2 * STEP))
    slope = np.column_stack(columns)
    if not np.isfinite(slope).all():
        raise ValueError("its answer at rest overflows")
    return GainLaw(-slope, controller().sample_time_s)
