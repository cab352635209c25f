"""The ships of the source, with what it leaves open filled in; forced roll in still water.

The first ship (3.8) is printed without the friction of its tank, and with a roll damping ten times
too large. Its own printed laws fit a ship with larger reservoirs better (docs/control.md).
"""

import math
from dataclasses import replace
from typing import Final, NamedTuple

import numpy as np

from tools.thesis.simulate import RollRun, simulate, whole_steps
from utank_hil.dynamics import GRAVITY_M_S2, RollModel, RollShip, Tank

INERTIA_KG_M2: Final = 1.9275e9
ROLL_RAD_S: Final = 0.5


def first_ship(
    damping_nms_rad: float, tank_damping: float, reservoir_area_m2: float = 17.11
) -> tuple[RollShip, Tank]:
    """The first ship with what the source leaves open: damping of the roll and of the water."""
    tank = Tank(17.1, 4.88, reservoir_area_m2, 6.22, lz_m=1.83, damping_ratio=tank_damping)
    return RollShip(INERTIA_KG_M2, INERTIA_KG_M2 * ROLL_RAD_S**2, damping_nms_rad), tank


AS_PRINTED: Final = first_ship(5.8e7, 0.080)
"""Printed geometry, dampings at which its laws come nearest to the printed ones."""
GREATER: Final = first_ship(1.04e8, 0.153, 25.2)
"""Reservoirs with which all printed gains come within 4 %."""
FITTED: Final = first_ship(7.9885e7, 0.15836, 24.416)
"""Reservoirs with which the sixteen gains on roll come within 0.03 %."""


STEP_S = 0.02
DURATION_S = 300.0


class StimulatedRoll(NamedTuple):
    """Result of a stimulation in still water."""

    run: RollRun
    stimulated_rad: float  #: Largest roll in the last cycle before the pump stops.
    level_lead_rad: float  #: Phase lead of the level against the roll in that cycle.
    #: Cycles after the stop until the roll stays below a tenth of `stimulated_rad`.
    cycles_to_tenth: float


def tuned_tank(ship: RollShip, tank: Tank) -> Tank:
    """The tank with its duct sized for the ship's natural roll frequency, thesis 2.6.

    Raises `ValueError` if the reservoirs alone have a lower natural frequency than the ship.
    """
    duct_part_m = 2 * GRAVITY_M_S2 / ship.natural_frequency_rad_s**2 - 2 * tank.height_m
    if duct_part_m <= 0:
        raise ValueError(
            f"a tank of height_m {tank.height_m} can't be as fast as the ship's "
            f"{ship.natural_frequency_rad_s:.3g} rad/s: lower it"
        )
    return replace(tank, duct_area_m2=tank.width_m * tank.reservoir_area_m2 / duct_part_m)


def tuned_ship(friction: float) -> tuple[RollShip, Tank]:
    """The first ship with 2.5 % roll damping and a duct of its roll frequency."""
    ship, tank = first_ship(4.87e7, friction)
    return ship, tuned_tank(ship, tank)


def stimulate_on_still_water(
    model: RollModel, pressure_pa: float, frequency_rad_s: float, *, off_s: float = 141.0
) -> StimulatedRoll:
    """Drive the roll with a sinusoidal pressure from rest, stop the pump, and let the roll decay.

    Raises `ValueError` if the pump runs for less than one cycle, or to the end.
    """
    cycle_s = math.tau / frequency_rad_s
    if not cycle_s < off_s < DURATION_S:
        raise ValueError(f"off_s must lie between {cycle_s:.3g} and {DURATION_S}, got {off_s}")
    time = STEP_S * np.arange(whole_steps("duration_s", DURATION_S, STEP_S))
    pressure = np.where(time < off_s, pressure_pa * np.sin(frequency_rad_s * time), 0.0)
    run = simulate(model, DURATION_S, pressure_pa=pressure, step_s=STEP_S)
    size = np.abs(run.state[:, 0])
    last = (run.time_s > off_s - cycle_s) & (run.time_s <= off_s)
    stimulated = float(size[last].max())
    demodulation = np.exp(-1j * frequency_rad_s * run.time_s[last])
    roll, level = (np.sum(run.state[last, k] * demodulation) for k in (0, 2))
    above_tenth_s = run.time_s[size > stimulated / 10]
    return StimulatedRoll(
        run, stimulated, float(np.angle(level / roll)), float((above_tenth_s[-1] - off_s) / cycle_s)
    )
