"""Gusts about the steady wind, as roll moments that no course of the ship changes.

The spectrum of the wind's speed along its mean direction is that of NPD (ISO 19901-1:2015, A.7.4),
of the mean U of an hour at 10 m and of a height z::

    S(f) = 320 (U / 10)^2 (z / 10)^0.45 / (1 + x^n)^(5 / (3 n)),   n = 0.468
    x = 172 f (z / 10)^(2/3) (U / 10)^(-3/4)                       in m^2/s^2 per Hz

The moment goes with the square of the speed. Of (U + u)^2 the part 2 U u is kept, as by Davenport
(1961); u^2 would add its variance over U^2, some 1 %, to the mean. Gusts that are smaller than the
windage A act on a part of it alone, by the aerodynamic admittance of Vickery (1965)::

    X(f) = 1 / (1 + (2 f sqrt(A) / U)^(4/3))
"""

import math
from typing import Annotated, Final

import numpy as np

from utank_hil.base.arrays import FloatArray
from utank_hil.base.elementary import each, exp, log
from utank_hil.base.parameters import NotNegative, Range
from utank_hil.configuration import Section
from utank_hil.sea import Harmonics
from utank_hil.sea.sea import uniform_numbers

COMPONENTS: Final = 128  #: Of the gusts: 16 in an octave.
BAND_HZ: Final = (1 / 600, 0.5)
"""Gusts of 2 s to 10 minutes; slower ones are changes of the steady wind. The standard holds from
1/2400 to 0.5 Hz."""
_N: Final = 0.468


def _power(base: FloatArray, exponent: float) -> FloatArray:
    return each(exp, exponent * each(log, base))


class Gusts(Section):
    """Gusts of the steady wind that ``wind_moment_nm`` belongs to."""

    mean_speed_m_s: Annotated[float, Range(least=1, most=80)]  #: Mean of an hour, 10 m high.
    height_m: Annotated[float, Range(least=1, most=100)] = 10.0
    """Height of the centre of the windage above the sea."""
    windage_m2: NotNegative = 0.0
    """Lateral area above the water, over which small gusts cancel; without it none do."""

    def speed_density(self, frequency_hz: FloatArray) -> FloatArray:
        """Spectral density of the wind's speed in m^2/s^2 per Hz."""
        mean, height = self.mean_speed_m_s / 10, self.height_m / 10
        scale = 172 * exp(2 / 3 * log(height) - 0.75 * log(mean))
        shape = _power(1 + _power(scale * frequency_hz, _N), 5 / (3 * _N))
        return 320 * mean * mean * exp(0.45 * log(height)) / shape

    def admittance(self, frequency_hz: FloatArray) -> FloatArray:
        """Share of a gust that acts on the whole windage."""
        if self.windage_m2 == 0:
            return np.ones_like(frequency_hz)
        reduced = 2 * frequency_hz * math.sqrt(self.windage_m2) / self.mean_speed_m_s
        return 1 / (1 + _power(reduced, 4 / 3))

    def moment(self, steady_nm: float, seed: int) -> Harmonics:
        """Roll moment of the gusts about the steady moment, drawn by a seed.

        A component's frequency is drawn in a band of its own, all bands as wide in proportion.
        """
        low, high = BAND_HZ
        ratio = log(high / low) * np.arange(COMPONENTS + 1) / COMPONENTS
        edges = low * each(exp, ratio)
        within, phase = uniform_numbers(seed, (2, COMPONENTS))
        width = np.diff(edges)
        frequency = edges[:-1] + within * width
        speed = np.sqrt(2 * self.speed_density(frequency) * width)
        amplitude = 2 * steady_nm / self.mean_speed_m_s * speed * self.admittance(frequency)
        return Harmonics(amplitude, 2 * np.pi * frequency, 2 * np.pi * phase)
