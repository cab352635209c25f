"""Validation of an identified model on data that it was not fitted to.

The criteria are the fit of the prediction, and its errors' correlation with themselves: coloured
errors mean unmodelled dynamics or disturbances (a wave, a higher order). Ljung, System
Identification, 16.6.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from utank_hil.base.arrays import FloatArray
from utank_hil.control.arx import ARX
from utank_hil.identification.disturbance import disturbance_basis
from utank_hil.identification.lag_regression import LagRegression
from utank_hil.identification.record import IdentificationError, channel_scale, stacked_record

_STILL = 1e-12  # smallest peak-to-peak value, relative to a channel's root mean square


@dataclass(frozen=True, slots=True, eq=False)
class Validation:
    """Validation results of a model on a record."""

    #: shape (m,): 1 - rms(prediction error) / rms(y - mean y); 1 is perfect.
    one_step_fit: FloatArray
    #: shape (lags, m): autocorrelation of the prediction errors at lags 1, 2, ...
    residual_correlation: FloatArray
    rows: int  #: Number of predictions.


def validate(
    arx: ARX,
    u: FloatArray,
    y: FloatArray,
    disturbance_frequencies_rad_s: Sequence[float] = (),
    lags: int = 25,
    disturbance_polynomial_degree: int | None = None,
) -> Validation:
    """Validate a model on a record, preferably one that it was not identified from.

    ValueError is raised if the record's channels do not match the model, or `lags` is below 1.
    IdentificationError is raised if the record does not allow a validation: no segment longer than
    order and lags, fewer predictions than lags, a channel that does not move, a clipped output, or
    predictions that overflow.

    Parameters
    ----------
    y : array_like, shape (N, m) or (N,)
        NaN rows are gaps, as in `okid`.
    disturbance_frequencies_rad_s : sequence of float
        Frequencies of regular waves; their amplitudes and phases are fitted to this record.
    lags : int
        Largest lag of the correlations, 1 or more.
    disturbance_polynomial_degree : int or None
        0 for an offset, 1 also for a drift, both fitted to this record: a heel or the bias of a
        sensor, which `okid` fits as well, is not an error of the model.
    """
    if int(lags) != lags or lags < 1:
        raise ValueError(f"lags must be a positive integer, got {lags}")
    z, m = stacked_record(u, y)
    if (m, z.shape[1] - m) != (arx.outputs, arx.inputs):
        raise ValueError(
            f"the model has {arx.outputs} outputs and {arx.inputs} inputs, the record {m} and "
            f"{z.shape[1] - m}"
        )
    scale = channel_scale(z, m)
    functions = disturbance_basis(
        len(z), arx.sample_time_s, disturbance_frequencies_rad_s, disturbance_polynomial_degree
    )
    regression = LagRegression(z / scale, m, max(arx.order, int(lags)), functions)
    _refuse_unusable(regression, lags)
    coefficients = _coefficients(arx, scale, regression)
    errors = _errors(regression, coefficients)
    if size := len(functions):
        known = regression.matrix[:, -size:]
        coefficients[-size:] = np.linalg.lstsq(known, errors, rcond=None)[0]
        errors = _errors(regression, coefficients)
    spread = np.std(regression.targets, axis=0)
    correlation = _correlation(np.split(errors, regression.ends), lags)
    return Validation(1 - _rms(errors) / spread, correlation, regression.rows)


def _refuse_unusable(regression: LagRegression, lags: int) -> None:
    """Raise IdentificationError for too few predictions, or channels that do not move."""
    if regression.rows <= lags:
        raise IdentificationError(
            f"{regression.rows} predictions are too few to correlate over {lags} lags; validate "
            "on a longer record, mend its gaps or ask for fewer lags"
        )
    # Outputs are compared at the predictions, inputs also at every lag before them.
    inputs = regression.channels - regression.outputs
    columns = (regression.input_rows[j::inputs][: lags + 1] for j in range(inputs))
    lagged = np.stack([regression.matrix[:, each] for each in columns])
    for name, parts in (("output", regression.targets.T), ("input", lagged.transpose(0, 2, 1))):
        for number, part in enumerate(parts):
            if np.ptp(part, axis=-1).min() < _STILL:
                raise IdentificationError(
                    f"{name} {number} does not move in the samples that predictions are judged by; "
                    "validate on a stretch in which it moves throughout"
                )


def _errors(regression: LagRegression, coefficients: FloatArray) -> FloatArray:
    """Return one-step prediction errors, shape (rows, m); an overflow is refused."""
    with np.errstate(over="ignore", invalid="ignore"):
        errors = regression.residuals(coefficients)
        if not np.isfinite(errors.T @ errors).all():
            raise IdentificationError(
                "the model's predictions of this record overflow; the model is not of these "
                "signals, or of other units"
            )
    return errors


def _coefficients(arx: ARX, scale: FloatArray, regression: LagRegression) -> FloatArray:
    """Return coefficients in a scaled regression; zero beyond the order and for the basis."""
    m = arx.outputs
    by_lag = np.zeros((regression.order + 1, m, regression.channels))
    by_lag[1 : arx.order + 1, :, :m] = arx.alpha
    by_lag[: arx.order + 1, :, m:] = arx.beta
    with np.errstate(over="ignore", invalid="ignore"):  # The predictions are then not finite.
        by_lag *= scale / scale[:m, None]
    lagged = by_lag.transpose(0, 2, 1).reshape(-1, m)[m:]
    return np.vstack([lagged, np.zeros((regression.basis_size, m))])


def _rms(errors: FloatArray) -> FloatArray:
    rms: FloatArray = np.sqrt(np.mean(errors**2, axis=0))
    return rms


def _correlation(errors: list[FloatArray], lags: int) -> FloatArray:
    """Return the autocorrelation of each output's errors, shape (lags, m)."""
    total = sum(np.sum(e**2, axis=0) for e in errors)
    products = [
        sum(np.sum(e[lag:] * e[:-lag], axis=0) for e in errors) for lag in range(1, lags + 1)
    ]
    correlation: FloatArray = np.array(products) / np.maximum(total, 1e-300)
    return correlation
