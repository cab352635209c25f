"""An LQG law designed for ship, tank and sea.

The Kalman filter is that of the predictive designs with unlimited memory: the same model of ship,
tank, drive lag, delay and wave moment (`predictive.design`). The regulator weights roll, level and
their rates at the samples. The wave moment is part of the model, so the regulator responds to the
predicted wave, too.
"""

from dataclasses import dataclass
from typing import Literal

import numpy as np

from utank_hil.base.parameters import Checked, NotNegative, Positive, Problem
from utank_hil.control.interface import BuiltLaw, DesignPlant, LinearLaw
from utank_hil.control.lqg import LQGLaw, design_lqg, design_lqr
from utank_hil.control.predictive.design import Predictor, washed, wave_plant, weight_problems
from utank_hil.dynamics.linear import STATES


@dataclass(frozen=True, slots=True)
class LQGDesign(Checked, owner="LQG design"):
    """Parameters of an LQG law."""

    predictor: Predictor  #: Parameters of the Kalman filter. Its `order` is not used.
    #: On the squares of `STATES`, per rad^2, (rad/s)^2, m^2, (m/s)^2.
    state_weight: tuple[NotNegative, ...]
    input_weight: Positive = 1.0  #: On the square of the pressure in Pa.
    #: Corner frequency of the washout that removes the steady list (`WashoutLaw`), at most a
    #: quarter of the ship's roll frequency; 0 for none.
    washout_rad_s: NotNegative = 0.0
    kind: Literal["lqg"] = "lqg"

    def _problems(self) -> list[Problem]:
        if len(self.state_weight) != len(STATES):
            return [("state_weight", f"must have {len(STATES)} numbers, got {self.state_weight}")]
        return weight_problems("state_weight", self.state_weight)

    def law(self, plant: DesignPlant) -> LinearLaw:
        """Design the law for a plant."""
        return washed(self._lqg_law(plant), self.washout_rad_s, plant.ship)

    def build(self, plant: DesignPlant) -> BuiltLaw:
        """Design the law for a plant."""
        law = self.law(plant)
        return BuiltLaw(law.controller, self.predictor.measured, law)

    def _lqg_law(self, plant: DesignPlant) -> LQGLaw:
        model, process = wave_plant(self.predictor, plant)
        weight = np.diag(self.state_weight)
        regulator = design_lqr(
            model,
            model.C.T @ weight @ model.C,
            self.input_weight + model.D.T @ weight @ model.D,
            model.C.T @ weight @ model.D,
        )
        rows = [STATES.index(name) for name in self.predictor.measured]
        return design_lqg(
            model._replace(C=model.C[rows], D=model.D[rows]),
            regulator,
            process,
            np.diag(np.square(self.predictor.measurement_std)),
        )
