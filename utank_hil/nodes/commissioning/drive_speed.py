"""Whether the speed that a drive tells is that which its pump's pressure takes."""

from typing import Final

import numpy as np

from utank_hil.control.interface import DesignPlant
from utank_hil.dynamics.pump import Pump
from utank_hil.dynamics.pump_curve import pump_speed
from utank_hil.nodes.commissioning.checks import Check
from utank_hil.nodes.commissioning.precision import Record
from utank_hil.nodes.commissioning.pulses import PulsePlan

SPEED: Final = "drive_speed_rad_s"
SCALE: Final = 0.25
"""Pressure and levels pass within 6 %, and the head curve of a pump is known to some 10 %: together
an eighth, doubled here. Wrong units and gears are a factor."""
SMOOTH: Final = 0.1
"""Of the tank's period: the mean of the levels whose slope is the flow."""


def judge_speed(
    rest: Record,
    pulses: Record,
    plant: DesignPlant,
    plan: PulsePlan,
    pump: Pump,
    sample_time_s: float,
) -> Check:
    """Compare a drive's speed with the head curve's at the measured pressure and flow.

    `rest`, `pulses` and the others are those of `judge_pulses`. Rows count whose pressure is at
    least half a pulse's: less is mostly noise.
    """
    rows = max(round(SMOOTH * plan.period_s / sample_time_s), 1)
    level = (pulses["starboard_level_m"] - pulses["port_level_m"]) / 2
    smooth = np.convolve(level, np.full(rows, 1 / rows), "same")
    flow = plant.tank.reservoir_area_m2 * np.gradient(smooth, sample_time_s)
    pressure = pulses["pressure_pa"] - rest["pressure_pa"].mean()
    pressed = np.abs(pressure) >= plan.pressure_pa / 2
    pressed[: rows + 1] = pressed[len(pressed) - rows - 1 :] = False  # no whole mean there
    both = zip(pressure[pressed].tolist(), flow[pressed].tolist(), strict=True)
    due = np.array([pump_speed(*each, pump.coefficients) for each in both])
    power = float(due @ due)
    scale = float(pulses[SPEED][pressed] @ due) / power if power > 0 else np.nan
    return Check(
        "drive_speed", "drive's speed, by pressure and flow", scale, 1.0, SCALE, "1",
        "Correct speed_rad_s_per_unit of devices.pump: it is of the pump's shaft (1 rpm is "
        "0.10472 rad/s). With a wrong speed the pressure does not follow the command.",
    )  # fmt: skip
