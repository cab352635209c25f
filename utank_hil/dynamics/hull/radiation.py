"""Radiation of a hull in the time domain: oscillators fitted to added mass and damping."""

from dataclasses import dataclass

import numpy as np

from utank_hil.base.arrays import ComplexArray, FloatArray

OSCILLATORS = 3  #: Number for each motion; surge, heave and pitch need one more for 1 %.
_STARTS = ((0.5, 0.0), (0.5, 0.01), (0.25, 0.01), (1.0, 0.01))
"""Damping ratio of the oscillators before a fit, for radiation of hulls is a broad hump, and share
of the greatest damping from which on their frequencies lie. From each, another rounding may end in
another valley."""
GOOD_FIT = 0.01  #: Error of a fit above which users are warned.
_BEST_FIT = GOOD_FIT / 2
"""Error after which no other start is tried; a single motion may be missed by twice it."""
_FEW_STEPS, _MOST_STEPS = 200, 600
"""The fit creeps along a valley: it has not ended by then, and leaves 0.2 % or less."""


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
    oscillators: int = OSCILLATORS,
) -> Radiation:
    """Fit oscillators to added mass and damping, by least squares.

    The force of radiation is ``-A(inf) v' - K(t) * v`` with (Ogilvie 1964) ::

        K(i w) = B(w) + i w (A(w) - A(inf))

    K is fitted by oscillators e that the motions drive along b, and that lose energy together by
    L::

        e'' + L L' e' + w0^2 e = b v,    force b' e',    K(s) = s b' (s^2 + L L' s + w0^2)^-1 b

    Whatever the numbers, that is zero at zero and infinite frequency and positive real: radiation
    takes energy and never gives more than it took.

    Added mass and damping, shape (k, m, m), are symmetric. Without the limit of the added mass,
    shape (m, m), the one that fits best is taken. `oscillators` is the number for each motion.
    """
    data = omega_rad_s, added_mass, damping, infinite_added_mass, oscillators
    best = _fitted(*data, *_STARTS[0])
    for start in _STARTS[1:]:
        if best.error <= _BEST_FIT:
            break
        best = min(best, _fitted(*data, *start), key=lambda each: each.error)
    return best


def _fitted(
    omega_rad_s: FloatArray,
    added_mass: FloatArray,
    damping: FloatArray,
    infinite_added_mass: FloatArray | None,
    oscillators: int,
    ratio: float,
    share: float,
) -> Radiation:
    """Fit from one of the starts."""
    from scipy.optimize import least_squares

    size = added_mass.shape[1]
    count = size * oscillators
    # Each motion in a unit in which its largest damping is 1.
    unit = np.sqrt(np.max(np.einsum("kaa->ka", damping), axis=0))
    unit[unit == 0] = 1.0  # strip theory has no radiation of surge
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

    radiates = np.einsum("kaa->ka", damped).max(axis=1) >= share
    first = _start(omega_rad_s[radiates], size, oscillators, ratio)
    if infinite_added_mass is None:  # which the data hardly show: stay near the last frequency's
        first = np.concatenate([first, limit[upper]])
        found = least_squares(left, first, jac=slopes, max_nfev=_FEW_STEPS)
    else:
        found = least_squares(left, first, jac=slopes, method="lm", max_nfev=_MOST_STEPS)
    direction, frequency, loss, free = parts(found.x)
    error = float(np.linalg.norm(found.fun) / np.linalg.norm(flat(wanted(free)[:, None])))
    return Radiation(free * scale, direction * unit, frequency, loss, error)


def _start(omega_rad_s: FloatArray, size: int, oscillators: int, ratio: float) -> FloatArray:
    """Oscillators of each motion alone, apart by equal ratios: directions, losses, log w0."""
    low, high = np.log(omega_rad_s[0]), np.log(omega_rad_s[-1])
    centres = low + (high - low) * (np.arange(oscillators) + 1) / (oscillators + 1)
    centres = np.tile(centres, size)
    own = np.repeat(np.eye(size), oscillators, axis=0)
    losses = own * np.sqrt(2 * ratio * np.exp(centres))[:, None]
    return np.concatenate([own.ravel(), losses.ravel(), centres])


def _answer(
    omega: FloatArray, frequency: FloatArray, loss: FloatArray, direction: FloatArray
) -> ComplexArray:
    """Return the oscillators' positions per motion, shape (k, n, m)."""
    s = 1j * omega[:, None, None]
    matrix = s**2 * np.eye(len(frequency)) + s * (loss @ loss.T) + np.diag(frequency**2)
    return np.asarray(
        np.linalg.solve(matrix, np.broadcast_to(direction, (len(s), *direction.shape)))
    )
