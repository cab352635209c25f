"""The faults of a campaign, as large for another ship as for the first.

Offsets, drifts and spikes of levels and pressures, and pressures that the pump adds, keep their
share of the law's limits. Noise is as many times that of the sensor. Rolls and times stay, but for
that of a law's sample. Frames of a CANopen drive have the ship's own node numbers.
"""

from collections.abc import Mapping
from typing import Any, Final, NamedTuple

from firmware_sim.fault_injection.kinds import AnyFault
from firmware_sim.fault_injection.nodes import LostIdentifier, Pump
from firmware_sim.fault_injection.signals import Drift, Noise, Offset, Spikes
from firmware_sim.scenario import Scenario
from utank_hil.canbus.profiles.drive_plan import DrivePlan
from utank_hil.configuration import ControllerConfig
from utank_hil.configuration.laws import sample_time

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


class Ratios(NamedTuple):
    """Another ship's sizes over the first one's, by signal."""

    range: Mapping[str, float]
    noise: Mapping[str, float]
    sample_s: float  #: Sample time of the other ship's law.


def ratios(
    first: tuple[Scenario, ControllerConfig], other: tuple[Scenario, ControllerConfig]
) -> Ratios:
    """The ratios of two ships, each with a scenario and its controller."""
    return Ratios(
        _ratios(LIMITS, first[1].limits, other[1].limits),
        _ratios(NOISES, first[0].sensors, other[0].sensors),
        _sample_s(other[1]),
    )


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
    size = getattr(fault, field) * ratio_of.get(signal, 1.0)
    return fault.model_copy(update={field: size})


def renumbered(fault: AnyFault, first: DrivePlan, own: DrivePlan) -> AnyFault:
    """A fault of a CANopen drive's frames with the node numbers of another ship."""
    if isinstance(fault, LostIdentifier):
        numbers = {first.node: own.node, first.controller_node: own.controller_node}
        node = fault.id_11bit & 0x7F
        number = fault.id_11bit - node + numbers.get(node, node)
        return fault.model_copy(update={"id_11bit": number})
    return fault
