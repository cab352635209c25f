"""Fit of a physical model of ship and tank to an identified model (grey-box identification).

In a storm the waves move the ship ten times as much as the pump does, and a realization of a
high-order ARX model alone has errors of tens of per cent. But the structure of the model is known
(`utank_hil.dynamics.linear`), and loading changes only some parameters. With A(q) y = B(q) u + e
from OKID and G(q, theta) the sampled ship and tank::

    min over theta = (log (I, k1, d1, tank damping ratio, pressure), a delay for each output):
        sum over w of |L (B - A G(theta))|^2 Phi_u + sum (theta / sigma)^2,   L^T L = cov(e)^-1

The first sum is that of the prediction errors of G(theta), with 1 / A as the spectrum of the waves.
So the fit is weighted to frequencies where the pump's effect exceeds the sea's (Wahlberg 1989;
Ljung, System Identification, 10.4). The second sum is a prior: parameters that the record does not
determine keep the given ship's values. A misfit above the stated errors scales these up.

The last parameters are not the ship's. Level gauge and motion sensor differ in delay, the drive's
pressure loop is not exactly a first-order lag, and the pressure differs from the command: by 10 ms
or 0.5 %. A record without irregular waves resolves this. Without these parameters it would bias
inertia and damping by ten standard deviations. At these frequencies lag and delay are equivalent.

A is estimated from the same record and overfits its waves, so the misfit is too small. With n
coefficients from N equations the standard deviations are enlarged by (1 + n / N) / (1 - n / N). The
form is that of Akaike's final prediction error; that it applies to the deviations, not to their
squares, was found by measurement (docs/retuning.md).
"""

import dataclasses
import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.optimize import least_squares

from utank_hil.base.arrays import ComplexArray, FloatArray
from utank_hil.base.tick import TICK_S
from utank_hil.control import DesignPlant
from utank_hil.dynamics import RollShip, Tank
from utank_hil.identification.lag_regression import LagRegression
from utank_hil.identification.okid import OkidResult
from utank_hil.identification.record import IdentificationError
from utank_hil.identification.validation import Validation

_BAND_RAD_S = 2.5  # Ship and tank hardly respond above this.
_LINES = 64  # Frequencies in the band; an ARX model of order 120 resolves no more.
_SPREAD = (0.1, 0.7, 0.5, 0.2)  # Standard deviations of the prior: relative changes by loading.
_PRESSURE_SPREAD = 0.005  # Gain errors of pressure sensor and pressure loop.
_DELAY_SPREAD_S = 2 * TICK_S  # A frame arrives in one tick or the next.
_PRESSURE = len(_SPREAD)  # Index of the pressure gain in theta; the delays follow.
_STARTS = np.log([0.5, 0.7, 1.0, 1.4, 2.0, 2.8])  # Initial values of the stiffness factor.
_PASSES = 5  # Largest number of passes.
_ROWS_PER_COLUMN = 4  # Least rows for a coefficient of the law's answer to prediction errors.
_CONVERGED = 1e-3  # Relative change of the dispersion, far below its own uncertainty.


@dataclass(frozen=True, slots=True, eq=False)
class ShipFit:
    """Ship and tank fitted to a record."""

    ship: RollShip  #: The given ship with fitted inertia, stiffness and linear damping.
    tank: Tank  #: The given tank with fitted damping ratio.
    #: shape (4,): relative standard deviations of inertia, stiffness, ship damping and tank damping
    #: ratio. In an irregular sea, intervals of two deviations contain the true value in about 90 %
    #: of records.
    deviation: FloatArray
    period_deviation: float  #: Relative standard deviation of the ship's roll period.
    dispersion: float  #: RMS of the misfit relative to the stated errors.
    #: shape (m,): delay of each output in addition to the plant's delay and lag.
    extra_delay_s: FloatArray
    pressure_gain: float  #: Ratio of pressure to command.


def fit_ship(
    result: OkidResult, u: FloatArray, plant: DesignPlant, measured: tuple[str, ...]
) -> ShipFit:
    """Fit ship and tank to the result of OKID.

    The `result` is of one input `u`, shape (N,), gaps included. The `plant` has the initial values,
    which parameters that are not fitted keep; `measured` are the outputs of the model, names of
    `STATES`. ValueError is raised if outputs or inputs do not match the model, IdentificationError
    if no ship can be fitted.
    """
    arx, ship, tank = result.arx, plant.ship, plant.tank
    if (arx.outputs, arx.inputs) != (len(measured), 1):
        raise ValueError(
            f"the model must have one input and the outputs {measured}, it has {arx.inputs} and "
            f"{arx.outputs}"
        )
    lines = (np.arange(_LINES) + 0.5) * _BAND_RAD_S / _LINES
    z = np.exp(1j * lines * arx.sample_time_s)
    powers = z[:, None] ** -np.arange(arx.order + 1)
    left = np.eye(arx.outputs) - np.einsum("wi,iab->wab", powers[:, 1:], arx.alpha)
    right = np.einsum("wi,iab->wab", powers, arx.beta)
    spread = np.array([*_SPREAD, _PRESSURE_SPREAD, *[_DELAY_SPREAD_S] * arx.outputs])
    amplitude = _amplitude(np.asarray(u, dtype=np.float64).ravel(), result)

    def physical_model(theta: FloatArray) -> DesignPlant:
        factor = np.exp(theta[:_PRESSURE]).tolist()
        return dataclasses.replace(
            plant,
            ship=ship.with_figures(
                ship.inertia_kg_m2 * factor[0],
                ship.stiffness_nm_rad * factor[1],
                ship.damping_nms_rad * factor[2],
            ),
            tank=dataclasses.replace(tank, damping_ratio=tank.damping_ratio * factor[3]),
        )

    def response(theta: FloatArray) -> ComplexArray:
        model = physical_model(theta).sampled(measured, arx.sample_time_s)
        resolvent = z[:, None, None] * np.eye(len(model.A)) - model.A
        exact = model.C @ np.linalg.solve(resolvent, model.B + 0j) + model.D
        correction = np.exp(theta[_PRESSURE] - 1j * np.outer(lines, theta[_PRESSURE + 1 :]))
        corrected: ComplexArray = correction[:, :, None] * exact
        return corrected

    def misfit(theta: FloatArray, weight: FloatArray) -> FloatArray:
        errors = weight @ (right - left @ response(theta)) * amplitude[:, None, None]
        return np.concatenate([errors.real.ravel(), errors.imag.ravel(), theta / spread])

    try:
        weight = np.linalg.cholesky(np.linalg.inv(result.residual_covariance)).T
        theta, covariance, dispersion = _solved(misfit, weight, spread)
        covariance = covariance[:_PRESSURE, :_PRESSURE]
    except (np.linalg.LinAlgError, ValueError) as error:  # overflow, or a singular matrix
        raise IdentificationError(f"no ship fits the identified model: {error}") from None
    period_gradient = np.array([0.5, -0.5, 0.0, 0.0])
    coefficients_per_row = result.columns / result.rows
    inflation = (1 + coefficients_per_row) / (1 - coefficients_per_row)
    fitted = physical_model(theta)
    return ShipFit(
        fitted.ship,
        fitted.tank,
        inflation * np.sqrt(covariance.diagonal()),
        inflation * float(np.sqrt(period_gradient @ covariance @ period_gradient)),
        dispersion,
        theta[_PRESSURE + 1 :],
        float(np.exp(theta[_PRESSURE])),
    )


def _solved(
    misfit: Callable[[FloatArray, FloatArray], FloatArray], weight: FloatArray, spread: FloatArray
) -> tuple[FloatArray, FloatArray, float]:
    """Parameters, their covariance, and how much larger the errors are than `weight` says."""
    starts = [np.where(np.arange(len(spread)) == 1, start, 0.0) for start in _STARTS]
    theta = min(starts, key=lambda start: float(np.sum(misfit(start, weight) ** 2)))
    dispersion = 1.0
    for _ in range(_PASSES):
        solution = least_squares(misfit, theta, x_scale=spread, args=(weight / dispersion,))
        theta = solution.x
        residual_rms = float(np.sqrt(np.mean(solution.fun[: -len(theta)] ** 2)))
        dispersion = max(1.0, dispersion * residual_rms)
        if abs(residual_rms - 1) < _CONVERGED or dispersion == 1:
            break
    return theta, np.linalg.inv(solution.jac.T @ solution.jac), dispersion


def _amplitude(u: FloatArray, result: OkidResult) -> FloatArray:
    """Return the root of the energy, around each frequency, of what informs of the ship.

    It is the two-sided energy of the input less what follows from the prediction errors up to now:
    the law's answer to the waves. Shape (_LINES,).
    """
    errors, here = result.errors, np.isfinite(u)
    lags = min(result.arx.order, result.rows // (_ROWS_PER_COLUMN * errors.shape[1]))
    lagged = LagRegression(errors, 0, lags, np.empty((0, len(u))))
    at = lagged.at[here[lagged.at]]
    matrix = lagged.matrix[here[lagged.at]]
    free = np.zeros(len(u))
    free[at] = u[at] - u[here].mean()
    free[at] -= matrix @ np.linalg.lstsq(matrix, free[at])[0]
    rows = max(1, len(at) - matrix.shape[1])  # as many degrees of freedom are left
    energy = 2 * np.abs(np.fft.rfft(free)) ** 2 / rows * np.count_nonzero(here) / len(u)
    frequency = 2 * np.pi * np.fft.rfftfreq(len(u), result.arx.sample_time_s)
    band = np.digitize(frequency, np.linspace(0, _BAND_RAD_S, _LINES + 1)) - 1
    inside = band < _LINES
    amplitude: FloatArray = np.sqrt(np.bincount(band[inside], energy[inside], minlength=_LINES))
    return amplitude


@dataclass(frozen=True, slots=True)
class ModelLimits:
    """Limits of the acceptance test."""

    #: Shortest and longest roll period of the ship's stability booklet.
    roll_period_range_s: tuple[float, float]
    fit: float = 0.8  #: Smallest one-step fit of each output on validation data.
    #: Largest autocorrelation of the prediction errors on validation data at any lag. A whiteness
    #: test is no criterion: with hundreds of coefficients the errors are always slightly coloured,
    #: and with enough data significantly.
    correlation: float = 0.5
    period_deviation: float = 0.05  #: Largest relative standard deviation of the roll period.
    #: Largest misfit of the ship to the identified model, relative to its uncertainty.
    dispersion: float = 12.0


def model_objections(validation: Validation, fit: ShipFit, limits: ModelLimits) -> tuple[str, ...]:
    """Return objections to an identified model, in words; empty if it is acceptable.

    `validation` is of the ARX model, and `fit` the ship and tank fitted to it.
    """
    found = []
    # The form of these conditions makes NaN an objection too.
    one_step = float(np.min(validation.one_step_fit))
    if not one_step >= limits.fit:
        found.append(f"fit on held-out data is {one_step:.2f}, less than {limits.fit:g}")
    correlation = float(np.max(np.abs(validation.residual_correlation)))
    if not correlation <= limits.correlation:
        found.append(
            f"held-out prediction errors are correlated by {correlation:.2f}, more than "
            f"{limits.correlation:g}: there is more to predict"
        )
    low, high = limits.roll_period_range_s
    period_s = 2 * math.pi / fit.ship.natural_frequency_rad_s
    if not low <= period_s <= high:
        found.append(
            f"roll period {period_s:.2f} s is outside the stability booklet's {low:g} to {high:g} s"
        )
    if not fit.period_deviation <= limits.period_deviation:
        found.append(
            f"roll period is uncertain by {fit.period_deviation:.0%}, more than "
            f"{limits.period_deviation:.0%}: give stronger or longer pulses"
        )
    if not fit.dispersion <= limits.dispersion:
        found.append(
            f"no ship explains the identified model: the misfit is {fit.dispersion:.1f} times "
            f"its uncertainty, more than {limits.dispersion:g}"
        )
    return tuple(found)
