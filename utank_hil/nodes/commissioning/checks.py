"""One check of a commissioning, and the zeros of the sensors while ship and water are at rest."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final

from utank_hil.base.arrays import FloatArray
from utank_hil.control.design_plant import DesignPlant
from utank_hil.dynamics.tank import GRAVITY_M_S2
from utank_hil.nodes.commissioning.pulses import PulsePlan, ValveStroke
from utank_hil.safety.monitors.thresholds import ZERO_HEEL_DEG
from utank_hil.safety.situation import VALVE_OFF

ROLL_ZERO_DEG: Final = 1.0
RATE_ZERO_DEG_S: Final = 0.03
"""The monitors learn so much; twice as much would be DRIFT for good, and arming refused."""
PRESSURE_ZERO: Final = 0.02
"""Share of the pressure limit."""
WATER_HEEL_DEG: Final = ZERO_HEEL_DEG * 2 / 3
"""The monitors bear half as much again."""

STILL: Final = 0.2
"""Share of the plan's peaks: ship and water that move more by themselves hide what pulses do."""

Record = Mapping[str, FloatArray]
"""Columns of equal length by name, one row every sample time."""


@dataclass(frozen=True, slots=True)
class Check:
    """One thing that was checked."""

    name: str  #: For programs, as in the record.
    what: str  #: For people.
    #: measured, expected, tolerance: in `unit`; NaN could not be measured, and fails.
    measured: float
    expected: float
    tolerance: float
    unit: str
    remedy: str  #: What to do if it failed.

    @property
    def passed(self) -> bool:
        """Whether it is within its tolerance."""
        return abs(self.measured - self.expected) <= self.tolerance


def judge_rest(
    rest: Record, plant: DesignPlant, plan: PulsePlan | None, volume_m: float
) -> list[Check]:
    """Zeros of the sensors, and whether ship and water are still enough for pulses.

    `rest` is the record of some seconds in which ship and water are at rest and the pump is off.
    `plan` is None for a tank without a pump. `volume_m` is the sum of both levels at which the
    volume's monitor speaks.
    """
    mean = {name: float(column.mean()) for name, column in rest.items()}
    roll_deg = math.degrees(mean["roll_rad"])
    # the water's surface stays level, but for what the pressure sensor says of a pump that is off
    width_m, density_kg_m3 = plant.tank.width_m, plant.tank.density_kg_m3
    starboard_m = math.tan(mean["roll_rad"]) * width_m / 2
    higher_m = mean["starboard_level_m"] - mean["port_level_m"]
    higher_m -= mean.get("pressure_pa", 0.0) / (density_kg_m3 * GRAVITY_M_S2)
    heel_deg = math.degrees(math.atan(higher_m / width_m))
    checks = [
        Check("roll_zero", "roll at rest", roll_deg, 0.0, ROLL_ZERO_DEG, "deg",
              "Trim the ship upright, or mount the motion sensor level."),
        _rate_zero("roll_rate_zero", "roll rate at rest", mean["roll_rate_rad_s"]),
        _gauge_zero("port", mean["port_level_m"], -starboard_m, volume_m / 2),
        _gauge_zero("starboard", mean["starboard_level_m"], starboard_m, volume_m / 2),
        Check("high_level_switches", "high-level switches open", 1 - mean["high_level"], 1.0, 0.0,
              "of the time", "Check the switches and their wiring: low water leaves both open."),
    ]  # fmt: skip
    if plan is not None:
        level_m = (rest["starboard_level_m"] - rest["port_level_m"]) / 2
        wait = "Wait for calmer water, without traffic and people moving on board."
        checks += [
            Check("roll_still", "roll about its mean, RMS", math.degrees(rest["roll_rad"].std()),
                  0.0, STILL * math.degrees(plan.roll_rad), "deg", wait),
            Check("level_still", "level about its mean, RMS", float(level_m.std()), 0.0,
                  STILL * plan.level_m, "m", wait),
        ]  # fmt: skip
        limit_kpa = plant.limits.pressure_pa * 1e-3
        checks.append(
            Check("pressure_zero", "pump pressure at rest", mean["pressure_pa"] * 1e-3, 0.0,
                  PRESSURE_ZERO * limit_kpa, "kPa",
                  "Set the pressure sensor's zero; both its sides are to be full of water.")
        )  # fmt: skip
    checks.append(
        Check("water_heel", "heel by levels and pressure, less the roll", heel_deg - roll_deg, 0.0,
              WATER_HEEL_DEG, "deg", "Set the zeros of motion sensor, gauges and pressure sensor.")
    )  # fmt: skip
    if "roll_2_rad" in rest:
        apart_deg = math.degrees(mean["roll_2_rad"]) - roll_deg
        checks += [
            Check("roll_2_zero", "second sensor's roll less the first's", apart_deg, 0.0,
                  ROLL_ZERO_DEG / 2, "deg", "Mount both motion sensors level."),
            _rate_zero("roll_rate_2_zero", "second sensor's rate", mean["roll_rate_2_rad_s"]),
        ]  # fmt: skip
    return checks


def judge_valve(opening: FloatArray, stroke: ValveStroke, sample_time_s: float) -> list[Check]:
    """Whether the valve went where it was commanded, by its measured opening during the stroke."""
    there = round(stroke.hold_s / sample_time_s) - 1
    remedy = "Check the valve's drive, and the order of open and shut of its position sensor."
    return [
        Check("valve_narrow", "valve narrow", float(opening[there]), stroke.opening,
              VALVE_OFF, "1", remedy),
        Check("valve_open", "valve open", float(opening[-1]), 1.0, VALVE_OFF, "1", remedy),
    ]  # fmt: skip


def _rate_zero(name: str, what: str, rate_rad_s: float) -> Check:
    remedy = "Wait until the ship is still; set the zero of the gyroscope."
    return Check(name, what, math.degrees(rate_rad_s), 0.0, RATE_ZERO_DEG_S, "deg/s", remedy)


def _gauge_zero(side: str, measured_m: float, expected_m: float, tolerance_m: float) -> Check:
    return Check(
        f"{side}_level_zero", f"{side} gauge at rest", measured_m, expected_m, tolerance_m, "m",
        f"Set the {side} gauge's zero at the still-water level; check the tank's filling.",
    )  # fmt: skip
