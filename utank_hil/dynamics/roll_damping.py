"""Roll damping of a hull without a decay test: the regression of Ikeda's method.

Kawahara, Maekawa and Ikeda, *A Simple Prediction Formula of Roll Damping of Conventional Cargo
Ships on the Basis of Ikeda's Method and Its Limitation*, STAB 2009, from main particulars at zero
speed. The coefficients below are those of the authors' program. A coefficient is made non-
dimensional by ``rho V B^2 sqrt(2 g / B)``.

How good it is: a bare tanker measured 1.62e-3 at 9 degrees where this gives 2.53e-3, and Ikeda's
full method 1.07e-3. So an estimate carries a factor of 1.5 either way, outside the
regression's ranges 2.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from utank_hil.dynamics.tank import GRAVITY_M_S2

WATER_KG_M3: Final = 1025.0
_2G: Final = 2 * GRAVITY_M_S2
_VISCOSITY_M2_S: Final = 1.14e-6
"""Kinematic viscosity of the authors' program, fresh water at 15 degrees."""
RANGES: Final = {
    "beam per draught": (2.5, 4.5),
    "block coefficient": (0.5, 0.85),
    "midship coefficient": (0.9, 0.99),
    "roll axis below the waterline per draught": (-1.5, 0.2),
    "roll frequency times sqrt(beam / 2 g)": (0.1, 1.0),
    "keel breadth per beam": (0.01, 0.06),
    "keel length per length": (0.05, 0.4),
}
"""Ranges of the regression."""
# rows: powers of the block coefficient; columns: of beam per draught; the highest first
_A11: Final = (
    (-0.002222, 0.040871, -0.286866, 0.599424),
    (0.010185, -0.161176, 0.904989, -1.641389),
    (-0.015422, 0.220371, -1.084987, 1.834167),
)
_A12: Final = (
    (-0.0628667, 0.4989259, 0.52735, -10.7918672, 16.616327),
    (0.1140667, -0.8108963, -2.2186833, 25.1269741, -37.7729778),
    (-0.0589333, 0.2639704, 3.1949667, -21.8126569, 31.4113508),
    (0.0107667, 0.0018704, -1.2494083, 6.9427931, -10.2018992),
)
_A13: Final = (
    (0.192207, -2.787462, 12.507855, -14.764856),
    (-0.350563, 5.222348, -23.974852, 29.007851),
    (0.237096, -3.535062, 16.368376, -20.539908),
    (-0.067119, 0.966362, -4.407535, 5.894703),
)
_AA11: Final = (
    (17.945, -166.294, 489.799, -493.142),
    (-25.507, 236.275, -698.683, 701.494),
    (9.077, -84.332, 249.983, -250.787),
)
_AA12: Final = (
    (-16.872, 156.399, -460.689, 463.848),
    (24.015, -222.507, 658.027, -660.665),
    (-8.56, 79.549, -235.827, 236.579),
)
# rows: powers of the block coefficient; columns: of the axis' height, 1 - OG / d
_A3: Final = (
    (-7686.0287, 61639.9103, -130677.4903, -110034.6584, 709672.0656, -822735.9289, 299122.8727),
    (30131.5678, -241201.0598, 507996.2604, 446051.22, -2803850.2395, 3238899.7308, -1175773.1606),
    (-49048.9664, 392579.5937, -826728.7127, -724186.4643, 4553780.5017, -5256636.5472,
     1907356.1357),
    (42480.7709, -340629.4699, 722677.104, 599411.9264, -3888378.9905, 4500543.147, -1634256.8172),
    (-20665.147, 166348.6917, -358360.7392, -264294.7189, 1839829.259, -2143487.3508, 780020.9393),
    (5355.2035, -43358.7938, 95501.4948, 58039.7328, -457313.6939, 538548.1194, -196679.7143),
    (-577.8827, 4714.7918, -10682.8619, -4774.6414, 46600.823, -55751.1528, 20467.0904),
)  # fmt: skip
_AA3: Final = (
    -1.05584, 12.688, -63.70534, 172.84571, -274.05701, 257.68705, -141.40915, 44.13177, -7.1654,
)  # fmt: skip


@dataclass(frozen=True, slots=True)
class HullForm:
    """Main particulars of a hull, as far as they decide about its roll damping."""

    length_m: float  #: Between perpendiculars.
    beam_m: float  #: At the waterline.
    draught_m: float  #: Mean.
    block_coefficient: float
    midship_coefficient: float
    axis_below_water_m: float  #: Centre of gravity below the waterline, OG = d - KG.
    keel_length_m: float = 0.0  #: Of one bilge keel; 0 for a bare hull.
    keel_breadth_m: float = 0.0

    @classmethod
    def usual(
        cls, length_m: float, beam_m: float, draught_m: float, displacement_t: float, gm_m: float
    ) -> "HullForm":
        """Return the form of a usual hull of these figures, with usual bilge keels.

        Midship coefficient by Kerlen, centre of buoyancy by Normand, inertia of the waterline by
        Schneekluth and Bertram, *Ship Design for Efficiency and Economy* (1998); keels of 0.3 of
        the length and 0.02 of the beam, the middle of the regression's ranges.
        """
        volume_m3 = 1e3 * displacement_t / WATER_KG_M3
        block = volume_m3 / (length_m * beam_m * draught_m)
        midship = max(1.006 - 0.0056 * block**-3.56, 0.5)
        waterline = (1 + 2 * block) / 3
        buoyancy_m = draught_m * (0.9 - 0.3 * midship - 0.1 * block)
        inertia_m4 = length_m * beam_m**3 / 12 * (0.096 + 0.89 * waterline**2)
        kg_m = buoyancy_m + inertia_m4 / volume_m3 - gm_m
        keels_m = 0.3 * length_m, 0.02 * beam_m
        return cls(length_m, beam_m, draught_m, block, midship, draught_m - kg_m, *keels_m)

    @property
    def volume_m3(self) -> float:
        """Displaced volume."""
        return self.length_m * self.beam_m * self.draught_m * self.block_coefficient

    @property
    def unit_nms_rad(self) -> float:
        """Roll damping whose non-dimensional value is 1."""
        return WATER_KG_M3 * self.volume_m3 * self.beam_m**2 / math.sqrt(self.beam_m / _2G)

    def outside(self, frequency_rad_s: float) -> list[str]:
        """Return what lies outside the regression's ranges, in words."""
        found = dict(zip(RANGES, self._ratios(frequency_rad_s), strict=True))
        if not self.keel_breadth_m:
            del found["keel breadth per beam"], found["keel length per length"]
        return [
            f"{name} {value:.3g}, made for {RANGES[name][0]:g} to {RANGES[name][1]:g}"
            for name, value in found.items()
            if not RANGES[name][0] <= value <= RANGES[name][1]
        ]

    def _ratios(self, frequency_rad_s: float) -> tuple[float, ...]:
        return (
            self.beam_m / self.draught_m,
            self.block_coefficient,
            self.midship_coefficient,
            self.axis_below_water_m / self.draught_m,
            frequency_rad_s * math.sqrt(self.beam_m / _2G),
            self.keel_breadth_m / self.beam_m,
            self.keel_length_m / self.length_m,
        )


@dataclass(frozen=True, slots=True)
class RollDamping:
    """Non-dimensional equivalent roll damping by its parts."""

    friction: float
    wave: float
    eddy: float
    keels: float

    @property
    def total(self) -> float:
        """Sum of the parts."""
        return self.friction + self.wave + self.eddy + self.keels


def estimated_roll_damping(
    hull: HullForm, amplitude_rad: float, frequency_rad_s: float
) -> RollDamping:
    """Estimate the equivalent damping of a roll of one amplitude and frequency at zero speed.

    A ratio outside its range counts as the range's end: the polynomials say nothing beyond.
    """
    bd, cb, cm, ogd, omega, breadth, length = (
        min(max(ratio, least), most)
        for ratio, (least, most) in zip(hull._ratios(frequency_rad_s), RANGES.values(), strict=True)
    )
    degrees = math.degrees(amplitude_rad)
    return RollDamping(
        _friction(hull, amplitude_rad, frequency_rad_s),
        _wave(bd, cb, cm, ogd, omega),
        _eddy(bd, cb, cm, ogd) * omega * amplitude_rad,
        _keels(bd, cb, cm, ogd, breadth, length, degrees) * omega if hull.keel_breadth_m else 0.0,
    )


def _friction(hull: HullForm, amplitude_rad: float, frequency_rad_s: float) -> float:
    """Kato's formula for a laminar layer."""
    cb, draught_m = hull.block_coefficient, hull.draught_m
    lever_m = (0.887 + 0.145 * cb) * (1.7 * draught_m + cb * hull.beam_m)
    lever_m = (lever_m - 2 * hull.axis_below_water_m) / math.pi
    wetted_m2 = hull.length_m * (1.75 * draught_m + cb * hull.beam_m)
    period_s = 2 * math.pi / frequency_rad_s
    reynolds = 3.22 * (lever_m * amplitude_rad) ** 2 / (period_s * _VISCOSITY_M2_S)
    moment = 4 / (3 * math.pi) * wetted_m2 * lever_m**3 * amplitude_rad * frequency_rad_s
    made_of = hull.volume_m3 * hull.beam_m**2
    return 1.328 / math.sqrt(reynolds) * moment / made_of * math.sqrt(hull.beam_m / _2G)


def _polynomial(coefficients: Sequence[float], at: float) -> float:
    """Polynomial, the highest power first."""
    return float(np.polyval(np.array(coefficients), at))


def _of_both(table: tuple[tuple[float, ...], ...], outer: float, inner: float) -> float:
    """Polynomial in `outer` whose coefficients are polynomials in `inner`."""
    return _polynomial([_polynomial(row, inner) for row in table], outer)


def _wave(bd: float, cb: float, cm: float, ogd: float, omega: float) -> float:
    height = 1 - ogd
    midship = _of_both(_AA11, cb, bd) * cm + _of_both(_AA12, cb, bd)
    a1 = _polynomial([_of_both(table, cb, bd) for table in (_A11, _A12, _A13)], height)
    a1 *= midship * (1 - height) + 1
    a2 = _polynomial((-1.402, 7.189, -10.993, 9.45), height)
    a3 = _of_both(_A3, cb, height) + _wave_shift(bd, cb, height)
    return a1 / omega * math.exp(-a2 * (math.log(omega) - a3) ** 2 / 1.44)


def _wave_shift(bd: float, cb: float, height: float) -> float:
    block = _polynomial((-17.102, 41.495, -33.234, 8.8007), cb) * height
    block += _polynomial((36.566, -89.203, 71.8, -18.108), cb)
    scale = _polynomial((-0.3767, 3.39, -10.356, 11.588), bd) * block
    moved = height - _polynomial((-0.0727, 0.7, -1.2818), bd)
    last = _polynomial((-0.0495, 0.4518, -0.61655), bd)
    return scale * _polynomial((*_AA3, last), moved)


def _eddy(bd: float, cb: float, cm: float, ogd: float) -> float:
    a = (-0.0182 * cb + 0.0155) * (bd - 1.8) ** 3
    a += _polynomial((-79.414, 215.695, -215.883, 93.894, -14.848), cb)
    b1 = (3.98 * cb - 5.1525) * (1.6 - 0.2 * bd) * ogd
    b1 *= _polynomial((0.9717, -1.55, 0.723), cb) * ogd + 0.04567 * cb + 0.9408
    b2 = (0.25 * ogd + 0.95) * ogd + _polynomial((-219.2, 443.7, -283.3, 59.6), cb)
    b3 = -15 * cb * bd + 46.5 * cb + 11.2 * bd - 28.6
    return 4 * a * math.exp(b1 + b2 * cm**b3) / (3 * math.pi * cb * bd**3)


def _keels(
    bd: float, cb: float, cm: float, ogd: float, breadth: float, length: float, degrees: float
) -> float:
    a = (0.3907 - 0.3651 * cb) * (bd - 2.83) ** 2 - 2.21 * cb + 2.632
    a *= _polynomial((0.00255, 0.122, 0.4794), degrees)
    a *= (
        _polynomial((-0.8913, -0.0733, 0), breadth) * length**2
        + _polynomial((5.2857, -0.01185, 0.00189), breadth) * length
    )
    b1 = 5 * breadth + 0.3 * bd - 0.2 * length
    b1 = (b1 + _polynomial((0.00125, -0.0425, -1.86), degrees)) * ogd
    b2 = -15 * breadth + 1.2 * cb - 0.1 * bd + _polynomial((-0.0657, 0.0586, 1.6164), ogd)
    return a * math.exp(b1 + b2 * cm ** (2.5 * ogd + 15.75))
