"""``utank-hil design tank``: tanks for a ship in a sea."""

import json
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from rich.table import Table

from firmware_sim.commands.shipped_scenarios import shipped_scenario
from utank_hil.base.provenance import describe
from utank_hil.base.whole_file import write_whole
from utank_hil.configuration import Vessel
from utank_hil.console.common import OUT, Json, fail, load, prepare_out, print_json
from utank_hil.console.ship_report import order_words
from utank_hil.console.terminal import Terminal, new_table
from utank_hil.dynamics.tank import Tank

if TYPE_CHECKING:
    from firmware_sim.scenario import Scenario
    from utank_hil.analysis.tank_prediction import RollPrediction, SeaState, SweepPoint
    from utank_hil.control import DesignPlant
    from utank_hil.dynamics.ship import RollShip

PICTURE, SWEEP, FIGURES = "tank.png", "tank_sweep.png", "tank.json"


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
    from utank_hil.control.optimal_tank import best_passive_tank
    from utank_hil.pictures.tank import draw_sweep, draw_tank

    loaded = load(vessel, Vessel)
    try:
        best = best_passive_tank(loaded.ship, loaded.tank)
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
    out = prepare_out(out, (PICTURE, SWEEP, FIGURES))
    plant, own = plants["present"], found["present"]
    loadings = loading_sensitivity(plant, sea, own)
    title = f"{loaded.name}: {name}"
    about = describe("design tank", loaded, out, options=context.params, scenario=chosen)
    files = {"picture": out / PICTURE, "figures": out / FIGURES}
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
    if left_out := _left_out(loaded.ship):
        console.say(f"left out of the roll: {left_out}; utank-hil bench has it")
    console.table(loading_table(loadings))
    for each in sweep_tables(points) if points else ():
        console.table(each)
    console.files(files)


def _left_out(ship: "RollShip") -> str:
    """Effects that a linear prediction of this ship leaves out."""
    return "the restoring moment's curve" if ship.restoring_odd_nm or ship.gz_m else ""


def _sea(path: Path, vessel: Vessel) -> tuple["Scenario", "SeaState"]:
    """Scenario, and its sea as it acts on the vessel's ship."""
    from firmware_sim.pooled_waves import pooled_wave_moment
    from firmware_sim.scenario import Scenario
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
    from utank_hil.analysis.tank_sizing import tank_cost
    from utank_hil.control.optimal_tank import tank_figures

    return {
        **asdict(tank_figures(vessel.ship, tank)),
        **asdict(tank_cost(vessel.ship, tank)),
        "prediction": None if found is None else prediction_json(found),
    }


def _table(
    vessel: Vessel, tanks: dict[str, Tank], found: dict[str, "RollPrediction"], caption: str = ""
) -> Table:
    """Table of the present tank beside the best passive one."""
    from firmware_sim.tank_report import cost_rows, figure_rows, roll_rows
    from utank_hil.analysis.tank_sizing import tank_cost
    from utank_hil.control.optimal_tank import tank_figures

    table = new_table(f"Tank of {vessel.name}", *tanks, caption=caption)
    columns = []
    for name, tank in tanks.items():
        rows = [
            *figure_rows(tank_figures(vessel.ship, tank)),
            *cost_rows(tank_cost(vessel.ship, tank)),
        ]
        columns.append(rows + (roll_rows(found[name]) if found else []))
    for (text, present), (_, best) in zip(*columns, strict=True):
        table.add_row(text, present, best)
    return table
