"""What the configuration files hold.

Sections that stand for a model or a node are the dataclasses of the code itself, so a key in a file
is the parameter of the same name.
"""

import hashlib
import json
from dataclasses import asdict
from typing import Annotated

from pydantic import Field, model_validator

from utank_hil.config_files import Section
from utank_hil.config_laws import Law
from utank_hil.control import PredictiveDesign, PumpLimits
from utank_hil.dynamics.pump import Pump
from utank_hil.dynamics.ship import RollShip
from utank_hil.dynamics.tank import Tank
from utank_hil.runtime.retuning.settings import RetuningSettings
from utank_hil.runtime.supervisor import SafetyLimits

NOT_AVAILABLE = 0xFFF
"""Twelve bits carry the hash on the bus; all ones means that there is none."""


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


class ControllerConfig(Section):
    """The controller's side, ``configs/controllers``: what ``utank-hil run`` takes."""

    name: str
    vessel: Vessel
    law: Law
    delay_s: Annotated[float, Field(ge=0, le=1)] = 0.05
    """From the sampling of a measurement to the drive's answer to the command made of it."""
    accept_low_margins: bool = False
    """Use the law even if it misses the required margins."""
    limits: PumpLimits = PumpLimits()
    safety: SafetyLimits = SafetyLimits()
    command_timeout_ms: Annotated[float, Field(ge=20, le=100)] = 50.0
    bit_rate: Annotated[int, Field(gt=0)] = 250_000
    retuning: RetuningSettings | None = None
    """How the controller may retune itself; without it, it never does."""

    @model_validator(mode="after")
    def _consistent(self) -> "ControllerConfig":
        pump, tank = self.vessel.pump, self.vessel.tank
        if self.limits.pressure_pa > pump.max_pressure_pa:
            raise ValueError(
                f"limits.pressure_pa is {self.limits.pressure_pa:g}, but the vessel's pump gives "
                f"{pump.max_pressure_pa:g} at most"
            )
        if self.limits.level_m > tank.level_limit_m:
            raise ValueError(
                f"limits.level_m is {self.limits.level_m:g}, but the vessel's tank is full or "
                f"empty at {tank.level_limit_m:g}"
            )
        if self.retuning is not None and (
            not isinstance(self.law, PredictiveDesign)
            or "roll_rad" not in self.law.predictor.measured
        ):
            raise ValueError("retuning is for predictive laws that measure roll_rad")
        return self
