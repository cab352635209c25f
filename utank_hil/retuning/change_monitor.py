"""Detects a change of the ship by the one-step prediction error of the law's model.

The measure is the RMS of the roll's prediction error over the RMS of the roll. Wave height alone
does not change this ratio. A change of loading does: the model fits the motion less, and the roll
itself becomes larger or smaller. The normal ratio is learned first, in the present sea. A sea of
another wavelength counts as a change as well, and costs an identification.
"""

import math
from typing import Final

import numpy as np

from utank_hil.arrays import FloatArray
from utank_hil.control import ARX
from utank_hil.retuning.history import SampleHistory

_MEMORY_S: Final = 300.0
_LEARNING_S: Final = 600.0
_LEAST_ROLL_RAD: Final = 0.005  # below, sensor noise dominates the error
_MOST_ERROR_RAD: Final = 10.0  # beyond any roll angle; keeps the sums finite


class ChangeMonitor:
    """Compares a model's present prediction error with the normal one.

    Parameters
    ----------
    model : ARX
        One input.
    roll : int
        Index of the roll among its outputs.

    Attributes
    ----------
    change : float
        Factor, 1 or more, between the present and the normal ratio; 1 while learning.
    """

    def __init__(self, model: ARX, roll: int) -> None:
        taps = np.concatenate([model.beta[1:, roll], model.alpha[:, roll]], axis=1)
        self._taps = np.ascontiguousarray(taps[::-1]).ravel()  # oldest first
        self._direct = float(model.beta[0, roll, 0])
        self._order = model.order
        self._roll = roll
        self._smoothing = 1.0 - math.exp(-model.sample_time_s / _MEMORY_S)
        self._learning = round(_LEARNING_S / model.sample_time_s)
        self.restart()

    def restart(self) -> None:
        """Discard the normal ratio and learn it again."""
        self._samples = 0
        self._error_square = self._roll_square = 0.0
        self._normal = 0.0
        self.change = 1.0

    def predict(self, history: SampleHistory, command_pa: float) -> float:
        """One-step prediction of the roll in rad, for the command since the last sample."""
        window: FloatArray = history.latest(self._order).ravel()
        return float(self._taps @ window) + self._direct * command_pa

    def watch(self, history: SampleHistory, command_pa: float, roll_rad: float) -> None:
        """Update with a new sample that is not in `history` yet."""
        if history.count < self._order:
            return
        error = roll_rad - self.predict(history, command_pa)
        if not abs(error) < _MOST_ERROR_RAD:  # also for NaN: an unstable model may overflow
            error = _MOST_ERROR_RAD
        self._samples += 1
        # arithmetic mean at first, then exponential forgetting
        weight = max(self._smoothing, 1.0 / self._samples)
        self._error_square += weight * (error * error - self._error_square)
        self._roll_square += weight * (roll_rad * roll_rad - self._roll_square)
        if self._roll_square < _LEAST_ROLL_RAD**2 or self._error_square == 0.0:
            return
        ratio = math.sqrt(self._error_square / self._roll_square)
        if self._normal > 0:
            self.change = max(ratio / self._normal, self._normal / ratio)
        elif self._samples >= self._learning:
            self._normal = ratio
