"""Which of the shipped scenarios is for a vessel."""

from pathlib import Path

from pydantic import BaseModel

from firmware_sim.commands.bench import STORM
from utank_hil.configuration import Vessel
from utank_hil.console.common import load


class _VesselOfScenario(BaseModel):
    """Whom a scenario is for; the rest of it may cost the design of its controllers."""

    vessel: Vessel


def shipped_scenario(vessel: Vessel) -> Path | None:
    """The shipped scenario of a vessel: the storm for its ship, else the first with the ship."""
    shipped = [STORM, *sorted(STORM.parent.glob("*.yaml"))]
    own = (p for p in shipped if load(p, _VesselOfScenario).vessel.version == vessel.version)
    return next(own, None)
