"""The robustness that a law must have before it may be armed."""

import dataclasses
from dataclasses import dataclass

from utank_hil.analysis.closed_loop import closed_loop_radius
from utank_hil.analysis.margins import Margins, margins, peak_sensitivity, stability_grid
from utank_hil.control.interface import LinearLaw
from utank_hil.control.ship_design import pump_model
from utank_hil.dynamics.sampling import sample
from utank_hil.dynamics.ship import RollShip
from utank_hil.dynamics.tank import Tank

PEAK_SENSITIVITY = 2.0
EXTRA_DELAY_S = 0.020  # two base ticks
PERIOD_SCALES = (0.7, 0.85, 1.0, 1.15, 1.3)
GAINS = (0.8, 1.0, 1.2)


@dataclass(frozen=True, slots=True)
class Robustness:
    """What a law's loop stands.

    Attributes
    ----------
    nominal : Margins
        On the ship it was designed for.
    late_radius, late_peak_sensitivity : float
        Closed-loop radius and peak sensitivity with `EXTRA_DELAY_S` more delay.
    worst_radius : float
        Greatest closed-loop radius over `PERIOD_SCALES` of the ship's roll period and `GAINS` of
        the pump.
    worst_period_scale, worst_gain : float
        Where that is.
    """

    nominal: Margins
    late_radius: float
    late_peak_sensitivity: float
    worst_radius: float
    worst_period_scale: float
    worst_gain: float

    def failures(self) -> tuple[str, ...]:
        """What is missing, in words; empty for a law that may be armed.

        What is not a number is missing, too.
        """
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
            found.append(
                f"unstable at {self.worst_period_scale:g} of the ship's roll period with "
                f"{self.worst_gain:g} of the pump's gain"
            )
        return tuple(found)


def robustness(
    law: LinearLaw,
    ship: RollShip,
    tank: Tank,
    measured: tuple[str, ...],
    delay_s: float = 0.05,
    lag_s: float = 0.1,
) -> Robustness:
    """Judge a law on its ship, late, and on a grid of ships and pump gains.

    Parameters
    ----------
    law : LinearLaw
    ship : RollShip
        The roll period is changed through its stiffness.
    tank : Tank
    measured : tuple of str
        Outputs the law sees.
    delay_s, lag_s : float
        As in `sampled_model`.
    """
    model = pump_model(ship, tank, measured)
    late = sample(model, law.sample_time_s, delay_s + EXTRA_DELAY_S, lag_s)
    ships = [
        pump_model(
            dataclasses.replace(ship, stiffness_nm_rad=ship.stiffness_nm_rad / scale**2),
            tank,
            measured,
        )
        for scale in PERIOD_SCALES
    ]
    radii = stability_grid(law, ships, GAINS, delay_s, lag_s)
    row, column = divmod(int(radii.argmax()), len(GAINS))
    return Robustness(
        nominal=margins(law, model, delay_s, lag_s),
        late_radius=closed_loop_radius(law, late),
        late_peak_sensitivity=peak_sensitivity(law, late)[0],
        worst_radius=float(radii[row, column]),
        worst_period_scale=PERIOD_SCALES[row],
        worst_gain=GAINS[column],
    )
