"""A ship with its tank and pump, and the checks that they fit together."""

import hashlib
import json
from dataclasses import asdict
from typing import Final

import numpy as np
from pydantic import model_validator

from utank_hil.configuration.files import Section
from utank_hil.dynamics.linear import coupled_matrices
from utank_hil.dynamics.pump import Pump
from utank_hil.dynamics.ship import RollShip
from utank_hil.dynamics.tank import Tank
from utank_hil.parameters import Problem, refuse

NOT_AVAILABLE = 0xFFF
"""Twelve bits carry the hash on the bus; all ones means that there is none."""

# default limits keep the first ship's ratios to its pump and tank: the laws were
# tuned within these
_RATE_PER_PRESSURE: Final = 2.0
_LEVEL_SHARE: Final = 3.85 / 4.88


class Vessel(Section):
    """A ship with its tank and pump: ``configs/ships``."""

    name: str
    ship: RollShip
    tank: Tank
    pump: Pump

    @property
    def version(self) -> int:
        """Hash of everything but the name, for the nodes to compare before arming."""
        content = [asdict(part) for part in (self.ship, self.tank, self.pump)]
        digest = hashlib.sha256(json.dumps(content, sort_keys=True).encode()).digest()
        return int.from_bytes(digest[:4], "big") % NOT_AVAILABLE

    @property
    def default_limits(self) -> dict[str, float]:
        """Limits of the pump's command where the user sets none."""
        pump = self.pump
        return {
            "pressure_pa": pump.max_pressure_pa,
            "rate_pa_s": min(
                _RATE_PER_PRESSURE * pump.max_pressure_pa, pump.max_pressure_rate_pa_s
            ),
            "level_m": self.tank.level_limit_m * _LEVEL_SHARE,
        }

    @model_validator(mode="after")
    def _tank_suits_the_ship(self) -> "Vessel":
        refuse("", tank_problems(self.ship, self.tank))
        return self


def tank_problems(ship: RollShip, tank: Tank) -> list[Problem]:
    """Why a ship can't carry a tank: inertia and stability must stay positive with its water."""
    try:
        mass, _, stiffness = coupled_matrices(ship, tank)
    except OverflowError:
        return [("tank", "has a length or area beyond all scale")]
    water = mass[1, 1] * (tank.width_m / 2) ** 2  # about the ship's axis, as in mass_ratio
    if not (0 < water < mass[0, 0] and np.linalg.det(mass) > 0):
        return [("tank", "has more roll inertia in its water than the ship: make it smaller")]
    if not (stiffness[0, 0] > 0 and np.linalg.det(stiffness) > 0):
        reason = (
            "takes all of the ship's stability by its free surface: lower reservoir_area_m2 or "
            "width_m"
        )
        return [("tank", reason)]
    return []
