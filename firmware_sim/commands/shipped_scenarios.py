"""Shipped scenario of a vessel."""

from pathlib import Path

from pydantic import BaseModel

from firmware_sim.commands.bench import STORM
from utank_hil.configuration import Vessel
from utank_hil.console.common import load


class _VesselOfScenario(BaseModel):
    """Vessel of a scenario; loading the rest could require the design of its controllers."""

    vessel: Vessel


def shipped_scenario(vessel: Vessel) -> Path | None:
    """Shipped scenario of a vessel: the storm for its ship, else the first one with the ship."""
    shipped = [STORM, *sorted(STORM.parent.glob("*.yaml"))]
    own = (p for p in shipped if load(p, _VesselOfScenario).vessel.version == vessel.version)
    return next(own, None)
