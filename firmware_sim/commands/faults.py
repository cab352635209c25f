"""``utank-hil faults``: injects every fault of the table and checks that it is found in time."""

import math
import time
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Final

import typer
from can import CanError
from rich.progress import MofNCompleteColumn

from utank_hil.base.provenance import describe
from utank_hil.base.shipped import CONFIGS
from utank_hil.console.common import (
    KILLED,
    Json,
    argument,
    fail,
    load,
    option,
    prepare_out,
    print_json,
    why,
)
from utank_hil.console.exit_codes import ExitCode
from utank_hil.console.terminal import Terminal, progress_bar, shown

if TYPE_CHECKING:
    from firmware_sim.fault_campaign.campaign import Campaign
    from firmware_sim.fault_campaign.trial import Window
    from firmware_sim.fault_campaign.verdict import Result

CAMPAIGN = CONFIGS / "faults" / "campaign.yaml"
INTERRUPTED: Final = "interrupted"
ROLLS_IN_CHARGE: Final = 5  #: Rolls over which an own ship with its law is compared. Chosen.


def faults(
    campaign: Annotated[Path, argument("Campaign file.", default="the fault table")] = CAMPAIGN,
    seeds: Annotated[int, option("Seas, from seed 1 on.", min=1)] = 5,
    rows: Annotated[
        str, option("Rows or requirements, or the beginnings of names.", metavar="NAMES")
    ] = "",
    scenario: Annotated[
        Path | None, option("Your ship in the place of the first, with its first controller.")
    ] = None,
    out: Annotated[
        Path | None, option("Folder for a recording of each row, of the first seed.")
    ] = None,
    full: Annotated[
        bool, option("Compare the roll over 600 s, as is asked for: ten times the work.")
    ] = False,
    bus: Annotated[
        str | None, option("SocketCAN interface for the live rows, such as vcan0.")
    ] = None,
    junit: Annotated[Path | None, option("Write the result as JUnit XML, too.")] = None,
    json_: Json = False,
) -> None:
    """Inject each fault of the fault table and judge what becomes of it.

    **Example:** utank-hil faults --rows motion,F19 --seeds 10

    In lockstep on all cores. Without **--full** the roll is compared over 60 s (an own ship's over
    600 s), and over 20 s where the controller stays in charge (an own ship's over five rolls, if
    these are longer), and rows that take minutes are left out. Live rows start, kill and stop the
    deployed programs, with **--bus** only. The exit code says whether a row failed
    (docs/deployment.md).
    """
    # imported late: `--help` needs none of it
    from firmware_sim.fault_campaign.campaign import Campaign
    from firmware_sim.fault_campaign.junit import write_junit
    from firmware_sim.fault_campaign.runner import run_rows
    from firmware_sim.fault_campaign.trial import Window
    from firmware_sim.fault_campaign.verdict import as_json, judged, write_recordings
    from firmware_sim.live_faults.rows import ROWS
    from utank_hil.runners import stop_on_signals

    whole = load(campaign, Campaign)
    loaded = whole if scenario is None else _on(whole, scenario)
    names = [name.strip() for name in rows.split(",") if name.strip()]
    chosen = loaded.chosen(names)
    window = Window() if full else Window(60.0, 20.0) if scenario is None else _window(loaded)
    too_long = [row for row in chosen if row.long and not (full or names)]
    chosen = [row for row in chosen if row not in too_long]
    live = [name for name in ROWS if not names or name.startswith(tuple(names))]
    for name in names:
        if not (
            whole.chosen([name])
            or whole.shown_elsewhere([name])
            or any(each.startswith(name) for each in live)
        ):
            fail(f"--rows: no row or requirement begins with {name}")
    if names and live and not chosen and bus is None:
        fail("--rows: live rows need --bus")
    if names and not (chosen or live):
        fail("--rows: nothing to run: tests show all of them, or the ship has none of these nodes")
    if out is not None:
        out = prepare_out(out, [f"{row.id}.rrd" for row in chosen])
    began = time.monotonic()
    with progress_bar(MofNCompleteColumn()) as bar, stop_on_signals() as stopped:
        task = bar.add_task("faults", total=len(chosen) * seeds)
        outcomes = run_rows(
            loaded,
            chosen,
            range(1, seeds + 1),
            window,
            lambda done: bar.update(task, completed=done),
            stopped,
            recorded=out is not None,
        )
        interrupted = stopped()
    ended_early = any(len(outcomes[row.id]) < seeds for row in chosen)
    begun = [row for row in chosen if outcomes[row.id]]
    results = [judged(loaded, row, outcomes[row.id]) for row in begun]
    killed = ended_early and not interrupted
    not_run = _not_to_run(whole, loaded, names)
    not_run |= {row.id: "takes long: --full or --rows" for row in too_long}
    not_begun = [row.id for row in chosen if row not in begun]
    ended = KILLED if killed else INTERRUPTED
    not_run |= dict.fromkeys(not_begun, ended)
    options = {"seeds": seeds, "full": full, "rows": names, "scenario": str(scenario or "")}
    about = describe("faults", loaded, out or Path(), options=options, seed=1)
    if out is not None:
        files = write_recordings(out, outcomes, about)
        kept = {name: shown(file) for name, file in files.items()}
        results = [replace(each, recording=kept.get(each.row.id, "")) for each in results]
    if bus is None or ended_early:
        not_run |= dict.fromkeys(live, ended if ended_early else "needs a live bus: --bus")
    on_bus = [] if bus is None or ended_early else _live(live, bus)
    content = as_json(results, not_run, about)
    content["rows"] += on_bus
    lost = sum(each["verdict"] == "fail" for each in on_bus)
    failed = content["failed"] = content["failed"] + lost
    content["passed"] += len(on_bus) - lost
    if junit is not None:
        write_junit(junit, content)
    if json_:
        print_json(content)
    else:
        _print(results, on_bus, seeds)
        count = len(content["rows"])
        Terminal().say(
            f"{count} row{'s' * (count != 1)} in {'up to ' * ended_early}{seeds} "
            f"sea{'s' * (seeds > 1)}, {failed} failed, {len(not_run)} not run; "
            f"roll compared over {window.stopped_s:g} s, "
            f"in charge over {window.running_s:g} s; {time.monotonic() - began:.0f} s."
        )
    if killed:
        fail(KILLED, ExitCode.SYSTEM)
    if interrupted:
        raise typer.Exit(ExitCode.INTERRUPTED)
    if failed:
        raise typer.Exit(ExitCode.REFUSED)


def _live(names: Sequence[str], bus: str) -> list[dict[str, Any]]:
    from firmware_sim.live_faults.rows import ROWS, as_json

    try:
        with progress_bar(MofNCompleteColumn()) as bar:
            task = bar.add_task(f"on {bus}", total=len(names))
            found = []
            for name in names:
                found.append(as_json(name, ROWS[name], bus))
                bar.advance(task)
            return found
    except (OSError, CanError) as error:
        fail(f"--bus {bus}: {why(error)}", ExitCode.NO_BUS)


def _on(campaign: "Campaign", path: Path) -> "Campaign":
    from firmware_sim.fault_campaign.campaign import COMMON
    from firmware_sim.scenario import Scenario

    ship = load(path, Scenario)
    if COMMON not in campaign.setups:
        fail(f"--scenario: the campaign has no setup {COMMON} whose ship it could replace")
    if not ship.controllers:
        fail(f"{path}: controllers: one is needed that is to find the faults")
    return campaign.on(ship, next(iter(ship.controllers)))


def _window(campaign: "Campaign") -> "Window":
    """Window for an own ship: it may be slow, or roll on for minutes after a stop."""
    from firmware_sim.fault_campaign.campaign import COMMON
    from firmware_sim.fault_campaign.trial import Window

    ship = campaign.setups[COMMON].scenario.vessel.ship
    rolls_s = ROLLS_IN_CHARGE * 2 * math.pi / ship.natural_frequency_rad_s
    return Window(600.0, max(20.0, round(rolls_s)))


def _not_to_run(whole: "Campaign", loaded: "Campaign", names: Sequence[str]) -> dict[str, str]:
    """Why each row of these names is none of this campaign: tests show it, or the ship can't."""
    kept = {row.id for row in loaded.rows}
    shown = {
        each.id: f"{each.fault}: shown by {each.elsewhere}"
        for each in loaded.shown_elsewhere(names)
    }
    return shown | {
        row.id: f"needs a ship, nodes and counters as of setup {row.fault.setup}"
        for row in whole.chosen(names)
        if row.id not in kept
    }


def _print(results: Sequence["Result"], live: Sequence[dict[str, Any]], seeds: int) -> None:
    from firmware_sim.fault_campaign.verdict import table

    console = Terminal()
    if results:
        console.table(table(results, seeds))
    for result in results:
        for problem in result.problems:
            console.say(problem, red=f"{result.row.id}:")
    for row in live:
        took = row["zero_ms"] if row["limit_ms"] is None else row["found_ms"]
        limit = row["zero_limit_ms"] if row["limit_ms"] is None else row["limit_ms"]
        if row["problems"]:
            console.say("; ".join(row["problems"]), red=f"{row['id']}:")
        else:
            console.say(f"{row['id']}: passed, {took:.0f} ms of {limit:.0f}")
