"""The faults of a campaign, as large for another ship as for the first.

Offsets, drifts and spikes of levels and pressures, and pressures that the pump adds, keep their
share of the law's limits. Noise is as many times that of the sensor. Rolls and times stay. Frames
of a CANopen drive have the ship's own node numbers.
"""

from collections.abc import Mapping
from typing import Final, NamedTuple

from firmware_sim.fault_injection.kinds import AnyFault
from firmware_sim.fault_injection.nodes import LostIdentifier, Pump
from firmware_sim.fault_injection.signals import Drift, Noise, Offset, Spikes
from firmware_sim.scenario import Scenario
from utank_hil.canbus.profiles.drive_plan import DrivePlan
from utank_hil.configuration import ControllerConfig

PRESSURE: Final = "pressure_pa"
LEVELS: Final = ("port_level_m", "starboard_level_m", "level_m")


class Ratios(NamedTuple):
    """Another ship's sizes over the first one's, by signal."""

    range: Mapping[str, float]
    noise: Mapping[str, float]


def ratios(
    first: tuple[Scenario, ControllerConfig], other: tuple[Scenario, ControllerConfig]
) -> Ratios:
    """The ratios of two ships, each with a scenario and its controller."""
    limits, their_limits = first[1].limits, other[1].limits
    noise, their_noise = first[0].sensors, other[0].sensors
    return Ratios(
        dict.fromkeys(LEVELS, their_limits.level_m / limits.level_m)
        | {PRESSURE: their_limits.pressure_pa / limits.pressure_pa},
        dict.fromkeys(LEVELS, _ratio(their_noise.level_noise_m, noise.level_noise_m))
        | {
            PRESSURE: _ratio(their_noise.pressure_noise_pa, noise.pressure_noise_pa),
            "roll_rad": _ratio(their_noise.roll_noise_rad, noise.roll_noise_rad),
            "roll_rate_rad_s": _ratio(
                their_noise.roll_rate_noise_rad_s, noise.roll_rate_noise_rad_s
            ),
        },
    )


def resized(fault: AnyFault, by: Ratios) -> AnyFault:
    """A fault as large for the other ship as it is for the first."""
    if isinstance(fault, Pump):
        return fault.model_copy(update={"plus_pa": fault.plus_pa * by.range[PRESSURE]})
    if isinstance(fault, Noise):
        size = fault.deviation * by.noise.get(fault.signals[0], 1.0)
        return fault.model_copy(update={"deviation": size})
    if isinstance(fault, Offset | Spikes):
        size = fault.by * by.range.get(fault.signals[0], 1.0)
        return fault.model_copy(update={"by": size})
    if isinstance(fault, Drift):
        size = fault.by_per_s * by.range.get(fault.signals[0], 1.0)
        return fault.model_copy(update={"by_per_s": size})
    return fault


def renumbered(fault: AnyFault, first: DrivePlan, own: DrivePlan) -> AnyFault:
    """A fault of a CANopen drive's frames with the node numbers of another ship."""
    if isinstance(fault, LostIdentifier):
        numbers = {first.node: own.node, first.controller_node: own.controller_node}
        node = fault.id_11bit & 0x7F
        number = fault.id_11bit - node + numbers.get(node, node)
        return fault.model_copy(update={"id_11bit": number})
    return fault


def _ratio(theirs: float, first: float) -> float:
    """A ratio of noises; 1 where either sensor has none."""
    return theirs / first if theirs and first else 1.0
