"""``utank-hil check``: is a configuration fit to be used, and how robust are its laws."""

import json
import math
import sys
from importlib.metadata import entry_points
from pathlib import Path
from typing import Annotated

import typer

from utank_hil.analysis.loop.robustness import Robustness, robustness
from utank_hil.commands.common import Json, fail, load, notes
from utank_hil.configuration.controller import ControllerConfig
from utank_hil.configuration.files import ConfigError, kind_of
from utank_hil.configuration.laws import build_law
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
        judged = {name: (each, judge(each)) for name, each in collection.controllers.items()}
        content = report.collection_json(collection.name, collection.vessel, judged)
        if not json_:
            report.print_collection(kind, collection.name, collection.vessel, judged)
    else:
        controller = load(config, ControllerConfig)
        robust = judge(controller)
        content = report.controller_json(controller, robust)
        if not json_:
            report.print_controller(controller, robust)
    if json_:
        sys.stdout.write(json.dumps({"kind": kind, **content}) + "\n")
    if not content.get("accepted", True):
        raise typer.Exit(1)


def judge(config: ControllerConfig) -> Robustness | None:
    """Robustness of a configuration's law; None if it has no loop.

    Of a nonlinear law it is that of its slope at rest (`BuiltLaw.linear`). Ends the command if the
    margins can't be computed: then the law can't be trusted either.
    """
    vessel = config.vessel
    built = build_law(config.law, vessel, config.delay_s, config.limits)
    if built.linear is None:
        return None
    try:
        found = robustness(
            built.linear,
            vessel.ship,
            vessel.tank,
            built.measured,
            config.delay_s,
            vessel.pump.lag_s,
        )
    except (ValueError, ArithmeticError) as error:
        fail(f"{config.name}: law: its margins can't be computed: {error}")
    figures = (found.nominal.radius, found.nominal.peak_sensitivity, found.worst_radius)
    if not all(map(math.isfinite, figures)):
        fail(f"{config.name}: law: its margins can't be computed: it is beyond all scale")
    return found


def refuse_low_margins(config: ControllerConfig) -> None:
    """End the command if the law misses its margins and the configuration does not accept that."""
    report = judge(config)
    failures = () if report is None else report.failures()
    for failure in failures:
        notes.print(f"[yellow]{config.name}, margins:[/yellow]", failure, soft_wrap=True)
    if failures and not config.accept_low_margins:
        fail(
            f"{config.name}: the law misses its margins; redesign it, or set "
            "accept_low_margins: true"
        )
