"""``utank-hil check``: is a configuration fit to be used, and how robust are its laws."""

import math
from dataclasses import asdict, replace
from importlib.metadata import entry_points
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer
from pydantic import BaseModel
from rich.text import Text

from utank_hil.analysis.loop.margins import DELAY_SAMPLES, Margins, Robustness
from utank_hil.analysis.loop.self_tuning import NoLawError, SelfTunedDesign
from utank_hil.base.finite import finite
from utank_hil.configuration.controller import ControllerConfig
from utank_hil.configuration.files import ConfigError, files_named, kind_of, load_config
from utank_hil.configuration.vessel import Vessel
from utank_hil.console import common, ship_report
from utank_hil.console.admission import judge_law
from utank_hil.console.common import argument, failing, load
from utank_hil.console.exit_codes import ExitCode
from utank_hil.console.terminal import Command, Terminal, new_table, run_command
from utank_hil.control import BuiltLaw
from utank_hil.control.constrained.design import ConstrainedDesign
from utank_hil.dynamics.linear import state_matrices
from utank_hil.gate import MOST_STEP_S, JudgedLaw

MARGINS = "Margins, delay and pump lag included"
NO_LOOP = "The law closes no loop that quiets the roll: it has no margins."
DISSIPATES = (
    "The law throttles a valve, which can only take energy out of the water, whatever it measures: "
    "no loop can become unstable, and there are no margins. It may still roll the ship more than "
    "the valve at rest; see what a bench says."
)
LEAST_LOOP_GAIN = 0.05
"""Loop gain below which a law with all margins hardly acts; the shipped laws have 1.3 and more."""
Judged = dict[str, JudgedLaw]


def controller_json(judged: JudgedLaw) -> dict[str, Any]:
    """Return a controller as one JSON object."""
    config, report = judged.config, judged.robustness
    return {
        "name": config.name,
        "vessel": config.vessel.name,
        "ship": ship_report.ship_figures(config.vessel),
        "devices": ship_report.devices_json(config.vessel.devices),
        "configuration_version": config.vessel.version,
        "law": config.law.kind,
        "at_rest": _at_rest(judged.law),
        "dissipates": judged.law.dissipates,
        "foreseen_s": judged.foreseen_s,
        "limits": finite(asdict(config.limits)),
        "robustness": None if report is None else finite(asdict(report)),
        "delay_margin_searched_s": None if report is None else _searched_s(judged.law),
        "failures": list(judged.failures),
        "remedy": remedy(judged),
        "accepted": judged.accepted,
    }


def collection_json(collection: Any, judged: Judged) -> dict[str, Any]:
    """Return a file of several controllers, such as a scenario, as one JSON object."""
    vessel: Vessel = collection.vessel
    controllers = {name: controller_json(each) for name, each in judged.items()}
    return {
        "name": collection.name,
        "vessel": vessel.name,
        "ship": ship_report.ship_figures(vessel),
        "figures": collection.figures(),
        "configuration_version": vessel.version,
        "controllers": controllers,
        "accepted": all(each["accepted"] for each in controllers.values()),
    }


def print_controller(judged: JudgedLaw) -> None:
    """Print a controller's margins."""
    config, report = judged.config, judged.robustness
    console = Terminal()
    console.say(f"{config.name} for {config.vessel.name}: the configuration is valid.")
    console.say(ship_report.ship_line(config.vessel))
    ship_report.print_devices(console, config.vessel.devices)
    if report is None:
        if judged.law.unjudged:
            _print_verdict(console, judged)
        else:
            console.say(DISSIPATES if judged.law.dissipates else NO_LOOP)
        return
    margin = report.nominal
    table = new_table(MARGINS, "value", "required")
    worst = radius_words(report.worst_radius)
    for row in (
        ("peak sensitivity", f"{margin.peak_sensitivity:.2f}", "2 or less"),
        ("  at", f"{margin.peak_frequency_rad_s:.2f} rad/s", ""),
        ("pump gain factor", _gain(margin), ""),
        ("phase margin", _phase(margin), ""),
        ("delay margin", _delay(judged.law, margin), "over 20 ms"),
        ("disk margin", f"{margin.disk_margin:.2f}", ""),
        ("greatest loop gain", f"{margin.peak_loop_gain:.3g}", ""),
        ("largest eigenvalue of the grid", worst, "less than 1"),
    ):
        table.add_row(*row)
    table.caption = (
        "grid: roll period 0.7 to 1.3, or inertia 0.8 to 1.25;\n"
        "pump gain 0.8 to 1.2, 0 or 20 ms more delay"
    )
    console.table(table)
    for remark in _remarks(judged, report):
        console.say(remark)
    _print_verdict(console, judged)


def _print_verdict(console: Terminal, judged: JudgedLaw) -> None:
    for failure in judged.failures:
        console.say(failure, red="missed:")
    if judged.failures:
        verdict = "accepted by the configuration" if judged.accepted else "refused"
        console.say(f"This law is {verdict}.")
        _print_remedy(console, judged)
    elif judged.law.adapts:
        console.say("met by what the law starts from", yellow="What it learns is not judged:")
    else:
        console.say(green="All requirements are met.")


def _print_remedy(console: Terminal, judged: JudgedLaw, whose: str = "") -> None:
    if (found := remedy(judged)) is not None:
        console.say(found, yellow=f"remedy{whose}:")


def print_collection(kind: str, collection: Any, judged: Judged) -> None:
    """Print the margins of all controllers of a file."""
    console = Terminal()
    console.say(f"{collection.name}, {collection.vessel.name}: the {kind} is valid.")
    console.say(ship_report.ship_line(collection.vessel))
    for line in collection.meaning():
        console.say(line)
    if not judged:  # A passive tank has no law.
        return
    table = new_table(
        MARGINS, "peak\nsensitivity", "pump gain\nfactor", "phase\nmargin", "delay\nmargin",
        "largest\neigenvalue",
    )  # fmt: skip
    table.add_column("", no_wrap=True)
    for each, one in judged.items():
        figures = ("",) * 5
        if one.robustness is not None:
            margin, worst = one.robustness.nominal, radius_words(one.robustness.worst_radius)
            delay = _delay(one.law, margin)
            peak = f"{margin.peak_sensitivity:.2f}"
            figures = peak, _gain(margin), _phase(margin), delay, worst
        table.add_row(each, *figures, _verdict(one))
    console.table(table)
    for each, one in judged.items():
        for remark in () if one.robustness is None else _remarks(one, one.robustness):
            console.say(f"{each}: {remark}")
    for each, one in judged.items():
        for failure in one.failures:
            console.say(failure, red=f"missed by {each}:")
        _print_remedy(console, one, f" of {each}")


def _verdict(judged: JudgedLaw) -> str | Text:
    if judged.failures:
        return Text("accepted", "yellow") if judged.accepted else Text("refused", "red")
    if judged.robustness is None:
        return "dissipates" if judged.law.dissipates else "no loop"
    return "at rest" if judged.law.adapts else Text("ok", "green")


def radius_words(radius: float) -> str:
    """An eigenvalue's modulus; one near 1 by what is missing."""
    near = abs(radius - 1) < 5e-5  # would print as 1.0000
    return f"1 {'-' if radius < 1 else '+'} {abs(1 - radius):.0e}" if near else f"{radius:.4f}"


def _gain(margin: Margins) -> str:
    high = f"{margin.gain_high:.2f}" if math.isfinite(margin.gain_high) else "any"
    return f"{margin.gain_low:.2f} to {high}"


def _phase(margin: Margins) -> str:
    if not math.isfinite(margin.phase_margin_rad):
        return "any"
    return f"{math.degrees(margin.phase_margin_rad):.0f}°"


def _delay(law: BuiltLaw, margin: Margins) -> str:
    if not math.isfinite(margin.delay_margin_s):
        return f"over {1e3 * _searched_s(law):.0f} ms"
    return f"{1e3 * margin.delay_margin_s:.0f} ms"


def _searched_s(law: BuiltLaw) -> float:
    """Return the extra delay up to which the loop was found stable, if no margin was found."""
    return 0.0 if law.linear is None else DELAY_SAMPLES * law.linear.sample_time_s


def _remarks(judged: JudgedLaw, report: Robustness) -> list[str]:
    law, tanks = judged.law, judged.config.design_plant.tanks
    notes = [note for note in (_at_rest(law),) if note is not None]
    if len(tanks) > 1:
        working, calm = (f"{tank.damping_ratio:.2g}" for tank in tanks)
        sea = "the sea that the law expects" if hasattr(judged.config.law, "sea") else "waves"
        notes.append(
            f"The worse of two tanks counts: the water's damping ratio is {working} in {sea}, "
            f"{calm} in small motions."
        )
    notes += _preview_words(judged)
    gain = report.nominal.peak_loop_gain
    if gain < LEAST_LOOP_GAIN and not law.adapts:
        notes.append(f"It hardly acts: its loop gain is {gain:.2g} at most.")
    return notes


def _preview_words(judged: JudgedLaw) -> list[str]:
    """What is made of the forecasts of a ship's preview station."""
    config, ahead_s = judged.config, judged.foreseen_s
    if config.vessel.preview is None:
        return []
    where = config.vessel.preview.bus or "the controller's own bus"
    if ahead_s is None:
        takes = "constrained and self-tuned laws do that are not renewed under way"
        return [f"It takes no forecasts of the waves: {takes}."]
    least_s, most_s = ahead_s
    return [
        f"It takes forecasts of the waves from {where}, {least_s:.3g} s ahead or more, of which it "
        f"plans {most_s:.3g}, each point for {config.safety.forecast_age_ms:g} ms. Without, or "
        "where the motion contradicts them, it is the law judged above."
    ]


def _at_rest(law: BuiltLaw) -> str | None:
    if not law.at_rest:
        return None
    learning = " with the parameters it starts from" if law.adapts else ""
    return f"The law is nonlinear: these are the margins of its slope at rest{learning}."


def remedy(judged: JudgedLaw) -> str | None:
    """Return what to do about a law that is refused for its margins; None about any other."""
    design, plant, report = judged.config.law, judged.config.design_plant, judged.robustness
    if report is None or not report.failures() or judged.step_s > MOST_STEP_S:
        return None
    stiffness = plant.ship.stiffness_nm_rad / report.worst_period_scale**2
    softer = replace(plant.ship, stiffness_nm_rad=stiffness)
    if np.linalg.eigvals(state_matrices(softer, plant.tank)[0]).real.max() > 0:
        return (
            f"at {report.worst_period_scale:g} of the roll period the ship is unstable with the "
            "tank's water alone, whatever the law asks for: make the tank's reservoirs smaller"
        )
    same, tuned = "", SelfTunedDesign("self_tuned")
    if isinstance(design, ConstrainedDesign):
        same, tuned = " with the same sea", SelfTunedDesign("self_tuned", design.sea)
    try:
        tuned.tuned(plant)
    except NoLawError:
        return "no self-tuned law passes, either: choose another tank"
    return f"law: {{kind: self_tuned}}{same} passes; it finds its numbers itself"


GROUP = "utank_hil.collections"
"""Entry points of further kinds of file: models with a name, a vessel, a mapping `controllers`, and
`figures` and `meaning` of whatever else they hold."""


def check(
    config: Annotated[Path, argument("Controller, scenario or ship.")],
    json_: common.Json = False,
    allow_code: common.AllowCode = False,
) -> None:
    """Validate a controller, scenario or ship file; design the laws and print their margins.

    Exit code 0: fit to be used. 1: a law misses the required margins, or the pump's pressure, held
    at its limit, takes the ship beyond its roll limit and no hard-wired cut is declared. 2: the
    file is wrong; every error is listed with file, key and reason.

    **Example:** utank-hil check configs/controllers/gpc.yaml
    """
    loaded: BaseModel
    pumped: dict[str, Vessel | ControllerConfig]
    collections = {point.name: point.load() for point in entry_points(group=GROUP)}
    with failing(ConfigError):
        kind = kind_of(config, {"controller": ControllerConfig, "ship": Vessel, **collections})
    if kind == "ship":
        loaded = ship = load(config, Vessel)
        content, pumped = ship_report.ship_json(ship), {"": ship}
        if not json_:
            ship_report.print_ship(ship)
    elif kind in collections:
        loaded = collection = load(config, collections[kind], allow_code=allow_code)
        keys = {name: f"controllers.{name}" for name in collection.controllers}
        pumped = {f"{key}.": collection.controllers[name] for name, key in keys.items()}
        judged = {
            name: judge_law(collection.controllers[name], config, key) for name, key in keys.items()
        }
        content = collection_json(collection, judged)
        if not json_:
            print_collection(kind, collection, judged)
    else:
        loaded = only = load(config, ControllerConfig, allow_code=allow_code)
        controller, pumped = judge_law(only, config), {"": only}
        content = controller_json(controller)
        if not json_:
            print_controller(controller)
    held = [
        f"{config}: {where}{key} {reason}"
        for where, each in pumped.items()
        for key, reason in each.held_pressure_problems()
    ]
    content["accepted"] = content.get("accepted", True) and not held
    if json_:
        unusual = [str(warning) for warning in common.warnings_of(loaded, config)]
        common.print_json({"kind": kind, **content, "warnings": unusual})
    else:
        for reason in held:
            Terminal().say(reason, red="refused:")
    if not content["accepted"]:
        raise typer.Exit(ExitCode.REFUSED)
    if not json_:
        following: dict[str, list[Command]] = {
            "ship": [("design", "tank", config)],
            "controller": [*_bench_of(config, allow_code=allow_code), *run_command(config)],
        }
        Terminal().lead_on(*following.get(kind, [("bench", config)]), allow_code=allow_code)


def _bench_of(controller: Path, *, allow_code: bool) -> list[Command]:
    """Return the bench of the scenario beside a controller, if it names it and would run."""
    scenario = controller.parent / "scenario.yaml"
    try:
        named = {key: file.resolve() for key, file in files_named(scenario).items()}
        if controller.resolve() not in named.values():
            return []
        for key, file in named.items():
            if key[:-1] == ("controllers",) and file != controller.resolve():
                load_config(file, ControllerConfig, allow_code=allow_code)
    except ConfigError:
        return []
    return [("bench", scenario)]
