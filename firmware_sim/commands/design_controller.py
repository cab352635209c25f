"""``utank-hil design controller``: a law's roll against its robustness and pressure."""

import math
from dataclasses import asdict
from typing import TYPE_CHECKING, Any, Final

import typer
from rich.table import Table
from rich.text import Text

from firmware_sim.commands.sea_choice import SeaOption, keep, sea_of, usual_scenario
from utank_hil.base.provenance import describe
from utank_hil.configuration import ControllerConfig
from utank_hil.console import common
from utank_hil.console.terminal import Terminal, new_table, progress_bar

if TYPE_CHECKING:
    from utank_hil.analysis.loop.trade import Trade, TradePoint

PICTURE: Final = "design.png"
FIGURES: Final = "design.json"


def controller(
    context: typer.Context,
    config: common.Config,
    scenario: SeaOption = None,
    out: common.Out = common.OUT,
    json_: common.Json = False,
) -> None:
    """Trade roll against robustness and pressure: scale the design's effort over decades.

    Roll, level and pressure are linear predictions for the scenario's sea, without any limit of
    pump or tank. Laws that miss a required margin are marked as refused.

    **Example:** utank-hil design controller configs/controllers/gpc.yaml
    """
    from utank_hil.analysis.loop.linear_tuning import AutoDesign
    from utank_hil.analysis.loop.trade import Design, trade
    from utank_hil.pictures.trade import draw_trade

    loaded = common.load(config, ControllerConfig, allow_code=True)  # foreign code is not run
    law = loaded.law
    if isinstance(law, AutoDesign):
        law = law.tuned(loaded.design_plant)
    if not isinstance(law, Design):
        common.fail(
            f"{config}: law.kind: a {law.kind} law has no weight to trade: take "
            "{kind: gpc, tuning: auto} in its place, in a copy of the file without sea_estimate"
        )
    vessel = loaded.vessel
    sea, waves = sea_of(scenario or usual_scenario(vessel, config), vessel, config)
    out = common.prepare_out(out, (PICTURE, FIGURES))
    with progress_bar() as bar:
        task = bar.add_task("designing", total=1.0)
        result = trade(
            law, loaded.plant, waves, progress=lambda done: bar.update(task, completed=done)
        )
    title = f"{loaded.name}: {vessel.name} in {sea.name}"
    limits = loaded.limits
    about = describe("design controller", loaded, out, options=context.params, scenario=sea)
    draw_trade(result, out / PICTURE, title, limits.pressure_pa, limits.level_m, about)
    figures = about | {"name": loaded.name, "vessel": vessel.name, "scenario": sea.name}
    figures |= _as_json(result)
    files = keep(figures, out / PICTURE, out / FIGURES, json_=json_)
    if json_:
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
