"""A sampled law on the continuous plant, exactly: sampled-data theory, no simulation.

The law sees samples and its commands are held, delayed and lagged; between the samples the plant is
continuous. With v the law's input count (see `utank_hil.dynamics.sampling`), the sampled loop is::

    y(z) = P(z) v(z) + samples of the wave's effect,    v(z) = C(z) y(z)
    L(z) = C(z) P(z),    S(z) = 1 / (1 - L(z)),    z = exp(j w Ts)

(L carries the law's sign, so negative feedback has L near -1.) If law and plant both have a direct
path, v(k) = C x + D y(k) and y(k) = Cp xp + Dp v(k) are solved for v(k). A wave of frequency w
below half the sampling frequency gives samples of that frequency alone. The held command then has
components at w and its aliases; the motions returned are those at w.
"""

from typing import TYPE_CHECKING, Final

import numpy as np

from utank_hil.base.arrays import ComplexArray, FloatArray
from utank_hil.control import DesignPlant, LinearLaw
from utank_hil.dynamics.linear import STATES, state_matrices
from utank_hil.dynamics.sampling import LinearModel, state_space_response

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
