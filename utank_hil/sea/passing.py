"""A sea that changes from one spectrum to the next while the ship sails through it.

The components keep their frequency and phase; energy and direction change linearly in time, so that
at each moment the sea is Gaussian with the interpolated spectrum.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from utank_hil.base.arrays import FloatArray
from utank_hil.base.elementary import angles_of, phasors
from utank_hil.sea.sea import COMPONENTS, Sea, drawn_components
from utank_hil.sea.spectrum import Spectrum


@dataclass(frozen=True, slots=True, eq=False)
class PassingSea:
    """Wave components whose energy and direction change with time."""

    #: shape (K,): times of the K spectra, increasing; before and after, the sea is constant.
    time_s: FloatArray
    energy_m2: FloatArray  #: shape (K, N): variance of each component.
    #: shape (K, N): direction of travel relative to the ship's initial course.
    heading_rad: FloatArray
    #: omega_rad_s, phase_rad: shape (N,): earth-frame frequency, and phase at the ship at time 0.
    omega_rad_s: FloatArray
    phase_rad: FloatArray

    @classmethod
    def of(cls, sea: Sea) -> "PassingSea":
        """Return a sea that does not change."""
        energy_m2, heading_rad = np.square(sea.amplitude_m[None]) / 2, sea.heading_rad[None]
        return cls(np.zeros(1), energy_m2, heading_rad, sea.omega_rad_s, sea.phase_rad)

    @classmethod
    def drawn(
        cls,
        time_s: Sequence[float],
        spectra: Sequence[Spectrum],
        seed: int,
        *,
        heading_rad: Sequence[FloatArray | float],
        spreading: float | None = None,
        components: int = COMPONENTS,
    ) -> "PassingSea":
        """Draw the components as `Sea.irregular` does, common to all spectra.

        `time_s` are the times of the spectra. `heading_rad` is the mean direction of travel of each
        spectrum, for all bands or, shape (F,), for each. Other arguments are those of
        `Sea.irregular`. ValueError is raised if a spectrum has no energy or an argument is out of
        range.
        """
        energy_m2, omega_rad_s, heading, phase_rad = drawn_components(
            spectra, seed, components, heading_rad, spreading
        )
        return cls(np.asarray(time_s, dtype=float), energy_m2, heading, omega_rad_s, phase_rad)

    def at(self, time_s: float) -> tuple[FloatArray, FloatArray]:
        """Return amplitude in m and direction in rad of each component at a time."""
        after = int(np.searchsorted(self.time_s, time_s, side="right"))
        if after in (0, len(self.time_s)):
            index = min(after, len(self.time_s) - 1)
            return np.sqrt(2 * self.energy_m2[index]), self.heading_rad[index]
        start_s, end_s = self.time_s[after - 1 : after + 1]
        share = (time_s - start_s) / (end_s - start_s)
        before, later = (1 - share) * self.energy_m2[after - 1], share * self.energy_m2[after]
        # A direction without energy has no weight.
        headings = self.heading_rad[after - 1], self.heading_rad[after]
        flow = phasors(before, headings[0]) + phasors(later, headings[1])
        return np.sqrt(2 * (before + later)), angles_of(flow)
