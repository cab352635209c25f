"""The thesis's yardstick of a law: roll taken away from the passive tank per pressure, Fig. 3.10.

::

    J = int | |phi_OL(q)| - |phi_CL(q)| | / |u_CL(q)| dq,    q = wave frequency / roll frequency

phi_OL with the passive tank and phi_CL, u_CL with the law, all per wave moment. The difference is
one of amplitudes: that of the complex answers is the same for every law, since phi_CL - phi_OL is
what the pressure u_CL does to the ship.
"""

from typing import Final

import numpy as np

from utank_hil.analysis.loop.closed_loop import closed_loop_response
from utank_hil.control.design_plant import DesignPlant
from utank_hil.control.interface import LinearLaw
from utank_hil.control.optimal_tank import ship_ratios
from utank_hil.dynamics.linear import coupled_model

FREQUENCY_RATIOS: Final = np.linspace(0.01, 2.0, 2000)  #: The source does not say how far it went.


def performance_index(law: LinearLaw, plant: DesignPlant, measured: tuple[str, ...]) -> float:
    """Index J in rad/Pa; the more the better.

    Parameters
    ----------
    plant : DesignPlant
        The thesis has a lag of 0 and, since its u(k) is made of y(k-1), a delay of one sample.
    measured : tuple of str
        Names of the outputs that the law sees, in its order.
    """
    w = FREQUENCY_RATIOS * ship_ratios(plant.ship, plant.tank)[1]
    system = coupled_model(plant.ship, plant.tank)
    row = system.output_labels.index("roll_rad")
    passive, _ = closed_loop_response(None, system, measured, w)
    active, pressure = closed_loop_response(law, system, measured, w, plant.delay_s, plant.lag_s)
    gain = np.abs(np.abs(passive[:, row]) - np.abs(active[:, row])) / np.abs(pressure)
    return float(np.sum((gain[1:] + gain[:-1]) / 2 * np.diff(FREQUENCY_RATIOS)))
