"""Memory of the waves that a hull radiates, as damped oscillators in the time domain.

The force of radiation is ``-A(inf) v' - K(t) * v`` with (Ogilvie 1964) ::

    K(i w) = B(w) + i w (A(w) - A(inf))

K is fitted by oscillators e that the motions drive along b, and that lose energy together by L::

    e'' + L L' e' + w0^2 e = b v,    force b' e',    K(s) = s b' (s^2 + L L' s + w0^2)^-1 b

Whatever the numbers, that is zero at zero and infinite frequency and positive real: radiation takes
energy and never gives more than it took.
"""

from dataclasses import dataclass

import numpy as np

from utank_hil.base.arrays import ComplexArray, FloatArray

_OSCILLATORS = 3  # Number for each motion.
_START_RATIO = 0.5
"""Damping ratio of the oscillators before the fit; radiation of hulls is a broad hump."""
_MOST_STEPS = 200


@dataclass(frozen=True, slots=True, eq=False)
class Radiation:
    """Oscillators of a fitted radiation force on m motions."""

    infinite_added_mass: FloatArray  #: shape (m, m)
    direction: FloatArray  #: shape (n, m): b.
    frequency_rad_s: FloatArray  #: shape (n,): w0.
    loss: FloatArray  #: shape (n, m): L.
    #: Root mean square of what the fit leaves of K, per root mean square of K, each entry per root
    #: of the diagonal's greatest damping.
    error: float


def fit_radiation(
    omega_rad_s: FloatArray,
    added_mass: FloatArray,
    damping: FloatArray,
    infinite_added_mass: FloatArray | None = None,
) -> Radiation:
    """Fit oscillators to added mass and damping, by least squares.

    Added mass and damping, shape (k, m, m), are symmetric. Without the limit of the added mass,
    shape (m, m), the one that fits best is taken.
    """
    from scipy.optimize import least_squares

    size = added_mass.shape[1]
    count = size * _OSCILLATORS
    # Each motion in a unit in which its largest damping is 1.
    unit = np.sqrt(np.max(np.einsum("kaa->ka", damping), axis=0))
    scale = unit[:, None] * unit[None, :]
    added, damped = added_mass / scale, damping / scale
    limit = added[-1] if infinite_added_mass is None else infinite_added_mass / scale
    upper = np.triu_indices(size)
    entries = np.zeros((len(upper[0]), size, size))
    entries[np.arange(len(upper[0])), upper[0], upper[1]] = 1.0
    s = 1j * omega_rad_s[:, None, None]

    def parts(x: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
        direction, loss = x[: 2 * count * size].reshape(2, count, size)
        free = limit
        if infinite_added_mass is None:
            free = np.tensordot(x[-len(entries) :], entries, 1)
            free = np.triu(free) + np.triu(free, 1).T
        return direction, np.exp(x[2 * count * size :][:count]), loss, free

    def wanted(free: FloatArray) -> ComplexArray:
        return np.asarray(damped + s * (added - free), dtype=np.complex128)

    def flat(values: ComplexArray) -> FloatArray:
        rows = values[..., upper[0], upper[1]]
        rows = np.moveaxis(rows, 0, -1).reshape(rows[0].size // len(upper[0]), -1)
        return np.asarray(np.concatenate([rows.real, rows.imag], axis=-1))

    def left(x: FloatArray) -> FloatArray:
        direction, frequency, loss, free = parts(x)
        found = s * (direction.T @ _answer(omega_rad_s, frequency, loss, direction))
        return np.asarray(flat((found - wanted(free))[:, None])[0])

    def slopes(x: FloatArray) -> FloatArray:
        direction, frequency, loss, _ = parts(x)
        answer = _answer(omega_rad_s, frequency, loss, direction)
        lost = loss.T @ answer
        by_direction = s[..., None, None] * np.einsum("kjb,ac->kjcab", answer, np.eye(size))
        by_loss = -(s**2)[..., None, None] * np.einsum("kja,kcb->kjcab", answer, lost)
        both = np.concatenate([by_direction, by_loss], axis=1)
        both = (both + np.swapaxes(both, -1, -2)).reshape(len(s), -1, size, size)
        square = np.einsum("kja,kjb->kjab", answer, answer)
        shapes = [both, -2 * s[..., None] * (frequency**2)[:, None, None] * square]
        if infinite_added_mass is None:
            shapes.append(s[..., None] * (entries + np.swapaxes(np.triu(entries, 1), -1, -2)))
        return flat(np.concatenate(shapes, axis=1)).T

    low, high = np.log(omega_rad_s[0]), np.log(omega_rad_s[-1])
    centres = low + (high - low) * (np.arange(_OSCILLATORS) + 1) / (_OSCILLATORS + 1)
    centres = np.tile(centres, size)
    own = np.repeat(np.eye(size), _OSCILLATORS, axis=0)
    start = [own, own * np.sqrt(2 * _START_RATIO * np.exp(centres))[:, None], centres]
    if infinite_added_mass is None:
        start.append(limit[upper])
    first = np.concatenate([each.ravel() for each in start])
    found = least_squares(left, first, jac=slopes, max_nfev=_MOST_STEPS)
    direction, frequency, loss, free = parts(found.x)
    error = float(np.linalg.norm(found.fun) / np.linalg.norm(flat(wanted(free)[:, None])))
    return Radiation(free * scale, direction * unit, frequency, loss, error)


def _answer(
    omega: FloatArray, frequency: FloatArray, loss: FloatArray, direction: FloatArray
) -> ComplexArray:
    """Return the oscillators' positions per motion, shape (k, n, m)."""
    s = 1j * omega[:, None, None]
    matrix = s**2 * np.eye(len(frequency)) + s * (loss @ loss.T) + np.diag(frequency**2)
    return np.asarray(
        np.linalg.solve(matrix, np.broadcast_to(direction, (len(s), *direction.shape)))
    )
