"""What commands of a design share: the sea that it is judged in, and the figures that it keeps."""

import json
from pathlib import Path
from typing import Annotated, Any

from pydantic import BaseModel

from firmware_sim.commands.bench import STORM
from firmware_sim.scenario import Scenario
from utank_hil.analysis.tank_response import expected_sea
from utank_hil.base.whole_file import write_whole
from utank_hil.configuration import Vessel
from utank_hil.console import common
from utank_hil.sea import Harmonics

SeaOption = Annotated[
    Path | None,
    common.option("Scenario whose sea counts.", default="scenario.yaml beside, or a shipped one"),
]


def sea_of(path: Path | None, vessel: Vessel, file: Path) -> tuple[Scenario, Harmonics]:
    """Scenario of the vessel of a file, and its moment in N m; of another ship the sea alone."""
    from utank_hil.analysis.loop.sea_response import CalmSeaError

    if path is None:
        common.fail(f"{file}: no shipped scenario has this ship: name a sea with --scenario")
    scenario = common.load(path, Scenario, allow_code=True)  # laws are not built from it
    if scenario.vessel.version != vessel.version:
        if scenario.hull is not None or scenario.fmu is not None:
            why = f"plant: {scenario.plant} is {scenario.vessel.name}, not {vessel.name}"
            common.fail(f"{path}: {why}; name a scenario with plant: roll")
        others = {"vessel": vessel, "controllers": {}, "actual_ship": {}, "voyage": ()}
        scenario = scenario.model_copy(update=others | {"gusts": None})
    waves = scenario.pooled_wave_moment()
    try:
        expected_sea(vessel.ship, waves)
    except CalmSeaError as error:
        common.fail(f"{path}: sea: {error}; name another scenario with --scenario")
    return scenario, waves


def keep(
    figures: dict[str, Any], picture: Path, file: Path, *, json_: bool, **more: Path
) -> dict[str, Path]:
    """Write the figures of a design, and print them if asked for; return its files."""
    files = {"picture": picture, "figures": file, **more}
    figures["files"] = {key: str(path) for key, path in files.items()}
    write_whole(file, json.dumps(figures, indent=2) + "\n")
    if json_:
        common.print_json(figures)
    return files


class _VesselOfScenario(BaseModel):
    """Vessel of a scenario; loading the rest could require the design of its controllers."""

    vessel: Vessel


def usual_scenario(vessel: Vessel, file: Path) -> Path | None:
    """Scenario of a vessel: the one beside its file, the storm, or the first one shipped."""
    beside = file.with_name("scenario.yaml")
    shipped = [STORM, *sorted(STORM.parent.glob("*.yaml"))]
    usual = [beside, *shipped] if beside.exists() else shipped
    own = (p for p in usual if common.load(p, _VesselOfScenario).vessel.version == vessel.version)
    return next(own, None)
