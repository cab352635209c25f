"""What the configuration files hold.

Sections that stand for a model or a node are the dataclasses of the code itself, so a key in a file
is the parameter of the same name.
"""

import hashlib
import json
from dataclasses import asdict
from typing import Annotated, Literal

from pydantic import Field

from utank_hil.config_files import Section
from utank_hil.control import PredictiveDesign, PumpLimits
from utank_hil.dynamics.pump import Pump
from utank_hil.dynamics.ship import RollShip
from utank_hil.dynamics.tank import Tank
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


class PassiveLaw(Section):
    """No pump pressure: the tank on its own."""

    kind: Literal["passive"]


class ControllerConfig(Section):
    """The controller's side, ``configs/controllers``: what ``utank-hil run`` takes."""

    name: str
    vessel: Vessel
    law: Annotated[PassiveLaw | PredictiveDesign, Field(discriminator="kind")]
    delay_s: Annotated[float, Field(ge=0, le=1)] = 0.05
    """From the sampling of a measurement to the drive's answer to the command made of it."""
    accept_low_margins: bool = False
    """Use the law even if it misses the required margins."""
    limits: PumpLimits = PumpLimits()
    safety: SafetyLimits = SafetyLimits()
    command_timeout_ms: Annotated[float, Field(ge=20, le=100)] = 50.0
    bit_rate: Annotated[int, Field(gt=0)] = 250_000
