"""``utank-hil design``: candidate laws and tanks, with their costs."""

import json
import math
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from pydantic import BaseModel
from rich.table import Table
from rich.text import Text

from firmware_sim.commands.bench import STORM
from firmware_sim.pooled_waves import pooled_wave_moment
from firmware_sim.scenario import Scenario
from utank_hil.base.provenance import describe
from utank_hil.base.whole_file import write_whole
from utank_hil.configuration import ControllerConfig, Vessel
from utank_hil.console.common import OUT, Json, fail, load, new_app, prepare_out, print_json
from utank_hil.console.ship_report import order_words
from utank_hil.console.terminal import Terminal, new_table, progress_bar
from utank_hil.dynamics.tank import Tank

if TYPE_CHECKING:
    from utank_hil.analysis.loop.trade import Trade, TradePoint
    from utank_hil.analysis.tank_prediction import RollPrediction, SeaState, SweepPoint
    from utank_hil.control import DesignPlant


PICTURE, FIGURES = "design.png", "design.json"


def controller(
    context: typer.Context,
    config: Annotated[Path, typer.Argument(help="Controller configuration.")],
    scenario: Annotated[
        Path | None,
        typer.Option(
            help="Scenario whose sea counts.",
            show_default="the shipped one of the controller's vessel",
        ),
    ] = None,
    out: Annotated[Path, typer.Option(help="Folder for picture and figures.")] = OUT,
    json_: Json = False,
) -> None:
    """Trade roll against robustness and pressure: scale the design's effort over decades.

    Roll, level and pressure are linear predictions for the scenario's sea, without any limit of
    pump or tank. Laws that miss a required margin are marked as refused.

    **Example:** utank-hil design controller configs/controllers/gpc.yaml
    """
    from utank_hil.analysis.loop.linear_tuning import AutoDesign
    from utank_hil.analysis.loop.sea_response import CalmSeaError
    from utank_hil.analysis.loop.trade import Design, trade
    from utank_hil.pictures.trade import draw_trade

    loaded = load(config, ControllerConfig, allow_code=True)  # foreign code is refused, not run
    law = loaded.law
    if isinstance(law, AutoDesign):
        law = law.tuned(loaded.design_plant)
    if not isinstance(law, Design):
        fail(
            f"{config}: law.kind: a {law.kind} law has no weight to trade: take "
            "{kind: gpc, tuning: auto} in its place, in a copy of the file"
        )
    vessel = loaded.vessel
    path = scenario or shipped_scenario(vessel)
    if path is None:
        fail(f"no shipped scenario is for {vessel.name}: say with --scenario which sea counts")
    sea = load(path, Scenario, allow_code=True)  # laws are not built from it
    out = prepare_out(out, (PICTURE, FIGURES))
    try:
        with progress_bar() as bar:
            task = bar.add_task("designing", total=1.0)
            result = trade(
                law,
                loaded.plant,
                pooled_wave_moment(sea, vessel.ship),
                progress=lambda done: bar.update(task, completed=done),
            )
    except CalmSeaError as error:
        fail(f"{path}: sea: {error}; name another scenario with --scenario")
    files = {"picture": out / PICTURE, "figures": out / FIGURES}
    title = f"{loaded.name}: {vessel.name} in {sea.name}"
    limits = loaded.limits
    about = describe("design controller", loaded, out, options=context.params, scenario=sea)
    draw_trade(result, files["picture"], title, limits.pressure_pa, limits.level_m, about)
    figures = {
        **about,
        "name": loaded.name,
        "vessel": vessel.name,
        "scenario": sea.name,
        **_as_json(result),
        "files": {name: str(path) for name, path in files.items()},
    }
    write_whole(files["figures"], json.dumps(figures, indent=2) + "\n")
    if json_:
        print_json(figures)
        return
    console = Terminal()
    console.table(_trade_table(result, title))
    for point in result.points:
        if point.factor == 1:
            for failure in point.robustness.failures():
                console.say(failure, red="missed by the design:")
    console.files(files)


def _trade_table(result: "Trade", title: str) -> Table:
    table = new_table(
        title,
        "roll\n°",
        "below\npassive",
        "pressure\nkPa",
        "level\nm",
        "sensi-\ntivity",
        "eigen-\nvalue",
        "",
        names=(result.varied.replace(" ", "\n"),),
        caption="RMS by linear prediction, without limits of pump and tank",
    )
    passive = result.passive
    table.add_row(
        "passive",
        f"{math.degrees(passive.roll_rms_rad):.2f}",
        "",
        "",
        f"{passive.level_rms_m:.2f}",
        end_section=True,
    )
    for point in result.points:
        table.add_row(*_trade_cells(point), style="bold" if point.factor == 1 else None)
    return table


def _trade_cells(point: "TradePoint") -> tuple[str | Text, ...]:
    motion, less, judged = point.motion, point.roll_below_passive, point.robustness
    verdict = Text("refused", "red") if point.refused else Text("ok", "green")
    predicted = ("unstable", "", "", "")
    if motion is not None and less is not None:
        predicted = (
            f"{math.degrees(motion.roll_rms_rad):.2f}",
            f"{less:.1%}",
            f"{motion.pressure_rms_pa / 1e3:.1f}",
            f"{motion.level_rms_m:.2f}",
        )
    return (
        "design" if point.factor == 1 else f"×{point.factor:.3g}",
        *predicted,
        f"{judged.nominal.peak_sensitivity:.2f}",
        f"{judged.worst_radius:.4f}",
        verdict,
    )


def _as_json(result: "Trade") -> dict[str, Any]:
    return {
        "varied": result.varied,
        "passive": asdict(result.passive),
        "points": [
            {
                "factor": point.factor,
                "motion": None if point.motion is None else asdict(point.motion),
                "roll_below_passive": point.roll_below_passive,
                "peak_sensitivity": point.robustness.nominal.peak_sensitivity,
                "worst_radius": point.robustness.worst_radius,
                "failures": list(point.robustness.failures()),
                "refused": point.refused,
            }
            for point in result.points
        ],
    }


TANK_PICTURE, SWEEP, TANK_FIGURES = "tank.png", "tank_sweep.png", "tank.json"


def tank(
    context: typer.Context,
    vessel: Annotated[Path, typer.Argument(help="Ship, tank and pump: a file of configs/ships.")],
    scenario: Annotated[
        Path | None,
        typer.Option(help="Scenario whose sea counts.", show_default="the vessel's, if shipped"),
    ] = None,
    sweep: Annotated[
        bool, typer.Option("--sweep", help="Other tanks: share of stability and frequency.")
    ] = False,
    out: Annotated[Path, typer.Option(help="Folder for pictures and figures.")] = OUT,
    json_: Json = False,
) -> None:
    """Say what a tank costs the ship and what it does in a sea, beside the best passive one.

    The best one has the least greatest roll over all wave frequencies; it keeps reservoirs, width,
    height and place, and differs in duct area and damping. Roll is a linear prediction. The active
    tank has an LQG law that meets the required margins, within the limits of pump and level.

    **Example:** utank-hil design tank configs/ships/naval_vessel.yaml --sweep
    """
    from firmware_sim.tank_report import loading_table, sweep_json, sweep_tables
    from utank_hil.analysis.tank_prediction import (
        loading_sensitivity,
        predict_roll,
        roll_curves,
        sweep_tank,
    )
    from utank_hil.analysis.tank_sizing import with_duct_loss
    from utank_hil.control.optimal_tank import best_passive_tank
    from utank_hil.pictures.tank import draw_sweep, draw_tank

    loaded = load(vessel, Vessel)
    try:
        best = best_passive_tank(loaded.ship, loaded.tank)
        if loaded.tank.quadratic_loss:
            best = with_duct_loss(loaded.ship, best)
    except ValueError as error:
        fail(error)
    tanks = {"present": loaded.tank, "best": best}
    path = scenario or shipped_scenario(loaded)
    console = Terminal()
    figures: dict[str, Any] = {"vessel": loaded.name, "scenario": None}
    if path is None:
        if sweep:
            fail(f"no shipped scenario is for {loaded.name}: say with --scenario which sea counts")
        figures |= {name: _figures(loaded, each, None) for name, each in tanks.items()}
        if json_:
            print_json(figures)
            return
        console.table(_table(loaded, tanks, {}))
        console.say("Name a sea with --scenario for the roll to be expected.")
        return
    chosen, sea = _sea(path, loaded)
    name = chosen.name
    plants = {key: _plant(loaded, each) for key, each in tanks.items()}
    pump = loaded.pump is not None
    found = {key: predict_roll(plant, sea, pump=pump) for key, plant in plants.items()}
    out = prepare_out(out, (TANK_PICTURE, SWEEP, TANK_FIGURES))
    plant, own = plants["present"], found["present"]
    loadings = loading_sensitivity(plant, sea, own)
    title = f"{loaded.name}: {name}"
    about = describe("design tank", loaded, out, options=context.params, scenario=chosen)
    files = {"picture": out / TANK_PICTURE, "figures": out / TANK_FIGURES}
    draw_tank(roll_curves(plant, sea, own.law), loadings, files["picture"], title, about)
    points: Sequence[SweepPoint] = ()
    if sweep:
        points = sweep_tank(plant, sea, pump=pump)
        files["sweep"] = draw_sweep(points, out / SWEEP, title, about)
    figures |= about | {
        "scenario": name,
        **{key: _figures(loaded, each, found[key]) for key, each in tanks.items()},
        "loading": [asdict(point) for point in loadings],
        "sweep": sweep_json(points),
        "files": {key: str(file) for key, file in files.items()},
    }
    write_whole(files["figures"], json.dumps(figures, indent=2) + "\n")
    if json_:
        print_json(figures)
        return
    console.table(_table(loaded, tanks, found, f"roll: linear prediction for {name}"))
    if loaded.pump is not None:
        console.say(f"pump: net head, flow, shaft, duty: {order_words(loaded)}")
    if loaded.ship.restoring_odd_nm or loaded.ship.gz_m:
        console.say("left out of the roll: the restoring moment's curve; utank-hil bench has it")
    console.table(loading_table(loadings))
    for each in sweep_tables(points) if points else ():
        console.table(each)
    console.files(files)


def _sea(path: Path, vessel: Vessel) -> tuple[Scenario, "SeaState"]:
    """Scenario, and its sea as it acts on the vessel's ship."""
    from utank_hil.analysis.loop.sea_response import CalmSeaError
    from utank_hil.analysis.tank_prediction import SeaState

    scenario = load(path, Scenario, allow_code=True)  # laws are not built from it
    try:
        return scenario, SeaState.on(vessel.ship, pooled_wave_moment(scenario, vessel.ship))
    except CalmSeaError as error:
        fail(f"{path}: sea: {error}; name another scenario with --scenario")


def _plant(vessel: Vessel, tank: Tank) -> "DesignPlant":
    """Plant for the design of a law, with the vessel's level limit and lag."""
    from utank_hil.control import DesignPlant, PumpLimits

    lag_s = 0.0 if vessel.pump is None else vessel.pump.lag_s
    return DesignPlant(vessel.ship, tank, lag_s=lag_s, limits=PumpLimits(**vessel.default_limits))


def _figures(vessel: Vessel, tank: Tank, found: "RollPrediction | None") -> dict[str, Any]:
    from firmware_sim.tank_report import prediction_json
    from utank_hil.analysis.tank_sizing import moving, tank_cost
    from utank_hil.control.optimal_tank import tank_figures

    return {
        **asdict(tank_figures(vessel.ship, moving(vessel.ship, tank))),
        **asdict(tank_cost(vessel.ship, tank)),
        "prediction": None if found is None else prediction_json(found),
    }


def _table(
    vessel: Vessel, tanks: dict[str, Tank], found: dict[str, "RollPrediction"], caption: str = ""
) -> Table:
    """Table of the present tank beside the best passive one."""
    from firmware_sim.tank_report import cost_rows, figure_rows, roll_rows
    from utank_hil.analysis.tank_sizing import moving, tank_cost
    from utank_hil.control.optimal_tank import tank_figures

    table = new_table(f"Tank of {vessel.name}", *tanks, caption=caption)
    columns = []
    for name, tank in tanks.items():
        rows = [
            *figure_rows(tank_figures(vessel.ship, moving(vessel.ship, tank))),
            *cost_rows(tank_cost(vessel.ship, tank)),
        ]
        columns.append(rows + (roll_rows(found[name]) if found else []))
    for (text, present), (_, best) in zip(*columns, strict=True):
        table.add_row(text, present, best)
    return table


class _VesselOfScenario(BaseModel):
    """Vessel of a scenario; loading the rest could require the design of its controllers."""

    vessel: Vessel


def shipped_scenario(vessel: Vessel) -> Path | None:
    """Shipped scenario of a vessel: the storm for its ship, else the first one with the ship."""
    shipped = [STORM, *sorted(STORM.parent.glob("*.yaml"))]
    own = (p for p in shipped if load(p, _VesselOfScenario).vessel.version == vessel.version)
    return next(own, None)


design = new_app("Design a law or a tank: what it could be, and what it would cost.")
design.command()(controller)
design.command()(tank)
