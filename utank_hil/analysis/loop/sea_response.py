"""Linear roll, level and pressure in irregular waves, in closed form: no simulation, no limits.

The mean square of a linear response to a sum of harmonics is sum |H(w)|^2 a^2 / 2. Limits of pump,
rate and level are neglected.
"""

from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

import numpy as np

from utank_hil.analysis.loop.closed_loop import closed_loop_response
from utank_hil.base.arrays import ComplexArray, FloatArray
from utank_hil.control.interface import LinearLaw
from utank_hil.dynamics.ship import RollShip
from utank_hil.sea import Harmonics

if TYPE_CHECKING:
    from control import StateSpace

LEAST_ROLL_RAD: Final = 1e-6
"""Roll RMS below which the sea counts as calm, as a ratio to it is meaningless. Chosen; no study.
"""


class CalmSeaError(ValueError):
    """The sea does not roll the ship, so there is no roll to reduce."""


@dataclass(frozen=True, slots=True)
class MotionInSea:
    """Root mean squares of the motion in a sea; the pressure's is that after delay and lag."""

    roll_rms_rad: float
    level_rms_m: float
    pressure_rms_pa: float


def motion_in_sea(
    law: LinearLaw | None,
    system: "StateSpace",
    measured: tuple[str, ...],
    wave_moment: Harmonics,
    delay_s: float = 0.05,
    lag_s: float = 0.1,
) -> MotionInSea:
    """Linear motion with a law that stabilizes its loop.

    Without a law the tank is passive; for an unstable loop the result is meaningless. `system` is
    the `coupled_model` of ship and tank. `wave_moment` is in N m; above the Nyquist frequency pi /
    Ts the tank is taken as passive. `delay_s` and `lag_s` are as in `sampled_model`.
    """
    w = wave_moment.frequency_rad_s
    motions, pressure = closed_loop_response(None, system, measured, w)
    if law is not None:
        seen = (w > 0) & (w < np.pi / law.sample_time_s)
        motions[seen], pressure[seen] = closed_loop_response(
            law, system, measured, w[seen], delay_s, lag_s
        )
    roll, level = (motions[:, system.output_labels.index(name)] for name in ("roll_rad", "level_m"))
    return MotionInSea(*(rms(answer, wave_moment) for answer in (roll, level, pressure)))


def require_roll(passive: MotionInSea) -> None:
    """Raise a `CalmSeaError` if the ship with passive tank does not roll."""
    if not passive.roll_rms_rad >= LEAST_ROLL_RAD:
        raise CalmSeaError(
            "the sea does not roll the ship, so no law can be compared: it needs waves, and not "
            "from ahead or astern"
        )


def rms(response: ComplexArray, waves: Harmonics) -> float:
    """Root mean square of a linear response with one value per component, shape (N,)."""
    return float(np.sqrt(np.sum(np.square(np.abs(response) * waves.amplitude)) / 2))


def roll_response_without_tank(ship: RollShip, frequency_rad_s: FloatArray) -> ComplexArray:
    """Roll of the ship alone per wave moment, rad/(N m), shape (N,)."""
    w = np.asarray(frequency_rad_s)
    impedance: ComplexArray = (
        ship.stiffness_nm_rad - ship.inertia_kg_m2 * w**2 + 1j * ship.damping_nms_rad * w
    )
    return 1 / impedance
