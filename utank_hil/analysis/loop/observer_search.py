"""The observer of a law that is best for the expected sea and keeps the loop robust.

A Kalman filter is best for the ship as she is known, and may be unstable on a slightly different
one. Here its gain L is what a search (L-BFGS-B) varies. It makes least::

    J(L) = j_0 + f + share * sum_v j_v + penalty * mean_w (|S(w)| / bound)^16

j_0 is the cost in the expected sea (`loop_in_sea`) on the ship as she is known, j_v that on ships
of other stiffness or inertia with other pump gains, each as a share of the same ship's cost with
her tank passive; of the known one's where that is unstable. f is the cost of the error of the plan
and of the motion that it starts from: mean squares over the horizon. Without f the observer is good
for the law's own command alone, and where limits bind a plan needs more than that. S is the
sensitivity, with the usual delay and with `EXTRA_DELAY_S` more. A loop that is nearly unstable on
one of the ships costs much there, so a search that begins where all of them are stable stays there.
The heel's row of L stays as it was: no heel is in the cost.
"""

import math
from collections.abc import Iterator
from dataclasses import replace
from typing import Final

import numpy as np

from utank_hil.analysis.loop.loop_in_sea import LoopInSea, in_pump_units, pump_units
from utank_hil.analysis.loop.robustness import (
    EXTRA_DELAY_S,
    GAINS,
    PEAK_SENSITIVITY,
    ship_variants,
)
from utank_hil.analysis.loop.scaled_law import NoLawError
from utank_hil.base.arrays import FloatArray
from utank_hil.control.constrained.design import ConstrainedDesign
from utank_hil.control.constrained.law import ConstrainedLaw
from utank_hil.control.design_plant import DesignPlant
from utank_hil.dynamics.transfer import state_space_response

_PENALTY: Final = 1.0
_BOUND: Final = 0.85 * PEAK_SENSITIVITY
_POWER: Final = 16
_LOW_OMEGA: Final = np.geomspace(2e-3, 0.2, 20, endpoint=False)
"""Over roll frequency: where the sensitivity is smooth, a few points of it count."""
_POINTS: Final = 300
"""From there to the Nyquist frequency."""
_UNSTABLE: Final = 1e3
"""J of a gain with which a loop is unstable: more than that of any that is stable and tried."""
_ITERATIONS: Final = 400
_MEMORY: Final = 30
"""Steps from which the search knows the curvature of J."""


class ObserverSearch:
    """J of the gains of one law's observer, and the gain that makes it least.

    Parameters
    ----------
    constrained : ConstrainedLaw
        Stable on all ships.
    design : ConstrainedDesign
        What it was made from.
    weights : tuple of float
        Of the cost, on the squares of roll in rad, level in m, and pressure per the pump's most.
    others_share : float
        Weight of each other ship.

    Attributes
    ----------
    start : ndarray, shape (n, m)
        The law's own gain.
    """

    def __init__(
        self,
        constrained: ConstrainedLaw,
        design: ConstrainedDesign,
        plant: DesignPlant,
        weights: tuple[float, float, float],
        others_share: float,
    ) -> None:
        law, self.start = constrained.unlimited(), constrained.observer_gain
        sea, unit, measured = design.sea, plant.limits.pressure_pa, design.measured
        self._law, self._sizes = in_pump_units(law, sea, unit), pump_units(law.model, sea, unit)
        self._noise = np.diag(np.square(design.measurement_std))

        def loop(
            ship: DesignPlant, gain: float = 1.0, forecast: FloatArray | None = None
        ) -> LoopInSea:
            return LoopInSea(ship, sea, self._law, measured, self._noise, weights, gain, forecast)

        self._own = loop(plant, forecast=self._forecast(constrained, measured, weights, unit))
        scale = self._own.passive_cost
        if scale is None:
            raise NoLawError("the ship is unstable with her tank passive")
        self._loops = [(1 / scale, self._own)]
        for ship, gain in _others(plant):
            other = loop(ship, gain)
            self._loops.append((others_share / (other.passive_cost or scale), other))
        low = plant.ship.natural_frequency_rad_s * law.sample_time_s * _LOW_OMEGA
        angle = np.concatenate([low, np.geomspace(low[-1], np.pi, _POINTS + 1)[1:]])
        self._points = np.exp(1j * angle)
        late = replace(plant, delay_s=plant.delay_s + EXTRA_DELAY_S)
        self._plants = unit * np.array(
            [
                state_space_response(each.sampled(measured, law.sample_time_s), self._points)
                for each in (plant, late)
            ]
        )

    def best(self) -> FloatArray:
        """The gain of least J that is found from the law's own."""
        from scipy.optimize import minimize

        start = self._law.observer_gain
        left, right = self._units(start)

        def along(x: FloatArray) -> tuple[float, FloatArray]:
            value, slope = self.value(start + left @ x.reshape(start.shape) @ right)
            return value, (left.T @ slope @ right.T).ravel()

        found = minimize(
            along,
            np.zeros(start.size),
            jac=True,
            method="L-BFGS-B",
            options={"maxiter": _ITERATIONS, "maxfun": 2 * _ITERATIONS, "maxcor": _MEMORY},
        )
        gain: FloatArray = start + left @ found.x.reshape(start.shape) @ right
        return gain * self._sizes[:, None]

    def value(self, observer_gain: FloatArray) -> tuple[float, FloatArray]:
        """J and its derivative by a gain that takes pressures in units of the pump's greatest."""
        value, slope = self._sensitivity_penalty(observer_gain)
        for weight, loop in self._loops:
            cost = loop.cost(observer_gain)
            if cost is None:
                return _UNSTABLE, np.zeros_like(observer_gain)
            value, slope = value + weight * cost[0], slope + weight * cost[1]
        return value, slope

    def _forecast(
        self,
        law: ConstrainedLaw,
        measured: tuple[str, ...],
        weights: tuple[float, float, float],
        unit_pa: float,
    ) -> FloatArray:
        """From the state, but for the heel, to roots of the cost of the motion and the plan."""
        horizon, rows = law.horizon, [measured.index(name) for name in ("roll_rad", "level_m")]
        motions = horizon.outputs_state[:, rows] * np.sqrt(weights[:2])[:, None]
        plan = horizon.unlimited_state * math.sqrt(weights[2]) / unit_pa
        states = plan.shape[1]
        parts = [part.reshape(-1, states) / math.sqrt(len(part)) for part in (motions, plan)]
        root: FloatArray = np.linalg.qr(np.vstack(parts) * self._sizes).R
        root[:, -1] = 0.0
        return root

    def _units(self, start: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Roots of the estimate's covariance, without the heel, and of the innovation's inverse."""
        error = self._own.estimate_covariance(start)
        assert error is not None  # the law is stable
        values, vectors = np.linalg.eigh(error)
        left = vectors * np.sqrt(np.maximum(values, 0.0))
        left[-1] = 0.0
        seen = self._law.model.C
        return left, np.linalg.inv(np.linalg.cholesky(seen @ error @ seen.T + self._noise))

    def _sensitivity_penalty(self, observer_gain: FloatArray) -> tuple[float, FloatArray]:
        """The last term of J, and its derivative.

        With F = z - A + B K + L H, H = C - D K, the law is -K F^-1 L. Its derivative by L is
        -K F^-1 dL (1 - H F^-1 L), that of 1 / (1 - law plant) is S^2 times the law's times the
        plant.
        """
        model, gain = self._law.model, self._law.gain
        expected = model.C - model.D @ gain
        inner = model.A - model.B @ gain - observer_gain @ expected
        resolvent = np.linalg.inv(self._points[:, None, None] * np.eye(len(inner)) - inner)
        to_command = gain @ resolvent
        law = -to_command @ observer_gain
        sensitivity = 1 / (1 - (law @ self._plants)[..., 0, 0])
        part = _PENALTY / len(self._points) * (np.abs(sensitivity) / _BOUND) ** _POWER
        by_law = np.einsum("vw,vwmr->wmr", _POWER * part * sensitivity, self._plants)
        left_over = np.eye(len(expected)) - expected @ resolvent @ observer_gain
        slope = -np.einsum("wrn,wmr->nm", to_command, left_over @ by_law).real
        return float(part.sum()), slope


def _others(plant: DesignPlant) -> Iterator[tuple[DesignPlant, float]]:
    """Other ships than the known one, a faster one with a later pump, and the pumps' gains."""
    for period_scale, inertia_scale, ship in ship_variants(plant.ship):
        if period_scale == inertia_scale == 1:
            continue
        late_s = EXTRA_DELAY_S if period_scale * inertia_scale < 1 else 0.0
        for gain in (GAINS[0], GAINS[-1]):
            yield replace(plant, ship=ship, delay_s=plant.delay_s + late_s), gain
