"""Observer/Kalman filter identification (OKID) of ship and tank, thesis 3.7, (3.10)-(3.13).

The observer Markov parameters of (3.12) are the coefficients of an ARX model: with
A_o = A - K C they are alpha_i = C A_o^(i-1) K and beta_i = C A_o^(i-1) (B - K D). They are fitted
by least squares together with a disturbance basis. The order p must cover the observer's memory:
p = 120 at 0.2 s is two roll periods.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from utank_hil.base.arrays import FloatArray
from utank_hil.control.arx import ARX
from utank_hil.identification.disturbance import disturbance_basis
from utank_hil.identification.lag_regression import Fit, LagRegression, fit
from utank_hil.identification.record import IdentificationError, channel_scale, stacked_record

_TRIED = 401  # Samples of a pulse response that must be finite: at 0.2 s, beyond any roll period.
_LEAST_EXCITATION = 4  # One oscillation needs twice its order.


@dataclass(frozen=True, slots=True, eq=False)
class OkidResult:
    """Result of OKID."""

    arx: ARX  #: Observer Markov parameters as a model.
    residual_covariance: FloatArray  #: shape (m, m): covariance of the one-step prediction errors.
    columns: int  #: Number n of the regression's columns: coefficients of each output.
    #: Rank of the regression; below n if the data fit exactly or the input does not excite.
    rank: int
    #: Order of persistent excitation of the input, at most p + 1. A system of order n needs 2 n or
    #: more.
    excitation_order: int
    rows: int  #: Number of equations, without gaps.
    errors: FloatArray  #: shape (N, m): one-step prediction errors; NaN where there is none.


def okid(
    u: FloatArray,
    y: FloatArray,
    order: int = 120,
    *,
    sample_time_s: float,
    disturbance_frequencies_rad_s: Sequence[float] = (),
    disturbance_polynomial_degree: int | None = None,
) -> OkidResult:
    """Identify a model from a record of inputs and outputs.

    ValueError is raised if an argument has the wrong shape or value. IdentificationError is raised
    if the record does not determine a model: too short, too many gaps, too little excitation, an
    output that does not move or is clipped.

    Parameters
    ----------
    u : array_like, shape (N, r) or (N,)
        Applied inputs (after limits). Row k is what acted between the measurements of rows k - 1
        and k of `y`, as a controller's record has it: a law designed on the model then answers row
        k of `y` with row k + 1 of `u`, at once. If row k of `u` acted after row k of `y`, as in
        simulations with a held input, the law's command has to be applied one sample later.
    y : array_like, shape (N, m) or (N,)
        Outputs. A row with a value that is not finite is a gap; gaps must keep their rows, since
        the row index is time. Join separate records with one such row between them.
    order : int
        Order p of the ARX model.
    disturbance_frequencies_rad_s : sequence of float
        Frequencies of regular waves; see `find_disturbance_frequencies`.
    disturbance_polynomial_degree : int or None
        0 fits an offset, 1 also a drift.
    """
    if not (np.isfinite(sample_time_s) and sample_time_s > 0):
        raise ValueError(f"sample_time_s must be positive, got {sample_time_s}")
    if int(order) != order or order < 1:
        raise ValueError(f"order must be a positive integer, got {order}")
    z, m = stacked_record(u, y)
    scale = channel_scale(z, m)
    functions = disturbance_basis(
        len(z), sample_time_s, disturbance_frequencies_rad_s, disturbance_polynomial_degree
    )
    regression = LagRegression(z / scale, m, int(order), functions)
    solution = fit(regression)
    if solution.excitation_order < min(_LEAST_EXCITATION, order + 1):
        raise IdentificationError(
            f"the input is persistently exciting of order {solution.excitation_order} only, "
            f"one oscillation takes {_LEAST_EXCITATION}; use random pulses or a PRBS"
        )
    errors = np.full((len(z), m), np.nan)
    errors[regression.at] = regression.residuals(solution.coefficients) * scale[:m]
    fitted = _in_units(solution, regression, scale, sample_time_s, errors)
    kick = np.zeros((max(_TRIED, 2 * order + 1), fitted.arx.inputs))
    kick[0] = 1.0
    with np.errstate(over="ignore", invalid="ignore"):
        answer = fitted.arx.simulate(kick)
    if not np.isfinite(answer).all():
        raise IdentificationError(
            "the fitted model is violently unstable, so the record does not determine it; "
            "record longer, excite more or raise the order"
        )
    return fitted


def _in_units(
    solution: Fit,
    regression: LagRegression,
    scale: FloatArray,
    sample_time_s: float,
    errors: FloatArray,
) -> OkidResult:
    """Convert a solution to the units of the record."""
    p, m = regression.order, regression.outputs
    y_scale = scale[:m]
    column_scale = np.concatenate([np.tile(scale, p + 1)[m:], np.ones(regression.basis_size)])
    coefficients = solution.coefficients * y_scale / column_scale[:, None]
    if not np.isfinite(coefficients).all():
        raise IdentificationError("the least-squares problem overflowed; check the record's units")
    split = len(coefficients) - regression.basis_size
    by_lag = np.vstack([np.zeros((m, m)), coefficients[:split]]).reshape(p + 1, -1, m)
    by_lag = by_lag.transpose(0, 2, 1)
    return OkidResult(
        ARX(by_lag[1:, :, :m], by_lag[:, :, m:], sample_time_s),
        residual_covariance=solution.residual_covariance * np.outer(y_scale, y_scale),
        columns=len(column_scale),
        rank=solution.rank,
        excitation_order=solution.excitation_order,
        rows=regression.rows,
        errors=errors,
    )
