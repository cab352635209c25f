"""Modal parameters of an identified model: frequency, damping ratio, shape, and their accuracy.

The least-squares estimate of the ARX coefficients has covariance Sigma (x) (Phi^T Phi)^-1. To first
order the change of an ERA pole with the Markov parameters is ::

    d lambda = psi^H S^-1/2 U^T (dH1 - lambda dH0) V S^-1/2 phi / (psi^H phi)

and that of the parameters with the coefficients follows from the recursion of `markov`, whose
adjoint gives the gradient in one backward pass (delta method; Pintelon, Guillaume and Schoukens
2007 for the subspace case). The covariance is valid for white prediction errors, which a high order
gives and `validate` checks.
"""

from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from utank_hil.base.arrays import ComplexArray, FloatArray
from utank_hil.identification.era import Realization, realize
from utank_hil.identification.okid import OkidResult, markov_gradient
from utank_hil.identification.record import IdentificationError

if TYPE_CHECKING:
    from control import StateSpace

_NULL = 1e-12  # Smallest eigenvalue of the Gram matrix, relative to the largest.


@dataclass(frozen=True, slots=True, eq=False)
class ModalParameters:
    """Modes in order of frequency, one of each conjugate pair."""

    poles: ComplexArray  #: shape (k,): poles of the discrete model, imaginary part zero or more.
    #: shape (k,): undamped natural frequency; infinite for a pole at 0.
    frequency_rad_s: FloatArray
    #: shape (k,): damping ratio: 1 for a real pole, negative when unstable.
    damping_ratio: FloatArray
    #: shape (k, m): mode shapes: complex amplitudes of the outputs, the largest 1; zero if
    #: unobservable.
    shapes: ComplexArray


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
    return _eigen(np.asarray(system.A), np.asarray(system.C), float(system.dt)).modes


def modal_confidence(result: OkidResult, order: int) -> ModalConfidence:
    """Return modal parameters of an identification's ERA model, with standard deviations.

    The modes are those of ``modal_parameters(era(result.markov, order, sample_time_s))``.

    The errors are those of `era`; IdentificationError is also raised if poles coincide or lie at 0
    or 1, where the gradient is not defined.
    """
    found = realize(result.markov, order)
    sample_time_s = result.arx.sample_time_s
    model, vectors, kept = _eigen(found.a, found.c, sample_time_s)
    left_vectors: ComplexArray | None
    try:
        left_vectors = np.linalg.inv(vectors).T[:, kept].astype(np.complex128)
    except np.linalg.LinAlgError:
        left_vectors = None
    if left_vectors is None or (model.poles == 0).any() or (model.poles == 1).any():
        raise IdentificationError(
            f"the model of order {order} has poles that coincide or lie at 0 or 1; their "
            "confidence is not defined, choose another order"
        )
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


class _Eigen(NamedTuple):
    """Modes, all right eigenvectors, and the indices of the modes' eigenvectors."""

    modes: ModalParameters
    vectors: ComplexArray
    kept: np.ndarray


def _eigen(a: FloatArray, c: FloatArray, sample_time_s: float) -> _Eigen:
    values, vectors = np.linalg.eig(a)
    with np.errstate(divide="ignore", invalid="ignore"):  # The logarithm of 0 is allowed.
        s = np.log(values.astype(np.complex128)) / sample_time_s
    kept = np.flatnonzero(values.imag >= 0)
    kept = kept[np.argsort(np.abs(s[kept]))]
    s = s[kept]
    oscillating = (np.abs(s) > 0) & np.isfinite(s)
    damping = np.ones(len(s))
    damping[oscillating] = -s[oscillating].real / np.abs(s[oscillating])
    shapes = (c @ vectors[:, kept]).T.astype(np.complex128)
    peak = np.take_along_axis(shapes, np.argmax(np.abs(shapes), axis=1)[:, None], axis=1)
    model = ModalParameters(
        values[kept].astype(np.complex128),
        np.abs(s),
        damping,
        shapes / np.where(peak == 0, 1.0, peak),
    )
    return _Eigen(model, vectors, kept)


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
