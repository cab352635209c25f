"""Impulse response of a law that can only be stepped, and the linear law that has this response.

A controller at rest is stepped with an impulse in one measurement. Its commands are passed to
`applied` unchanged, without limits. Divided by the size of the impulse they are the law's Markov
parameters h(1), h(2), ... in the loop's count (`utank_hil.dynamics.sampling`)::

    v(k) = h(1) y(k-1) + h(2) y(k-2) + ...,    C(z) = sum_j h(j) z^-j

The frequency response is this sum. The state-space model, whose eigenvalues are taken, is the
balanced truncation of the sum (Kung 1978)::

    H = [h1 h2 ...; h2 h3 ...; ...] = U S V^T
    A = S^-1/2 U^T U+ S^1/2,   B = S^1/2 V^T E_m,   C = E_r^T U S^1/2,   U+ = U one sample on

The error of its response is at most 2 (s_{n+1} + s_{n+2} + ...). H has as many rows as h has
samples, and few significant singular values. They are found from products with random vectors
(Halko, Martinsson and Tropp 2011), which are convolutions.

References
----------
S. Y. Kung, A new identification and model reduction algorithm via singular value decomposition,
12th Asilomar Conference (1978). N. Halko, P. G. Martinsson, J. A. Tropp, SIAM Review 53 (2011)
217-288.
"""

import itertools
import math
import time
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from typing import Final

import numpy as np
from scipy.fft import next_fast_len

from utank_hil.base.arrays import ComplexArray, FloatArray
from utank_hil.control import Controller
from utank_hil.dynamics import STATES, LinearModel

IMPULSES: Final[Mapping[str, float]] = dict(zip(STATES, (1e-3, 1e-3, 1e-2, 1e-2), strict=True))
"""Size of the impulse in each measurement, in its unit."""
MOST_SAMPLES: Final = 200_000  #: Limit on the steps of one response. Chosen; no study.
BUDGET_S: Final = 60.0  #: Time limit for all steps together. Chosen; no study.
MOST_STATES: Final = 256  #: Limit on the order of the realized model. Chosen; no study.

_QUIET = 1e-9  # share of the peak below which a response has decayed
_LEAST_QUIET = 100  # samples that must be quiet, besides half of those before
_BEYOND = 1e100  # response per unit impulse that counts as unbounded growth
_LINEAR = 1e-6  # share of the peak by which a linear law's scaled responses may differ
_FIRST_STATES = 16  # Random vectors of the first attempt, doubled until accurate. Chosen; no study.
_TRUNCATED = 1e-7  # share of the sum of singular values that may be truncated
_ACCURACY = 1e-6  # error of the model's response over the greatest response
_BLOCK = 256  # samples of the response summed at once


class NoImpulseResponse(ValueError):
    """The impulse response of a law cannot be determined; the message gives the reason."""


@dataclass(frozen=True, slots=True, eq=False)
class ImpulseResponseLaw:
    """The linear law that has a controller's impulse response; a `LinearLaw`."""

    #: shape (N, r, m): command of the j-th step, per unit of an impulse in the first.
    impulse: FloatArray
    model: LinearModel  #: Realization of `impulse`, strictly proper.
    #: Whether impulses of half the size and of opposite sign have the same response. If not, the
    #: law is nonlinear at rest, and `impulse` is the slope for small measurements.
    linear: bool
    make_controller: Callable[[], Controller]

    @property
    def sample_time_s(self) -> float:
        """Time between two steps."""
        return self.model.dt

    def controller(self) -> Controller:
        """Return a new controller at rest: the stepped law itself."""
        return self.make_controller()

    def response(self, z: ComplexArray) -> ComplexArray:
        """Transfer matrix from y to u at N points of the unit circle; shape (N, r, m)."""
        points = np.asarray(z, dtype=np.complex128)
        samples, *shape = self.impulse.shape
        blocks = math.ceil(samples / _BLOCK)
        padded = np.zeros((blocks * _BLOCK, math.prod(shape)))
        padded[:samples] = self.impulse.reshape(samples, -1)
        powers = points[:, None] ** -np.arange(1.0, _BLOCK + 1)
        total = np.zeros((len(points), padded.shape[1]), dtype=np.complex128)
        for block in padded.reshape(blocks, _BLOCK, -1)[::-1]:  # Horner's scheme
            total = powers @ block + powers[:, -1:] * total
        return total.reshape(-1, *shape)

    def matrices(self) -> LinearModel:
        """Discrete state-space model of the law from y to u."""
        return self.model


def impulse_response_law(
    make_controller: Callable[[], Controller],
    measured: tuple[str, ...],
    sizes: Mapping[str, float] = IMPULSES,
    most_samples: int = MOST_SAMPLES,
    budget_s: float = BUDGET_S,
) -> ImpulseResponseLaw:
    """Find the linear law that a controller is about rest, by stepping it.

    `make_controller` makes a controller at rest that measures `measured`, in this order; `sizes`
    are those of the impulse in each measurement. A response must decay within `most_samples` steps;
    `budget_s` limits the time of all steps. Raises `NoImpulseResponse` if a response has not
    decayed to 1e-9 of its peak in `most_samples` (the law integrates, is unstable, or adapts), a
    step raises, its command is not an array of finite numbers, the steps take too long, or no model
    of `MOST_STATES` states has the response.
    """
    until_s = time.monotonic() + budget_s
    columns, linear = [], True
    for index, name in enumerate(measured):
        answers = (
            _answers(make_controller(), measured, index, factor * sizes[name], until_s)
            for factor in (0.5, -0.5, 1.0)
        )
        column, proportional = _slope(zip(*answers, strict=True), name, sizes[name], most_samples)
        columns.append(column)
        linear = linear and proportional
    impulse = np.zeros((max(map(len, columns)), columns[0].shape[1], len(measured)))
    for index, column in enumerate(columns):
        impulse[: len(column), :, index] = column
    model = realize(impulse, make_controller().sample_time_s)
    return ImpulseResponseLaw(impulse, model, linear, make_controller)


def realize(impulse: FloatArray, sample_time_s: float) -> LinearModel:
    """Strictly proper state-space model of a decayed impulse response C B, C A B, ..., (N, r, m).

    Raises `NoImpulseResponse` if no model of `MOST_STATES` states has the response to 1e-6 of its
    greatest value.
    """
    _, commands, outputs = impulse.shape
    row_scale = _peaks(impulse, (0, 2))
    column_scale = _peaks(impulse / row_scale[:, None], (0, 1))
    scaled = impulse / row_scale[:, None] / column_scale
    left, values, right = _hankel_svd(scaled)
    tails = np.append(np.cumsum(values[::-1])[::-1], 0.0)
    states = int(np.argmax(tails <= _TRUNCATED * tails[0]))
    left, root = left[:, :states], np.sqrt(values[:states])
    a = (left[:-commands].T @ left[commands:]) / root[:, None] * root
    b = root[:, None] * right[:outputs, :states].T
    c = left[:commands] * root
    # The sum of the samples' errors bounds the error of the frequency response.
    state, error = b, np.zeros((commands, outputs))
    for sample in scaled:
        error += np.abs(sample - c @ state)
        state = a @ state
    greatest = np.abs(np.fft.fft(scaled, axis=0)).max()
    if not error.max() <= _ACCURACY * greatest:
        raise NoImpulseResponse(
            f"no model of {MOST_STATES} states has the impulse response: it is "
            f"{error.max() / greatest:.1e} off; give the law's linear form"
        )
    return LinearModel(
        a, b * column_scale, row_scale[:, None] * c, np.zeros((commands, outputs)), sample_time_s
    )


def _answers(
    controller: Controller, measured: tuple[str, ...], index: int, size: float, until_s: float
) -> Iterator[FloatArray]:
    """Yield a controller's commands after an impulse, step by step, until a moment of the clock."""
    commands = None
    for step in itertools.count(1):
        y = np.zeros(len(measured))
        y[index] = size if step == 1 else 0.0
        try:
            answer = np.array(controller.step(y), dtype=np.float64)
            controller.applied(answer.copy())
        except (Exception, SystemExit) as error:
            reason = f"{type(error).__name__}: {error}"
            raise NoImpulseResponse(f"{_where(step, size, measured[index])}: {reason}") from error
        commands = commands or answer.shape
        if answer.ndim != 1 or answer.shape != commands or not np.isfinite(answer).all():
            reason = f"the answer must be finite, shape (commands,), got {answer!r}"
            raise NoImpulseResponse(f"{_where(step, size, measured[index])}: {reason}")
        if time.monotonic() > until_s:
            reason = "out of time; make the step faster, or give the law's linear form"
            raise NoImpulseResponse(f"{_where(step, size, measured[index])}: {reason}")
        yield answer


def _where(step: int, size: float, name: str) -> str:
    return f"step {step} after an impulse of {size:g} in {name}"


def _slope(
    answers: Iterable[tuple[FloatArray, ...]], name: str, size: float, most_samples: int
) -> tuple[FloatArray, bool]:
    """Response per unit impulse until decay, and if linear, by half, minus half and all of it."""
    slopes: list[FloatArray] = []
    peak, deviation, loud = 0.0, 0.0, 0  # loud: the last sample that was not quiet
    for up, down, full in answers:
        slopes.append((up - down) / size)
        height = float(np.abs(slopes[-1]).max())
        peak = max(peak, height)
        deviation = max(deviation, np.abs(up + down).max(), np.abs(full - 2 * up).max())
        if height > _QUIET * peak:
            loud = len(slopes)
        if len(slopes) >= 1.5 * loud + _LEAST_QUIET:
            break
        if len(slopes) == most_samples or height > _BEYOND:
            raise NoImpulseResponse(
                f"the answer to an impulse of {size:g} in {name} does not decay: it peaks at "
                f"{peak * size:.3g} and is {height * size:.3g} after {len(slopes)} steps; a law "
                "that integrates, learns or is unstable by itself has no impulse response"
            )
    return np.array(slopes), bool(deviation <= _LINEAR * peak * size)


def _hankel_svd(impulse: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Leading singular vectors and values of the Hankel matrix, up to the truncation error."""
    samples, commands, outputs = impulse.shape
    length = next_fast_len(2 * samples, real=True)
    spectrum = np.fft.rfft(impulse, length, axis=0)
    transposed = spectrum.transpose(0, 2, 1)

    def times(spectrum: ComplexArray, vectors: FloatArray) -> FloatArray:
        """Multiply columns by the Hankel matrix or its transpose."""
        product = np.empty((samples * spectrum.shape[1], vectors.shape[1]))
        for k, vector in enumerate(vectors.T):
            seen = np.fft.rfft(vector.reshape(samples, -1), length, axis=0).conj()
            convolved = np.fft.irfft(np.einsum("frm,fm->fr", spectrum, seen), length, axis=0)
            product[:, k] = convolved[:samples].ravel()
        return product

    random = np.random.default_rng(0)
    most = min(MOST_STATES, samples * min(commands, outputs))
    states = min(_FIRST_STATES, most)
    while True:
        vectors = random.standard_normal((samples * outputs, states))
        for _ in range(2):
            basis = np.linalg.qr(times(spectrum, vectors))[0]
            vectors = times(transposed, basis)
        right, values, inner = np.linalg.svd(vectors, full_matrices=False)
        if states == most or states * values[-1] <= _TRUNCATED * values[0]:
            return basis @ inner.T, values, right
        states = min(2 * states, most)


def _peaks(impulse: FloatArray, axes: tuple[int, int]) -> FloatArray:
    """Greatest magnitude over `axes`; one where all values are zero."""
    peaks: FloatArray = np.abs(impulse).max(axis=axes)
    return np.where(peaks > 0, peaks, 1.0)
