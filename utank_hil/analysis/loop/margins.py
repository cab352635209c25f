"""A sampled law on the continuous plant, exactly: sampled-data theory, no simulation.

The law sees samples and its commands are held, delayed and lagged; between the samples the plant is
continuous. With v the law's input count (see `utank_hil.dynamics.sampling`), the sampled loop is::

    y(z) = P(z) v(z) + samples of the wave's effect,    v(z) = C(z) y(z)
    L(z) = C(z) P(z),    S(z) = 1 / (1 - L(z)),    z = exp(j w Ts)

(L carries the law's sign, so negative feedback has L near -1.) If law and plant both have a direct
path, v(k) = C x + D y(k) and y(k) = Cp xp + Dp v(k) are solved for v(k). A wave of frequency w
below half the sampling frequency gives samples of that frequency alone. The held command then has
components at w and its aliases; the motions returned are those at w.

Margins and robustness follow from this loop; a law must have them before the pump may be armed.
"""

import dataclasses
import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

import numpy as np

from utank_hil.base.arrays import ComplexArray, FloatArray
from utank_hil.control import DesignPlant, LinearLaw
from utank_hil.dynamics import RollShip
from utank_hil.dynamics.linear import STATES, pump_model, state_matrices
from utank_hil.dynamics.sampling import LinearModel, sample, state_space_response

if TYPE_CHECKING:
    from control import StateSpace

_SINGULAR: Final = 1e-12  # relative; smaller singular values of 1 - D Dp count as zero


def closed_loop_eigenvalues(
    law: LinearLaw, plant: "StateSpace | LinearModel", gain: float = 1.0
) -> ComplexArray:
    """Eigenvalues of the loop of a law and a sampled plant (`sampled_model`), scaled by `gain`.

    Raises `ValueError` if the loop is ill-posed: 1 - D Dp is singular, so the direct paths of law
    and plant leave the command undetermined.
    """
    compensator = law.matrices()
    reach, direct = gain * plant.B, gain * plant.D
    difference = np.eye(len(compensator.D)) - compensator.D @ direct
    least = np.linalg.svd(difference, compute_uv=False).min()
    if least <= _SINGULAR * max(1.0, float(np.abs(compensator.D @ direct).max())):
        raise ValueError(
            "the loop is ill-posed: the direct paths (D) of law and plant multiply to one, so that "
            "no command fits its own measurement; change the law's D"
        )
    # v = from_plant xp + from_law x
    from_plant = np.linalg.solve(difference, compensator.D @ plant.C)
    from_law = np.linalg.solve(difference, compensator.C)
    outer = plant.A + reach @ from_plant
    seen = plant.C + direct @ from_plant
    inner = compensator.A + compensator.B @ direct @ from_law
    closed = np.block([[outer, reach @ from_law], [compensator.B @ seen, inner]])
    return np.linalg.eigvals(closed).astype(np.complex128)


def closed_loop_radius(
    law: LinearLaw, plant: "StateSpace | LinearModel", gain: float = 1.0
) -> float:
    """Greatest magnitude of `closed_loop_eigenvalues`; below one the loop is stable."""
    return float(np.abs(closed_loop_eigenvalues(law, plant, gain)).max())


def closed_loop_response(
    law: LinearLaw | None,
    plant: DesignPlant,
    measured: tuple[str, ...],
    frequency_rad_s: FloatArray,
) -> tuple[ComplexArray, ComplexArray]:
    """Motions and pump pressure per unit of wave moment, at the wave's frequency.

    Without a law the tank is passive. The frequencies, shape (N,), are positive and below pi / Ts.
    Returns motions, shape (N, 4), of `STATES`, and the actual pressure, shape (N,), after delay and
    lag. Raises `ValueError` if a frequency is outside (0, pi / Ts).
    """
    w = np.asarray(frequency_rad_s, dtype=np.float64)
    a, b = state_matrices(plant.ship, plant.tank)
    system = LinearModel(a, b, np.eye(len(a)), np.zeros(b.shape), 0.0)
    open_loop = state_space_response(system, np.asarray(1j * w, dtype=np.complex128))
    from_pressure, from_wave = open_loop[:, :, 0], open_loop[:, :, 1]
    if law is None:
        return from_wave, np.zeros(len(w), dtype=np.complex128)
    sample_time_s = law.sample_time_s
    if not ((w > 0) & (w < np.pi / sample_time_s)).all():
        raise ValueError(f"frequencies must lie in (0, {np.pi / sample_time_s:.3f}) rad/s")
    rows = [STATES.index(name) for name in measured]
    z = np.exp(1j * w * sample_time_s)
    compensator = law.response(z)
    sampled = plant.sampled(measured, sample_time_s)
    loop = (compensator @ state_space_response(sampled, z))[:, 0, 0]
    command = (compensator @ from_wave[:, rows, None])[:, 0, 0] / (1 - loop)
    # v(k) is held over [t_{k-1} + d, t_k + d)
    hold = (1 - np.exp(-1j * w * sample_time_s)) / (1j * w * sample_time_s)
    path = hold * np.exp(-1j * w * (plant.delay_s - sample_time_s)) / (1 + 1j * w * plant.lag_s)
    pressure = path * command
    return from_wave + from_pressure * pressure[:, None], pressure


DELAY_SAMPLES = 25  #: Largest delay in samples for which the delay margin is searched.


@dataclass(frozen=True, slots=True)
class Margins:
    """Stability margins with the loop broken at the pump."""

    #: Greatest eigenvalue magnitude of the closed loop; stable below one. For an unstable loop the
    #: margins are zero (gains one) and carry no other information.
    radius: float
    #: Greatest abs(S) = abs(1 / (1 - L)); its inverse is the distance of L from the critical point.
    peak_sensitivity: float
    peak_frequency_rad_s: float
    gain_low: float  #: The loop is stable for any gain factor from this to `gain_high`.
    gain_high: float
    phase_margin_rad: float  #: Least lag or lead, taken alone, that destabilizes; inf if none does.
    #: Least extra delay that destabilizes; inf if none up to `DELAY_SAMPLES` samples does, nan if
    #: it was not searched for.
    delay_margin_s: float
    #: Greatest a for which every gain and phase error (1 + a d / 2) / (1 - a d / 2), complex abs(d)
    #: < 1, is harmless (symmetric disk); at most 2.
    disk_margin: float
    peak_loop_gain: float  #: Greatest abs(L); far below one the law has no effect on the roll.


def margins(
    law: LinearLaw,
    system: "StateSpace | LinearModel",
    delay_s: float = 0.0,
    lag_s: float = 0.0,
    *,
    with_delay_margin: bool = True,
) -> Margins:
    """Margins of the loop that a law with one input closes around a system.

    `system` is continuous, from the pump pressure to the law's measurements, in its order;
    `delay_s` and `lag_s` are as in `sampled_model`. ValueError is raised if the system has more
    than one input.
    """
    if system.B.shape[1] != 1:
        raise ValueError(f"margins are those of one pump, the model has {system.B.shape[1]} inputs")
    plant = sample(system, law.sample_time_s, delay_s, lag_s)
    radius, w, loop = _loop(law, plant)
    sensitivity = np.abs(1 / (1 - loop))
    peak, peak_frequency_rad_s = float(sensitivity.max()), float(w[sensitivity.argmax()])
    peak_gain = float(np.abs(loop).max())
    if radius >= 1:
        return Margins(radius, peak, peak_frequency_rad_s, 1, 1, 0, 0, 0, peak_gain)
    low, high = _gain_margins(loop)
    return Margins(
        radius=radius,
        peak_sensitivity=peak,
        peak_frequency_rad_s=peak_frequency_rad_s,
        gain_low=low,
        gain_high=high,
        phase_margin_rad=_phase_margin(loop),
        delay_margin_s=(
            _delay_margin(law, system, delay_s, lag_s, _delay_of_phase(w, loop))
            if with_delay_margin
            else math.nan
        ),
        disk_margin=float(1 / np.abs(1 / (1 - loop) - 0.5).max()),
        peak_loop_gain=peak_gain,
    )


def loop_response(
    law: LinearLaw, plant: "StateSpace | LinearModel", frequency_rad_s: FloatArray
) -> ComplexArray:
    """Loop transfer L(exp(j w Ts)) of one pump with a sampled plant; shape (N,)."""
    z = np.exp(1j * frequency_rad_s * law.sample_time_s)
    loop: ComplexArray = (law.response(z) @ state_space_response(plant, z))[:, 0, 0]
    return loop


def _loop(
    law: LinearLaw, plant: "StateSpace | LinearModel"
) -> tuple[float, FloatArray, ComplexArray]:
    """Closed-loop radius, frequencies in rad/s, and the loop transfer there."""
    closed = closed_loop_eigenvalues(law, plant)
    modes = np.concatenate([np.linalg.eigvals(plant.A), closed])
    w = _frequencies(modes, law.sample_time_s)
    return float(np.abs(closed).max()), w, loop_response(law, plant, w)


def _frequencies(modes: ComplexArray, sample_time_s: float) -> FloatArray:
    """Frequencies up to the Nyquist frequency, dense around lightly damped modes."""
    nyquist = np.pi / sample_time_s
    grids = [np.geomspace(1e-3, nyquist, 1500), np.array([nyquist])]
    for mode in np.log(modes[(modes.imag > 0) & (np.abs(modes) > 0.8)]) / sample_time_s:
        width = max(abs(mode.real), 1e-6 * mode.imag)
        grids.append(mode.imag + width * np.linspace(-4, 4, 101))
    w: FloatArray = np.unique(np.concatenate(grids))
    return w[(w > 0) & (w <= nyquist)]


def _gain_margins(loop: ComplexArray) -> tuple[float, float]:
    """Gain factors nearest to one, below and above, that put L on the critical point 1."""
    ends = loop[[0, -1]].real  # L is real at zero and at the Nyquist frequency
    turn = np.flatnonzero(loop.imag[:-1] * loop.imag[1:] < 0)
    share = loop.imag[turn] / (loop.imag[turn] - loop.imag[turn + 1])
    real = np.concatenate([loop.real[turn] + share * (loop.real[turn + 1] - loop.real[turn]), ends])
    critical = 1 / real[real > 0]
    low = critical[critical < 1].max(initial=0.0)
    return float(low), float(critical[critical > 1].min(initial=np.inf))


def _phase_margin(loop: ComplexArray) -> float:
    """Least angle of L from the positive real axis where its magnitude crosses one."""
    size = np.abs(loop)
    turn = np.flatnonzero((size[:-1] < 1) != (size[1:] < 1))
    share = (1 - size[turn]) / (size[turn + 1] - size[turn])
    angle = np.angle(loop[turn] + share * (loop[turn + 1] - loop[turn]))
    return float(np.abs(angle).min(initial=np.inf))


def _delay_of_phase(frequency_rad_s: FloatArray, loop: ComplexArray) -> float:
    """Least delay whose phase alone turns L to the critical point 1; inf if abs(L) is below one."""
    at = np.flatnonzero((np.abs(loop[:-1]) < 1) != (np.abs(loop[1:]) < 1))
    delay_s = np.angle(loop[at]) % (2 * np.pi) / frequency_rad_s[at]
    return float(delay_s.min(initial=np.inf))


def _delay_margin(
    law: LinearLaw, system: "StateSpace | LinearModel", delay_s: float, lag_s: float, near_s: float
) -> float:
    """Least destabilizing delay, by eigenvalues at quarters of a sample and bisection to 0.1 ms.

    The search begins at `near_s`, by the phase: a part of a sample changes the hold, too.
    """

    def stable(extra_s: float) -> bool:
        plant = sample(system, law.sample_time_s, delay_s + extra_s, lag_s)
        return closed_loop_radius(law, plant) < 1

    quarter_s = law.sample_time_s / 4
    count = int(min(near_s / quarter_s, 4 * DELAY_SAMPLES))
    while count > 0 and not stable(count * quarter_s):
        count -= 1
    while count < 4 * DELAY_SAMPLES and stable((count + 1) * quarter_s):
        count += 1
    if count == 4 * DELAY_SAMPLES:
        return float("inf")
    good, bad = count * quarter_s, (count + 1) * quarter_s
    while bad - good > 1e-4:
        middle = (good + bad) / 2
        good, bad = (middle, bad) if stable(middle) else (good, middle)
    return good


PEAK_SENSITIVITY = 2.0
"""Greatest allowed peak sensitivity: L stays at least 0.5 from the critical point."""
EXTRA_DELAY_S = 0.020  # two base ticks of 10 ms
PERIOD_SCALES = (0.7, 0.85, 1.0, 1.15, 1.3)
"""Factors on the roll period in the grid. Chosen; no study."""
INERTIA_SCALES = (0.8, 1.25)  # load moved inwards, and outwards; chosen, no study
GAINS = (0.8, 1.0, 1.2)  #: Factors on the pump's gain in the grid. Chosen; no study.


@dataclass(frozen=True, slots=True)
class Robustness:
    """Margins of a law's loop on its own ship and on a grid of variants."""

    nominal: Margins  #: On the ship of the design.
    late_radius: float  #: Closed-loop radius with `EXTRA_DELAY_S` more delay.
    #: Greatest closed-loop radius over `PERIOD_SCALES` of the ship's roll period (by its stiffness)
    #: and `INERTIA_SCALES` of its inertia, `GAINS` of the pump, and `EXTRA_DELAY_S` more delay or
    #: none.
    worst_radius: float
    #: worst_period_scale, worst_inertia_scale, worst_gain, worst_extra_delay_s: variant with the
    #: greatest radius; one of the first two is 1.
    worst_period_scale: float
    worst_inertia_scale: float
    worst_gain: float
    worst_extra_delay_s: float

    def failures(self) -> tuple[str, ...]:
        """Unmet requirements in words, NaN values included; empty for a law that may be armed."""
        found = []
        if not self.nominal.radius < 1:
            found.append(f"unstable on its own ship (eigenvalue {self.nominal.radius:.4f})")
        if not self.nominal.peak_sensitivity <= PEAK_SENSITIVITY:
            found.append(
                f"peak sensitivity {self.nominal.peak_sensitivity:.2f} is above "
                f"{PEAK_SENSITIVITY:g}"
            )
        if not self.late_radius < 1:
            found.append(f"unstable with {1e3 * EXTRA_DELAY_S:g} ms more delay")
        if not self.worst_radius < 1:
            ship = f"at {self.worst_period_scale:g} of the ship's roll period"
            if self.worst_inertia_scale != 1:
                ship = f"at {self.worst_inertia_scale:g} of the ship's inertia"
            late = ""
            if self.worst_extra_delay_s:
                late = f" and {1e3 * self.worst_extra_delay_s:g} ms more delay"
            found.append(f"unstable {ship} with {self.worst_gain:g} of the pump's gain{late}")
        return tuple(found)


def robustness(
    law: LinearLaw, plant: DesignPlant, measured: tuple[str, ...], *, with_delay_margin: bool = True
) -> Robustness:
    """Judge a law on its ship, with extra delay, and on a grid of ships, pump gains and delays.

    The worst of the plant's `tanks` counts. The delay margin (`with_delay_margin`) is informative
    only; no requirement uses it.
    """
    delay_s, lag_s = plant.delay_s, plant.lag_s
    models = [pump_model(plant.ship, tank, measured) for tank in plant.tanks]
    own = [
        margins(law, each, delay_s, lag_s, with_delay_margin=with_delay_margin) for each in models
    ]

    def sampled(model: LinearModel, extra_s: float) -> LinearModel:
        return sample(model, law.sample_time_s, delay_s + extra_s, lag_s)

    worst = (-math.inf, 1.0, 1.0, 1.0, 0.0)
    for extra_s in (0.0, EXTRA_DELAY_S):
        for tank in plant.tanks:
            for period_scale, inertia_scale, ship in ship_variants(plant.ship):
                variant = sampled(pump_model(ship, tank, measured), extra_s)
                for gain in GAINS:
                    radius = closed_loop_radius(law, variant, gain)
                    if radius > worst[0]:
                        worst = radius, period_scale, inertia_scale, gain, extra_s
    return Robustness(
        max(own, key=lambda each: (each.radius >= 1, each.peak_sensitivity)),
        max(closed_loop_radius(law, sampled(each, EXTRA_DELAY_S)) for each in models),
        *worst,
    )


def ship_variants(ship: RollShip) -> Iterator[tuple[float, float, RollShip]]:
    """Yield the ships of the grid: scales of period and of inertia, and the ship with these.

    Stability changes the stiffness and with it the period; the distribution of load the inertia.
    """
    for scale in PERIOD_SCALES:
        yield scale, 1.0, of_period(ship, scale)
    for scale in INERTIA_SCALES:
        inertia = ship.inertia_kg_m2 * scale
        yield 1.0, scale, dataclasses.replace(ship, inertia_kg_m2=inertia)


def of_period(ship: RollShip, scale: float) -> RollShip:
    """Return the ship with its roll period multiplied, by its stiffness."""
    return dataclasses.replace(ship, stiffness_nm_rad=ship.stiffness_nm_rad / scale**2)
