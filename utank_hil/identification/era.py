"""Eigensystem realization (ERA) of a state-space model from Markov parameters, and its modes.

::

    H0 = [Y_1 Y_2 ...; Y_2 Y_3 ...; ...] = U S V^T,   H1 = the same, one sample on
    A = S^-1/2 U^T H1 V S^-1/2,   B = S^1/2 V^T E_r,   C = E_m^T U S^1/2,   D = Y_0

Juang and Pappa (1985). The Hankel matrix has half of the Markov parameters down and half across. It
must span a roll period or more: with 6 s for a period of 12.5 s the errors are 10-50 %. Channels
are scaled to equal energy, because pascals, radians and metres share the singular values.

Modal parameters are frequency, damping ratio, shape, and their accuracy. The least-squares estimate
of the ARX coefficients has covariance Sigma (x) (Phi^T Phi)^-1. To first
order the change of an ERA pole with the Markov parameters is ::

    d lambda = psi^H S^-1/2 U^T (dH1 - lambda dH0) V S^-1/2 phi / (psi^H phi)

and that of the parameters with the coefficients follows from the recursion of `markov`, whose
adjoint gives the gradient in one backward pass (delta method; Pintelon, Guillaume and Schoukens
2007 for the subspace case). The covariance is valid for white prediction errors, which a high order
gives and `validate` checks.
"""

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from utank_hil.base.arrays import ComplexArray, FloatArray
from utank_hil.identification.okid import OkidResult, markov_gradient
from utank_hil.identification.record import IdentificationError

if TYPE_CHECKING:
    from control import StateSpace

_HIGHEST_ORDER = 20  # This limits an order chosen from the singular values. Chosen; no study.
_SMALLEST, _LARGEST = 1e-140, 1e140  # Products stay finite in this range.
_SIGNAL = 1e-3  # This is the smallest singular value of a signal, relative to the largest.


@dataclass(frozen=True, slots=True, eq=False)
class Realization:
    """A realized model with the singular vectors of the scaled Hankel matrix."""

    #: a, b, c: state matrix (n, n), input matrix (n, r), output matrix (m, n), for unscaled
    #: channels.
    a: FloatArray
    b: FloatArray
    c: FloatArray
    #: left, right: shape (a m, n): singular vectors of H0, divided by the square roots of its
    #: singular values.
    left: FloatArray
    right: FloatArray
    #: row_scale, column_scale: shape (m,): scales by which outputs and inputs were divided.
    row_scale: FloatArray
    column_scale: FloatArray


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
    found = realize(markov, order)
    return ss(found.a, found.b, found.c, markov[0], sample_time_s)


def order_from_singular_values(values: FloatArray) -> int:
    """Return the order before the largest relative drop of the singular values, largest first.

    Values below 1e-3 of the first, or beyond the 20th, are ignored.
    """
    held = values[: _HIGHEST_ORDER + 1]
    signal = int(np.count_nonzero(held > _SIGNAL * held[0]))
    floor = np.finfo(np.float64).eps * held[0]
    drops = held[:-1] / np.maximum(held[1:], floor)
    return int(np.argmax(drops[:signal])) + 1 if len(drops) else 1


def realize(markov: FloatArray, order: int | None) -> Realization:
    """Return the realization of `era`, with the data for `modal_confidence`."""
    scaled, row_scale, column_scale = _scaled(markov)
    m, r = markov.shape[1:]
    half = len(markov) // 2
    across = len(markov) - 1 - half
    u, s, vt = np.linalg.svd(_hankel(scaled, 1, half, across), full_matrices=False)
    n = _checked_order(order, s)
    root = np.sqrt(s[:n])
    left, right = u[:, :n] / root, vt[:n].T / root
    a = left.T @ _hankel(scaled, 2, half, across) @ right
    return Realization(
        a,
        (vt[:n, :r].T * root).T * column_scale,
        u[:m, :n] * root * row_scale[:, None],
        left,
        right,
        row_scale,
        column_scale,
    )


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


_NULL = 1e-12  # Smallest eigenvalue of the Gram matrix, relative to the largest.


@dataclass(frozen=True, slots=True, eq=False)
class ModalParameters:
    """Modes in order of frequency, one of each conjugate pair."""

    poles: ComplexArray  #: shape (k,): poles of the discrete model, imaginary part zero or more.
    #: shape (k,): undamped natural frequency; infinite for a pole at 0.
    frequency_rad_s: FloatArray
    #: shape (k,): damping ratio: 1 for a real pole, negative when unstable.
    damping_ratio: FloatArray


@dataclass(frozen=True, slots=True, eq=False)
class ModalConfidence:
    """Modal parameters with standard deviations, shape (k,), of frequency and damping ratio."""

    modes: ModalParameters
    frequency_std_rad_s: FloatArray
    damping_ratio_std: FloatArray

    def intervals(self) -> tuple[FloatArray, FloatArray]:
        """Return intervals of 95 % of frequency and damping ratio, both of shape (k, 2)."""
        reach = 1.96 * np.array([-1.0, 1.0])
        return (
            self.modes.frequency_rad_s[:, None] + self.frequency_std_rad_s[:, None] * reach,
            self.modes.damping_ratio[:, None] + self.damping_ratio_std[:, None] * reach,
        )


def modal_parameters(system: "StateSpace") -> ModalParameters:
    """Return the modal parameters of a discrete python-control model; ValueError for others."""
    if not system.dt or system.dt is True:
        raise ValueError(f"modes need a discrete model with a sample time, its dt is {system.dt}")
    return _eigen(np.asarray(system.A), float(system.dt))[0]


def modal_confidence(result: OkidResult, order: int) -> ModalConfidence:
    """Return modal parameters of an identification's ERA model, with standard deviations.

    The modes are those of ``modal_parameters(era(result.markov, order, sample_time_s))``.

    The errors are those of `era`; IdentificationError is also raised if poles coincide or lie at 0
    or 1, where the gradient is not defined.
    """
    found = realize(result.markov, order)
    sample_time_s = result.arx.sample_time_s
    model, vectors, kept = _eigen(found.a, sample_time_s)
    try:
        left_vectors = np.linalg.inv(vectors).T[:, kept].astype(np.complex128)
        if np.isin(model.poles, (0, 1)).any():
            raise np.linalg.LinAlgError
    except np.linalg.LinAlgError:
        raise IdentificationError(
            f"the model of order {order} has poles that coincide or lie at 0 or 1; their "
            "confidence is not defined, choose another order"
        ) from None
    right_vectors = vectors[:, kept]
    rows = len(result.column_scale)
    m = result.arx.outputs
    directions = np.zeros((rows, m, 2 * len(model.poles)))
    for j, pole in enumerate(model.poles):
        weights = _pole_weights(found, result, pole, right_vectors[:, j], left_vectors[:, j])
        slope = markov_gradient(result.arx, result.markov, weights)
        slope = slope / result.column_scale[: len(slope), None] / (pole * sample_time_s)
        directions[: len(slope), :, 2 * j] = slope.real
        directions[: len(slope), :, 2 * j + 1] = slope.imag
    spread = np.stack([_inverse_root(result, j) @ directions[:, j] for j in range(m)], axis=1)
    covariance = np.einsum("ras,ab,rbt->st", spread, result.residual_covariance, spread)
    s = np.log(model.poles) / sample_time_s
    frequency_std, damping_std = np.zeros(len(s)), np.zeros(len(s))
    for j, pole in enumerate(s):
        block = covariance[2 * j : 2 * j + 2, 2 * j : 2 * j + 2]
        frequency_std[j], damping_std[j] = _frequency_and_damping_std(pole, block)
    return ModalConfidence(model, frequency_std, damping_std)


def _frequency_and_damping_std(s: complex, covariance: FloatArray) -> tuple[float, float]:
    """Return the standard deviations of |s| and -Re s / |s| from the covariance of (Re s, Im s)."""
    size = abs(s)
    to_frequency = np.array([s.real, s.imag]) / size
    to_damping = np.array([-1.0, 0.0]) / size + s.real / size**2 * to_frequency
    return (
        float(np.sqrt(to_frequency @ covariance @ to_frequency)),
        float(np.sqrt(to_damping @ covariance @ to_damping)),
    )


def _eigen(
    a: FloatArray, sample_time_s: float
) -> tuple[ModalParameters, ComplexArray, npt.NDArray[np.intp]]:
    """Return modes, all right eigenvectors, and the places of the modes' own among them."""
    values, vectors = np.linalg.eig(a)
    with np.errstate(divide="ignore", invalid="ignore"):  # The logarithm of 0 is allowed.
        s = np.log(values.astype(np.complex128)) / sample_time_s
    kept = np.flatnonzero(values.imag >= 0)
    kept = kept[np.argsort(np.abs(s[kept]))]
    s = s[kept]
    oscillating = (np.abs(s) > 0) & np.isfinite(s)
    damping = np.ones(len(s))
    damping[oscillating] = -s[oscillating].real / np.abs(s[oscillating])
    model = ModalParameters(values[kept].astype(np.complex128), np.abs(s), damping)
    return model, vectors, kept


def _pole_weights(
    found: Realization,
    result: OkidResult,
    pole: complex,
    right_vector: ComplexArray,
    left_vector: ComplexArray,
) -> ComplexArray:
    """Return a pole's gradient with respect to the Markov parameters, shape (K, m, r)."""
    count, m, r = result.markov.shape
    down = (found.left @ left_vector).reshape(-1, m)
    across = (found.right @ right_vector).reshape(-1, r)
    weights = np.zeros((count, m, r), dtype=np.complex128)
    for i in range(m):
        for j in range(r):
            shared = np.convolve(down[:, i], across[:, j])
            weights[2:, i, j] = shared
            weights[1:-1, i, j] -= pole * shared
    return weights / found.row_scale[:, None] / found.column_scale


def _inverse_root(result: OkidResult, output: int) -> FloatArray:
    """Return the symmetric root of one output's coefficient covariance, for unit error variance."""
    gram = result.gram.copy()
    m, r = result.arx.outputs, result.arx.inputs
    inputs = (np.arange(result.arx.order + 1)[:, None] * (m + r) + np.arange(r)).ravel()
    gram[inputs, inputs] += result.penalty[output]
    values, vectors = np.linalg.eigh(gram, UPLO="U")
    kept = values > _NULL * values[-1]
    root: FloatArray = (vectors[:, kept] / np.sqrt(values[kept])) @ vectors[:, kept].T
    return root
