"""The ships of the source, with what it leaves open filled in.

The first ship (3.8) is printed without the friction of its tank, and with a roll damping ten times
too large. Its own printed laws fit a ship with larger reservoirs better (docs/control.md).
"""

from typing import Final

from utank_hil.dynamics.ship import RollShip
from utank_hil.dynamics.tank import Tank

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
