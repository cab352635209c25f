"""Stability margins of a sampled law on the continuous plant behind delay and lag."""

import math
from collections.abc import Iterable
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from utank_hil.analysis.loop.closed_loop import closed_loop_eigenvalues, closed_loop_radius
from utank_hil.base.arrays import ComplexArray, FloatArray
from utank_hil.control.interface import LinearLaw
from utank_hil.dynamics.sampling import LinearModel, sample, state_space_response

if TYPE_CHECKING:
    from control import StateSpace

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
    `delay_s` and `lag_s` are as in `sampled_model`. The search for the delay margin takes most of
    the time. ValueError is raised if the system has more than one input.
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
            _delay_margin(law, system, delay_s, lag_s) if with_delay_margin else math.nan
        ),
        disk_margin=float(1 / np.abs(1 / (1 - loop) - 0.5).max()),
        peak_loop_gain=peak_gain,
    )


def stability_grid(
    law: LinearLaw,
    systems: Iterable["StateSpace | LinearModel"],
    gains: Iterable[float],
    delay_s: float = 0.0,
    lag_s: float = 0.0,
) -> FloatArray:
    """Closed-loop radius for each of `systems` (rows, continuous) at each plant gain (columns)."""
    plants = [sample(system, law.sample_time_s, delay_s, lag_s) for system in systems]
    gains = list(gains)
    return np.array([[closed_loop_radius(law, plant, gain) for gain in gains] for plant in plants])


def radius_and_peak(law: LinearLaw, plant: "StateSpace | LinearModel") -> tuple[float, float]:
    """Closed-loop radius and greatest abs(1 / (1 - L)) with a sampled plant."""
    radius, _, loop = _loop(law, plant)
    return radius, float(np.abs(1 / (1 - loop)).max())


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


def _delay_margin(
    law: LinearLaw, system: "StateSpace | LinearModel", delay_s: float, lag_s: float
) -> float:
    """Least destabilizing delay, by eigenvalues at quarters of a sample and bisection to 0.1 ms."""

    def stable(extra_s: float) -> bool:
        plant = sample(system, law.sample_time_s, delay_s + extra_s, lag_s)
        return closed_loop_radius(law, plant) < 1

    grid = law.sample_time_s * np.arange(1, 4 * DELAY_SAMPLES + 1) / 4
    first = next((i for i, extra_s in enumerate(grid) if not stable(extra_s)), None)
    if first is None:
        return float("inf")
    bad = float(grid[first])
    good = bad - law.sample_time_s / 4
    while bad - good > 1e-4:
        middle = (good + bad) / 2
        good, bad = (middle, bad) if stable(middle) else (good, middle)
    return good
