"""Configuration of an identified ship: its vessel, and a controller that names it."""

import dataclasses
import os
from pathlib import Path
from typing import Any, Final

import yaml

from utank_hil.base.finite import mapped
from utank_hil.base.parameters import refuse
from utank_hil.base.provenance import headline
from utank_hil.base.whole_file import claimed_files, left_whole
from utank_hil.configuration.plausibility import tank_problems
from utank_hil.configuration.vessel import Vessel
from utank_hil.dynamics.ship import RollShip
from utank_hil.dynamics.tank import Tank
from utank_hil.nodes.redundancy import NO_REDUNDANCY
from utank_hil.retuning import ModelSummary

VESSEL: Final = "identified_vessel.yaml"
CONTROLLER: Final = "identified_controller.yaml"
_RELATIVE: Final = ("./", "../")


def read_controller(config: Path) -> dict[str, Any]:
    """Read the content of a controller's file, with absolute paths of the files that it names."""
    folder = config.resolve().parent

    def whole(value: Any) -> Any:  # as `configuration.files` knows the name of a file
        names = isinstance(value, str) and (value.endswith(".yaml") or value.startswith(_RELATIVE))
        return str(folder / value) if names else value

    content: dict[str, Any] = mapped(yaml.safe_load(config.read_text(encoding="utf-8")), whole)
    return content


@dataclasses.dataclass(frozen=True)
class IdentifiedShips:
    """Files of identified ships: a vessel, and a controller that names it."""

    folder: Path  #: Folder of the files; created if missing.
    vessel: Vessel  #: The configured vessel.
    content: dict[str, Any]  #: Content of the controller's file, from `read_controller`.

    def write(self, found: ModelSummary) -> dict[str, Path]:
        """Write vessel and controller, named by the time; `ParameterError` for no possible ship."""
        ship, tank = found.ship(self.vessel.ship), found.tank(self.vessel.tank)
        refuse("vessel", tank_problems(ship, tank))
        self.folder.mkdir(parents=True, exist_ok=True)
        names = [f"{Path(name).stem}-{{}}.yaml" for name in (VESSEL, CONTROLLER)]
        return self.write_to(claimed_files(self.folder, *names), ship, tank)

    def write_to(self, files: tuple[Path, ...], ship: RollShip, tank: Tank) -> dict[str, Path]:
        """Write vessel and controller; return the paths of both as "vessel" and "config"."""
        vessel_file, controller_file = files
        vessel = self.vessel.model_copy(update={"ship": ship, "tank": tank})
        contents = _vessel_content(vessel), self.content | {"vessel": vessel_file.name}
        with left_whole(controller_file), left_whole(vessel_file):
            for file, held in zip(files, contents, strict=True):
                text = f"# Identified by {headline()}.\n{yaml.safe_dump(held, sort_keys=False)}"
                with file.open("w", encoding="utf-8") as written:
                    written.write(text)
                    written.flush()
                    os.fsync(written.fileno())  # a rare result must survive a power cut
        return {"vessel": vessel_file, "config": controller_file}


def _vessel_content(vessel: Vessel) -> dict[str, Any]:
    """Return the content of a vessel's file, without values at their defaults."""
    content: dict[str, Any] = {"name": f"{vessel.name.removesuffix(', identified')}, identified"}
    content |= vessel.model_dump(
        mode="json", include={"least_gm_m", "emulated", "devices"}, exclude_defaults=True
    )
    for key in ("ship", "tank", "pump", "valve", "redundancy"):
        part = getattr(vessel, key)
        if part is not None and part != NO_REDUNDANCY:
            values = {each.name: getattr(part, each.name) for each in dataclasses.fields(part)}
            usual = {each.name: each.default for each in dataclasses.fields(part)}
            content[key] = {name: of for name, of in values.items() if of != usual[name]}
    return content
