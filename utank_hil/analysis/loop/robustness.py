"""Robustness that a law must have before the pump may be armed."""

import dataclasses
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from utank_hil.analysis.loop.margins import Margins, margins, radius_and_peak, stability_grid
from utank_hil.control import DesignPlant, LinearLaw
from utank_hil.dynamics import RollShip
from utank_hil.dynamics.linear import pump_model
from utank_hil.dynamics.sampling import sample

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
    #: late_radius, late_peak_sensitivity: closed-loop radius and peak sensitivity with
    #: `EXTRA_DELAY_S` more delay.
    late_radius: float
    late_peak_sensitivity: float
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

    The delay margin (`with_delay_margin`) is informative only; no requirement uses it.
    """
    delay_s, lag_s = plant.delay_s, plant.lag_s
    model = plant.model(measured)
    late_radius, late_peak = radius_and_peak(
        law, sample(model, law.sample_time_s, delay_s + EXTRA_DELAY_S, lag_s)
    )
    variants = list(ship_variants(plant.ship))
    systems = [pump_model(variant, plant.tank, measured) for _, _, variant in variants]
    extra_s = (0.0, EXTRA_DELAY_S)
    radii = np.array(
        [stability_grid(law, systems, GAINS, delay_s + extra, lag_s) for extra in extra_s]
    )
    when, which, gain = np.unravel_index(int(radii.argmax()), radii.shape)
    period_scale, inertia_scale, _ = variants[which]
    return Robustness(
        nominal=margins(law, model, delay_s, lag_s, with_delay_margin=with_delay_margin),
        late_radius=late_radius,
        late_peak_sensitivity=late_peak,
        worst_radius=float(radii[when, which, gain]),
        worst_period_scale=period_scale,
        worst_inertia_scale=inertia_scale,
        worst_gain=GAINS[gain],
        worst_extra_delay_s=extra_s[when],
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
