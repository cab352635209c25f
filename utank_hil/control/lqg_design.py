"""From a ship, a tank and what is known of the sea to an LQG law.

The Kalman filter is that of the predictive designs with unlimited memory: the same model of ship,
tank, drive lag, delay and wave moment (`ship_design`). The regulator weighs roll, level and their
rates as they are at the samples, and because the wave moment is part of the model, it answers the
wave it expects, not only the motion there is.
"""

from dataclasses import dataclass
from typing import Final

import numpy as np

from utank_hil.control.interface import LinearLaw
from utank_hil.control.lqg import LQGLaw, design_lqg, design_lqr
from utank_hil.control.predictive.design import Predictor, washed, wave_plant, weight_problems
from utank_hil.dynamics.linear import STATES
from utank_hil.dynamics.ship import RollShip
from utank_hil.dynamics.tank import Tank
from utank_hil.parameters import NotNegative, Positive, range_problems, refuse


@dataclass(frozen=True, slots=True)
class LQGDesign:
    """An LQG law in parameters: what a configuration file holds.

    Parameters
    ----------
    predictor : Predictor
        What the Kalman filter is told. Its `order` counts for nothing here.
    state_weight : tuple of float
        On the squares of `STATES`, per rad^2, (rad/s)^2, m^2, (m/s)^2.
    input_weight : float
        On the square of the pressure in Pa.
    washout_rad_s : float
        Corner of the washout that keeps the steady list from the law (`WashoutLaw`), a quarter of
        the ship's roll frequency at most; 0 for none.

    Raises
    ------
    ValueError
        If a weight is out of its range.
    """

    predictor: Predictor
    state_weight: tuple[NotNegative, ...]
    input_weight: Positive = 1.0
    washout_rad_s: NotNegative = 0.0

    def __post_init__(self) -> None:
        problems = range_problems(self)
        if len(self.state_weight) != len(STATES):
            problems.append(
                ("state_weight", f"must have {len(STATES)} numbers, got {self.state_weight}")
            )
        else:
            problems += weight_problems("state_weight", self.state_weight)
        refuse("LQG design", problems)

    def law(
        self, ship: RollShip, tank: Tank, delay_s: float = 0.05, lag_s: float = 0.1
    ) -> LinearLaw:
        """The law for a ship and tank behind `delay_s` and `lag_s` (`sampled_model`).

        Raises
        ------
        ValueError
            If a parameter is out of its range.
        """
        return washed(self._lqg_law(ship, tank, delay_s, lag_s), self.washout_rad_s, ship)

    def _lqg_law(self, ship: RollShip, tank: Tank, delay_s: float, lag_s: float) -> LQGLaw:
        plant, process = wave_plant(self.predictor, ship, tank, delay_s, lag_s)
        weight = np.diag(self.state_weight)
        regulator = design_lqr(
            plant,
            plant.C.T @ weight @ plant.C,
            self.input_weight + plant.D.T @ weight @ plant.D,
            plant.C.T @ weight @ plant.D,
        )
        rows = [STATES.index(name) for name in self.predictor.measured]
        return design_lqg(
            plant._replace(C=plant.C[rows], D=plant.D[rows]),
            regulator,
            process,
            np.diag(np.square(self.predictor.measurement_std)),
        )


# Found as the predictive defaults were (`utank_hil.control.defaults`), by the linear loop's answer
# to the storm hour: least roll with a pressure of 33 kPa and a level of 2.3 m RMS and a peak
# sensitivity of 1.7 at most.
LQG_ROLL_RATE_LEVEL: Final = LQGDesign(
    predictor=Predictor(
        measured=("roll_rad", "roll_rate_rad_s", "level_m"),
        measurement_std=(4.9e-3, 3.6e-3, 0.055),
        order=1,
        wave_peak_rad_s=0.634,
        wave_damping_ratio=0.0051,
        wave_slope_rad=0.054,
        pressure_noise_pa_rt_s=1740.0,
    ),
    state_weight=(3.0e11, 6.0e11, 9.0e5, 2.0e5),
    washout_rad_s=0.02,
)
