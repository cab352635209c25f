"""A ship with its tank and pump, and the checks that they fit together."""

import hashlib
import json
from dataclasses import asdict
from typing import Final

from pydantic import model_validator

from utank_hil.configuration.files import Section
from utank_hil.configuration.plausibility import vessel_problems, vessel_warnings
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
    def _plausible(self) -> "Vessel":
        refuse("", vessel_problems(self.ship, self.tank, self.pump))
        return self

    def warnings(self) -> list[Problem]:
        """What is unusual in the vessel."""
        return vessel_warnings(self.ship, self.tank, self.pump)
