"""Realization of a sea: long-crested or short-crested wave components at a ship.

Ship-fixed horizontal axes, x forward and y to starboard, origin at the centre of gravity. A
component travels in direction `heading_rad` from the x axis towards y and raises the surface by::

    zeta = a cos(omega_e t - k (x cos(heading) + y sin(heading)) + phase)

The transverse wave slope is positive like roll, starboard down: -d zeta / dy =
k a sin(heading) cos(omega_e t + phase + pi/2) at the centre of gravity. A small ship on a long wave
aligns with the surface, so the wave moment is the restoring stiffness times an effective slope::

    K = k1 r(k, heading) k a sin(heading) cos(omega_e t + phase + pi/2)

Encounter frequency of a ship under way in deep water.

A wave of frequency omega has wave number k = omega^2 / g. A ship at speed U meets it at::

    omega_e = omega - k U cos(heading)

`heading` is the direction of wave travel relative to the ship's course: 0 following, pi head,
+pi/2 from port to starboard. In a following sea omega_e is zero for a wave of the ship's speed, and
negative for a wave that the ship overtakes.

A sea that changes from one spectrum to the next while the ship sails through it.

The components keep their frequency and phase; energy and direction change linearly in time, so that
at each moment the sea is Gaussian with the interpolated spectrum.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated, Final

import numpy as np

from utank_hil.base.arrays import ComplexArray, FloatArray
from utank_hil.base.elementary import angles_of, each, exp, log, phasors, sines_cosines, sizes
from utank_hil.base.parameters import Checked, NotNegative, Range
from utank_hil.dynamics.tank import GRAVITY_M_S2
from utank_hil.sea.harmonics import Harmonics
from utank_hil.sea.spectrum import Spectrum


def wavenumber_rad_m(omega_rad_s: FloatArray) -> FloatArray:
    """Deep-water wave number omega^2 / g in rad/m."""
    omega = np.asarray(omega_rad_s, dtype=float)
    wavenumber: FloatArray = omega * omega / GRAVITY_M_S2
    return wavenumber


def encounter_frequency(
    omega_rad_s: FloatArray, heading_rad: FloatArray | float, speed_m_s: float
) -> FloatArray:
    """Signed encounter frequency, rad/s, broadcast; negative where the ship overtakes the wave."""
    omega = np.asarray(omega_rad_s, dtype=float)
    return (
        omega
        - wavenumber_rad_m(omega)
        * speed_m_s
        * sines_cosines(np.asarray(heading_rad, dtype=float))[1]
    )


BEAM_RAD = math.pi / 2  # These waves travel from port to starboard.
COMPONENTS = 512  #: Of a sea. Chosen; no study.


MOST_SLOPE_SHARE: Final = 2.0
"""Twice the long-wave limit of a hull that follows the slope; a larger value is no share."""


@dataclass(frozen=True, slots=True)
class EffectiveSlope(Checked, owner="effective slope"):
    """Ratio r of effective to true wave slope.

    r = coefficient * exp(-k depth) * sinc(k ``|sin(heading)|`` beam / 2), sinc(x) = sin(x) / x.
    """

    #: Effective wave slope coefficient, the long-wave limit of r.
    coefficient: Annotated[float, Range(least=0, most=MOST_SLOPE_SHARE)] = 1.0
    depth_m: NotNegative = 0.0  #: Depth for the Smith effect, usually half the draught.
    beam_m: NotNegative = 0.0  #: Beam over which the slope is averaged; much shorter waves cancel.

    def factor(self, wavenumber_rad_m: FloatArray, heading_rad: FloatArray) -> FloatArray:
        """Return the ratio r per component."""
        across = wavenumber_rad_m * np.abs(sines_cosines(heading_rad)[0]) * self.beam_m / 2
        smith = each(exp, -wavenumber_rad_m * self.depth_m)
        averaged = np.divide(sines_cosines(across)[0], across, where=across > 0, out=across + 1)
        ratio: FloatArray = self.coefficient * smith * averaged
        return ratio

    def moment(
        self, omega_rad_s: FloatArray, heading_rad: FloatArray, stiffness_nm_rad: float
    ) -> ComplexArray:
        """Roll moment in N m per m of wave amplitude; its argument is the lead on the crest."""
        wavenumber = wavenumber_rad_m(omega_rad_s)
        slope = wavenumber * sines_cosines(heading_rad)[0] * self.factor(wavenumber, heading_rad)
        return np.asarray(1j * stiffness_nm_rad * slope, dtype=np.complex128)


@dataclass(frozen=True, slots=True, eq=False)
class Sea:
    """Wave components at a ship; created by `Sea.irregular` or `Sea.regular`."""

    #: amplitude_m, omega_rad_s, heading_rad, phase_rad: shape (N,): amplitude, earth-frame
    #: frequency, direction of travel relative to the ship, phase.
    amplitude_m: FloatArray
    omega_rad_s: FloatArray
    heading_rad: FloatArray
    phase_rad: FloatArray
    speed_m_s: float = 0.0  #: Speed of the ship.

    @classmethod
    def regular(
        cls,
        amplitude_m: float,
        omega_rad_s: float,
        *,
        heading_rad: float = BEAM_RAD,
        speed_m_s: float = 0.0,
        phase_rad: float = 0.0,
    ) -> "Sea":
        """One regular wave, by default with a crest at the ship at t = 0."""
        if not (amplitude_m >= 0 and omega_rad_s > 0):
            raise ValueError(
                "a regular wave needs amplitude_m zero or more and omega_rad_s greater than zero, "
                f"got {amplitude_m} and {omega_rad_s}"
            )
        return cls(
            np.array([amplitude_m]),
            np.array([omega_rad_s]),
            np.array([heading_rad]),
            np.array([phase_rad]),
            speed_m_s,
        )

    @classmethod
    def irregular(
        cls,
        spectrum: Spectrum,
        seed: int,
        *,
        components: int = COMPONENTS,
        heading_rad: FloatArray | float = BEAM_RAD,
        spreading: float | None = None,
        speed_m_s: float = 0.0,
    ) -> "Sea":
        """Draw a sea from a spectrum: the same seed gives the same sea.

        The spectrum is divided into `components` intervals of equal integral of sqrt(S). Each has
        one component with the energy of the interval, a frequency drawn from the spectrum within
        it, and a uniform phase. So every sea has exactly the variance m0, the mean over seeds has
        exactly the spectrum, and the sea does not repeat, since no frequencies are commensurate.

        ValueError is raised if the spectrum has no energy or an argument is out of range.

        Parameters
        ----------
        seed : int
            Zero or more. The random numbers are the raw stream of `numpy.random.PCG64`, which is
            the same in every numpy version.
        components : int
            Number of intervals.
        heading_rad : float or ndarray, shape (F,)
            Mean direction of travel relative to the ship, for all bands or for each
            (`Spectrum.heading_rad`): 0 following, pi head, +pi/2 from port to starboard.
        spreading : float, optional
            Exponent s of the short-crested spreading cos^2s(theta / 2) about the mean direction
            (Longuet-Higgins 1963; 10 to 15 for wind sea, 25 and more for swell). By default the
            spread of the spectrum, and long-crested where it has none. Each component has one
            direction, so the sea is ergodic.
        speed_m_s : float
            Speed of the ship.
        """
        energy_m2, omega_rad_s, heading, phase_rad = drawn_components(
            [spectrum], seed, components, [heading_rad], spreading
        )
        return cls(np.sqrt(2 * energy_m2[0]), omega_rad_s, heading[0], phase_rad, speed_m_s)

    @property
    def encounter_rad_s(self) -> FloatArray:
        """Signed encounter frequencies; negative where the ship overtakes the wave."""
        return encounter_frequency(self.omega_rad_s, self.heading_rad, self.speed_m_s)

    def harmonics(self, amplitude: ComplexArray) -> Harmonics:
        """Return a quantity with complex amplitudes, whose arguments are leads on the crest."""
        return self._harmonics(sizes(amplitude), angles_of(amplitude))

    @property
    def elevation(self) -> Harmonics:
        """Surface elevation at the ship's centre of gravity in m."""
        return self._harmonics(self.amplitude_m, 0.0)

    @property
    def slope(self) -> Harmonics:
        """Wave slope across the ship in rad, positive starboard down."""
        return self.harmonics(self.amplitude_m * slope_per_m(self.omega_rad_s, self.heading_rad))

    def roll_moment(
        self, stiffness_nm_rad: float, effective_slope: EffectiveSlope | None = None
    ) -> Harmonics:
        """Wave moment on roll in N m, of the ship's stiffness; by default of the true slope."""
        slope = effective_slope or EffectiveSlope()
        moment = slope.moment(self.omega_rad_s, self.heading_rad, stiffness_nm_rad)
        return self.harmonics(self.amplitude_m * moment)

    def _harmonics(self, amplitude: FloatArray, lead_rad: FloatArray | float) -> Harmonics:
        encounter = self.encounter_rad_s
        phase = self.phase_rad + lead_rad
        # The cosine is even: a negative frequency is a positive one with reversed phase.
        return Harmonics(amplitude, np.abs(encounter), np.where(encounter < 0, -phase, phase))


def slope_per_m(omega_rad_s: FloatArray, heading_rad: FloatArray) -> ComplexArray:
    """Complex wave slope across the ship per m of amplitude, positive starboard down."""
    slope = wavenumber_rad_m(omega_rad_s) * sines_cosines(heading_rad)[0]
    return np.asarray(1j * slope, dtype=np.complex128)


def drawn_components(
    spectra: Sequence[Spectrum],
    seed: int,
    components: int,
    heading_rad: Sequence[FloatArray | float],
    spreading: float | None,
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Return components common to several spectra; for one alone see `Sea.irregular`.

    The intervals are those of the mean of the spectra, each normalized to a total of one.

    Returns variances in m^2, frequencies, headings and phases, of shapes (K, N), (N,), (K, N) and
    (N,) for K spectra.
    """
    if components < 1:
        raise ValueError(f"a sea needs one component or more, got {components}")
    if any(spectrum.moment(0) == 0 for spectrum in spectra):
        raise ValueError("the spectrum holds no energy: choose another hour")
    if spreading is not None and not (math.isfinite(spreading) and spreading >= 0):
        raise ValueError(f"spreading exponent must be zero or more, got {spreading}")
    within, phase, order, across = uniform_numbers(seed, (4, components))
    edges = np.unique([edge for each in spectra for edge in each.band_edges_hz.ravel()])
    energy = np.stack([_energy_below(each, edges) for each in spectra])
    share = (energy / energy[:, -1:]).mean(axis=0)
    root_density = np.sqrt(np.diff(share) / np.diff(edges))
    root_integral = np.concatenate([[0.0], np.cumsum(root_density * np.diff(edges))])
    cuts = np.interp(np.linspace(0, root_integral[-1], components + 1), root_integral, edges)
    share_at_cuts = np.interp(cuts, edges, share)
    frequency = np.interp(share_at_cuts[:-1] + within * np.diff(share_at_cuts), share, edges)
    energies = np.diff(np.stack([np.interp(cuts, edges, each) for each in energy]))
    # Stratified sampling makes one draw per quantile interval, in random order.
    quantile = (np.argsort(order) + across) / components
    headings = np.stack(
        [
            _heading_at(frequency, *pair, quantile if spreading is None else None)
            for pair in zip(spectra, heading_rad, strict=True)
        ]
    )
    if spreading is not None:
        headings = headings + _spread(quantile, spreading)
    return energies, 2 * np.pi * frequency, headings, 2 * np.pi * phase


def _energy_below(spectrum: Spectrum, edges_hz: FloatArray) -> FloatArray:
    """Variance of the waves below each frequency."""
    own = spectrum.band_edges_hz
    per_band = spectrum.density * (own[:, 1] - own[:, 0])
    total = np.concatenate([[0.0], np.cumsum(per_band)])
    # The spectrum is constant between bands that leave a gap.
    below = np.column_stack([total[:-1], total[1:]])
    return np.asarray(np.interp(edges_hz, own.ravel(), below.ravel()), dtype=float)


def _heading_at(
    frequency_hz: FloatArray,
    spectrum: Spectrum,
    heading_rad: FloatArray | float,
    quantile: FloatArray | None,
) -> FloatArray:
    """Return the direction of each component; `quantile` draws it from the measured spread."""
    mean: FloatArray = np.broadcast_to(np.asarray(heading_rad, dtype=float), spectrum.density.shape)
    upper = spectrum.band_edges_hz[:, 1]
    band = np.clip(np.searchsorted(upper, frequency_hz), 0, len(upper) - 1)
    heading = np.asarray(mean[band], dtype=float)
    if spectrum.spread is None or spectrum.direction_from_deg is None or quantile is None:
        return heading
    return heading + spectrum.spread.offset_rad(spectrum.direction_from_deg, band, quantile)


def uniform_numbers(seed: int, shape: tuple[int, int]) -> FloatArray:
    """Return uniform random numbers in [0, 1) from the top 53 bits of PCG64's raw output."""
    raw = np.random.PCG64(seed).random_raw(shape)
    return (raw >> np.uint64(11)).astype(np.float64) * 2.0**-53


def _spread(probability: FloatArray, exponent: float) -> FloatArray:
    """Quantiles of the density cos^2s(theta / 2) on (-pi, pi)."""
    theta = np.linspace(-np.pi, np.pi, 8193)
    cosine = np.maximum(sines_cosines(theta / 2)[1], 1e-300)  # zero at the ends
    density = each(exp, 2 * exponent * each(log, cosine))
    cumulative = np.concatenate([[0.0], np.cumsum(density[1:] + density[:-1])])
    return np.interp(probability, cumulative / cumulative[-1], theta)


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
