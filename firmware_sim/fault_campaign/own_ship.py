"""The faults of a campaign, as large for another ship as for the first.

Offsets, drifts and spikes of levels and pressures, and pressures that the pump adds, keep their
share of the law's limits, and of the sum of the levels that the monitor excuses if that is more.
Noise is as many times that of the sensor. Rolls stay. Times of a row stay, but for that of a law's
sample, and where `Limit.follows` names what they follow from. Frames of a CANopen drive have the
ship's own node numbers.
"""

import math
from bisect import bisect_left
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Final, NamedTuple

import numpy as np

from firmware_sim.fault_injection.frames import Lost
from firmware_sim.fault_injection.kinds import AnyFault
from firmware_sim.fault_injection.nodes import LostIdentifier, Pump
from firmware_sim.fault_injection.signals import Drift, Noise, Offset, Spikes
from firmware_sim.scenario import Scenario
from utank_hil.base.arrays import FloatArray
from utank_hil.canbus.profiles.drive_plan import DrivePlan
from utank_hil.configuration import ControllerConfig
from utank_hil.configuration.laws import sample_time
from utank_hil.dynamics.linear import state_matrices
from utank_hil.dynamics.sampling import transition_and_step
from utank_hil.safety.monitors.thresholds import MonitorThresholds, thresholds_of

PRESSURE: Final = "pressure_pa"
LEVELS: Final = ("port_level_m", "starboard_level_m", "level_m")
LIMITS: Final = {**dict.fromkeys(LEVELS, "level_m"), PRESSURE: "pressure_pa"}
NOISES: Final = {
    **dict.fromkeys(LEVELS, "level_noise_m"),
    PRESSURE: "pressure_noise_pa",
    "roll_rad": "roll_noise_rad",
    "roll_rate_rad_s": "roll_rate_noise_rad_s",
}
SIZES: Final = {
    Pump: "plus_pa", Noise: "deviation", Offset: "by", Spikes: "by", Drift: "by_per_s",
}  # fmt: skip
"""Field with the size of a fault, by its kind."""


GAP_S: Final = 0.9  #: Longest gap of a measurement that is no silence, which ends control.
RAMP_S: Final = 0.5  #: Time at the pressure limit that a ramp of 1 s counts as.
MOST_S: Final = 30.0  #: Where the roll budget never ends: as long as a drift may last (F11).
_STEP_S: Final = 0.02
_SHARE: Final = 0.25  #: Of the roll limit, which a wrong signal may have the pump add.


class Ratios(NamedTuple):
    """Another ship's sizes over the first one's, by signal."""

    range: Mapping[str, float]
    noise: Mapping[str, float]
    sample_s: float  #: Sample time of the other ship's law.
    period: float  #: Of the natural periods of the water.
    volume: float  #: Of the sums of the levels that are excused.
    volume_m: float  #: The first one's.


def ratios(
    first: tuple[Scenario, ControllerConfig], other: tuple[Scenario, ControllerConfig]
) -> Ratios:
    """The ratios of two ships, each with a scenario and its controller."""
    here, there = thresholds(first[1]), thresholds(other[1])
    return Ratios(
        _ratios(LIMITS, first[1].limits, other[1].limits),
        _ratios(NOISES, first[0].sensors, other[0].sensors),
        _sample_s(other[1]),
        there.tank_period_s / here.tank_period_s,
        there.volume_m / here.volume_m,
        here.volume_m,
    )


def thresholds(config: ControllerConfig) -> MonitorThresholds:
    """Thresholds of a controller's monitors."""
    return thresholds_of(config.plant, config.safety.roll_limit_rad, config.sensors)


def _sample_s(config: ControllerConfig) -> float:
    """Sample time of a law; a law that finds its own takes 0.1 over the roll frequency."""
    given = sample_time(config.law)
    return 0.1 / config.vessel.ship.natural_frequency_rad_s if given is None else given[1]


def _ratios(names: Mapping[str, str], first: Any, other: Any) -> dict[str, float]:
    """The ratios of some fields; 1 where either ship's is zero, as that of a noise may be."""
    sizes = {key: (getattr(first, name), getattr(other, name)) for key, name in names.items()}
    return {key: theirs / own if theirs and own else 1.0 for key, (own, theirs) in sizes.items()}


def resized(fault: AnyFault, by: Ratios) -> AnyFault:
    """A fault as large for the other ship as it is for the first."""
    field = SIZES.get(type(fault))
    if field is None:
        return fault
    ratio_of = by.noise if isinstance(fault, Noise) else by.range
    (signal, *_) = getattr(fault, "signals", (PRESSURE,))
    size, ratio = getattr(fault, field), ratio_of.get(signal, 1.0)
    if isinstance(fault, Offset) and signal in LEVELS and abs(size) > by.volume_m:
        ratio = max(ratio, by.volume)
    return fault.model_copy(update={field: size * ratio})


def stretched(fault: AnyFault, by: Ratios) -> AnyFault:
    """A fault whose times are as many periods of the water as for the first ship."""
    changed = {
        name: by.period * seconds
        for name in ("at_s", "for_s", "by_s")
        if (seconds := getattr(fault, name, None))
    }
    if isinstance(fault, Lost) and "for_s" in changed:
        changed["for_s"] = min(changed["for_s"], GAP_S)
    return fault.model_copy(update=changed)


@dataclass(frozen=True, slots=True)
class RollBudget:
    """How long a wrong signal may last (docs/monitors.md, *Roll budget*).

    Whatever the phase, the pressures until zero may add a quarter of the roll limit.
    """

    sums_rad: FloatArray  #: Roll per Pa of a pressure that lasts and turns at the worst moments.
    allowed_rad: float
    full_pa: float  #: The pressure limit.
    halved_pa: float  #: The one after a fault that halves the pressure.

    @classmethod
    def of(cls, config: ControllerConfig) -> "RollBudget":
        """The budget of a controller's ship: linear, the decay of its roll followed to the end."""
        a, b = state_matrices(config.vessel.ship, config.vessel.tank)
        transition, step = transition_and_step(a, b[:, :1], _STEP_S)
        slowest_1_s = -max(np.linalg.eigvals(a).real)
        answers, state = [0.0], step[:, 0]
        for _ in range(math.ceil(max(5.0 / slowest_1_s, 2 * MOST_S) / _STEP_S)):
            answers.append(abs(float(state[0])))
            state = transition @ state
        full_pa, limit_rad = config.limits.pressure_pa, config.safety.roll_limit_rad
        halved_pa = thresholds(config).degraded_share * full_pa
        return cls(np.cumsum(answers), _SHARE * limit_rad, full_pa, halved_pa)

    def found_s(self, halved_s: float) -> float:
        """Latest time at which the ramp must begin, if the pressure was halved at another."""
        sums_rad, most = self.sums_rad, round((MOST_S + RAMP_S) / _STEP_S)
        until = round(min(halved_s, 2 * MOST_S) / _STEP_S)

        def spent(steps: int) -> bool:
            full, end = min(until, steps), len(sums_rad)
            added_rad = self.full_pa * sums_rad[steps:] - self.halved_pa * sums_rad[: end - steps]
            added_rad -= (self.full_pa - self.halved_pa) * sums_rad[steps - full : end - full]
            return bool(added_rad.max() > self.allowed_rad)

        steps = bisect_left(range(1, most + 1), True, key=spent)  # the last that is not spent
        return max(steps * _STEP_S - RAMP_S, 0.0)


def renumbered(fault: AnyFault, first: DrivePlan, own: DrivePlan) -> AnyFault:
    """A fault of a CANopen drive's frames with the node numbers of another ship."""
    if isinstance(fault, LostIdentifier):
        numbers = {first.node: own.node, first.controller_node: own.controller_node}
        node = fault.id_11bit & 0x7F
        number = fault.id_11bit - node + numbers.get(node, node)
        return fault.model_copy(update={"id_11bit": number})
    return fault
