"""The ship and tank behind an identified model, by what is known of their physics.

In a storm the waves move the ship ten times as much as the pump does, and what is realized from a
high-order ARX model alone is tens of per cent off. But the form of the model is known
(`utank_hil.dynamics.linear`), and loading changes few of its numbers. With A(q) y = B(q) u + e from
OKID and G(q, theta) the sampled ship and tank::

    min over theta = (log (I, k1, d1, tank damping ratio, pressure), a delay for each output):
        sum over w of |L (B - A G(theta))|^2 Phi_u + sum (theta / sigma)^2,   L^T L = cov(e)^-1

These are the prediction errors of G(theta) with 1 / A for the spectrum of the waves, so the fit
looks where the pump can be told from the sea (Wahlberg 1989; Ljung, System Identification, 10.4).
Where it cannot be told, the given ship's numbers stand. When the misfit is larger than the errors
explain, they are taken to be as much larger.

The last numbers are not the ship's. A gauge is heard sooner than the motion sensor, a drive's loop
is not quite the lag it is taken for, and the pressure is not quite the command: 10 ms or half a
per cent, which a record without irregular waves shows, and which would be laid to inertia and
damping, ten of their deviations off. At these frequencies a longer lag is a longer delay.

A is estimated from the waves of the same record and knows them better than it should, so the
misfit looks surer than it is. With n coefficients from N equations the deviations are stated
(1 + n / N) / (1 - n / N) times larger. The form is that of Akaike's final prediction error; that it
is right for deviations, and not for their squares, was measured (docs/retuning.md).
"""

import dataclasses
from dataclasses import dataclass

import numpy as np
from scipy.optimize import least_squares

from utank_hil.arrays import ComplexArray, FloatArray
from utank_hil.control.design_plant import DesignPlant
from utank_hil.dynamics.ship import RollShip
from utank_hil.dynamics.tank import Tank
from utank_hil.identification.errors import IdentificationError
from utank_hil.identification.okid import OkidResult
from utank_hil.tick import TICK_S

_BAND_RAD_S = 2.5  # above it neither ship nor tank move
_LINES = 64  # in the band; an ARX model of order 120 resolves no more
_SPREAD = (0.1, 0.7, 0.5, 0.2)  # sigma: how far loading changes each number
_PRESSURE_SPREAD = 0.005  # of a pressure sensor's slope, and of a loop that holds it
_DELAY_SPREAD_S = 2 * TICK_S  # sensors and drive are heard in one or the next
_PRESSURE = len(_SPREAD)  # its place among the fitted numbers, the delays after it
_STARTS = np.log([0.5, 0.7, 1.0, 1.4, 2.0, 2.8])  # stiffness to begin with
_PASSES = 5
_SETTLED = 1e-3


@dataclass(frozen=True, slots=True, eq=False)
class ShipFit:
    """Ship and tank of a record.

    Attributes
    ----------
    ship : RollShip
        The given one with inertia, stiffness and linear damping of the record.
    tank : Tank
        The given one with the damping ratio of the record.
    deviation : ndarray, shape (4,)
        Standard deviations of inertia, stiffness, ship damping and tank damping ratio, each as a
        part of its value. In an irregular sea the interval of two of them holds the truth in about
        nine records of ten.
    period_deviation : float
        Standard deviation of the ship's roll period, as a part of it.
    dispersion : float
        Root mean square of the misfit over what the prediction errors explain.
    later_s : ndarray, shape (m,)
        By how much each output is later than the plant's delay and lag have it.
    pressure : float
        Pressure over command.
    """

    ship: RollShip
    tank: Tank
    deviation: FloatArray
    period_deviation: float
    dispersion: float
    later_s: FloatArray
    pressure: float


def fit_ship(
    result: OkidResult,
    u: FloatArray,
    plant: DesignPlant,
    measured: tuple[str, ...],
) -> ShipFit:
    """Fit ship and tank to what OKID found.

    Parameters
    ----------
    result : OkidResult
        One input.
    u : array_like, shape (N,)
        The input it was found with, gaps included.
    plant : DesignPlant
        Where the fit begins; what is not fitted stays as it is there.
    measured : tuple of str
        Outputs of the model, by their names in `utank_hil.dynamics.linear.STATES`.

    Returns
    -------
    ShipFit

    Raises
    ------
    ValueError
        If outputs or inputs do not fit the model.
    IdentificationError
        If no ship can be fitted.
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
    amplitude = _amplitude(np.asarray(u, dtype=np.float64).ravel(), arx.sample_time_s)

    def changed(theta: FloatArray) -> DesignPlant:
        factor = np.exp(theta[:_PRESSURE]).tolist()
        return dataclasses.replace(
            plant,
            ship=dataclasses.replace(
                ship,
                inertia_kg_m2=ship.inertia_kg_m2 * factor[0],
                stiffness_nm_rad=ship.stiffness_nm_rad * factor[1],
                damping_nms_rad=ship.damping_nms_rad * factor[2],
            ),
            tank=dataclasses.replace(tank, damping_ratio=tank.damping_ratio * factor[3]),
        )

    def response(theta: FloatArray) -> ComplexArray:
        model = changed(theta).sampled(measured, arx.sample_time_s)
        resolvent = z[:, None, None] * np.eye(len(model.A)) - model.A
        exact = model.C @ np.linalg.solve(resolvent, model.B + 0j) + model.D
        later = np.exp(theta[_PRESSURE] - 1j * np.outer(lines, theta[_PRESSURE + 1 :]))
        found: ComplexArray = later[:, :, None] * exact
        return found

    def misfit(theta: FloatArray, weight: FloatArray) -> FloatArray:
        errors = weight @ (right - left @ response(theta)) * amplitude[:, None, None]
        return np.concatenate([errors.real.ravel(), errors.imag.ravel(), theta / spread])

    try:
        weight = np.linalg.cholesky(np.linalg.inv(result.residual_covariance)).T
        starts = [np.where(np.arange(len(spread)) == 1, start, 0.0) for start in _STARTS]
        theta = min(starts, key=lambda start: float(np.sum(misfit(start, weight) ** 2)))
        dispersion = 1.0
        for _ in range(_PASSES):
            solution = least_squares(misfit, theta, x_scale=spread, args=(weight / dispersion,))
            theta = solution.x
            excess = float(np.sqrt(np.mean(solution.fun[: -len(theta)] ** 2)))
            dispersion = max(1.0, dispersion * excess)
            if abs(excess - 1) < _SETTLED or dispersion == 1:
                break
        covariance = np.linalg.inv(solution.jac.T @ solution.jac)[:_PRESSURE, :_PRESSURE]
    except (np.linalg.LinAlgError, ValueError) as error:  # overflow on the way, or singular
        raise IdentificationError(f"no ship fits the identified model: {error}") from None
    of_period = np.array([0.5, -0.5, 0.0, 0.0])
    part = len(result.column_scale) / result.rows
    wider = (1 + part) / (1 - part)
    found = changed(theta)
    return ShipFit(
        found.ship,
        found.tank,
        wider * np.sqrt(covariance.diagonal()),
        wider * float(np.sqrt(of_period @ covariance @ of_period)),
        dispersion,
        theta[_PRESSURE + 1 :],
        float(np.exp(theta[_PRESSURE])),
    )


def _amplitude(u: FloatArray, sample_time_s: float) -> FloatArray:
    """Root of the input's energy in each line's band, negative frequencies too; shape (_LINES,)."""
    here = np.isfinite(u)
    energy = 2 * np.abs(np.fft.rfft(np.where(here, u - u[here].mean(), 0.0))) ** 2 / len(u)
    frequency = 2 * np.pi * np.fft.rfftfreq(len(u), sample_time_s)
    band = np.digitize(frequency, np.linspace(0, _BAND_RAD_S, _LINES + 1)) - 1
    inside = band < _LINES
    amplitude: FloatArray = np.sqrt(np.bincount(band[inside], energy[inside], minlength=_LINES))
    return amplitude
