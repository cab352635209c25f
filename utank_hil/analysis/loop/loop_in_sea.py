"""The loop of an LQG law in a sea without limits: its covariance, its cost, and their derivative.

With x of ship, tank, drive and waves, e the law's state, its command u = -K e, its observer gain L
and the sensors' noise R, the loop z = (x, e) has the covariance X and the cost j::

    X = A X A' + W(L),    W = diag(process, L R L'),    j = tr(Z X Z')

and with Y = A' Y A + Z'Z the derivative of j by L is 2 [(Y A X)_e M' + Y_ee L R], where M z is what
the observer corrects by. Both equations are solved by doubling (Smith, SIAM J. Appl. Math. 1968).
Pressures are in units of the pump's greatest.
"""

from typing import Final

import numpy as np

from utank_hil.base.arrays import FloatArray
from utank_hil.control.constrained.sea_plant import sea_plant
from utank_hil.control.design_plant import DesignPlant
from utank_hil.control.lqg import LQGLaw
from utank_hil.control.sea_model import SeaModel
from utank_hil.dynamics.linear import STATES
from utank_hil.dynamics.sampling import LinearModel

_DOUBLINGS: Final = 40
_EXACT: Final = 1e-10
_HUGE: Final = 1e12
"""A covariance so many times its noise grows for ever."""


def in_pump_units(law: LQGLaw, sea: SeaModel, unit_pa: float) -> LQGLaw:
    """A law on the model of `sea_plant` with its pressures in another unit."""
    size = pump_units(law.model, sea, unit_pa)
    return LQGLaw(
        _scaled(law.model, size, unit_pa),
        law.gain * size / unit_pa,
        law.observer_gain / size[:, None],
    )


class LoopInSea:
    """A ship in a sea under laws that differ in their observer's gain alone.

    Parameters
    ----------
    plant : DesignPlant
        As it is, with the limits of its pump.
    sea : SeaModel
        That there is.
    law : LQGLaw
        From `in_pump_units`.
    measured : tuple of str
        What it sees.
    measurement_noise : ndarray, shape (m, m)
        Covariance.
    weights : tuple of float
        Of the cost, on the squares of roll, level and command.
    pump_gain : float
        Pressure that a command of one ends in.
    forecast : ndarray, shape (F, n), optional
        From the law's state to what it foresees; its error's square is in the cost.

    Attributes
    ----------
    passive_cost : float or None
        With the tank passive; None for a ship that is unstable then.
    """

    passive_cost: float | None

    def __init__(
        self,
        plant: DesignPlant,
        sea: SeaModel,
        law: LQGLaw,
        measured: tuple[str, ...],
        measurement_noise: FloatArray,
        weights: tuple[float, float, float],
        pump_gain: float = 1.0,
        forecast: FloatArray | None = None,
    ) -> None:
        whole, process = sea_plant(sea, plant, sample_time_s=law.sample_time_s)
        unit = plant.limits.pressure_pa
        size = pump_units(whole, sea, unit)
        true = _scaled(whole, size, unit)
        rows = [STATES.index(name) for name in measured]
        outer, own = len(true.A), len(law.model.A)
        b, d = pump_gain * true.B, pump_gain * true.D
        seen, direct = true.C[rows], d[rows]
        expected = law.model.C - law.model.D @ law.gain
        self._own, self._noise = slice(outer, outer + own), measurement_noise
        self._corrected = np.hstack([seen, -direct @ law.gain - expected])
        self._open = np.zeros((outer + own, outer + own))
        self._open[:outer] = np.hstack([true.A, -b @ law.gain])
        self._open[outer:, outer:] = law.model.A - law.model.B @ law.gain
        self._process = np.zeros_like(self._open)
        self._process[:outer, :outer] = process / size / size[:, None]
        self.command = np.hstack([np.zeros((1, outer)), -law.gain])
        self.motion = np.hstack([true.C, -d @ law.gain])
        picked = [STATES.index("roll_rad"), STATES.index("level_m")]
        self._cost = np.sqrt(weights)[:, None] * np.vstack([self.motion[picked], self.command])
        if forecast is not None:
            self._cost = np.vstack([self._cost, np.hstack([forecast, -forecast])])
        passive, size_of = covariance(true.A, self._process[:outer, :outer]), self._cost[:2, :outer]
        self.passive_cost = None
        if passive is not None:
            self.passive_cost = float(np.trace(size_of @ passive @ size_of.T))

    def closed(self, observer_gain: FloatArray) -> FloatArray:
        """Matrix A of the loop."""
        found = self._open.copy()
        found[self._own] += observer_gain @ self._corrected
        return found

    def spread(self, observer_gain: FloatArray) -> FloatArray | None:
        """Covariance of the loop; None if it is unstable."""
        noise = self._process.copy()
        noise[self._own, self._own] = observer_gain @ self._noise @ observer_gain.T
        return covariance(self.closed(observer_gain), noise)

    def estimate_covariance(self, observer_gain: FloatArray) -> FloatArray | None:
        """Covariance of the estimate's error, where the law's model has the loop's states."""
        spread = self.spread(observer_gain)
        if spread is None:
            return None
        apart = np.hstack([np.eye(len(observer_gain)), -np.eye(len(observer_gain))])
        error: FloatArray = apart @ spread @ apart.T
        return error

    def cost(self, observer_gain: FloatArray) -> tuple[float, FloatArray] | None:
        """Cost and its derivative by the gain; None if the loop is unstable."""
        spread = self.spread(observer_gain)
        if spread is None:
            return None
        closed = self.closed(observer_gain)
        value = covariance(closed.T, self._cost.T @ self._cost)
        if value is None:
            return None
        own = self._own
        slope = (value @ closed @ spread)[own] @ self._corrected.T
        slope += value[own, own] @ observer_gain @ self._noise
        return float(np.trace(self._cost @ spread @ self._cost.T)), 2 * slope


def covariance(a: FloatArray, noise: FloatArray) -> FloatArray | None:
    """X of X = A X A' + noise; None if A is unstable."""
    found, power, most = noise, a, _HUGE * float(np.abs(noise).max())
    with np.errstate(all="ignore"):
        for _ in range(_DOUBLINGS):
            more = power @ found @ power.T
            found = found + more
            size = float(np.abs(more).max())
            if not size < most:
                return None
            if size <= _EXACT * float(np.abs(found).max()):
                return found
            power = power @ power
    return None


def pump_units(model: LinearModel, sea: SeaModel, unit_pa: float) -> FloatArray:
    """Units of the states of `sea_plant`: those of lag and past commands are pressures."""
    size = np.ones(len(model.A))
    size[len(STATES) : len(size) - sea.order - 1] = unit_pa
    return size


def _scaled(model: LinearModel, size: FloatArray, unit_pa: float) -> LinearModel:
    a, b, c, d, dt = model
    return LinearModel(
        a * size / size[:, None], b * unit_pa / size[:, None], c * size, d * unit_pa, dt
    )
