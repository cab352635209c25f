"""Published identification behind one signature: pressure and outputs in, a state model out.

PBSID and the regularised ARX are written from the papers; N4SID and PARSIM-K are those of SIPPY
(``pip install sippy_unipi==1.0.1``, LGPL-3), left out where it is not installed. Inputs and outputs
are scaled to unit deviation. Row k of the input acted between rows k - 1 and k of the outputs.
"""

import contextlib
import io
from collections.abc import Callable
from functools import partial
from importlib import import_module
from importlib.util import find_spec
from typing import Any, Final

import numpy as np
from scipy.linalg import cho_factor, cho_solve, lstsq
from scipy.optimize import minimize

from utank_hil.base.arrays import FloatArray
from utank_hil.control import ARX
from utank_hil.identification import era, markov_parameters

Model = tuple[FloatArray, FloatArray, FloatArray, FloatArray]
Identify = Callable[[FloatArray, FloatArray, float], Model]
"""From u (N,), y (N, m) and the sample time to A, B, C, D."""

_LAGS: Final = 120
_MARKOV: Final = 401


def pbsid(u: FloatArray, y: FloatArray, order: int, past: int, future: int) -> Model:
    """Predictor-based subspace identification, optimised, of one input.

    A. Chiuso, The role of vector autoregressive modeling in predictor-based subspace
    identification, Automatica 43 (2007) 1034-1048; I. Houtzager, J. W. van Wingerden,
    M. Verhaegen, Recursive predictor-based subspace identification, IEEE TCST 20 (2012).
    """
    z = np.column_stack([u, y])
    width, m = z.shape[1], y.shape[1]
    rows = len(z) - past
    past_z = np.hstack([z[past - i : past - i + rows] for i in range(1, past + 1)])  # newest first
    coefficients = lstsq(np.hstack([past_z, u[past:, None]]), y[past:])[0]
    markov = coefficients[: past * width].reshape(past, width, m).transpose(0, 2, 1)
    blocks = []
    for ahead in range(future):  # C A_K^ahead of the state before: lags ahead + 1 .. past
        shifted = np.zeros((past, m, width))
        shifted[: past - ahead] = markov[ahead:]
        blocks.append(shifted.transpose(1, 0, 2).reshape(m, past * width))
    predicted = past_z @ np.vstack(blocks).T
    left, values, _ = np.linalg.svd(predicted, full_matrices=False)
    state = left[:, :order] * np.sqrt(values[:order])
    outputs = lstsq(np.hstack([state, u[past:, None]]), y[past:])[0]
    error = y[past:] - np.hstack([state, u[past:, None]]) @ outputs
    inner = np.hstack([state[:-1], u[past:-1, None], error[:-1]])
    step = lstsq(inner, state[1:])[0]
    return step[:order].T, step[order : order + 1].T, outputs[:order].T, outputs[order:].T


def regularised_arx(u: FloatArray, y: FloatArray, sample_time_s: float) -> Model:
    """Roll alone: ARX of order 120, "tuned/correlated" priors by empirical Bayes, ERA of order 4.

    T. Chen, H. Ohlsson, L. Ljung, On the estimation of transfer functions, regularizations and
    Gaussian processes, Automatica 48 (2012) 1525-1535; G. Pillonetto and others, Kernel methods in
    system identification, Automatica 50 (2014) 657-682. Size and decay of each predictor's impulse
    response follow from the marginal likelihood.
    """
    y = y[:, :1]
    signals = np.column_stack([u, y])
    rows, m = len(y) - _LAGS, y.shape[1]
    first = (0, *[1] * m)  # the input acts at once
    columns = [
        np.column_stack([signals[_LAGS - i : _LAGS - i + rows, j] for i in range(k, _LAGS + k)])
        for j, k in enumerate(first)
    ]
    regressor = np.hstack(columns)
    gram, count = regressor.T @ regressor, len(columns)
    lags = np.maximum.outer(np.arange(_LAGS), np.arange(_LAGS))

    def prior(theta: FloatArray) -> FloatArray:
        kernel = np.zeros((count * _LAGS, count * _LAGS))
        for j in range(count):
            block = slice(j * _LAGS, (j + 1) * _LAGS)
            decay = 1 / (1 + np.exp(-theta[2 * j + 1]))
            kernel[block, block] = np.exp(theta[2 * j]) * (decay**lags + 1e-9 * np.eye(_LAGS))
        return kernel

    alpha, beta = np.zeros((_LAGS, m, m)), np.zeros((_LAGS + 1, m, 1))
    for output in range(m):
        aimed = y[_LAGS:, output]
        moment, energy = regressor.T @ aimed, float(aimed @ aimed)
        free = lstsq(regressor, aimed)[0]
        noise = float(np.mean((aimed - regressor @ free) ** 2)) * rows / (rows - len(free))

        def solved(theta: FloatArray, noise: float = noise) -> tuple[Any, FloatArray]:
            root = np.linalg.cholesky(prior(theta))
            factor = cho_factor(noise * np.eye(len(gram)) + root.T @ gram @ root)
            return factor, np.asarray(root, dtype=np.float64)

        def cost(
            theta: FloatArray,
            moment: FloatArray = moment,
            energy: float = energy,
            noise: float = noise,
            solved: Callable[[FloatArray], tuple[Any, FloatArray]] = solved,
        ) -> float:
            try:
                factor, root = solved(theta)
            except np.linalg.LinAlgError:
                return 1e12
            fitted = root.T @ moment
            quadratic = (energy - float(fitted @ cho_solve(factor, fitted))) / noise
            # noise^(rows - n) of the determinant does not depend on theta
            return quadratic + 2 * float(np.log(np.diag(factor[0])).sum())

        theta = minimize(
            cost,
            np.tile([-3.0, 3.0], count),
            method="Nelder-Mead",
            options={"maxfev": 120, "xatol": 0.05, "fatol": 0.1},
        ).x
        factor, root = solved(theta)
        found = np.asarray(root @ cho_solve(factor, root.T @ moment)).reshape(count, _LAGS)
        beta[:_LAGS, output, 0] = found[0]
        alpha[:, output, :] = found[1:].T
    markov, _ = markov_parameters(ARX(alpha, beta, sample_time_s), _MARKOV)
    system = era(markov, 4, sample_time_s=sample_time_s)
    a, b, c, d = (
        np.asarray(part, dtype=np.float64) for part in (system.A, system.B, system.C, system.D)
    )
    return a, b, c, d


def _pbsid(
    order: int,
    past: int,
    u: FloatArray,
    y: FloatArray,
    sample_time_s: float,  # noqa: ARG001
) -> Model:
    return pbsid(u, y, order, past, past // 2)


def _sippy(
    method: str,
    u: FloatArray,
    y: FloatArray,
    sample_time_s: float,  # noqa: ARG001
) -> Model:
    package = import_module("sippy_unipi")
    with contextlib.redirect_stdout(io.StringIO()):
        found = package.system_identification(
            y.T, u[None], method, SS_fixed_order=8, SS_f=_LAGS, SS_p=_LAGS, SS_D_required=True
        )
    return found.A, found.B, found.C, found.D


def _scaled(identify: Identify, u: FloatArray, y: FloatArray, sample_time_s: float) -> Model:
    u, y = u - u.mean(), y - y.mean(axis=0)
    size, scale = np.std(u), np.std(y, axis=0)
    a, b, c, d = identify(u / size, y / scale, sample_time_s)
    return a, b / size, c * scale[:, None], d * scale[:, None] / size


def published() -> dict[str, Identify]:
    """Methods by name, with the settings that are tried; SIPPY's if it is installed."""
    found: dict[str, Identify] = {
        f"PBSID, order {order}, past {past}": partial(_pbsid, order, past)
        for order, past in ((4, 60), (8, 120))
    }
    found["regularised ARX, ERA"] = regularised_arx
    if find_spec("sippy_unipi") is not None:
        for method in ("N4SID", "PARSIM-K"):
            found[f"SIPPY {method}, order 8, {_LAGS} rows"] = partial(_sippy, method)
    return {name: partial(_scaled, identify) for name, identify in found.items()}
