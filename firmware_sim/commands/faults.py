"""``utank-hil faults``: injects every fault of the table and checks that it is found in time."""

import math
import time
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Final

import typer
from can import CanError
from rich.progress import MofNCompleteColumn

from utank_hil.base.provenance import describe
from utank_hil.base.shipped import CONFIGS
from utank_hil.console import common
from utank_hil.console.common import KILLED, argument, fail, load, option, why
from utank_hil.console.exit_codes import ExitCode
from utank_hil.console.terminal import Terminal, progress_bar, say_note, shown

if TYPE_CHECKING:
    from firmware_sim.fault_campaign.campaign import Campaign, Row
    from firmware_sim.fault_campaign.trial import Outcome, Window
    from firmware_sim.fault_campaign.verdict import Verdict

CAMPAIGN = CONFIGS / "faults" / "campaign.yaml"
ROLLS_IN_CHARGE: Final = 5  #: Rolls over which an own ship with its law is compared. Chosen.
CALM_DEG: Final = 1.0  #: RMS roll in which the monitors find all in time (docs/monitors.md).


End = tuple[str, ExitCode]
"""Why the rows ended early, and the exit code that says so."""
INTERRUPTED: Final[End] = ("interrupted", ExitCode.INTERRUPTED)


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
    json_: common.Json = False,
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
    from utank_hil.console.loops import require_bus
    from utank_hil.runners import stop_on_signals

    whole = load(campaign, Campaign)
    loaded = whole if scenario is None else _on(whole, scenario)
    names = [name.strip() for name in rows.split(",") if name.strip()]
    chosen, live, not_run = _chosen(whole, loaded, names, full=full, on_bus=bus is not None)
    if bus is not None and live:
        require_bus(bus)  # before minutes of other rows
    window = Window() if full else Window(60.0, 20.0) if scenario is None else _window(loaded)
    if junit is not None:
        common.require_writable(junit, "--junit")  # before minutes of rows
    if out is not None:
        out = common.prepare_out(out, [f"{row.id}.rrd" for row in chosen])
    options = {"seeds": seeds, "full": full, "rows": names, "scenario": str(scenario or "")}
    about = describe("faults", loaded, out or Path(), options=options, seed=1)
    began, files = time.monotonic(), dict[str, Path]()
    end: End | None = None
    with stop_on_signals() as stopped:
        with progress_bar(MofNCompleteColumn()) as bar:
            task = bar.add_task("faults", total=len(chosen) * seeds)
            outcomes = run_rows(
                loaded, chosen, range(1, seeds + 1), window,
                lambda done: bar.update(task, completed=done), stopped, recorded=out is not None,
            )  # fmt: skip
        results = [judged(loaded, row, outcomes[row.id]) for row in chosen if outcomes[row.id]]
        if out is not None:
            try:
                files = write_recordings(out, outcomes, about)
            except OSError as error:
                end = why(error), ExitCode.USAGE
        ended_early = any(len(outcomes[row.id]) < seeds for row in chosen)
        if ended_early:
            end = KILLED, ExitCode.SYSTEM
        if stopped():
            end = INTERRUPTED
    on_bus: list[Verdict] = []
    if bus is not None and end is None:
        on_bus, end = _run_live(live, bus)
    begun = {each["id"] for each in (*results, *on_bus)}
    left = [name for name in (*(row.id for row in chosen), *live) if name not in begun]
    not_run |= dict.fromkeys(left, "needs a live bus: --bus" if end is None else end[0])
    for each in results:
        file = files.get(each["id"])
        each["recording"] = None if file is None else shown(file)
    content = as_json([*results, *on_bus], not_run, about)
    if json_:
        common.print_json(content)
    else:
        _print(results, on_bus, seeds)
        count = len(content["rows"])
        Terminal().say(
            f"{count} row{'s' * (count != 1)} in {'up to ' * ended_early}{seeds} "
            f"sea{'s' * (seeds > 1)}, {content['failed']} failed, {len(not_run)} not run; "
            f"roll compared over {window.stopped_s:g} s, "
            f"in charge over {window.running_s:g} s; {time.monotonic() - began:.0f} s."
        )
    if scenario is not None and content["failed"] and (calm := _calm(outcomes)):
        say_note(f"{scenario}: {calm}")
    if junit is not None:
        write_junit(junit, content)
    if end is INTERRUPTED:
        raise typer.Exit(end[1])
    if end is not None:
        fail(*end)
    if content["failed"]:
        raise typer.Exit(ExitCode.REFUSED)


def _chosen(
    whole: "Campaign", loaded: "Campaign", names: Sequence[str], *, full: bool, on_bus: bool
) -> tuple[list["Row"], list[str], dict[str, str]]:
    """Rows to run, live rows, and why others are not run; end where a name or all is none."""
    from firmware_sim.live_faults.rows import ROWS

    kept, asked = {row.id for row in loaded.rows}, loaded.chosen(names)
    not_run = {
        each.id: f"{each.fault}: shown by {each.elsewhere}"
        for each in loaded.shown_elsewhere(names)
    }
    not_run |= {
        row.id: f"needs a ship, nodes and counters as of setup {row.fault.setup}"
        for row in whole.chosen(names)
        if row.id not in kept
    }
    if not (full or names):
        not_run |= {row.id: "takes long: --full or --rows" for row in asked if row.long}
    chosen = [row for row in asked if row.id not in not_run]
    live = [name for name in ROWS if not names or name.startswith(tuple(names))]
    for name in names:
        if not (
            whole.chosen([name])
            or whole.shown_elsewhere([name])
            or any(each.startswith(name) for each in live)
        ):
            fail(f"--rows: no row or requirement begins with {name}")
    if names and live and not chosen and not on_bus:
        fail("--rows: live rows need --bus")
    if names and not (chosen or live):
        fail("--rows: nothing to run: tests show all of them, or the ship has none of these nodes")
    return chosen, live, not_run


def _run_live(names: Sequence[str], bus: str) -> "tuple[list[Verdict], End | None]":
    """Run live rows; return the results, and what ended them early."""
    from firmware_sim.live_faults.rows import ROWS, as_json

    found: list[Verdict] = []
    try:
        with progress_bar(MofNCompleteColumn()) as bar:
            task = bar.add_task(f"on {bus}", total=len(names))
            for name in names:
                found.append(as_json(name, ROWS[name], bus))
                bar.update(task, advance=1)
    except KeyboardInterrupt:  # of SIGTERM, too
        return found, INTERRUPTED
    except (OSError, CanError) as error:
        if getattr(error, "filename", None) is not None:
            return found, (why(error), ExitCode.USAGE)
        return found, (f"--bus {bus}: {why(error)}", ExitCode.NO_BUS)
    return found, None


def _on(campaign: "Campaign", path: Path) -> "Campaign":
    from firmware_sim.fault_campaign.campaign import COMMON
    from firmware_sim.scenario import Scenario

    ship = load(path, Scenario)
    if COMMON not in campaign.setups:
        fail(f"--scenario: the campaign has no setup {COMMON} whose ship it could replace")
    if not ship.controllers:
        fail(f"{path}: controllers: one is needed that is to find the faults")
    return campaign.on(ship, next(iter(ship.controllers)))


def _calm(outcomes: "Mapping[str, Sequence[Outcome]]") -> str:
    """What may have failed rows of an own ship: a sea in which she hardly rolls."""
    rolls = [one.passive_variance for each in outcomes.values() for one in each if not one.error]
    roll_deg = math.degrees(math.sqrt(max(rolls, default=math.inf)))
    if roll_deg >= CALM_DEG:
        return ""
    return (
        f"with the pump off she rolls {roll_deg:.2g} degrees RMS in this sea: below "
        f"{CALM_DEG:g} wrong signals show late, try a sea that rolls her more"
    )


def _window(campaign: "Campaign") -> "Window":
    """Window for an own ship: it may be slow, or roll on for minutes after a stop."""
    from firmware_sim.fault_campaign.campaign import COMMON
    from firmware_sim.fault_campaign.trial import Window

    ship = campaign.setups[COMMON].scenario.vessel.ship
    rolls_s = ROLLS_IN_CHARGE * 2 * math.pi / ship.natural_frequency_rad_s
    return Window(600.0, max(20.0, round(rolls_s)))


def _print(results: "list[Verdict]", live: "list[Verdict]", seeds: int) -> None:
    from firmware_sim.fault_campaign.verdict import table

    console = Terminal()
    if results:
        console.table(table(results, seeds))
    for result in results:
        for problem in result["problems"]:
            console.say(problem, red=f"{result['id']}:")
    for row in live:
        took = row["zero_ms"] if row["limit_ms"] is None else row["found_ms"]
        limit = row["zero_limit_ms"] if row["limit_ms"] is None else row["limit_ms"]
        if row["problems"]:
            console.say("; ".join(row["problems"]), red=f"{row['id']}:")
        else:
            console.say(f"{row['id']}: passed, {took:.0f} ms of {limit:.0f}")
