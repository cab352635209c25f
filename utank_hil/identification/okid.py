"""Observer/Kalman filter identification (OKID) of ship and tank, thesis 3.7, (3.10)-(3.13).

The observer Markov parameters of (3.12) are the coefficients of an ARX model: with
A_o = A - K C they are alpha_i = C A_o^(i-1) K and beta_i = C A_o^(i-1) (B - K D). They are fitted
by least squares together with a disturbance basis (`arx`). The Markov parameters of the system
follow by recursion. The order p must cover the observer's memory: p = 120 at 0.2 s is two roll
periods.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from utank_hil.base.arrays import FloatArray
from utank_hil.control.arx import ARX
from utank_hil.identification.disturbance import DisturbanceBasis
from utank_hil.identification.errors import IdentificationError
from utank_hil.identification.lag_regression import LagRegression
from utank_hil.identification.least_squares import Fit, fit
from utank_hil.identification.markov import markov_parameters
from utank_hil.identification.record import channel_scale, stacked_record

_MARKOV_COUNT = 401  # At 0.2 s this is a Hankel matrix over 40 s, longer than any roll period.
_LEAST_EXCITATION = 4  # One oscillation needs twice its order.


@dataclass(frozen=True, slots=True, eq=False)
class OkidResult:
    """Result of OKID."""

    arx: ARX  #: Observer Markov parameters as a model.
    #: shape (K, m, r): system Markov parameters; ``markov[0]`` is D, ``markov[k]`` is C A^(k-1) B.
    markov: FloatArray
    #: shape (K - 1, m, m): observer gain Markov parameters C A^(k-1) K, K being -G of the thesis.
    observer_gain: FloatArray
    basis: DisturbanceBasis
    #: shape (d, m): coefficients of the disturbance basis in the ARX equation.
    disturbance: FloatArray
    residual_covariance: FloatArray  #: shape (m, m): covariance of the one-step prediction errors.
    #: shape (n, n): upper triangle of the regression's Gram matrix, with columns divided by
    #: `column_scale`, in the order of `LagRegression`.
    gram: FloatArray
    column_scale: FloatArray  #: shape (n,)
    #: shape (m,): term of the shrinkage on the inputs' diagonal of the Gram matrix; zero for plain
    #: least squares, when the input excites well.
    penalty: FloatArray
    #: Rank of the regression; below n if the data fit exactly or the input does not excite.
    rank: int
    #: Order of persistent excitation of the input, at most p + 1. A system of order n needs 2 n or
    #: more.
    excitation_order: int
    rows: int  #: Number of equations, without gaps.


def arx(
    u: FloatArray,
    y: FloatArray,
    order: int = 120,
    *,
    sample_time_s: float,
    disturbance_frequencies_rad_s: Sequence[float] = (),
    disturbance_polynomial_degree: int | None = None,
    disturbance_decay_rates_1_s: Sequence[float] = (),
) -> ARX:
    """Fit an ARX model by least squares: the first step of `okid`.

    Parameters and errors are those of `okid`, except that strongly unstable models, whose one-step
    predictions are valid, are not refused. The result is `OkidResult.arx` of the same record.
    """
    return _fitted(
        u,
        y,
        order,
        sample_time_s,
        disturbance_frequencies_rad_s,
        disturbance_polynomial_degree,
        disturbance_decay_rates_1_s,
    ).arx


def okid(
    u: FloatArray,
    y: FloatArray,
    order: int = 120,
    *,
    sample_time_s: float,
    disturbance_frequencies_rad_s: Sequence[float] = (),
    disturbance_polynomial_degree: int | None = None,
    disturbance_decay_rates_1_s: Sequence[float] = (),
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
    disturbance_decay_rates_1_s : sequence of float
        Decay rates of exponential disturbances.
    """
    fitted = _fitted(
        u,
        y,
        order,
        sample_time_s,
        disturbance_frequencies_rad_s,
        disturbance_polynomial_degree,
        disturbance_decay_rates_1_s,
    )
    with np.errstate(over="ignore", invalid="ignore"):
        markov, observer_gain = markov_parameters(
            fitted.arx, max(_MARKOV_COUNT, 2 * fitted.arx.order + 1)
        )
    if not (np.isfinite(markov).all() and np.isfinite(observer_gain).all()):
        raise IdentificationError(
            "the fitted model is violently unstable, so the record does not determine it; "
            "record longer, excite more or raise the order"
        )
    return replace(fitted, markov=markov, observer_gain=observer_gain)


def _fitted(
    u: FloatArray,
    y: FloatArray,
    order: int,
    sample_time_s: float,
    frequencies_rad_s: Sequence[float],
    polynomial_degree: int | None,
    decay_rates_1_s: Sequence[float],
) -> OkidResult:
    """Return the result, yet without Markov parameters."""
    if not (np.isfinite(sample_time_s) and sample_time_s > 0):
        raise ValueError(f"sample_time_s must be positive, got {sample_time_s}")
    basis = DisturbanceBasis(tuple(frequencies_rad_s), polynomial_degree, tuple(decay_rates_1_s))
    z, m = stacked_record(u, y)
    scale = channel_scale(z, m)
    functions = basis.evaluate(len(z), sample_time_s)
    regression = LagRegression(z / scale, m, checked_order(order), functions)
    solution = fit(regression)
    if solution.excitation_order < min(_LEAST_EXCITATION, order + 1):
        raise IdentificationError(
            f"the input is persistently exciting of order {solution.excitation_order} only, "
            f"one oscillation takes {_LEAST_EXCITATION}; use random pulses or a PRBS"
        )
    return _in_units(solution, regression, scale, sample_time_s, basis)


def _in_units(
    solution: Fit,
    regression: LagRegression,
    scale: FloatArray,
    sample_time_s: float,
    basis: DisturbanceBasis,
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
        markov=np.empty(0),
        observer_gain=np.empty(0),
        basis=basis,
        disturbance=coefficients[split:],
        residual_covariance=solution.residual_covariance * np.outer(y_scale, y_scale),
        gram=solution.gram,
        column_scale=column_scale,
        penalty=solution.penalty,
        rank=solution.rank,
        excitation_order=solution.excitation_order,
        rows=regression.rows,
    )


def checked_order(order: int) -> int:
    """`order` as int; ValueError if it is not a positive integer."""
    if int(order) != order or order < 1:
        raise ValueError(f"order must be a positive integer, got {order}")
    return int(order)
