"""Observer/Kalman filter identification (OKID) of ship and tank, thesis 3.7, (3.10)-(3.13).

The observer Markov parameters of (3.12) are the coefficients of an ARX model: with
A_o = A - K C they are alpha_i = C A_o^(i-1) K and beta_i = C A_o^(i-1) (B - K D). They are fitted
by least squares together with a disturbance basis. The Markov parameters of the system follow by
recursion. The order p must cover the observer's memory: p = 120 at 0.2 s is two roll periods.
"""

from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace

import numpy as np

from utank_hil.base.arrays import FloatArray
from utank_hil.control.arx import ARX
from utank_hil.identification.disturbance import disturbance_basis
from utank_hil.identification.lag_regression import Fit, LagRegression, fit
from utank_hil.identification.record import IdentificationError, channel_scale, stacked_record

_MARKOV_COUNT = 401  # At 0.2 s this is a Hankel matrix over 40 s, longer than any roll period.
_LEAST_EXCITATION = 4  # One oscillation needs twice its order.


def markov_parameters(arx: ARX, count: int) -> tuple[FloatArray, FloatArray]:
    """Return K = `count` Markov parameters of the system and of the observer gain.

    ::

        Y_0 = beta_0,    Y_k  = beta_k + sum_{i=1..min(k,p)} alpha_i Y_{k-i}
                         Yo_k = alpha_k + sum_{i=1..min(k-1,p)} alpha_i Yo_{k-i}

    Y_k = C A^(k-1) B are the system's Markov parameters and Yo_k = C A^(k-1) K those of its
    observer x(k+1) = A x + B u + K (y - C x - D u); K is -G of the thesis (3.10). Juang, Applied
    System Identification, 6.3. Beyond p the terms beta_k and alpha_k are zero.

    The parameters of the system, shape (K, m, r), are D, then C A^(k-1) B; those of the observer,
    shape (K - 1, m, m), C A^(k-1) K.
    """
    p, m, r = arx.order, arx.outputs, arx.inputs
    # Both recursions run at once, newest first, so that the last p responses are contiguous.
    newest_first = np.zeros((count + p, m, r + m))
    known = min(count, p + 1)
    newest_first[count - known : count, :, :r] = arx.beta[:known][::-1]
    newest_first[count - known : count - 1, :, r:] = arx.alpha[: known - 1][::-1]
    alphas = np.ascontiguousarray(arx.alpha.transpose(1, 0, 2).reshape(m, p * m))
    past = newest_first.reshape(-1, r + m)
    for k in range(1, count):
        first = count - k  # This is the row block of response k - 1.
        newest_first[first - 1] += alphas @ past[first * m : (first + p) * m]
    responses = newest_first[:count][::-1]
    return responses[:, :, :r].copy(), responses[1:, :, r:].copy()


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class OkidResult(Fit):
    """Result of OKID: a fit in the units of the record, but for its `penalty`."""

    arx: ARX  #: Observer Markov parameters as a model.
    #: shape (K, m, r): system Markov parameters; ``markov[0]`` is D, ``markov[k]`` is C A^(k-1) B.
    markov: FloatArray
    #: shape (K - 1, m, m): observer gain Markov parameters C A^(k-1) K, K being -G of the thesis.
    observer_gain: FloatArray
    errors: FloatArray  #: shape (N, m): one-step prediction errors; NaN where there is none.


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
    waves = disturbance_frequencies_rad_s
    shapes = (waves, disturbance_polynomial_degree, disturbance_decay_rates_1_s)
    return _fitted(u, y, order, sample_time_s, shapes).arx


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
    waves = disturbance_frequencies_rad_s
    shapes = (waves, disturbance_polynomial_degree, disturbance_decay_rates_1_s)
    fitted = _fitted(u, y, order, sample_time_s, shapes)
    with np.errstate(over="ignore", invalid="ignore"):
        markov, observer_gain = markov_parameters(fitted.arx, max(_MARKOV_COUNT, 2 * order + 1))
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
    shapes: tuple[Sequence[float], int | None, Sequence[float]],
) -> OkidResult:
    """The result with a disturbance basis of these shapes, yet without Markov parameters."""
    if not (np.isfinite(sample_time_s) and sample_time_s > 0):
        raise ValueError(f"sample_time_s must be positive, got {sample_time_s}")
    if int(order) != order or order < 1:
        raise ValueError(f"order must be a positive integer, got {order}")
    order = int(order)
    z, m = stacked_record(u, y)
    scale = channel_scale(z, m)
    functions = disturbance_basis(len(z), sample_time_s, *shapes)
    regression = LagRegression(z / scale, m, order, functions)
    solution = fit(regression)
    if solution.excitation_order < min(_LEAST_EXCITATION, order + 1):
        raise IdentificationError(
            f"the input is persistently exciting of order {solution.excitation_order} only, "
            f"one oscillation takes {_LEAST_EXCITATION}; use random pulses or a PRBS"
        )
    y_scale = scale[:m]
    errors = np.full((len(z), m), np.nan)
    errors[regression.at] = regression.residuals(solution.coefficients) * y_scale
    column_scale = np.concatenate([np.tile(scale, order + 1)[m:], np.ones(len(functions))])
    coefficients = solution.coefficients * y_scale / column_scale[:, None]
    if not np.isfinite(coefficients).all():
        raise IdentificationError("the least-squares problem overflowed; check the record's units")
    lagged = coefficients[: len(coefficients) - len(functions)]
    by_lag = np.vstack([np.zeros((m, m)), lagged]).reshape(order + 1, -1, m).transpose(0, 2, 1)
    figures = asdict(solution) | {
        "coefficients": coefficients,
        "residual_covariance": solution.residual_covariance * np.outer(y_scale, y_scale),
    }
    return OkidResult(
        arx=ARX(by_lag[1:, :, :m], by_lag[:, :, m:], sample_time_s),
        markov=np.empty(0),
        observer_gain=np.empty(0),
        errors=errors,
        **figures,
    )
