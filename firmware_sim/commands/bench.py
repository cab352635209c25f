"""``utank-hil bench``: a controller quiets a rolling ship."""

from collections.abc import Mapping
from errno import ENOSPC
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import typer
from rich.progress import TaskProgressColumn

from utank_hil.base.parameters import ParameterError
from utank_hil.base.provenance import describe
from utank_hil.base.shipped import CONFIGS
from utank_hil.commands.monitor import watch
from utank_hil.configuration.files import files_named
from utank_hil.console import common, terminal
from utank_hil.console.admission import admit
from utank_hil.console.exit_codes import ExitCode
from utank_hil.control import BuiltLaw
from utank_hil.runners.node import ModelError
from utank_hil.telemetry.ring import RingError

if TYPE_CHECKING:
    from firmware_sim.bench import BenchOptions, BenchResult
    from firmware_sim.figures import BenchFigures
    from firmware_sim.scenario import Scenario

STORM = CONFIGS / "scenarios" / "storm.yaml"
REAL_TIME_S = 120.0  #: Default length of a run in real time. Chosen; no study.


def bench(
    context: typer.Context,
    scenario: Annotated[
        Path, common.argument("Scenario file.", default="the measured storm")
    ] = STORM,
    real_time: Annotated[
        bool,
        common.option("Real time, or simulated time as fast as it goes.", "--realtime/--lockstep"),
    ] = False,
    bus: Annotated[
        str | None,
        common.option("SocketCAN interface for real time; without it all nodes share one process."),
    ] = None,
    seed: common.Seed = None,
    duration: common.Duration = None,
    out: common.Out = common.OUT,
    frames: Annotated[
        bool, common.option("Keep each run's frame log there, for replay and export.", "--frames")
    ] = False,
    fmu: Annotated[
        Path | None,
        common.option(
            "Run nothing: write the emulated ship as FMU for other programs.", metavar="FILE"
        ),
    ] = None,
    with_: Annotated[
        Literal["guard"] | None,
        common.option("Add a node: a guard that may cut the drive's power.", "--with"),
    ] = None,
    json_: common.Json = False,
    view: common.View = False,
    allow_code: common.AllowCode = False,
) -> None:
    """Run a scenario: the tank passive, then with each controller, in the same waves.

    **Example:** utank-hil bench --seed 7 --duration 600

    In real time each run lasts its duration; without **--duration** that is 120 s. A run
    that capsized, ended in a fault or was not in charge is marked, not ranked, and the exit code
    says so (docs/deployment.md).
    """
    # imported late: `--help` needs none of it
    from firmware_sim.bench import BenchOptions, frames_name
    from firmware_sim.figures import figures
    from firmware_sim.report_page import REPORT_FILES, write_files
    from firmware_sim.scenario import Scenario, guard_problem
    from utank_hil.console.loops import require_bus

    if bus is not None and not real_time:
        common.fail("--bus is for real time: add --realtime, or leave --bus out")
    loaded = common.load(scenario, Scenario, allow_code=allow_code)
    if with_ == "guard":
        if reason := guard_problem(loaded.vessel):
            common.fail(f"{scenario}: --with guard {reason}")
        loaded = loaded.model_copy(update={"guard": True})
    if fmu is not None:
        _write_fmu(scenario, loaded, fmu, loaded.seed if seed is None else seed)
        if json_:
            common.print_json({"file": str(fmu)})
        raise typer.Exit
    _refuse_faults(scenario, loaded, real_time=real_time, frames=frames)
    if bus is not None:
        require_bus(bus)
    logs = [frames_name(name) for name in ("passive", *loaded.controllers)] if frames else []
    out = common.prepare_out(out, (*REPORT_FILES, *logs))
    laws = {
        name: admit(controller, scenario, f"controllers.{name}")
        for name, controller in loaded.controllers.items()
    }
    if real_time and duration is None:
        duration = min(loaded.duration_s, REAL_TIME_S)
    options = BenchOptions(real_time, bus, seed, duration, out if frames else None)
    about = _about(loaded, options, out, context.params)
    result = _run(loaded, options, laws)
    found = figures(result)
    files, failures = write_files(result, found, out, about)
    files |= {f"frames of {Path(name).stem}": out / name for name in logs}
    if json_:
        common.print_json(found.as_json(files, about))
    else:
        _print(result, found, files)
        shown = [("monitor", out)] if "recording" in files else []
        following = (*shown, *_run_next(found, scenario))
        terminal.Terminal().lead_on(*following, allow_code=allow_code)
    if failures:
        common.fail("; ".join(failures))
    if view:
        watch(files["recording"])
    raise typer.Exit(found.exit_code)


def _write_fmu(path: Path, scenario: "Scenario", fmu: Path, seed: int) -> None:
    from firmware_sim.fmu_export import write_fmu

    with common.failing(OSError), common.failing(ValueError, at=path):
        write_fmu(scenario, fmu, seed)
    terminal.notes.say(f"{terminal.shown(fmu)}: FMI 2 for co-simulation, with its source")


def _refuse_faults(path: Path, scenario: "Scenario", *, real_time: bool, frames: bool) -> None:
    if real_time and scenario.faults:
        common.fail(f"{path}: faults: are for simulated time: leave --realtime out, or the faults")
    for number, fault in enumerate(scenario.faults if frames else ()):
        if not fault.replayable:
            common.fail(
                f"{path}: faults.{number}: kind {fault.kind} changes the controller itself, so "
                "its frames can't be replayed: leave --frames out, or the fault"
            )


def _run(
    scenario: "Scenario", options: "BenchOptions", laws: Mapping[str, BuiltLaw]
) -> "BenchResult":
    from firmware_sim.bench import run_bench

    length_s = scenario.duration_s if options.duration_s is None else options.duration_s
    with terminal.progress_bar(
        TaskProgressColumn(), "{task.completed:.0f} of {task.total:.0f} s"
    ) as bar:
        tasks = {
            name: bar.add_task(f"{name:>10}", total=length_s)
            for name in ("passive", *scenario.controllers)
        }
        try:
            return run_bench(
                scenario, options, lambda name, done: bar.update(tasks[name], completed=done), laws
            )
        except ParameterError as error:
            common.fail(error, ExitCode.USAGE)
        except InterruptedError as error:
            common.fail(error, ExitCode.INTERRUPTED)
        except OSError as error:
            if isinstance(error, RingError) or (error.errno == ENOSPC and error.filename is None):
                common.fail(
                    f"/dev/shm, the memory that processes share: {common.why(error)}",
                    ExitCode.SYSTEM,
                )
            of_bus = options.channel is not None and not isinstance(error, ModelError)
            common.fail(error, ExitCode.NO_BUS if of_bus else ExitCode.USAGE)


def _print(result: "BenchResult", found: "BenchFigures", files: Mapping[str, Path]) -> None:
    from firmware_sim.report_tables import few_rolls, tables

    console = terminal.Terminal()
    for table in tables(found):
        console.table(table)
    if few := few_rolls(found, result.scenario.vessel.ship.natural_frequency_rad_s):
        console.say(yellow=few)
    last = {event.partition(", ")[0]: event for event in found.retuned}
    for event in last.values():  # the page has all of them
        console.say(event)
    for ending in found.endings:
        console.say(red=ending)
    for limit in found.limits_passed:
        console.say(yellow=limit)
    loops = {run.name: run.loop for run in result.runs if run.loop is not None}
    if loops:
        console.table(terminal.timing_table(loops))
    else:
        count = f"{len(result.runs)} runs" if len(result.runs) > 1 else "one run"
        simulated_s = sum(run.end_s for run in result.runs)
        console.say(
            f"Simulated {count}, {simulated_s:.0f} s in all, in "
            f"{result.wall_s:.1f} s, {simulated_s / result.wall_s:.0f} times real time; "
            "no deadlines there."
        )
    console.files(files)


def _run_next(found: "BenchFigures", scenario: Path) -> list[terminal.Command]:
    """Return the command that runs the best law of a sound bench, if a file of its own holds it."""
    if found.endings:
        return []
    files = files_named(scenario)
    ranked = sorted((run.rank, run.name) for run in found.runs if run.rank is not None)
    named = [files[key] for _, name in ranked if (key := ("controllers", name)) in files]
    return terminal.run_command(named[0]) if named else []


def _about(
    scenario: "Scenario", options: "BenchOptions", out: Path, given: Mapping[str, Any]
) -> dict[str, Any]:
    changes: dict[str, float] = {}
    if options.seed is not None:
        changes["seed"] = options.seed
    if options.duration_s is not None:
        settle_s = min(scenario.settle_s, options.duration_s / 2)
        changes |= {"duration_s": options.duration_s, "settle_s": settle_s}
    ran = scenario.model_copy(update=changes)
    return describe("bench", ran, out, options=given, seed=ran.seed)
