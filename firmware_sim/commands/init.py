"""``utank-hil init``: a starter project for a user's ship."""

import math
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import asdict, replace
from pathlib import Path
from typing import Annotated, Any, Final

import typer
from rich.table import Table

from firmware_sim.prediction import Expected, as_json, laws_of, predict
from firmware_sim.scenario import Scenario
from firmware_sim.starter import FILES, HULL, SCENARIO, StarterProject, StarterShip, make_starter
from firmware_sim.tank_report import cost_rows, interval_words, roll_rows
from utank_hil.analysis.loop.sea_response import CalmSeaError
from utank_hil.analysis.loop.self_tuning import NoLawError
from utank_hil.analysis.tank_sizing import TankImpossibleError, TankRoom, tank_cost
from utank_hil.base.parameters import ParameterError
from utank_hil.base.whole_file import write_whole
from utank_hil.console import common
from utank_hil.console.common import argument, fail, option
from utank_hil.console.exit_codes import ExitCode
from utank_hil.console.ship_report import order_words
from utank_hil.console.terminal import Terminal, notes, rows_table, shown

_OPTIONS = {
    "stability_share": "gm-loss",
    "roll_damping_ratio": "roll-damping",
    "damping_ratio": "roll-damping",
    "ship.damping_ratio": "roll-damping",
    "tank.width_m": "tank-breadth",
    "tank.height_m": "tank-height",
    "tank.lz_m": "duct-below-cg",
    "duct_below_cg_m": "duct-below-cg",
}  #: Options whose names differ from the parameters they set.
_UNITS = ("_m", "_t", "_s")

WORTH_IT: Final = 0.15
"""Least reduction of roll that makes a tank worthwhile in the starter's sea; chosen, no study."""


def init(
    length: Annotated[float, option("Of the ship at the waterline, m.")],
    beam: Annotated[float, option("At the waterline, m.")],
    displacement: Annotated[float, option("Without the tank's water, t.")],
    gm: Annotated[float, option("Metacentric height without the tank's water, m.")],
    folder: Annotated[Path, argument("Where to write.", metavar="[DIR]")] = Path("my_ship"),
    roll_period: Annotated[
        float | None,
        option(
            "Natural roll period without the tank's water, s.",
            default="weather criterion's formula, with --draught",
        ),
    ] = None,
    draught: Annotated[float | None, option("Mean moulded draught, m.")] = None,
    roll_damping: Annotated[
        float | None,
        option("Damping ratio of the roll.", default="Ikeda's method, with --draught; else 0.05"),
    ] = None,
    tank_breadth: Annotated[
        float | None, option("Room across the ship, m.", default="0.9 of the beam")
    ] = None,
    tank_height: Annotated[
        float | None, option("From duct to roof, m.", default="0.4 of the beam")
    ] = None,
    tank_length: Annotated[
        float | None, option("Room along the ship, m.", default="0.08 of the length")
    ] = None,
    duct_below_cg: Annotated[
        float | None,
        option("Duct below the centre of gravity, m; negative above.", default="0.1 of the beam"),
    ] = None,
    gm_loss: Annotated[
        float, option("Share of GM that the free surface may take, 0.03 to 0.25.")
    ] = 0.15,
    hs: Annotated[
        float | None,
        option("Significant wave height of the scenario, m.", default="by length and wave slope"),
    ] = None,
    tp: Annotated[
        float | None, option("Peak period of its sea, s.", default="near the roll period")
    ] = None,
    name: Annotated[str | None, option("Of the ship.", default="the folder's")] = None,
    hull: Annotated[
        bool,
        option(
            "Compute what waves do to a usual hull of these dimensions, so that the ship "
            "sways, too; needs --draught and the extra hulls.",
            "--hull",
        ),
    ] = False,
    json_: common.Json = False,
) -> None:
    """Write a starter project for your ship: tank, pump, law, sea.

    The tank is sized by stability, frequency and room, the pump by the water it must move, and the
    law is one that meets the required margins. Exit code 1: no tank can be, and why.

    **Example:** utank-hil init patrol --length 63 --beam 9.5 --displacement 1900
    --gm 0.9 --roll-period 9.5
    """
    _refuse_former(folder / file for file in (*FILES, *([HULL] * hull)))
    given = {
        "breadth_m": tank_breadth,
        "height_m": tank_height,
        "length_m": tank_length,
        "duct_below_cg_m": duct_below_cg,
    }
    ship_name = name or folder.resolve().name.replace("_", " ")
    if not " ".join(ship_name.split()).isprintable():
        fail(f"--name: {ship_name!a} has letters that can't be written; give another name")
    with _at_options():
        ship = StarterShip(
            ship_name, length, beam, displacement, gm, roll_period, draught, roll_damping
        )
    room = _room(length, beam, given)
    for which, value in (("hs", hs), ("tp", tp)):
        if value is not None and not 0 < value < math.inf:
            fail(f"--{which}: must be positive and finite, got {value}")
    data, slope = None, None
    if hull:
        ship, data, slope = _with_usual_hull(ship)
    try:
        with _at_options(), notes.busy(f"{ship_name}: sizing tank and pump, designing a law"):
            project = make_starter(ship, room, gm_loss, hs, tp, slope)
    except (TankImpossibleError, NoLawError) as error:
        if json_:
            common.print_json({"possible": False, "reason": str(error)})
        notes.say(str(error), red="no tank:")
        raise typer.Exit(ExitCode.REFUSED) from None
    except CalmSeaError as error:
        fail(f"--tp: {error}")
    files = _written(project, data, folder)
    _tell(ship, project, files, json_)


def _refuse_former(files: Iterable[Path]) -> None:
    for path in files:
        if path.exists():
            fail(f"{path}: is there already; name another folder, or remove it")


def _room(length: float, beam: float, given: dict[str, float | None]) -> TankRoom:
    """Room for the tank: what is given, and else what is usual in such a hull."""
    with _at_options():
        usual = TankRoom.in_hull(length, beam)
    with _at_options("tank-"):
        room = replace(usual, **{key: of for key, of in given.items() if of is not None})
    if room.breadth_m > beam:
        fail(f"--tank-breadth: is {room.breadth_m:g} m, and the ship's beam {beam:g} m")
    return room


def _tell(ship: StarterShip, project: StarterProject, files: dict[str, Path], json_: bool) -> None:
    """Predict what a bench of the project would give, and print all that is known of it."""
    scenario = common.load(files[SCENARIO], Scenario)
    (config,) = scenario.controllers.values()
    with notes.busy(f"{project.vessel.name}: what a bench of its scenario would give"):
        expected = predict(scenario, config.plant, *laws_of(scenario, config))
    little = _little_help(project, expected, config.safety.roll_limit_rad)
    if json_:
        figures = {"possible": True, "little_help": little, **_as_json(project)}
        figures["expected"] = as_json(expected)
        figures["files"] = {Path(file).stem: str(path) for file, path in files.items()}
        common.print_json(figures)
    else:
        _print(ship, project, expected, little, files)


def _with_usual_hull(ship: StarterShip) -> tuple[StarterShip, Any, float | None]:
    """Ship with the radiation of a usual hull, that hull's data, and its effective slope."""
    from firmware_sim.hull.compute import Loading, usual_hull
    from firmware_sim.hull.mesh import MeshError

    if ship.draught_m is None:
        fail("--hull: needs --draught")
    loading = Loading(ship.gm_m, roll_period_s=ship.period_s, displacement_t=ship.displacement_t)
    try:
        with _at_options(), notes.busy(f"{ship.name}: computing the hull"):
            data, found = usual_hull(ship.form, loading)
            return replace(ship, radiated_ratio=found.radiation_ratio), data, found.effective_slope
    except (MeshError, ValueError) as error:
        fail(f"--hull: the usual hull of these dimensions {error}")


def _written(project: StarterProject, data: Any | None, folder: Path) -> dict[str, Path]:
    if reason := common.why_not_writable(folder):  # written last: a refusal leaves no files behind
        fail(f"{reason}; name another folder")
    files = {file: folder / file for file in (*FILES, *(() if data is None else (HULL,)))}
    _refuse_former(files.values())  # of another that began since
    try:
        for file in FILES:
            write_whole(files[file], project.texts[file])
        if data is not None:
            from firmware_sim.hull.compute import write_hull

            write_hull(files[HULL], data)
    except OSError as error:
        for path in files.values():  # half a project would be in the way of the next one
            path.unlink(missing_ok=True)
        fail(error)
    return files


def _print(
    ship: StarterShip,
    project: StarterProject,
    expected: Sequence[Expected],
    little: str | None,
    files: dict[str, Path],
) -> None:
    console = Terminal()
    console.table(_table(project, expected))
    period_s, (ratio, damping_source) = ship.period_s, ship.damping
    console.say(f"Roll period {period_s:.3g} s: {ship.period_source}.")
    console.say(f"Damping ratio of the roll {ratio:.2g}: {damping_source}.")
    if little:
        console.say(little, yellow="little help:")
    for path in files.values():
        console.say(f"written: {shown(path)}")
    steps = (("check", "controller.yaml"), ("bench", "scenario.yaml"))
    console.lead_on(*((command, files[file]) for command, file in steps))


def _little_help(
    project: StarterProject, found: Sequence[Expected], limit_rad: float
) -> str | None:
    active_rad = [each.active_rad.mean for each in found if each.active_rad is not None]
    without_rad = found[0].without_tank_rad
    if not active_rad or without_rad is None:
        return None  # a ship that capsizes has no roll to compare with
    peak_rad = max(each.roll_peak_rad or 0.0 for each in found)
    if peak_rad > limit_rad:
        return (
            f"with the law the ship rolls to {math.degrees(peak_rad):.0f} degrees in "
            f"this sea, and from {math.degrees(limit_rad):.0f} on the pump is off (HEEL_LIMIT): "
            "then it has the passive tank's roll. Try a lower --hs, more room, or --gm-loss"
        )
    less = 1 - min(active_rad) / without_rad.mean
    if less >= WORTH_IT:
        return None
    period_s = 2 * math.pi / project.vessel.ship.natural_frequency_rad_s
    return (
        f"the tank takes {max(less, 0.0):.0%} of the roll in a sea of {project.sea['tp_s']:g} s, "
        f"and the ship rolls in {period_s:.1f} s. A tank helps near the roll period: try --tp, "
        "more room, or --gm-loss"
    )


@contextmanager
def _at_options(prefix: str = "") -> Iterator[None]:
    try:
        yield
    except ParameterError as error:
        for name, reason in error.problems:
            place = f"--{_OPTIONS[name]}" if name in _OPTIONS else _place(name, prefix)
            notes.say(f"{place}: {reason}", red="error:")
        raise typer.Exit(ExitCode.USAGE) from None


def _place(name: str, prefix: str) -> str:
    """Option that sets a parameter, or the parameter itself where there is none."""
    section, _, option = name.rpartition(".")
    if section not in ("", "ship", "sea", "law.sea"):
        return name
    for unit in _UNITS:
        option = option.removesuffix(unit)
    return f"--{prefix}{option.replace('_', '-')}"


def _as_json(project: StarterProject) -> dict[str, Any]:
    vessel, sized, law, pump = project.vessel, project.sized, project.law, project.vessel.pump
    assert pump is not None
    return {
        "name": vessel.name,
        "roll_period_s": 2 * math.pi / vessel.ship.natural_frequency_rad_s,
        "tank": {
            **asdict(tank_cost(vessel.ship, vessel.tank)),
            "bound_by": sized.bound_by,
            "reservoir_length_m": sized.reservoir_length_m,
            "reservoir_breadth_m": sized.reservoir_breadth_m,
            "duct_height_m": sized.duct_height_m,
        },
        "pump": {
            **asdict(project.demand),
            "max_pressure_pa": pump.max_pressure_pa,
            "max_power_w": pump.max_power_w,
        },
        "law": {
            "kind": "self_tuned",
            "peak_sensitivity": law.robustness.nominal.peak_sensitivity,
            "worst_radius": law.robustness.worst_radius,
        },
        "sea": project.sea,
    }


def _table(project: StarterProject, expected: Sequence[Expected]) -> Table:
    sized, demand, law = project.sized, project.demand, project.law
    ship, tank, duct_m = project.vessel.ship, project.vessel.tank, project.sized.duct_height_m
    heights = (duct_m, duct_m + tank.height_m, duct_m + tank.height_m + tank.headroom_m)
    along = f"{sized.reservoir_length_m:.2f} m along"
    rows = [
        ("roll period", f"{2 * math.pi / ship.natural_frequency_rad_s:.2f} s"),
        ("tank sized by", sized.bound_by),
        ("reservoirs, each", f"{along}, {sized.reservoir_breadth_m:.2f} m across"),
        ("duct, still water, roof at", ", ".join(f"{each:.2f}" for each in heights) + " m"),
        *cost_rows(tank_cost(ship, tank)),
        ("pump moves the water by", f"{demand.level_m:.2f} m"),
        ("pump: net head, flow, shaft, duty", order_words(project.vessel)),
        ("law", "self-tuned"),
        ("peak sensitivity, 2 at most", f"{law.robustness.nominal.peak_sensitivity:.2f}"),
        *roll_rows(expected),
    ]
    sea = f"a sea of {project.sea['hs_m']:g} m, {project.sea['tp_s']:g} s"
    return rows_table(project.vessel.name, rows, caption=interval_words(expected[0], sea))
