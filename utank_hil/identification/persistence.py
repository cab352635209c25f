"""How well an input excites: the order it does, and what its weakest directions cost."""

import numpy as np
from scipy.linalg import lapack

from utank_hil.arrays import FloatArray
from utank_hil.identification.lag_regression import LagRegression

_EXCITED = 1e-10  # pivots of the lagged inputs' Gram matrix: singular values down to 1e-5


def excitation_order(u: FloatArray, most: int) -> int:
    """Order to which an input is persistently exciting, to numerical precision.

    The rank of the Gram matrix of `most` lagged inputs. A model of n states takes 2 n or more; all
    coefficients of an ARX model of order p take p + 1. A signal within a narrow band has a low
    order however many lines it holds.

    Parameters
    ----------
    u : array_like, shape (N,) or (N, r)
        Rows that are not finite are gaps.
    most : int
        Largest order looked for.

    Raises
    ------
    IdentificationError
        If no stretch without gaps holds `most` samples.
    """
    signal = np.asarray(u, dtype=np.float64)
    signal = signal[:, None] if signal.ndim == 1 else signal
    peak = np.abs(signal[np.isfinite(signal).all(axis=1)]).max(axis=0, initial=0.0)
    if not peak.any():
        return 0
    signal = signal / np.where(peak > 0, peak, 1.0)
    regression = LagRegression(signal, 0, most - 1, np.empty((0, len(signal))))
    return lagged_inputs(regression, regression.gram()[0])[0]


def lagged_inputs(regression: LagRegression, gram: FloatArray) -> tuple[int, float]:
    """Order of excitation and variance inflation, from a regression's Gram matrix.

    Returns
    -------
    order : int
    inflation : float
        Mean variance of the input coefficients, over what white inputs of the same power would
        leave; infinite when the order is less than the number of lags.
    """
    index = regression.input_rows
    lagged = gram[np.ix_(index, index)]
    power = lagged.diagonal()
    factor, _, rank, _ = lapack.dpstrf(lagged.T, lower=1, tol=_EXCITED * power.max())
    inputs = regression.channels - regression.outputs
    if rank < len(index):
        return int(rank) // inputs, np.inf
    inverse, _ = lapack.dtrtri(factor, lower=1)
    # dpstrf leaves the other triangle as it was
    inflation = np.sum(np.tril(inverse) ** 2) * power.mean() / len(index)
    return int(rank) // inputs, float(inflation)
