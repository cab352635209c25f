"""The least-squares problem of an ARX model, without its regression matrix.

::

    y(k) = sum_{i=1..p} alpha_i y(k-i) + sum_{i=0..p} beta_i u(k-i) + c psi(k) + e(k)

With z = (y, u) of q = m + r channels, the N - p rows of the regression matrix are a sliding window
over z. So its Gram matrix is block Toeplitz up to corrections from the windows' ends (displacement
structure, the covariance method of linear prediction)::

    G[i+1, j+1] = G[i, j] + z(p-1-i) z(p-1-j)^T - z(N-1-i) z(N-1-j)^T

One block row of correlations and this recursion give the Gram matrix in O(N p q^2 + p^2 q^2)
operations, and products with the regression matrix are convolutions. Rows with a NaN divide a
record into segments. The sums run over the segments, so a window never spans a gap.
"""

from dataclasses import dataclass

import numpy as np
from scipy.linalg import lapack

from utank_hil.base.arrays import FloatArray
from utank_hil.identification.record import IdentificationError

_EXCITED = 1e-10  # Smallest pivot of the lagged inputs' Gram matrix: singular values of 1e-5.


@dataclass(frozen=True, slots=True)
class Segment:
    """A part of the record without gaps."""

    channels: FloatArray  #: shape (q, N): outputs, then inputs; each channel contiguous.
    basis: FloatArray  #: shape (d, N - p): disturbance basis at the rows of the regression.


class LagRegression:
    """Regression of the outputs on their past, the inputs and a disturbance basis.

    Coefficients have shape (n, m), n = r + p q + d: beta_0 transposed, then alpha_i and beta_i
    transposed for each lag i = 1..p, then the rows of the basis.

    `z`, shape (N, q), holds outputs and inputs, the outputs first; a row with a value that is not
    finite is a gap. `basis`, shape (d, N), is the disturbance basis at every sample.
    IdentificationError is raised if no segment is longer than the order.
    """

    def __init__(self, z: FloatArray, outputs: int, order: int, basis: FloatArray) -> None:
        self.outputs = outputs
        self.order = order
        self.channels = z.shape[1]
        self.segments = [
            Segment(np.ascontiguousarray(z[start:stop].T), basis[:, start + order : stop])
            for start, stop in segment_bounds(z)
            if stop - start > order
        ]
        if not self.segments:
            raise IdentificationError(
                f"no stretch of the record without gaps is longer than the order {order}; "
                "record longer, mend the gaps or lower the order"
            )
        self.basis_size = len(basis)
        self.rows = sum(s.channels.shape[1] - order for s in self.segments)
        self.columns = (order + 1) * self.channels - outputs + self.basis_size

    @property
    def input_rows(self) -> np.ndarray:
        """Row indices of the input coefficients, beta_0 first."""
        q, m = self.channels, self.outputs
        index: np.ndarray = np.arange(self.order + 1)[:, None] * q + np.arange(q - m)
        return index.ravel()

    def target_squares(self) -> FloatArray:
        """Sum of squares of each output over the rows, shape (m,)."""
        squares: FloatArray = np.sum(
            [np.sum(s.channels[: self.outputs, self.order :] ** 2, axis=1) for s in self.segments],
            axis=0,
        )
        return squares

    def gram(self) -> tuple[FloatArray, FloatArray]:
        """Normal equations: the upper triangle of G (n, n), and the right side (n, m)."""
        p, q, m = self.order, self.channels, self.outputs
        lags = (p + 1) * q
        size = lags + self.basis_size
        gram = np.zeros((size, size))
        # The window ends of all segments are side by side: the displacement is one matrix product.
        head = np.hstack([s.channels[:, :p][:, ::-1].T.reshape(-1, 1) for s in self.segments])
        tail = np.hstack([s.channels[:, -p:][:, ::-1].T.reshape(-1, 1) for s in self.segments])
        np.matmul(np.hstack([head, tail]), np.hstack([head, -tail]).T, out=gram[q:lags, q:lags])
        gram[:q, :lags] = self._correlate([s.channels[:, p:] for s in self.segments]).T
        for start in range(0, lags - q, q):
            here, below = slice(start, start + q), slice(start + q, start + 2 * q)
            gram[below, start + q : lags] += gram[here, start : lags - q]
        if self.basis_size:
            gram[:lags, lags:] = self._correlate([s.basis for s in self.segments])
            gram[lags:, lags:] = sum(s.basis @ s.basis.T for s in self.segments)
        right = gram[:m, m:].T.copy()
        return gram[m:, m:], right

    def residuals(self, coefficients: FloatArray) -> list[FloatArray]:
        """One-step prediction errors by segment, each of shape (m, N - p)."""
        p, q, m = self.order, self.channels, self.outputs
        split = (p + 1) * q - m
        filters = np.zeros(((p + 1) * q, m))
        filters[m:] = coefficients[:split]
        filters = np.ascontiguousarray(filters.reshape(p + 1, q, m).transpose(1, 2, 0))
        left = []
        for segment in self.segments:
            error = segment.channels[:m, p:] - coefficients[split:].T @ segment.basis
            for channel, taps in zip(segment.channels, filters, strict=True):
                for row, tap in zip(error, taps, strict=True):
                    row -= np.convolve(channel, tap, "valid")
            left.append(error)
        return left

    def transposed(self, errors: list[FloatArray]) -> FloatArray:
        """Product of the transposed regression matrix with errors by segment; shape (n, j)."""
        split = self.channels * (self.order + 1)
        product = np.empty((split + self.basis_size, len(errors[0])))
        product[:split] = self._correlate(errors)
        product[split:] = sum(s.basis @ e.T for s, e in zip(self.segments, errors, strict=True))
        return product[self.outputs :]

    def matrix(self) -> tuple[FloatArray, FloatArray]:
        """Explicit regression matrix (rows, n) and targets (rows, m), for small problems."""
        p, m = self.order, self.outputs
        blocks, targets = [], []
        for segment in self.segments:
            windows = np.lib.stride_tricks.sliding_window_view(segment.channels, p + 1, axis=1)
            lagged = windows[:, :, ::-1].transpose(1, 2, 0).reshape(windows.shape[1], -1)
            blocks.append(np.hstack([lagged[:, m:], segment.basis.T]))
            targets.append(lagged[:, :m])
        return np.vstack(blocks), np.vstack(targets)

    def _correlate(self, errors: list[FloatArray]) -> FloatArray:
        """sum_k z_c(k-i) e_j(k) for all lags and channels; shape ((p + 1) q, j)."""
        out = np.zeros((self.order + 1, self.channels, len(errors[0])))
        for segment, error in zip(self.segments, errors, strict=True):
            for c, channel in enumerate(segment.channels):
                for j, row in enumerate(error):
                    out[:, c, j] += np.correlate(channel, row, "valid")[::-1]
        return out.reshape(-1, out.shape[2])


def segment_bounds(z: FloatArray) -> list[tuple[int, int]]:
    """Start and stop index of each segment: consecutive rows of finite values."""
    good = np.isfinite(z).all(axis=1)
    edges = np.flatnonzero(np.diff(np.concatenate([[0], good.view(np.int8), [0]])))
    return [(int(a), int(b)) for a, b in edges.reshape(-1, 2)]


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
