"""A ship with its tank and pump, and the checks that they fit together."""

import hashlib
import json
import math
from collections.abc import Callable
from dataclasses import asdict
from typing import Any, Final

from pydantic import ValidationInfo, field_validator, model_validator

from utank_hil.configuration.files import Section
from utank_hil.configuration.plausibility import vessel_problems, vessel_warnings
from utank_hil.configuration.ship_keys import ShipFromFile, written_key
from utank_hil.dynamics.pump import Pump
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
    ship: ShipFromFile
    tank: Tank
    pump: Pump | None = None
    """None leaves the tank passive."""
    _assumptions: tuple[str, ...] = ()
    _ship_keys: frozenset[str] = frozenset()

    @property
    def version(self) -> int:
        """Hash of everything but the name, for the nodes to compare before arming."""
        parts = (self.ship, self.tank, self.pump)
        content = [None if part is None else asdict(part) for part in parts]
        digest = hashlib.sha256(json.dumps(content, sort_keys=True).encode()).digest()
        return int.from_bytes(digest[:4], "big") % NOT_AVAILABLE

    @property
    def default_limits(self) -> dict[str, float]:
        """Limits of the pump's command where the user sets none."""
        level = {"level_m": self.tank.level_limit_m * _LEVEL_SHARE}
        pump = self.pump
        if pump is None:
            return level
        return {
            "pressure_pa": pump.max_pressure_pa,
            "rate_pa_s": min(
                _RATE_PER_PRESSURE * pump.max_pressure_pa, pump.max_pressure_rate_pa_s
            ),
            **level,
        }

    @property
    def assumptions(self) -> tuple[str, ...]:
        """What was taken for granted because the file does not say it, in words."""
        return self._assumptions

    @field_validator("pump", mode="before")
    @classmethod
    def _by_similarity(cls, pump: Any, info: ValidationInfo) -> Any:
        """Parameters of the pump that are not given: the first ship's pump, scaled."""
        if not isinstance(pump, dict):
            return pump
        tank = info.data.get("tank")
        area_m2 = pump.get("duct_area_m2", 1.0 if tank is None else tank.duct_area_m2)
        try:
            similar = Pump.for_duct(float(area_m2), float(pump["max_pressure_pa"]))
        except (KeyError, TypeError, ValueError, OverflowError):
            similar = Pump.for_duct(1.0)  # what is wrong with these two is found at their keys
        others = {name: of for name, of in asdict(similar).items() if name != "max_pressure_pa"}
        return others | pump

    @model_validator(mode="wrap")
    @classmethod
    def _judged_as_written(cls, content: Any, validated: Callable[[Any], "Vessel"]) -> "Vessel":
        vessel = validated(content)
        if isinstance(content, dict) and isinstance(content["ship"], dict):
            given = content["ship"].keys()
            vessel._ship_keys = frozenset(given)
            if not given & {"roll_period_s", "inertia_kg_m2"}:
                period_s = 2 * math.pi / vessel.ship.natural_frequency_rad_s
                vessel._assumptions = (
                    f"ship: roll period {period_s:.1f} s by the weather criterion's formula (IS "
                    "Code 2008, part A, 2.3.4); give roll_period_s if it is known",
                )
        refuse("", vessel._as_written(vessel_problems(vessel.ship, vessel.tank, vessel.pump)))
        return vessel

    def warnings(self) -> list[Problem]:
        """What is unusual in the vessel."""
        return self._as_written(vessel_warnings(self.ship, self.tank, self.pump))

    def _as_written(self, problems: list[Problem]) -> list[Problem]:
        """Problems at the keys that the file has for the ship."""
        if not self._ship_keys:
            return problems
        parts = [(*key.partition("."), reason) for key, reason in problems]
        return [
            (f"ship.{written_key(name, self._ship_keys)}" if part == "ship" else part + dot + name,
             reason)
            for part, dot, name, reason in parts
        ]  # fmt: skip
