"""Eigensystem realization (ERA) of a state-space model from Markov parameters, and its modes.

::

    H0 = [Y_1 Y_2 ...; Y_2 Y_3 ...; ...] = U S V^T,   H1 = the same, one sample on
    A = S^-1/2 U^T H1 V S^-1/2,   B = S^1/2 V^T E_r,   C = E_m^T U S^1/2,   D = Y_0

Juang and Pappa (1985). The Hankel matrix has half of the Markov parameters down and half across. It
must span a roll period or more: with 6 s for a period of 12.5 s the errors are 10-50 %. Channels
are scaled to equal energy, because pascals, radians and metres share the singular values.
"""

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from utank_hil.base.arrays import ComplexArray, FloatArray
from utank_hil.identification.record import IdentificationError

if TYPE_CHECKING:
    from control import StateSpace

_HIGHEST_ORDER = 20  # This limits an order chosen from the singular values. Chosen; no study.
_SMALLEST, _LARGEST = 1e-140, 1e140  # Products stay finite in this range.
_SIGNAL = 1e-3  # This is the smallest singular value of a signal, relative to the largest.


def era(markov: FloatArray, order: int | None = None, *, sample_time_s: float) -> "StateSpace":
    """Realize a discrete state-space model by ERA.

    ValueError is raised if the Markov parameters have the wrong shape or the order does not fit
    them. IdentificationError is raised if the Markov parameters are zero, or too large or small for
    the computation.

    Parameters
    ----------
    markov : array_like, shape (K, m, r)
        Markov parameters; ``markov[0]`` is D.
    order : int or None
        Number of states; None: `order_from_singular_values`.
    """
    from control import ss  # This import would bring plotting into the process.

    markov = _checked(markov)
    scaled, row_scale, column_scale = _scaled(markov)
    m, r = markov.shape[1:]
    half = len(markov) // 2
    across = len(markov) - 1 - half
    u, s, vt = np.linalg.svd(_hankel(scaled, 1, half, across), full_matrices=False)
    n = _checked_order(order, s)
    root = np.sqrt(s[:n])
    a = (u[:, :n] / root).T @ _hankel(scaled, 2, half, across) @ (vt[:n].T / root)
    b = (vt[:n, :r].T * root).T * column_scale
    c = u[:m, :n] * root * row_scale[:, None]
    return ss(a, b, c, markov[0], sample_time_s)


def order_from_singular_values(values: FloatArray) -> int:
    """Return the order before the largest relative drop of the singular values, largest first.

    Values below 1e-3 of the first, or beyond the 20th, are ignored.
    """
    held = values[: _HIGHEST_ORDER + 1]
    signal = int(np.count_nonzero(held > _SIGNAL * held[0]))
    floor = np.finfo(np.float64).eps * held[0]
    drops = held[:-1] / np.maximum(held[1:], floor)
    return int(np.argmax(drops[:signal])) + 1 if len(drops) else 1


def _hankel(markov: FloatArray, first: int, rows: int, columns: int) -> FloatArray:
    """Return the block Hankel matrix from ``markov[first]`` on, shape (rows m, columns r)."""
    _, m, r = markov.shape
    index = first + np.arange(rows)[:, None] + np.arange(columns)
    matrix: FloatArray = markov[index].transpose(0, 2, 1, 3).reshape(rows * m, columns * r)
    return matrix


def _scaled(markov: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return Markov parameters with D = 0 and channels of equal energy, and the two scales."""
    scaled = markov.copy()
    scaled[0] = 0.0
    rows = _energy(scaled, (0, 2))
    scaled /= rows[:, None]
    columns = _energy(scaled, (0, 1))
    return scaled / columns, rows, columns


def _energy(markov: FloatArray, axes: tuple[int, int]) -> FloatArray:
    """Return the root sum of squares over `axes`; 1 for a zero channel."""
    largest = np.abs(markov).max(axis=axes)  # Scaling before squaring prevents underflow.
    largest = np.where(largest > 0, largest, 1.0)
    relative = markov / np.expand_dims(largest, axes)
    energy: FloatArray = largest * np.sqrt(np.sum(relative**2, axis=axes))
    return np.where(energy > 0, energy, 1.0)


def _checked(markov: FloatArray) -> FloatArray:
    markov = np.asarray(markov, dtype=np.float64)
    if markov.ndim != 3 or len(markov) < 3:
        raise ValueError(
            f"markov must have shape (K, m, r) with K of 3 or more, got {markov.shape}"
        )
    if not np.isfinite(markov).all():
        raise ValueError("Markov parameters must be finite")
    if not markov[1:].any():
        raise IdentificationError("the Markov parameters are zero: the input moves no output")
    size = np.abs(markov)
    if size.max() > _LARGEST or size[1:].max() < _SMALLEST:
        raise IdentificationError(
            f"the Markov parameters reach {size.max():.1e}, responses {size[1:].max():.1e}; scale "
            "the units of inputs and outputs"
        )
    return markov


def _checked_order(order: int | None, values: FloatArray) -> int:
    if values[0] < _SMALLEST:  # Scaled channels have values of about 1.
        raise IdentificationError("the Markov parameters hold no response that can be realized")
    if order is None:
        return order_from_singular_values(values)
    rank = int(np.count_nonzero(values > len(values) * np.finfo(np.float64).eps * values[0]))
    if not 1 <= order <= rank:
        raise ValueError(
            f"order must be from 1 to {rank}, the rank of these Markov parameters, got {order}"
        )
    return int(order)


@dataclass(frozen=True, slots=True, eq=False)
class ModalParameters:
    """Modes in order of frequency, one of each conjugate pair."""

    poles: ComplexArray  #: shape (k,): poles of the discrete model, imaginary part zero or more.
    #: shape (k,): undamped natural frequency; infinite for a pole at 0.
    frequency_rad_s: FloatArray
    #: shape (k,): damping ratio: 1 for a real pole, negative when unstable.
    damping_ratio: FloatArray


def modal_parameters(system: "StateSpace") -> ModalParameters:
    """Return the modal parameters of a discrete python-control model; ValueError for others."""
    if not system.dt or system.dt is True:
        raise ValueError(f"modes need a discrete model with a sample time, its dt is {system.dt}")
    poles = np.linalg.eigvals(np.asarray(system.A)).astype(np.complex128)
    poles = poles[poles.imag >= 0]
    with np.errstate(divide="ignore", invalid="ignore"):  # The logarithm of 0 is allowed.
        s = np.log(poles) / float(system.dt)
    order = np.argsort(np.abs(s))
    poles, s = poles[order], s[order]
    oscillating = (np.abs(s) > 0) & np.isfinite(s)
    damping = np.ones(len(s))
    damping[oscillating] = -s[oscillating].real / np.abs(s[oscillating])
    return ModalParameters(poles, np.abs(s), damping)
