"""Eigensystem realization (ERA) of a state-space model from Markov parameters, and its modes.

::

    H0 = [Y_1 Y_2 ...; Y_2 Y_3 ...; ...] = U S V^T,   H1 = the same, one sample on
    A = S^-1/2 U^T H1 V S^-1/2,   B = S^1/2 V^T E_r,   C = E_m^T U S^1/2,   D = Y_0

Juang and Pappa (1985). The Hankel matrix has half of the Markov parameters down and half across. It
must span a roll period or more: with 6 s for a period of 12.5 s the errors are 10-50 %. Channels
are scaled to equal energy, because pascals, radians and metres share the singular values.
"""

from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

import numpy as np

from utank_hil.base.arrays import ComplexArray, FloatArray
from utank_hil.control.arx import ARX
from utank_hil.identification.record import IdentificationError

if TYPE_CHECKING:
    from control import StateSpace

_HIGHEST_ORDER = 20  # This limits an order chosen from the singular values. Chosen; no study.
_SMALLEST, _LARGEST = 1e-140, 1e140  # Products stay finite in this range.
_SIGNAL = 1e-3  # This is the smallest singular value of a signal, relative to the largest.


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


MARKOV: Final = 401  #: At 0.2 s a Hankel matrix over 40 s, longer than any roll period.


def realized(arx: ARX, order: int | None = None) -> "StateSpace":
    """Realize an identified model by its Markov parameters."""
    markov, _ = markov_parameters(arx, max(MARKOV, 2 * arx.order + 1))
    return era(markov, order, sample_time_s=arx.sample_time_s)
