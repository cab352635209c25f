"""The innovation filter that costs least in the expected sea and keeps the loop robust.

The innovations nu of a law's observer are white noise as long as ship and sea match the model. A
stable filter Q from them to the command changes the law's response to that sea and cannot make the
loop unstable on that ship (Youla parametrization). With the Laguerre basis f_k(z)::

    q(k) = Q nu(k),    Q = sum_k f_k c_k,    T = T_0 + T_q Q M

where T is the loop from sea and sensors to the command. So the cost, the mean square of roll, level
and pressure, is quadratic in the coefficients c, and the sensitivity S = 1 + T P is affine in them.
On another ship the law becomes unstable only where 1 - Q D passes zero, with D from q to nu on that
ship. Re exp(-j a) (1 - Q D) > 0 at all frequencies prevents it, and is linear in c. The objective
is convex and has a unique minimum::

    J + mean (|S| / 0.85 S_max)^16 + mean (|S_v| / Re exp(-j a) (1 - Q D_v) S_others)^4 + r |c|^2

with S_v the sensitivity on ship v without the filter. Newton's method reaches it to rounding. The
angles a are zero in the first solution; a second one takes the angles that 1 - Q D has there.

Means over frequency are Gaussian quadratures on panels that are narrow around the roll frequency.

References
----------
S. Boyd, C. Barratt, Linear Controller Design: Limits of Performance, Prentice Hall 1991.
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cache, lru_cache
from typing import Final

import numpy as np

from utank_hil.analysis.loop import margins
from utank_hil.base.arrays import ComplexArray, FloatArray
from utank_hil.control import ConstrainedDesign, DesignPlant, LQGLaw
from utank_hil.control.constrained.design import sea_plant
from utank_hil.dynamics import STATES, LinearModel
from utank_hil.dynamics.sampling import state_space_response

_ORDER: Final = 14
"""Filter states. From 8 to 14 the roll of the shipped laws falls by 1.5 %, to 16 by 0.2 % more."""
_POLE: Final = 0.7
"""Decay rate of the Laguerre basis over w; from 0.5 to 1 the roll changes by 0.5 %."""
_BOUND: Final = 0.85 * margins.PEAK_SENSITIVITY
"""Peak sensitivity that the penalty aims at: the required one less 15 %. The 15 % is chosen; no
study."""
_POWER: Final = 16  # Exponent of the penalty on the ship's sensitivity. Chosen; no study.
_OTHERS_PEAK: Final = 40.0
"""Sensitivity on the other ships from which it is penalized; on these only stability is required.
"""
_OTHERS_POWER: Final = 4
"""Exponent of the penalty on the other ships' sensitivity. Chosen; no study."""
_RIDGE: Final = 1e-6
"""Cost of a squared coefficient; it selects the smallest of equivalent filters."""
_TURNS: Final = 2
"""Number of solutions: with zero angles, then with the angles found. Chosen; no study."""
_MOST_ANGLE_RAD: Final = math.radians(80)
"""Limit on the angles a, so that a half plane does not pass zero between two frequencies."""
_LOADS: Final = (0.85, 1.0, 1.15, 1.3)
"""Scales of the roll period that a ship may be loaded to, where it is not identified."""
_SHARES: Final = (0.1, 0.2, 0.4, 0.7, 1.0)
"""Shares of its command that a pump at its limit gives there."""
_EXACT: Final = 1e-14
"""Newton decrement of the last step. Newton's method squares the remaining error."""
_MOST_STEPS: Final = 200  # Limit on the Newton steps. Chosen; no study.
_SHORTEST: Final = 1e-6
"""Smallest share of a Newton step that is tried; below it only rounding error remains."""


@dataclass(frozen=True, slots=True)
class Prediction:
    """Predicted root mean squares without limits, and mean power."""

    roll_rad: float
    level_m: float
    pressure_pa: float
    power_w: float  #: Mean power from pump to water; power taken from the water is not counted.


class InnovationFilter:
    """The convex problem of one law on one ship in one sea.

    `law` is stable on all ships of the grid (`robustness`), and that of `design`. `weights` are the
    cost weights on the squares of roll in rad, level in m, and pressure over the pump's maximum.
    On ships loaded otherwise, with the pump at its limit or not, a sensitivity above `loads_peak`
    is penalized; None for a ship whose load is known.
    """

    def __init__(
        self,
        law: LQGLaw,
        design: ConstrainedDesign,
        plant: DesignPlant,
        weights: tuple[float, float, float],
        *,
        loads_peak: float | None = None,
    ) -> None:
        self._law, self._plant, self._loads_peak = law, plant, loads_peak
        self._unit_pa = plant.limits.pressure_pa
        angle = plant.ship.natural_frequency_rad_s * law.sample_time_s
        omega, self._mean = _quadrature(angle)
        self._angle, self._z = angle, np.exp(1j * omega)
        share = np.where(omega > 2e-3 * angle, self._mean / omega, 0.0)
        self._octaves = share / share.sum()  # each octave has the same weight
        self._measured = [STATES.index(name) for name in design.measured]
        self.coefficients = _ORDER * len(self._measured)  #: Number of coefficients of the filter.
        self._noise = np.diag(np.asarray(design.measurement_std))
        self._basis_a, self._basis_b = laguerre(_ORDER, math.exp(-_POLE * angle))
        basis = LinearModel(
            self._basis_a, self._basis_b[:, None], np.eye(_ORDER), np.zeros((_ORDER, 1)), 0.0
        )
        self._basis = state_space_response(basis, self._z)[..., 0]
        self._by_pump = self._pumped(plant, STATES)
        self._by_sea = self._in_sea(design)
        self._own_ship(np.asarray(weights))
        turning, peaks = zip(*self._other_ships(), strict=True)
        self._turning, self._others_peak = np.array(turning), np.array(peaks)
        self._aim(np.zeros(self._others_peak.shape))

    def laws(self) -> Iterator[LQGLaw]:
        """Yield the law with its best filter, then with intermediate filters, best first."""
        found, coefficients = [], np.zeros(self.coefficients)
        for _ in range(_TURNS):
            angle_rad = np.angle(1 + self._turning @ coefficients)
            self._aim(np.clip(angle_rad, -_MOST_ANGLE_RAD, _MOST_ANGLE_RAD))
            coefficients = self.minimum(coefficients)
            found.append(coefficients)
        for each in reversed(found):
            yield self._filtered(each)

    def prediction(self, law: LQGLaw) -> Prediction:
        """Predict the motion under a law in the sea, with the noise of the sensors."""
        to_command, loop = self._loop(law)
        to_command = to_command / (1 - loop)[:, None]
        command = np.einsum("wm,wmc->wc", to_command, self._seen)
        together = np.concatenate(
            [self._by_pump[..., None] * command[:, None], command[:, None]], axis=1
        )
        together[:, :-1, 0] += self._by_sea
        spread = np.einsum("w,wic,wjc->ij", self._mean, together, together.conj()).real
        *rms, pressure = np.sqrt(np.diag(spread)).tolist()
        speed = STATES.index("level_rate_m_s")
        power = mean_positive_product(pressure, rms[speed], float(spread[-1, speed]))
        return Prediction(
            roll_rad=rms[STATES.index("roll_rad")],
            level_m=rms[STATES.index("level_m")],
            pressure_pa=pressure * self._unit_pa,
            power_w=self._plant.tank.reservoir_area_m2 * self._unit_pa * power,
        )

    def peak_sensitivity(self, law: LQGLaw) -> float:
        """Peak of the sensitivity of a law on the nominal ship, at the nodes of the means."""
        return float(np.abs(1 / (1 - self._loop(law)[1])).max())

    def _loop(self, law: LQGLaw) -> tuple[ComplexArray, ComplexArray]:
        """Transfers to the command, over the pump's maximum, and the loop transfer."""
        to_command = law.response(self._z)[:, 0] / self._unit_pa
        return to_command, np.einsum("wm,wm->w", to_command, self._by_pump[:, self._measured])

    def value(self, coefficients: FloatArray) -> float:
        """Objective at these coefficients; infinite outside a half plane."""
        c = coefficients
        room = self._room + self._rooms @ c
        if not (room > 0).all():
            return math.inf
        sensitivity = np.abs(1 + self._sensitivity_start + self._sensitivities @ c)
        peaks = self._octaves @ (sensitivity / _BOUND) ** _POWER
        others = ((self._others_peak / room) ** _OTHERS_POWER).sum(axis=0) @ self._octaves
        cost = self._start + 2 * self._slope @ c + c @ self._curvature @ c
        return float(cost + _RIDGE * c @ c + peaks + others)

    def derivatives(self, coefficients: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Gradient and Hessian of `value`."""
        c = coefficients
        quadratic = self._curvature + _RIDGE * np.eye(len(c))
        sensitivity = 1 + self._sensitivity_start + self._sensitivities @ c
        square = np.abs(sensitivity) ** 2
        peak = _POWER * self._octaves * (np.sqrt(square) / _BOUND) ** _POWER / square
        along = (self._sensitivities * sensitivity.conj()[:, None]).real
        outer = (self._sensitivities.T.conj() @ (self._sensitivities * peak[:, None])).real
        room = (self._room + self._rooms @ c).ravel()
        rooms = self._rooms.reshape(-1, len(c))
        others = self._octaves * self._others_peak**_OTHERS_POWER
        other = _OTHERS_POWER * others.ravel() / room ** (_OTHERS_POWER + 1)
        gradient = 2 * (self._slope + quadratic @ c) + along.T @ peak - rooms.T @ other
        hessian = 2 * quadratic + outer
        hessian += (_POWER - 2) * along.T @ (along * (peak / square)[:, None])
        rooms = rooms * np.sqrt((_OTHERS_POWER + 1) * other / room)[:, None]
        hessian += rooms.T @ rooms  # of one matrix: half the work
        return gradient, hessian

    def minimum(self, coefficients: FloatArray) -> FloatArray:
        """Coefficients at the minimum, by Newton's method from a point inside all half planes."""
        for _ in range(_MOST_STEPS):
            value = self.value(coefficients)
            gradient, hessian = self.derivatives(coefficients)
            step = -np.linalg.solve(hessian, gradient)
            decrement = -float(gradient @ step)
            length = 1.0
            while self.value(coefficients + length * step) > value - 0.1 * length * decrement:
                length /= 2
                if length < _SHORTEST:
                    return coefficients
            coefficients = coefficients + length * step
            if decrement < _EXACT:
                break
        return coefficients

    def _law_parts(self, share: float) -> "_LawParts":
        """Compute transfers from command and innovations to the estimate's command and output.

        The estimate is x = (z - A + B K)^-1 (B q + L nu), the command q - K x. A pump at its limit
        gives a share of both, which the estimate takes into account.
        """
        law, unit = self._law, self._unit_pa
        a, b, c, d, dt = law.model
        gain = share * law.gain
        expected = c - d @ gain
        response = state_space_response(
            LinearModel(
                a - b @ gain,
                np.hstack([b * unit, law.observer_gain]),
                np.vstack([gain / unit, expected]),
                np.zeros((1 + len(c), 1 + len(c))),
                dt,
            ),
            self._z,
        )
        return _LawParts(
            command_by_command=1 - response[:, 0, 0],
            command_by_surprise=-response[:, 0, 1:],
            expected_by_command=response[:, 1:, 0] + unit * d[:, 0],
            expected_by_surprise=response[:, 1:, 1:],
        )

    def _own_ship(self, weights: FloatArray) -> None:
        """Compute cost and sensitivity on the nominal ship as functions of the coefficients."""
        pump, parts = self._by_pump[:, self._measured], self._law_parts(1.0)
        surprise = parts.surprise(pump)
        noise = np.broadcast_to(self._noise, surprise.shape)
        self._seen = np.concatenate([self._by_sea[:, self._measured, None], noise], axis=2)
        innovations = surprise @ self._seen
        spread = np.einsum("w,wic,wjc->ij", self._mean, innovations, innovations.conj()).real
        self._whitening = np.linalg.inv(np.linalg.cholesky(spread))
        start = np.einsum("wi,wij->wj", parts.command_by_surprise, surprise)
        # A command v gives roll, level and pressure m + g v, at a cost |g|^2 |v - best|^2.
        picked = [STATES.index("roll_rad"), STATES.index("level_m")]
        g = np.hstack([self._by_pump[:, picked], np.ones((len(self._z), 1))])
        m = np.hstack([self._by_sea[:, picked], np.zeros((len(self._z), 1))])
        size = (weights * np.abs(g) ** 2).sum(axis=1)
        best = -(weights * g.conj() * m).sum(axis=1) / size
        passive = (weights * np.abs(m) ** 2).sum(axis=1)
        scale = float(self._mean @ passive)
        root = np.sqrt(size * self._mean / scale)
        error = np.einsum("wm,wmc->wc", start, self._seen)
        error[:, 0] -= best
        error *= root[:, None]
        by = np.einsum(
            "w,wk,wjc->wckj",
            root * parts.command_by_command,
            self._basis,
            self._whitening @ innovations,
        ).reshape(error.size, -1)
        self._curvature = (by.T.conj() @ by).real
        self._slope = (by.T.conj() @ error.ravel()).real
        left = float(self._mean @ (passive - size * np.abs(best) ** 2)) / scale
        self._start = float(np.sum(np.abs(error) ** 2)) + left
        self._sensitivity_start = np.einsum("wm,wm->w", start, pump)
        by_pump = self._along(np.einsum("wij,wj->wi", surprise, pump))
        self._sensitivities = parts.command_by_command[:, None] * by_pump

    def _other_ships(self) -> Iterator[tuple[ComplexArray, FloatArray]]:
        """Yield how 1 - Q D depends on the coefficients on another ship, and its sensitivity."""
        names = tuple(STATES[row] for row in self._measured)
        by_share = cache(self._law_parts)
        for ship, gain, share, peak in _others(self._plant, self._loads_peak):
            parts, pump = by_share(share), gain * self._pumped(ship, names)
            surprise = parts.surprise(pump)
            effect = pump * parts.command_by_command[:, None] - parts.expected_by_command
            start = np.einsum("wi,wij->wj", parts.command_by_surprise, surprise)
            yield (
                -share * self._along(np.einsum("wij,wj->wi", surprise, effect)),
                np.abs(1 + share * np.einsum("wm,wm->w", start, pump)) / peak,
            )

    def _aim(self, angle_rad: FloatArray) -> None:
        """Set the half planes of 1 - Q D to these angles."""
        back = np.exp(-1j * angle_rad)
        self._room, self._rooms = back.real, (back[..., None] * self._turning).real

    def _filtered(self, coefficients: FloatArray) -> LQGLaw:
        """Append filter states q to the law: q+ = A' q + c nu, with b q added to the command."""
        law, states = self._law, len(self._law.model.A)
        a, b, c, d, dt = law.model
        rest = np.zeros((states, _ORDER))
        return LQGLaw(
            LinearModel(
                np.block([[a, rest], [rest.T, self._basis_a.T]]),
                np.vstack([b, np.zeros((_ORDER, 1))]),
                np.hstack([c, np.zeros((len(c), _ORDER))]),
                d,
                dt,
            ),
            np.hstack([law.gain, -self._unit_pa * self._basis_b[None]]),
            np.vstack([law.observer_gain, coefficients.reshape(_ORDER, -1) @ self._whitening]),
        )

    def _along(self, outputs: ComplexArray) -> ComplexArray:
        """Transfers to innovations, each followed by the filter, per coefficient."""
        per: ComplexArray = self._basis[..., None] * (outputs @ self._whitening.T)[:, None]
        return per.reshape(len(self._z), -1)

    def _pumped(self, plant: DesignPlant, names: tuple[str, ...]) -> ComplexArray:
        return self._unit_pa * _pumped(plant, names, self._law.sample_time_s, self._angle)

    def _in_sea(self, design: ConstrainedDesign) -> ComplexArray:
        """Response of the motion with passive tank to the sea's white noise; shape (N, 4)."""
        model, spread, *_ = sea_plant(
            design.sea, self._plant, sample_time_s=self._law.sample_time_s
        )
        most = int(np.diag(spread).argmax())
        noise = spread[:, most : most + 1] / math.sqrt(spread[most, most])  # its rank is one
        response = state_space_response(model._replace(B=noise, D=0 * model.D), self._z)
        motion: ComplexArray = response[..., 0]
        return motion


@dataclass(frozen=True, slots=True)
class _LawParts:
    """Transfers of the law: command and expected measurement, by command and innovations."""

    command_by_command: ComplexArray
    command_by_surprise: ComplexArray
    expected_by_command: ComplexArray
    expected_by_surprise: ComplexArray

    def surprise(self, pump: ComplexArray) -> ComplexArray:
        """Inverse of the return difference at the innovations, on a plant."""
        loop = self.expected_by_surprise - pump[..., None] * self.command_by_surprise[:, None]
        return np.asarray(np.linalg.inv(np.eye(loop.shape[-1]) + loop), dtype=np.complex128)


@lru_cache(maxsize=256)
def _pumped(
    plant: DesignPlant, names: tuple[str, ...], sample_time_s: float, roll_angle: float
) -> ComplexArray:
    """Motion by the command, at the nodes of `_quadrature`; the same for each law of a search."""
    z = np.exp(1j * _quadrature(roll_angle)[0])
    response = state_space_response(plant.sampled(names, sample_time_s), z)[..., 0]
    response.flags.writeable = False
    return response


def laguerre(order: int, pole: float) -> tuple[FloatArray, FloatArray]:
    """Laguerre filters x+ = A x + b e of orthonormal pulse responses; pole between 0 and 1."""
    back = np.subtract.outer(np.arange(order), np.arange(order))
    a = np.where(back > 0, (1 - pole**2) * (-pole) ** (np.maximum(back, 1) - 1.0), 0.0)
    np.fill_diagonal(a, pole)
    return a, math.sqrt(1 - pole**2) * (-pole) ** np.arange(float(order))


def mean_positive_product(first: float, second: float, covariance: float) -> float:
    """Mean of the positive part of x y, for two normal variables of zero mean."""
    size = first * second
    if size == 0:
        return 0.0
    r = min(max(covariance / size, -1.0), 1.0)
    return size / (2 * math.pi) * (2 * math.sqrt(1 - r**2) + 2 * r * (math.pi / 2 + math.asin(r)))


def _quadrature(roll_angle: float) -> tuple[FloatArray, FloatArray]:
    """Angles from 0 to pi and their weights in a mean, dense near the roll's angle per sample."""
    low, high = 0.3 * roll_angle, 3 * roll_angle
    edges = np.concatenate(
        [
            [0.0],
            np.geomspace(low / 30, low, 5)[:-1],
            np.linspace(low, high, 16)[:-1],
            np.square(np.linspace(math.sqrt(high), math.sqrt(math.pi), 9)),
        ]
    )
    nodes, weights = np.polynomial.legendre.leggauss(8)
    half = np.diff(edges)[:, None] / 2
    angles = edges[:-1, None] + half * (1 + nodes)
    return angles.ravel(), (half * weights).ravel() / math.pi


def _others(
    plant: DesignPlant, loads_peak: float | None
) -> Iterator[tuple[DesignPlant, float, float, float]]:
    """Yield the other ships, the pump's gain, its share of the command, and the peak to penalize.

    The ships of the grid have extra delay or none, and the tank at work and in small motions.
    """
    if plant.calm is not None:
        calm = replace(plant, tank=plant.calm, calm=None)
        yield calm, 1.0, 1.0, margins.PEAK_SENSITIVITY
        yield from _others(calm, loads_peak)
    late = replace(plant, delay_s=plant.delay_s + margins.EXTRA_DELAY_S)
    yield late, 1.0, 1.0, _OTHERS_PEAK
    for period_scale, inertia_scale, ship in margins.ship_variants(plant.ship):
        if period_scale == inertia_scale == 1:
            continue
        for gain in (margins.GAINS[0], margins.GAINS[-1]):
            yield replace(plant, ship=ship), gain, 1.0, _OTHERS_PEAK
            yield replace(late, ship=ship), gain, 1.0, _OTHERS_PEAK
    if loads_peak is None:
        return
    for scale in _LOADS:
        loaded = replace(plant, ship=margins.of_period(plant.ship, scale))
        for share in _SHARES:
            yield loaded, 1.0, share, loads_peak
