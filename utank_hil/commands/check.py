"""``utank-hil check``: is a configuration fit to be used, and how robust are its laws."""

from importlib.metadata import entry_points
from pathlib import Path
from typing import Annotated

import typer
from pydantic import BaseModel

from utank_hil.configuration.controller import ControllerConfig
from utank_hil.configuration.files import ConfigError, kind_of
from utank_hil.configuration.vessel import Vessel
from utank_hil.console.admission import judge_law
from utank_hil.console.common import AllowCode, Json, fail, load, print_json, warnings_of
from utank_hil.console.exit_codes import ExitCode
from utank_hil.console.terminal import Terminal

GROUP = "utank_hil.collections"
"""Entry points of further kinds of file: models with a name, a vessel, a mapping `controllers`, and
`figures` and `meaning` of whatever else they hold."""


def check(
    config: Annotated[Path, typer.Argument(help="Controller, scenario or ship.")],
    json_: Json = False,
    allow_code: AllowCode = False,
) -> None:
    """Validate a controller, scenario or ship file; design the laws and print their margins.

    Exit code 0: fit to be used. 1: a law misses the required margins, or the pump's pressure, held
    at its limit, takes the ship beyond its roll limit and no hard-wired cut is declared. 2: the
    file is wrong; every error is listed with file, key and reason.

    **Example:** utank-hil check configs/controllers/gpc.yaml
    """
    from utank_hil.commands import check_report as report
    from utank_hil.console.ship_report import print_ship, ship_json

    loaded: BaseModel
    pumped: dict[str, Vessel | ControllerConfig]
    collections = {point.name: point.load() for point in entry_points(group=GROUP)}
    try:
        kind = kind_of(config, {"controller": ControllerConfig, "ship": Vessel, **collections})
    except ConfigError as error:
        fail(error)
    if kind == "ship":
        loaded = ship = load(config, Vessel)
        content, pumped = ship_json(ship), {"": ship}
        if not json_:
            print_ship(ship)
    elif kind in collections:
        collection = load(config, collections[kind], allow_code=allow_code)
        judged = {
            name: judge_law(each, config, f"controllers.{name}")
            for name, each in collection.controllers.items()
        }
        pumped = {f"controllers.{name}.": each for name, each in collection.controllers.items()}
        loaded, content = collection, report.collection_json(collection, judged)
        if not json_:
            report.print_collection(kind, collection, judged)
    else:
        loaded = only = load(config, ControllerConfig, allow_code=allow_code)
        controller, pumped = judge_law(only, config), {"": only}
        content = report.controller_json(controller)
        if not json_:
            report.print_controller(controller)
    held = [
        f"{config}: {where}{key} {reason}"
        for where, each in pumped.items()
        for key, reason in each.held_pressure_problems()
    ]
    content["accepted"] = content.get("accepted", True) and not held
    if json_:
        unusual = [str(warning) for warning in warnings_of(loaded, config)]
        print_json({"kind": kind, **content, "warnings": unusual})
    else:
        for reason in held:
            Terminal().say(reason, red="refused:")
    if not content["accepted"]:
        raise typer.Exit(ExitCode.REFUSED)
    if not json_:
        following: dict[str, tuple[str | Path, ...]] = {
            "ship": ("design", "tank", config),
            "controller": ("run", config, "--bus", "can0"),
        }
        Terminal().lead_on(following.get(kind, ("bench", config)))
