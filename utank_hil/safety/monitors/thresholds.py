"""The thresholds of the monitors: all of them follow from ship, tank, pump and sensors, here.

Symbols: w0 is the water's natural frequency, T its period, to which the tank was tuned and at which
the ship rolls; s a sensor's noise. The smallest roll at which each fault can be detected is in
`docs/monitors.md`.
"""

import math
from dataclasses import dataclass
from typing import Annotated, Final

from utank_hil.base.parameters import Range, range_problems, refuse
from utank_hil.control.interface import DesignPlant
from utank_hil.dynamics.linear import coupled_matrices
from utank_hil.dynamics.nonlinear import RollModel, greatest_held_pa
from utank_hil.dynamics.tank import GRAVITY_M_S2

UNCONFIRMED_SHARE: Final = 0.25
UNCONFIRMED_HEEL_DEG: Final = 0.25
"""Steady heel by a pressure that does little harm, whichever way it presses."""
NOISE_LIMIT: Final = 5.0
"""Noise, in the figures of the sensors, from which a signal counts as degraded."""
STILL: Final = 3.0
"""In the noise of a gauge: a level that stays within this of a value does not move."""
DEGRADED_SHARE: Final = 0.5
"""Of the greatest pressure, or of that which would take the ship to its roll limit if it was held:
nobody knows whether it presses the right way, and a step heels it up to twice as far at first."""
LEAST_ROLL_DEG: Final = 0.2
ROLL_PUSH_AT_W0: Final = 0.6
"""The tank's equation judges from so many degrees RMS on, which push the water by this share of
g L phi at w0: the least of the shipped tanks, the naval vessel's (Patti-B's has 0.93)."""
ZERO_HEEL_DEG: Final = 0.3
"""Steady heel by which motion sensor, gauges and pressure sensor may disagree about the water."""
TURN_G: Final = 0.05
"""Acceleration to the side in the hardest turn over g, which no sensor measures: V^2 / (g R) of a
ship at a Froude number of 0.4 who keeps 0.7 of her speed in a circle of 1.5 lengths' radius."""


@dataclass(frozen=True, slots=True)
class SensorFigures:
    """Noise of the sensors as their makers state it, standard deviations of one sample.

    Ten to twenty times the default at most, at which wrong signs are still found within seconds.
    Below the least, a figure is in another unit.

    Raises `ValueError` if a figure is out of its range.
    """

    roll_noise_rad: Annotated[float, Range(least=1e-6, most=2e-3)] = 2e-4  #: Noise of the roll.
    #: Noise of its rate.
    roll_rate_noise_rad_s: Annotated[float, Range(least=1e-6, most=1e-2)] = 5e-4
    #: Noise of a level gauge.
    level_noise_m: Annotated[float, Range(least=1e-4, most=0.05)] = 0.005

    def __post_init__(self) -> None:
        refuse("sensors", range_problems(self))


@dataclass(frozen=True, slots=True)
class MonitorThresholds:
    """Thresholds of the monitors."""

    tank_period_s: float  #: T, in which the tank's equation is judged.
    #: roll_spike_rad, roll_most_rad_s, rate_spike_rad_s, rate_most_rad_s2: of roll and of its rate;
    #: a sample further than the first from the last one, and than the second a second more, is
    #: discarded.
    roll_spike_rad: float
    roll_most_rad_s: float
    rate_spike_rad_s: float
    rate_most_rad_s2: float
    #: level_spike_m, level_most_m_s: the same of the levels.
    level_spike_m: float
    level_most_m_s: float
    #: roll_noise_rad, rate_noise_rad_s, level_noise_m: noise at which the signals count as
    #: degraded.
    roll_noise_rad: float
    rate_noise_rad_s: float
    level_noise_m: float
    drift_rad: float  #: Roll that the integrated rate does not account for.
    roll_still_rad: float  #: A roll that stays within this of a value does not move.
    level_still_m: float  #: The same of the level.
    volume_m: float  #: Sum of both levels.
    #: least_roll_push_m2_s2, least_pump_push_m2_s2: root mean square of the push on the water, as
    #: pressure over density, below which the tank's equation says nothing.
    least_roll_push_m2_s2: float
    least_pump_push_m2_s2: float
    gauge_push_m2_s2: float  #: Push that would hold the level off by the noise of a sample.
    zero_push_m2_s2: float  #: Constant push that the sensors' zeros may feign, all together.
    steady_push_m2_s2: float  #: Constant push by these zeros and a hard turn.
    motion_late_s: float  #: Delay of the motion sensor.
    pressure_error_pa: float  #: Error of the pump's pressure against the model of the drive.
    free_rotor_pa_m: float  #: Pressure of a pump that is off, per level, that is excused besides.
    pressure_limit_pa: float  #: Greatest command.
    #: Share of the pressure until the water was seen to move as roll and pressure push it.
    unconfirmed_share: float
    degraded_share: float  #: Share while a sensor or the drive is in doubt.
    #: Root mean square of the roll below which it is not compared with the twin's.
    amplified_roll_rad: float
    of_hull: bool  #: Whether hull data say that the ship may be a wide one that sways.


def thresholds_of(
    plant: DesignPlant, roll_limit_rad: float, sensors: SensorFigures, *, of_hull: bool = False
) -> MonitorThresholds:
    """The thresholds: nothing moves faster than the greatest controlled roll does at 2 w0."""
    tank, limits = plant.tank, plant.limits
    frequency_rad_s = tank.natural_frequency_rad_s
    fastest_rad_s = 2 * frequency_rad_s
    roll_s, rate_s = sensors.roll_noise_rad, sensors.roll_rate_noise_rad_s
    roll_push_m2_s2 = math.radians(LEAST_ROLL_DEG) * ROLL_PUSH_AT_W0 * GRAVITY_M_S2 * tank.width_m
    model = RollModel(plant.ship, tank)
    held_pa = greatest_held_pa(model, limits.pressure_pa, roll_limit_rad)
    # the noise of 15 s of integrated rate, and of the roll itself
    drift_s = math.sqrt(roll_s * roll_s + 0.01 * 7.5 * rate_s * rate_s)
    return MonitorThresholds(
        tank_period_s=2 * math.pi / frequency_rad_s,
        roll_spike_rad=30 * roll_s,
        roll_most_rad_s=roll_limit_rad * fastest_rad_s,
        rate_spike_rad_s=30 * rate_s,
        rate_most_rad_s2=roll_limit_rad * fastest_rad_s * fastest_rad_s,
        level_spike_m=10 * sensors.level_noise_m,
        level_most_m_s=tank.level_limit_m * fastest_rad_s,
        roll_noise_rad=NOISE_LIMIT * roll_s,
        rate_noise_rad_s=NOISE_LIMIT * rate_s,
        level_noise_m=3.75 * sensors.level_noise_m,  # in the sum of both
        drift_rad=6 * drift_s,
        roll_still_rad=5 * roll_s,
        level_still_m=STILL * sensors.level_noise_m,
        volume_m=max(0.03 * tank.height_m, 6 * sensors.level_noise_m),
        least_roll_push_m2_s2=roll_push_m2_s2,
        least_pump_push_m2_s2=0.1 * limits.pressure_pa / tank.density_kg_m3,
        gauge_push_m2_s2=math.sqrt(2) * GRAVITY_M_S2 * sensors.level_noise_m,  # mean of two
        zero_push_m2_s2=GRAVITY_M_S2 * tank.width_m * math.radians(ZERO_HEEL_DEG),
        steady_push_m2_s2=GRAVITY_M_S2 * tank.width_m * (math.radians(ZERO_HEEL_DEG) + TURN_G),
        motion_late_s=0.2 / frequency_rad_s,
        pressure_error_pa=0.15 * limits.pressure_pa,
        # its inertia is some 7 % of the water's, which 2 rho g accelerates per level
        free_rotor_pa_m=0.1 * 2 * tank.density_kg_m3 * GRAVITY_M_S2,
        pressure_limit_pa=limits.pressure_pa,
        unconfirmed_share=_unconfirmed_share(plant),
        degraded_share=DEGRADED_SHARE * held_pa / limits.pressure_pa,
        amplified_roll_rad=math.radians(0.5),
        of_hull=of_hull,
    )


def _unconfirmed_share(plant: DesignPlant) -> float:
    """A quarter, or what heels a ship whose pump is strong for its size by so little."""
    push_n = plant.limits.pressure_pa * plant.tank.reservoir_area_m2
    stiffness = coupled_matrices(plant.ship, plant.tank)[2]
    (k11, k12), (_, k22) = stiffness.tolist()
    heel_rad = abs(k12 * push_n / (k11 * k22 - k12 * k12))
    # where both are equal, so is the share
    least = UNCONFIRMED_SHARE * heel_rad <= math.radians(UNCONFIRMED_HEEL_DEG)
    return UNCONFIRMED_SHARE if least else float(math.radians(UNCONFIRMED_HEEL_DEG) / heel_rad)
