"""``utank-hil check``: is a configuration fit to be used, and how robust are its laws."""

import json
import sys
from importlib.metadata import entry_points
from pathlib import Path
from typing import Annotated

import typer

from utank_hil.commands.common import Json, fail, load
from utank_hil.commands.exit_codes import ExitCode
from utank_hil.commands.gate import judge
from utank_hil.configuration.controller import ControllerConfig
from utank_hil.configuration.files import ConfigError, kind_of
from utank_hil.configuration.vessel import Vessel

GROUP = "utank_hil.collections"
"""Entry points of further kinds of file: models with a name, vessel and mapping `controllers`."""


def check(
    config: Annotated[Path, typer.Argument(help="Controller, scenario or ship.")],
    json_: Json = False,
) -> None:
    """Validate a controller, scenario or ship file; design the laws and print their margins.

    Exit code 0: fit to be used. 1: a law misses the required margins. 2: the file is wrong; every
    error is listed with file, key and reason.

    [bold]Example:[/bold] utank-hil check configs/controllers/gpc.yaml
    """
    from utank_hil.commands import check_report as report

    collections = {point.name: point.load() for point in entry_points(group=GROUP)}
    try:
        kind = kind_of(config, {"controller": ControllerConfig, "ship": Vessel, **collections})
    except ConfigError as error:
        fail(error)
    if kind == "ship":
        vessel = load(config, Vessel)
        content = report.ship_json(vessel)
        if not json_:
            report.print_ship(vessel)
    elif kind in collections:
        collection = load(config, collections[kind])
        judged = {
            name: judge(each, config, f"controllers.{name}")
            for name, each in collection.controllers.items()
        }
        content = report.collection_json(collection.name, collection.vessel, judged)
        if not json_:
            report.print_collection(kind, collection.name, collection.vessel, judged)
    else:
        controller = judge(load(config, ControllerConfig), config)
        content = report.controller_json(controller)
        if not json_:
            report.print_controller(controller)
    if json_:
        sys.stdout.write(json.dumps({"kind": kind, **content}) + "\n")
    if not content.get("accepted", True):
        raise typer.Exit(ExitCode.REFUSED)
