"""``utank-hil design``: a tank beside the best passive one, and how far to fill it."""

import math
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from rich.table import Table

from firmware_sim.commands.design_controller import controller
from firmware_sim.commands.sea_choice import SeaOption, keep, sea_of, usual_scenario
from firmware_sim.scenario import Scenario
from utank_hil.analysis.tank_filling import fillings
from utank_hil.analysis.tank_response import expected_sea, roll_curves
from utank_hil.analysis.tank_sizing import moving, tank_cost, with_duct_loss
from utank_hil.analysis.tank_sweep import sweep_tank
from utank_hil.base.parameters import ParameterError
from utank_hil.base.provenance import describe
from utank_hil.configuration import ControllerConfig, Vessel
from utank_hil.console import common
from utank_hil.console.ship_report import order_words, sized_words
from utank_hil.console.terminal import Terminal, new_table, notes
from utank_hil.control import DesignPlant, PumpLimits
from utank_hil.control.optimal_tank import best_passive_tank, tank_figures
from utank_hil.dynamics.tank import Tank
from utank_hil.sea import Harmonics

if TYPE_CHECKING:
    from firmware_sim.prediction import Expected, Laws


PICTURE, FIGURES, SWEEP = "tank.png", "tank.json", "tank_sweep.png"
GMS = (0.6, 0.8, 1.0, 1.2, 1.4, 1.6)
DISPLACEMENTS = (0.85, 1.0, 1.15)
LOADINGS = 5.0  #: Times the file's GM or displacement at most: more is another unit. Chosen.
"""Loadings that filling is advised for by default, over those of the file."""

Ship = Annotated[Path, common.argument("Ship, tank and pump: a file of configs/ships.")]


def tank(
    context: typer.Context,
    vessel: Ship,
    scenario: SeaOption = None,
    sweep: Annotated[
        bool, common.option("Other tanks, too: share of stability and frequency.", "--sweep")
    ] = False,
    out: common.Out = common.OUT,
    json_: common.Json = False,
) -> None:
    """Say what a tank costs the ship and what it does in a sea, beside the best passive one.

    The best one has the least greatest roll over all wave frequencies; it keeps reservoirs, width,
    height and place, and differs in duct area and damping. Roll and pump are what a bench is
    expected to give. The active tank has the scenario's self-tuned law, designed for each tank;
    without one there, a self-tuned law for its sea.

    **Example:** utank-hil design tank configs/ships/naval_vessel.yaml
    """
    from firmware_sim.prediction import other_loadings, predict
    from firmware_sim.tank_report import interval_words, loading_table, rolls, sweep_table
    from utank_hil.pictures.tank import draw_sweep, draw_tank

    loaded = common.load(vessel, Vessel)
    with common.failing(ValueError):
        best = best_passive_tank(loaded.ship, loaded.tank)
        if loaded.tank.quadratic_loss:
            best = with_duct_loss(loaded.ship, best)
    tanks = {"present": loaded.tank, "best": best}
    path = scenario or usual_scenario(loaded, vessel)
    console = Terminal()
    figures: dict[str, Any] = {"vessel": loaded.name, "scenario": None}
    if path is None and not sweep:
        figures |= {name: _figures(loaded, each, None) for name, each in tanks.items()}
        if json_:
            common.print_json(figures)
            return
        console.table(_table(loaded, tanks, {}))
        _say_pump(console, loaded)
        console.say("Name a sea with --scenario for the roll to be expected.")
        return
    chosen, waves = sea_of(path, loaded, vessel)
    name = chosen.name
    out = common.prepare_out(out, (PICTURE, FIGURES, SWEEP))
    with notes.busy(f"{loaded.name}: a law for each tank, and what a bench would give"):
        benches = {key: _bench(chosen, loaded, each, waves) for key, each in tanks.items()}
        found = {key: predict(bench, plant, *laws) for key, (bench, plant, laws) in benches.items()}
        bench, plant, (law, *_) = benches["present"]
        loadings = other_loadings(bench, plant, law, found["present"][0])
    # a scenario of `init` begins with the ship's name
    title = name if name.startswith(loaded.name) else f"{loaded.name}: {name}"
    about = describe("design tank", loaded, out, options=context.params, scenario=chosen)
    drawn = {
        each.period_scale: [roll.mean if roll else math.nan for roll in rolls(each.expected)]
        for each in loadings
    }
    draw_tank(roll_curves(plant, waves, law), drawn, out / PICTURE, title, about)
    figures |= about | {key: _figures(loaded, each, found[key]) for key, each in tanks.items()}
    figures["loading"] = [
        {"period_scale": each.period_scale, **each.expected.as_json()} for each in loadings
    ]
    others = sweep_tank(_plant(loaded), waves) if sweep else ()
    figures |= {"scenario": name, "sweep": [asdict(each) for each in others]}
    more = {"sweep": draw_sweep(others, out / SWEEP, title, about)} if sweep else {}
    files = keep(figures, out / PICTURE, out / FIGURES, json_=json_, **more)
    if json_:
        return
    console.table(_table(loaded, tanks, found, interval_words(found["present"][0], name)))
    if loaded.pump is not None and law is None:
        console.say("no self-tuned law has all margins with this tank", yellow="not active:")
    elif chosen.controllers and not _self_tuned(chosen):
        laws = ", ".join(chosen.controllers)
        console.say(f"active: a self-tuned law for this sea; a bench has {laws}")
    _say_pump(console, loaded)
    if loadings:
        console.table(loading_table(loadings))
    if sweep:
        console.table(sweep_table(others))
    console.files(files)


def filling(
    context: typer.Context,
    vessel: Annotated[Path, common.argument("Ship with displacement, and tank with roof.")],
    scenario: SeaOption = None,
    gm: Annotated[
        list[float] | None,
        common.option("GM without the tank's free surface, in m; may be given again."),
    ] = None,
    displacement: Annotated[
        list[float] | None, common.option("Displacement in t; may be given again.")
    ] = None,
    out: common.Out = common.OUT,
    json_: common.Json = False,
) -> None:
    """Say how far to fill the tank, by displacement and GM: the still level with the least roll.

    The tank's walls stay. Roll is a linear prediction for the passive tank in the scenario's sea,
    with the same waves for every loading. Without --gm and --displacement: 0.6 to 1.6 times the
    file's GM, 0.85 to 1.15 times its displacement.

    **Example:** utank-hil design filling VESSEL --gm 0.8 --gm 1.2 --displacement 14500
    """
    from firmware_sim.tank_report import filling_table
    from utank_hil.pictures.tank import draw_filling

    loaded = common.load(vessel, Vessel)
    path = scenario or usual_scenario(loaded, vessel)
    ship, (chosen, waves) = loaded.ship, sea_of(path, loaded, vessel)
    if not ship.displacement_n > 0:
        common.fail(f"{vessel}: ship.displacement_t is needed to tell GM from stiffness: state it")
    own_t, own_m = ship.displacement_n / 9806.65, ship.stiffness_nm_rad / ship.displacement_n
    for name, values, own, unit in (
        ("--gm", gm, own_m, "metres"),
        ("--displacement", displacement, own_t, "tonnes"),
    ):
        for value in values or ():
            if not 1 / LOADINGS <= value / own <= LOADINGS:
                common.fail(
                    f"{name} {value:g}: the file has {own:.3g}, and a loading 1/{LOADINGS:g} to "
                    f"{LOADINGS:g} times that; state it in {unit}"
                )
    loads_t = displacement or [share * own_t for share in DISPLACEMENTS]
    gms_m = gm or [share * own_m for share in GMS]
    loadings = [(load_t, gm_m) for load_t in sorted(loads_t) for gm_m in sorted(gms_m)]
    with common.failing(ValueError, at=vessel):
        pump_pa = 0.0 if loaded.pump is None else loaded.pump.max_pressure_pa
        found = fillings(_plant(loaded), waves, loadings, pump_pa)
    out = common.prepare_out(out, ("filling.png", "filling.json"))
    about = describe("design filling", loaded, out, options=context.params, scenario=chosen)
    title = f"{loaded.name}: filling for {chosen.name}"
    draw_filling(found, out / "filling.png", title, about)
    figures = about | {"vessel": loaded.name, "scenario": chosen.name}
    figures["fillings"] = [asdict(each) for each in found]
    files = keep(figures, out / "filling.png", out / "filling.json", json_=json_)
    if not json_:
        console = Terminal()
        console.table(filling_table(found, loaded.tank.height_m, chosen.name))
        console.files(files)


def _plant(vessel: Vessel) -> DesignPlant:
    limits, pump = PumpLimits(**vessel.default_limits), vessel.pump
    lag_s = 0.0 if pump is None else pump.lag_s
    return DesignPlant(vessel.ship, vessel.tank, lag_s=lag_s, limits=limits)


def _bench(
    scenario: Scenario, vessel: Vessel, tank: Tank, waves: Harmonics
) -> "tuple[Scenario, DesignPlant, Laws]":
    """Scenario with a tank, its plant, and the self-tuned laws for it, if there are any."""
    from firmware_sim.prediction import laws_of
    from utank_hil.analysis.loop.self_tuning import NoLawError, SelfTunedDesign

    vessel = vessel.model_copy(update={"tank": tank})
    scenario = scenario.model_copy(update={"vessel": vessel})
    if vessel.pump is None:
        return scenario, _plant(vessel), (None,)
    own = _self_tuned(scenario)
    content = {"name": "", "vessel": vessel, "law": {"kind": "self_tuned"}}
    config = own[0] if own else ControllerConfig.model_validate(content)
    design = config.law if own else SelfTunedDesign("self_tuned", expected_sea(vessel.ship, waves))
    config = config.model_copy(update={"vessel": vessel, "law": design})
    try:
        return scenario, config.plant, laws_of(scenario, config)
    except ParameterError as error:
        if not isinstance(error.__cause__, NoLawError):
            raise
        return scenario, config.plant, (None,) * (1 + config.renews)


def _say_pump(console: Terminal, vessel: Vessel) -> None:
    order = "" if vessel.pump is None else order_words(vessel)
    console.say(f"pump: net head, flow, shaft, duty: {order}" if order else sized_words(vessel))


def _self_tuned(scenario: Scenario) -> list[ControllerConfig]:
    from utank_hil.analysis.loop.self_tuning import SelfTunedDesign

    laws = scenario.controllers.values()
    return [each for each in laws if isinstance(each.law, SelfTunedDesign)]


def _figures(vessel: Vessel, tank: Tank, found: "Sequence[Expected] | None") -> dict[str, Any]:
    from firmware_sim.prediction import as_json

    return {
        **asdict(tank_figures(vessel.ship, moving(vessel.ship, tank))),
        **asdict(tank_cost(vessel.ship, tank)),
        "expected": None if found is None else as_json(found),
    }


def _table(
    vessel: Vessel,
    tanks: dict[str, Tank],
    found: "dict[str, tuple[Expected, ...]]",
    caption: str = "",
) -> Table:
    from firmware_sim.tank_report import cost_rows, figure_rows, roll_rows

    table = new_table(f"Tank of {vessel.name}", *tanks, caption=caption)
    columns = []
    for name, tank in tanks.items():
        rows = [
            *figure_rows(tank_figures(vessel.ship, moving(vessel.ship, tank))),
            *cost_rows(tank_cost(vessel.ship, tank)),
        ]
        columns.append(rows + (roll_rows(found[name]) if found else []))
    for (text, present), (_, best) in zip(*columns, strict=True):
        if present or best:
            table.add_row(text, present, best)
    return table


design = common.new_app(
    "Design a tank, or judge a law: what it could be, and what it would cost.\n\n"
    "**Example:** utank-hil design tank configs/ships/naval_vessel.yaml"
)
design.command()(tank)
design.command()(filling)
design.command()(controller)
