"""Persistent excitation: its order, and the variance inflation by weak directions."""

import numpy as np
from scipy.linalg import lapack

from utank_hil.base.arrays import FloatArray
from utank_hil.identification.lag_regression import LagRegression

_EXCITED = 1e-10  # Smallest pivot of the lagged inputs' Gram matrix: singular values of 1e-5.


def excitation_order(u: FloatArray, most: int) -> int:
    """Order of persistent excitation of an input, to numerical precision.

    This is the rank of the Gram matrix of `most` lagged inputs. A model of n states needs 2 n or
    more; all coefficients of an ARX model of order p need p + 1. A narrow-band signal has a low
    order for any number of lines.

    IdentificationError is raised if no segment without gaps has `most` samples.

    Parameters
    ----------
    u : array_like, shape (N,) or (N, r)
        Input; rows that are not finite are gaps.
    most : int
        Largest order to test.
    """
    signal = np.asarray(u, dtype=np.float64)
    signal = signal[:, None] if signal.ndim == 1 else signal
    peak = np.abs(signal[np.isfinite(signal).all(axis=1)]).max(axis=0, initial=0.0)
    if not peak.any():
        return 0
    signal = signal / np.where(peak > 0, peak, 1.0)
    regression = LagRegression(signal, 0, most - 1, np.empty((0, len(signal))))
    return input_excitation(regression, regression.gram()[0])[0]


def input_excitation(regression: LagRegression, gram: FloatArray) -> tuple[int, float]:
    """Return persistent excitation and variance inflation, from a regression's Gram matrix.

    The first is the order. The second is the mean variance of the input coefficients relative to
    white inputs of the same power, infinite if the order is less than the number of lags.
    """
    index = regression.input_rows
    lagged = gram[np.ix_(index, index)]
    power = lagged.diagonal()
    factor, _, rank, _ = lapack.dpstrf(lagged.T, lower=1, tol=_EXCITED * power.max())
    inputs = regression.channels - regression.outputs
    if rank < len(index):
        return int(rank) // inputs, np.inf
    inverse, _ = lapack.dtrtri(factor, lower=1)
    # The routine dpstrf leaves the other triangle unchanged.
    inflation = np.sum(np.tril(inverse) ** 2) * power.mean() / len(index)
    return int(rank) // inputs, float(inflation)
