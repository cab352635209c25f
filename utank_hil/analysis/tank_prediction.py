"""Linear prediction of a ship's roll in a sea: without tank, with passive and with active tank.

The active tank has the law of `first_law`, with weights lowered until twice the RMS of its pressure
and level, their significant amplitudes, are within the limits of pump and tank, beyond which a
linear prediction does not hold.
"""

import math
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from utank_hil.analysis.loop.linear_tuning import LinearDesign, TunedLaw, first_law
from utank_hil.analysis.loop.margins import PERIOD_SCALES, closed_loop_response, of_period
from utank_hil.analysis.loop.sea_response import (
    CalmSeaError,
    MotionInSea,
    at_its_motion,
    at_work,
    motion_in_sea,
    rms,
    roll_response_without_tank,
)
from utank_hil.analysis.loop.self_tuning import NoLawError
from utank_hil.base.arrays import ComplexArray, FloatArray
from utank_hil.control import DesignPlant
from utank_hil.dynamics import STATES, RollShip
from utank_hil.dynamics.pump import Pump, pump_load, pump_speed
from utank_hil.dynamics.tank import negligible
from utank_hil.sea import Harmonics

_BANDS = 40  # Number of bands of the sea's energy in the curves. Chosen; no study.


_NODES: Final = 24  # Quadrature nodes for each variable. Chosen; no study.


@dataclass(frozen=True, slots=True)
class SeaState:
    """A sea and its roll moment on a ship."""

    wave_moment: Harmonics  #: In N m.
    slope_rad: float  #: Significant amplitude of the effective wave slope.
    peak_rad_s: float  #: Peak frequency of the spectrum.

    @classmethod
    def on(cls, ship: RollShip, wave_moment: Harmonics) -> "SeaState":
        """Return the sea that acts on a ship: waves up to twice its roll frequency, and their peak.

        Raises `CalmSeaError` if there are no such waves.
        """
        w, energy = wave_moment.frequency_rad_s, np.square(wave_moment.amplitude)
        most_rad_s = 2 * ship.natural_frequency_rad_s
        bands, edges = np.histogram(w, _BANDS, (0.0, most_rad_s), weights=energy)
        if not bands.any():
            raise CalmSeaError(
                f"the sea has no waves below {most_rad_s:.2g} rad/s, twice the roll frequency, or "
                "none from the side: it does not roll the ship"
            )
        peak = int(bands.argmax())
        slope = 2 * math.sqrt(bands.sum() / 2) / ship.stiffness_nm_rad
        return cls(wave_moment, slope, float(edges[peak : peak + 2].mean()))


@dataclass(frozen=True, slots=True)
class RollPrediction:
    """Root mean squares of the linear motions in one sea."""

    without_tank_rad: float
    passive: MotionInSea
    active: MotionInSea | None  #: None without pump or law.
    #: Shaft power of a pump similar to the first ship's, see `mean_shaft_power_w`.
    mean_power_w: float | None
    law: TunedLaw | None  #: Law of the active tank.
    no_law: str = ""  #: Reason for the absence of a law.

    @property
    def passive_below_no_tank(self) -> float:
        """Reduction of the roll by the passive tank, as a share."""
        return 1 - self.passive.roll_rms_rad / self.without_tank_rad

    @property
    def active_below_passive(self) -> float | None:
        """Reduction of the passive tank's roll by the pump, as a share."""
        if self.active is None:
            return None
        return 1 - self.active.roll_rms_rad / self.passive.roll_rms_rad


@dataclass(frozen=True, slots=True)
class LoadingPoint:
    """Roll in one loading of a ship, with unchanged tank and law."""

    period_scale: float  #: Factor on the roll period, by the stiffness.
    #: without_tank_rad, passive_rad: roll RMS.
    without_tank_rad: float
    passive_rad: float
    active_rad: float | None


@dataclass(frozen=True, slots=True, eq=False)
class RollCurves:
    """Roll over static roll in regular waves, and the distribution of the sea's energy."""

    period_s: FloatArray  #: shape (N,): wave periods.
    #: without_tank, passive: shape (N,)
    without_tank: FloatArray
    passive: FloatArray
    active: FloatArray | None  #: shape (N,)
    #: sea_period_s, sea: shape (M,): energy of the moment in each band over that of the greatest
    #: band.
    sea_period_s: FloatArray
    sea: FloatArray


def roll_curves(plant: DesignPlant, sea: SeaState, law: TunedLaw | None) -> RollCurves:
    """Roll over static roll in regular waves of half to twice the roll period.

    The tank has the loss of its passive motion in the sea.
    """
    ship, plant = plant.ship, at_work(plant, sea.wave_moment)
    own = ship.natural_frequency_rad_s
    w = own * np.geomspace(0.5, 2.0, 300)
    roll = STATES.index("roll_rad")

    def magnified(response: ComplexArray) -> FloatArray:
        size: FloatArray = np.abs(response) * ship.stiffness_nm_rad
        return size

    active = None
    if law is not None:
        measured = law.design.predictor.measured
        motions, _ = closed_loop_response(law.design.law(plant), plant, measured, w)
        active = magnified(motions[:, roll])
    passive, _ = closed_loop_response(None, plant, (), w)
    waves, edges = sea.wave_moment, own * np.geomspace(0.5, 2.0, _BANDS + 1)
    energy, _ = np.histogram(waves.frequency_rad_s, edges, weights=np.square(waves.amplitude))
    density = energy / np.diff(edges)
    return RollCurves(
        period_s=2 * np.pi / w,
        without_tank=magnified(roll_response_without_tank(ship, w)),
        passive=magnified(passive[:, roll]),
        active=active,
        sea_period_s=2 * np.pi / np.sqrt(edges[1:] * edges[:-1]),
        sea=density / max(density.max(), 1e-300),
    )


def predict_roll(plant: DesignPlant, sea: SeaState, *, pump: bool = True) -> RollPrediction:
    """Predict the roll of a ship without, with a passive and, given a pump, an active tank."""
    waves = sea.wave_moment
    without = roll_without_tank(plant, waves)
    passive = motion_in_sea(None, at_its_motion(None, plant, (), waves), (), waves)
    if not pump:
        return RollPrediction(without, passive, None, None, None, "there is no pump")

    def within_limits(design: LinearDesign) -> bool:
        motion = _active(plant, design, waves)
        return (
            2 * motion.pressure_rms_pa <= plant.limits.pressure_pa
            and 2 * motion.level_rms_m <= plant.limits.level_m
        )

    try:
        law = first_law(at_work(plant, waves), sea.slope_rad, sea.peak_rad_s, within_limits)
    except NoLawError as error:
        return RollPrediction(without, passive, None, None, None, str(error))
    active, power_w = _active(plant, law.design, waves), _mean_power_w(plant, law.design, waves)
    return RollPrediction(without, passive, active, power_w, law)


def loading_sensitivity(
    plant: DesignPlant, sea: SeaState, prediction: RollPrediction
) -> tuple[LoadingPoint, ...]:
    """Roll at the other roll periods `PERIOD_SCALES` of the ship, in the same waves.

    Tank and law are unchanged; the wave moment is proportional to the ship's stiffness.
    """
    points = []
    for scale in PERIOD_SCALES:
        ship = of_period(plant.ship, scale)
        waves = replace(sea.wave_moment, amplitude=sea.wave_moment.amplitude / scale**2)
        loaded = replace(plant, ship=ship)
        active = None
        if prediction.law is not None:
            design = prediction.law.design
            active = _active(
                loaded, design, waves, design_plant=at_work(plant, sea.wave_moment)
            ).roll_rms_rad
        points.append(
            LoadingPoint(
                scale,
                roll_without_tank(loaded, waves),
                motion_in_sea(None, at_its_motion(None, loaded, (), waves), (), waves).roll_rms_rad,
                active,
            )
        )
    return tuple(points)


def _active(
    plant: DesignPlant,
    design: LinearDesign,
    waves: Harmonics,
    *,
    design_plant: DesignPlant | None = None,
) -> MotionInSea:
    """Linear motion with a law, which may have been designed for another plant."""
    law = design.law(at_work(design_plant or plant, waves))
    measured = design.predictor.measured
    return motion_in_sea(law, at_its_motion(law, plant, measured, waves), measured, waves)


def roll_without_tank(plant: DesignPlant, waves: Harmonics) -> float:
    """Roll RMS of the ship alone."""
    bare = at_its_motion(None, replace(plant, tank=negligible(plant.tank)), (), waves).ship
    return rms(roll_response_without_tank(bare, waves.frequency_rad_s), waves)


def pump_moments(
    plant: DesignPlant, design: LinearDesign, waves: Harmonics
) -> tuple[float, float, float]:
    """RMS of pressure in Pa and flow in m^3/s, and mean power to the water in W; linear loop."""
    law, measured = design.law(at_work(plant, waves)), design.predictor.measured
    plant = at_its_motion(law, plant, measured, waves)
    w = waves.frequency_rad_s
    seen = (w > 0) & (w < math.pi / law.sample_time_s)
    motions, pressure = closed_loop_response(law, plant, measured, w[seen])
    rate = motions[:, STATES.index("level_rate_m_s")]
    flow = plant.tank.reservoir_area_m2 * rate
    square = waves.amplitude[seen] ** 2 / 2
    return (
        math.sqrt(float(np.sum(np.abs(pressure) ** 2 * square))),
        math.sqrt(float(np.sum(np.abs(flow) ** 2 * square))),
        float(np.sum((pressure * flow.conj()).real * square)),
    )


def _mean_power_w(plant: DesignPlant, design: LinearDesign, waves: Harmonics) -> float:
    """Mean shaft power of a pump for this duct, similar to the first ship's."""
    pump = Pump.for_duct(plant.tank.duct_area_m2, plant.limits.pressure_pa)
    return mean_shaft_power_w(pump, *pump_moments(plant, design, waves))


def mean_shaft_power_w(
    pump: Pump, pressure_rms_pa: float, flow_rms_m3_s: float, water_power_w: float
) -> float:
    """Mean shaft power for Gaussian pressure and flow, with the rotor in equilibrium at each value.

    Power from the water counts as zero, as on the bench. In waves the shaft power is several times
    the mean power `water_power_w` (pressure times flow), because a pump is efficient at its rated
    point, not while pressure or flow changes sign.
    """
    if not (pressure_rms_pa > 0 and flow_rms_m3_s > 0):
        return 0.0
    correlation = min(1.0, max(-1.0, water_power_w / (pressure_rms_pa * flow_rms_m3_s)))
    rest = math.sqrt(1 - correlation**2)
    nodes, weights = np.polynomial.hermite_e.hermegauss(_NODES)
    mean_w = 0.0
    for first, share in zip(nodes.tolist(), weights.tolist(), strict=True):
        if first < 0:
            continue  # the power is symmetric in the sign
        for second, part in zip(nodes.tolist(), weights.tolist(), strict=True):
            pressure_pa = pressure_rms_pa * first
            flow_m3_s = flow_rms_m3_s * (correlation * first + rest * second)
            speed = pump_speed(pressure_pa, flow_m3_s, pump.coefficients)
            torque_nm, _ = pump_load(speed, flow_m3_s, pump.coefficients)
            mean_w += 2 * share * part * max(speed * torque_nm, 0.0)
    return mean_w / math.tau
