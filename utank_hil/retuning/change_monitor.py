"""Has the ship changed: the running model's one-step prediction error, watched.

The measure is the error of the roll, root mean square, over that of the roll itself, so that a
higher or lower sea alone leaves it where it is. A ship that has changed moves it either way: her
motions fit the model less, and she also rolls more or less than she did. What is normal is learned
first, in the sea there is; a sea of another length counts as a change, and costs an identification.
"""

import math
from typing import Final

import numpy as np

from utank_hil.arrays import FloatArray
from utank_hil.control import ARX
from utank_hil.retuning.history import SampleHistory

_MEMORY_S: Final = 300.0
_LEARNING_S: Final = 600.0
_LEAST_ROLL_RAD: Final = 0.005  # below it the sensor's noise is what is predicted
_MOST_ERROR_RAD: Final = 10.0  # no ship rolls so far; keeps every figure finite


class ChangeMonitor:
    """Watches how well a model predicts.

    Parameters
    ----------
    model : ARX
        One input.
    roll : int
        Index of the roll among its outputs.

    Attributes
    ----------
    change : float
        Factor, 1 or more, between the measure now and what was learned as normal; 1 while learning.
    """

    def __init__(self, model: ARX, roll: int) -> None:
        taps = np.concatenate([model.beta[1:, roll], model.alpha[:, roll]], axis=1)
        self._taps = np.ascontiguousarray(taps[::-1]).ravel()  # oldest first
        self._direct = float(model.beta[0, roll, 0])
        self._order = model.order
        self._roll = roll
        self._share = 1.0 - math.exp(-model.sample_time_s / _MEMORY_S)
        self._learning = round(_LEARNING_S / model.sample_time_s)
        self.restart()

    def restart(self) -> None:
        """Learn anew what is normal."""
        self._samples = 0
        self._error_square = self._roll_square = 0.0
        self._normal = 0.0
        self.change = 1.0

    def predict(self, history: SampleHistory, command_pa: float) -> float:
        """Roll of the next sample from those in `history` and the command since the last one."""
        window: FloatArray = history.latest(self._order).ravel()
        return float(self._taps @ window) + self._direct * command_pa

    def watch(self, history: SampleHistory, command_pa: float, roll_rad: float) -> None:
        """Take the next sample, not yet in `history`."""
        if history.count < self._order:
            return
        error = roll_rad - self.predict(history, command_pa)
        if not abs(error) < _MOST_ERROR_RAD:  # a model may foretell anything, or nothing
            error = _MOST_ERROR_RAD
        self._samples += 1
        # plain means to begin with, then exponentially forgetting ones
        share = max(self._share, 1.0 / self._samples)
        self._error_square += share * (error * error - self._error_square)
        self._roll_square += share * (roll_rad * roll_rad - self._roll_square)
        if self._roll_square < _LEAST_ROLL_RAD**2 or self._error_square == 0.0:
            return
        ratio = math.sqrt(self._error_square / self._roll_square)
        if self._normal > 0:
            self.change = max(ratio / self._normal, self._normal / ratio)
        elif self._samples >= self._learning:
            self._normal = ratio
