"""Last step of an identification: maximum-likelihood refinement of the model of low order.

OKID identifies a model of high order, which includes the spectrum of the prediction errors, mainly
the sea's. ERA reduces that model without regard to the accuracy of its parts. Here the reduced
model is the start of a search for the smallest whitened output error::

    e(k) = A(q) (y(k) - yhat(k)) - c psi(k),    A(q) = I - alpha_1 q^-1 - ... - alpha_p q^-p

with A(q) and the errors' covariance from OKID: maximum likelihood for a noise model of high order
(Box-Jenkins structure; Ljung, System Identification, 7.4). OKID estimates A(q) before the ship is
known. So the errors of the model of smallest unweighted output error are tested for a low-order
A(q) (`noise_model`). Sensor noise has one, alone or with regular waves, and the search continues
with it.

The model is in modal form, yhat = D u + sum over poles of c_l b_l u / (q - lambda_l), with exact
derivatives. Free oscillations at the start of each segment and the disturbance basis enter linearly
and are projected out (variable projection, Golub and Pereyra 1973). The search takes damped
Gauss-Newton steps that reduce the error.
"""

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from utank_hil.base.arrays import ComplexArray, FloatArray
from utank_hil.identification.lag_regression import LagRegression, segment_bounds
from utank_hil.identification.modal import (
    ModalConfidence,
    ModalParameters,
    frequency_and_damping_std,
)
from utank_hil.identification.noise_model import NoiseModel, low_order_noise_model
from utank_hil.identification.okid import OkidResult
from utank_hil.identification.record import channel_scale, stacked_record

if TYPE_CHECKING:
    from control import StateSpace

_STEPS = 15
_DAMPINGS = (1e-8, 1e-6, 1e-4, 1e-2, 1.0)  # tried in turn until a step reduces the error
_CONVERGED = 1e-7  # relative reduction by the last step
_ROUNDING = 1e-15  # relative to an output's root mean square
_DEPENDENT = 1e-10  # smallest singular value of the linear part's normalized columns
_NULL = 1e-8  # relative singular value of the Jacobian; c_l and b_l share a free scale factor


@dataclass(frozen=True, slots=True, eq=False)
class Refinement:
    """A refined model with the confidence of its modes.

    Parameters
    ----------
    gain : float
        Relative reduction of the whitened squared error; 0 if there is none.
    noise_order : int
        Order of the noise model: 0 for white errors, OKID's order if no low order explains them,
        as in an irregular sea.
    """

    system: "StateSpace"
    confidence: ModalConfidence
    gain: float
    noise_order: int


def refine(system: "StateSpace", result: OkidResult, u: FloatArray, y: FloatArray) -> Refinement:
    """Refine a realized model on the record it was identified from.

    Parameters
    ----------
    system : control.StateSpace
        Model of `era` from ``result.markov``; its poles must be distinct.
    result : OkidResult
        Noise model and disturbance basis.
    u : array_like, shape (N, r) or (N,)
    y : array_like, shape (N, m) or (N,)

    Raises
    ------
    ValueError
        If model, result and record do not belong together.
    IdentificationError
        If the record has no segment longer than the order.
    """
    z, m = stacked_record(u, y)
    if np.shape(system.D) != (m, z.shape[1] - m) or result.arx.outputs != m:
        raise ValueError(
            f"a model of shape {np.shape(system.D)} and a result of {result.arx.outputs} outputs "
            f"do not belong to a record of {m} outputs and {z.shape[1] - m} inputs"
        )
    scale = channel_scale(z, m)
    y_scale, u_scale = scale[:m], scale[m:]
    functions = result.basis.evaluate(len(z), result.arx.sample_time_s)

    def whitened(noise: NoiseModel) -> _Problem:
        return _Problem(z / scale, m, functions, noise)

    given = _modal(system, y_scale, u_scale)
    largest = max(np.abs(given.poles).max(), np.exp(3.0 / len(z)))
    noise = _noise_of(result, y_scale)
    problem = whitened(noise)
    model = _fitted(problem, given, largest)
    # the model of smallest output error has no bias, whatever the errors' spectrum; OKID's filter
    # would suppress free oscillations and leave them in the errors
    plain = whitened(NoiseModel(np.zeros((0, m, m)), np.eye(m)))
    unbiased = _fitted(plain, model, largest)
    short = low_order_noise_model(plain.errors(unbiased), result.arx.order)
    if short is not None:
        noise, problem = short, whitened(short)
        # start from the best, so that the result is no worse than any of them
        best = min(given, model, unbiased, key=problem.squares)
        model = _fitted(problem, best, largest)
    before = problem.squares(given)
    return Refinement(
        model.state_space(y_scale, u_scale, result.arx.sample_time_s),
        _confidence(model, problem, y_scale, result.arx.sample_time_s),
        1 - problem.squares(model) / before if before > 0 else 0.0,
        noise.order,
    )


def _fitted(problem: "_Problem", model: "_Modal", largest: float) -> "_Modal":
    """Minimize the squared errors, with poles up to the largest magnitude."""
    squares = problem.squares(model)
    for _ in range(_STEPS):
        errors, derivatives = problem.linearized(model)
        size = np.linalg.norm(derivatives, axis=0)
        left, values, right = np.linalg.svd(derivatives / size, full_matrices=False)
        kept = values > _NULL * values[0]
        along = left[:, kept].T @ errors
        before = squares
        for damping in _DAMPINGS:
            factor = values[kept] / (values[kept] ** 2 + damping * values[0] ** 2)
            trial = model.moved(right[kept].T @ (factor * along) / size)
            if np.abs(trial.poles).max() <= largest:
                reached = problem.squares(trial)
                if reached < squares:
                    model, squares = trial, reached
                    break
        if before - squares <= _CONVERGED * before:
            break
    return model


def _noise_of(result: OkidResult, y_scale: FloatArray) -> NoiseModel:
    """OKID's noise model, for outputs scaled to unit RMS."""
    covariance = result.residual_covariance / np.outer(y_scale, y_scale)
    # regularized: data without noise may have zero errors, or equal ones in two outputs
    covariance = covariance + (1e-12 * np.trace(covariance) + _ROUNDING**2) * np.eye(len(y_scale))
    return NoiseModel(result.arx.alpha * y_scale / y_scale[:, None], covariance)


@dataclass(frozen=True, slots=True, eq=False)
class _Modal:
    """One of each conjugate pair of poles, with its output and input vectors; and D."""

    poles: ComplexArray  # (k,)
    c: ComplexArray  # (k, m)
    b: ComplexArray  # (k, r)
    d: FloatArray  # (m, r)

    @property
    def real(self) -> np.ndarray:
        flags: np.ndarray = self.poles.imag == 0
        return flags

    def signals(self, u: FloatArray) -> tuple[FloatArray, list[FloatArray], list[FloatArray]]:
        """Response (m, N) to inputs (r, N), its derivatives, and the free oscillations."""
        response = self.d @ u
        derivatives: list[FloatArray] = []
        free: list[FloatArray] = []
        outputs = len(self.d)
        decay = np.arange(u.shape[1])
        for pole, c, b, real in zip(self.poles, self.c, self.b, self.real, strict=True):
            inputs = _filtered(pole, u.astype(np.complex128))
            state = b @ inputs
            twice = _filtered(pole, state[None])[0]
            terms = [np.outer(c, twice)]
            terms += [np.outer(unit, state) for unit in np.eye(outputs)]
            terms += [np.outer(c, part) for part in inputs]
            response = response + _both(np.outer(c, state), real)[0]
            for term in terms:
                derivatives += _both(term, real)
            free += _both(np.outer(c, pole**decay), real)
        derivatives += [np.outer(unit, part) for unit in np.eye(outputs) for part in u]
        return response, derivatives, free

    def moved(self, step: FloatArray) -> "_Modal":
        """The model after a step of its parameters, in the order of the derivatives."""
        m, r = self.d.shape
        poles, c, b = self.poles.copy(), self.c.copy(), self.b.copy()
        start = 0
        for k, real in enumerate(self.real):
            if real:
                change = step[start : start + 1 + m + r].astype(np.complex128)
                start += 1 + m + r
            else:
                pairs = step[start : start + 2 * (1 + m + r)].reshape(-1, 2)
                change = pairs[:, 0] + 1j * pairs[:, 1]
                start += 2 * (1 + m + r)
            poles[k] += change[0]
            c[k] += change[1 : 1 + m]
            b[k] += change[1 + m :]
        return _Modal(poles, c, b, self.d + step[start:].reshape(m, r))

    def state_space(
        self, y_scale: FloatArray, u_scale: FloatArray, sample_time_s: float
    ) -> "StateSpace":
        """Real block-diagonal form in the record's units."""
        from control import ss  # here, because importing it brings plotting into the process

        blocks, rows, columns = [], [], []
        for pole, c, b, real in zip(self.poles, self.c, self.b, self.real, strict=True):
            if real:
                blocks.append(np.array([[pole.real]]))
                rows.append(b.real[None])
                columns.append(c.real[:, None])
            else:
                blocks.append(np.array([[pole.real, -pole.imag], [pole.imag, pole.real]]))
                rows.append(np.array([b.real, b.imag]))
                columns.append(2 * np.column_stack([c.real, -c.imag]))
        a = np.zeros((sum(map(len, blocks)),) * 2)
        start = 0
        for block in blocks:
            a[start : start + len(block), start : start + len(block)] = block
            start += len(block)
        b_all, c_all = np.vstack(rows) / u_scale, np.hstack(columns) * y_scale[:, None]
        return ss(a, b_all, c_all, self.d * y_scale[:, None] / u_scale, sample_time_s)


class _Problem:
    """Whitened errors of a model on a record, with the linear part projected out."""

    def __init__(self, z: FloatArray, m: int, functions: FloatArray, noise: NoiseModel) -> None:
        self._m = m
        self._order = noise.order
        self._samples = len(z)
        self._segment_bounds = [(a, b) for a, b in segment_bounds(z) if b - a > noise.order]
        self._segments = LagRegression(z, m, noise.order, functions).segments
        self._taps = noise.whitening()

    def squares(self, model: _Modal) -> float:
        """Sum of squared errors."""
        errors, _ = self._projected(model, linearize=False)
        return float(errors @ errors)

    def errors(self, model: _Modal) -> FloatArray:
        """Errors by sample, shape (N, m), NaN in gaps."""
        found, _ = self._projected(model, linearize=False)
        placed = np.full((self._samples, self._m), np.nan)
        start = 0
        for a, b in self._segment_bounds:
            stop = start + self._m * (b - a - self._order)
            placed[a + self._order : b] = found[start:stop].reshape(self._m, -1).T
            start = stop
        return placed

    def linearized(self, model: _Modal) -> tuple[FloatArray, FloatArray]:
        """Errors (rows,) and Jacobian of the model's output (rows, parameters), both projected."""
        return self._projected(model, linearize=True)

    def _projected(self, model: _Modal, linearize: bool) -> tuple[FloatArray, FloatArray]:
        columns, linear = [], []
        for i, segment in enumerate(self._segments):
            response, derivatives, free = model.signals(segment.channels[self._m :])
            signals = [segment.channels[: self._m] - response, *(derivatives if linearize else [])]
            white = self._filtered(np.array(signals + free))
            columns.append(white[:, : len(signals)])
            waves = np.einsum("ao,fk->akof", self._taps[0], segment.basis)
            waves = waves.reshape(len(white), -1)
            # free oscillations differ between segments; the disturbance is common
            own = np.zeros((len(white), len(free) * len(self._segments)))
            own[:, i * len(free) : (i + 1) * len(free)] = white[:, len(signals) :]
            linear.append(np.hstack([own, waves]))
        basis = np.vstack(linear)
        size = np.maximum(np.linalg.norm(basis, axis=0), 1e-300)
        basis, values, _ = np.linalg.svd(basis / size, full_matrices=False)
        basis = basis[:, values > _DEPENDENT]  # dependent in short segments
        stacked = np.vstack(columns)
        stacked = stacked - basis @ (basis.T @ stacked)
        return stacked[:, 0], stacked[:, 1:]

    def _filtered(self, signals: FloatArray) -> FloatArray:
        """Signals (s, m, N) through the whitening filter; shape (m (N - p), s)."""
        order, samples = len(self._taps) - 1, signals.shape[2]
        size = 1 << (samples + order).bit_length()
        spectrum = np.fft.rfft(self._taps, size, axis=0)
        spectra = np.fft.rfft(signals, size, axis=2)
        white = np.fft.irfft(np.einsum("fac,scf->saf", spectrum, spectra), size, axis=2)
        return white[:, :, order:samples].reshape(len(signals), -1).T


def _filtered(pole: complex, signals: ComplexArray) -> ComplexArray:
    """Signals through 1 / (q - pole), along the last axis."""
    from scipy.signal import lfilter  # here: slow to import

    filtered: ComplexArray = lfilter([0.0, 1.0], [1.0, -pole], signals, axis=-1)
    return filtered


def _both(signal: ComplexArray, real: bool) -> list[FloatArray]:
    """Sum of a term and its conjugate, and its derivative by the imaginary part."""
    return [signal.real] if real else [2 * signal.real, -2 * signal.imag]


def _modal(system: "StateSpace", y_scale: FloatArray, u_scale: FloatArray) -> _Modal:
    a, b, c, d = (np.asarray(part) for part in (system.A, system.B, system.C, system.D))
    values, vectors = np.linalg.eig(a)
    values, vectors = values.astype(np.complex128), vectors.astype(np.complex128)
    kept = values.imag >= 0
    outputs = (c @ vectors / y_scale[:, None]).T[kept]
    inputs = (np.linalg.inv(vectors) @ b * u_scale)[kept]
    size = np.linalg.norm(outputs, axis=1)[:, None]
    return _Modal(values[kept], outputs / size, inputs * size, d / y_scale[:, None] * u_scale)


def _confidence(
    model: _Modal, problem: _Problem, y_scale: FloatArray, sample_time_s: float
) -> ModalConfidence:
    """Modal parameters with standard deviations: the Cramer-Rao bound at the estimate."""
    errors, derivatives = problem.linearized(model)
    size = np.linalg.norm(derivatives, axis=0)
    _, values, right = np.linalg.svd(derivatives / size, full_matrices=False)
    kept = values > _NULL * values[0]
    root = right[kept].T / values[kept] / size[:, None]
    root *= np.sqrt(errors @ errors / (len(errors) - np.count_nonzero(kept)))
    width = 1 + model.c.shape[1] + model.b.shape[1]
    starts = np.concatenate([[0], np.cumsum(np.where(model.real, width, 2 * width))[:-1]])
    s = np.log(model.poles) / sample_time_s
    order = np.argsort(np.abs(s))
    frequency_std, damping_std = np.zeros(len(s)), np.zeros(len(s))
    for position, k in enumerate(order):
        per_pole = 1 / (model.poles[k] * sample_time_s)
        terms = np.array([per_pole]) if model.real[k] else np.array([per_pole, 1j * per_pole])
        spread = terms @ root[starts[k] : starts[k] + len(terms)]
        block = np.array([spread.real, spread.imag])
        frequency_std[position], damping_std[position] = frequency_and_damping_std(
            s[k], block @ block.T
        )
    shapes = model.c[order] * y_scale
    peak = np.take_along_axis(shapes, np.argmax(np.abs(shapes), axis=1)[:, None], axis=1)
    modes = ModalParameters(
        model.poles[order], np.abs(s[order]), -s[order].real / np.abs(s[order]), shapes / peak
    )
    return ModalConfidence(modes, frequency_std, damping_std)
