"""The roll moment of the waves as a spectrum over encounter frequency.

The moment is given per roll stiffness of the ship, as an angle: the effective wave slope (`Sea`).
This is sufficient for a law. The wave height follows from an assumed ratio of effective to true
slope and an assumed direction.
"""

import math
from dataclasses import dataclass

import numpy as np

from utank_hil.base.arrays import FloatArray
from utank_hil.dynamics.tank import GRAVITY_M_S2


@dataclass(frozen=True, slots=True, eq=False)
class SlopeSpectrum:
    """Density of the effective wave slope in bands of equal width.

    ValueError is raised if the shapes differ, the frequencies are not equally spaced, or a value is
    negative or not finite.
    """

    #: shape (F,): centres of the bands: encounter frequencies, positive and equally spaced, F > 1.
    omega_rad_s: FloatArray
    density: FloatArray  #: shape (F,): one-sided density in rad^2 per rad/s, zero or more.
    #: shape (F,): standard deviation of each density, by default zero.
    deviation: FloatArray | None = None

    def __post_init__(self) -> None:
        omega, density = self.omega_rad_s, self.density
        if omega.ndim != 1 or omega.size < 2 or density.shape != omega.shape:
            raise ValueError(
                "a slope spectrum needs two or more frequencies and as many densities, got shapes "
                f"{omega.shape} and {density.shape}"
            )
        steps = np.diff(omega)
        if not (omega[0] > 0 and steps[0] > 0 and np.allclose(steps, steps[0], rtol=1e-6)):
            raise ValueError("slope spectrum omega_rad_s must be positive and equally spaced")
        for name, values in (("density", density), ("deviation", self.deviation)):
            if values is not None and not (
                values.shape == omega.shape and np.isfinite(values).all() and np.all(values >= 0)
            ):
                raise ValueError(
                    f"slope spectrum {name} must be finite, zero or more, one per frequency"
                )

    @property
    def band_rad_s(self) -> float:
        """Width of a band."""
        return float(self.omega_rad_s[1] - self.omega_rad_s[0])

    @property
    def rms_rad(self) -> float:
        """Root mean square of the effective slope."""
        return math.sqrt(float(self.density.sum()) * self.band_rad_s)

    @property
    def tp_s(self) -> float:
        """Encounter period of the greatest density; nan without energy."""
        peak = int(np.argmax(self.density))
        return 2 * math.pi / float(self.omega_rad_s[peak]) if self.density[peak] > 0 else math.nan

    def slope_density(self, omega_rad_s: FloatArray) -> FloatArray:
        """One-sided density of the effective wave slope in rad^2 per rad/s, at other frequencies.

        It is linear between the centres, and zero outside of the bands.
        """
        return np.interp(omega_rad_s, self.omega_rad_s, self.density, left=0.0, right=0.0)

    def elevation_density(self, effective_slope: float) -> FloatArray:
        """One-sided density of the surface elevation in each band, m^2 per rad/s.

        It holds for beam waves in deep water and a ship without speed; `effective_slope` is the
        ratio of effective to true wave slope.
        """
        per_height = effective_slope * self.omega_rad_s**2 / GRAVITY_M_S2
        density: FloatArray = self.density / per_height**2
        return density

    def hs_m(self, effective_slope: float) -> float:
        """Significant wave height of `elevation_density`."""
        return 4 * math.sqrt(float(self.elevation_density(effective_slope).sum()) * self.band_rad_s)
