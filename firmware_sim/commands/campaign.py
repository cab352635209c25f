"""``utank-hil campaign``: many cases of a scenario, on all cores or on a cluster."""

import os
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from rich.progress import MofNCompleteColumn

from utank_hil.base.provenance import describe
from utank_hil.configuration import ConfigError
from utank_hil.console import common
from utank_hil.console.exit_codes import ExitCode
from utank_hil.console.terminal import Terminal, notes, progress_bar, shown

if TYPE_CHECKING:
    from firmware_sim.campaign.study import LoadedStudy


def campaign(
    context: typer.Context,
    study: Annotated[Path, common.argument("Study file, such as configs/studies/*.yaml.")],
    out: Annotated[
        Path | None, common.option("Folder for the results.", default="out/NAME OF THE FILE")
    ] = None,
    resume: Annotated[
        bool, common.option("Compute only what the folder does not hold yet.", "--resume")
    ] = False,
    scheduler: Annotated[
        str | None,
        common.option(
            "Dask scheduler, as tcp://10.0.0.5:8786, instead of this machine.", metavar="ADDRESS"
        ),
    ] = None,
    workers: Annotated[int | None, common.option("Processes.", default="one a core", min=1)] = None,
    json_: common.Json = False,
    allow_code: common.AllowCode = False,
) -> None:
    """Run the cases of a study, keep their figures as Parquet, and compare the laws.

    **Example:** utank-hil campaign configs/studies/storm_seeds.yaml --resume

    After Ctrl-C, or if it was killed, the same command with **--resume** goes on where it
    was. A case that fails is recorded with its reason and ends nothing.
    """
    # imported late: `--help` needs none of it
    from firmware_sim.campaign.report import draw
    from firmware_sim.campaign.store import FILES, PICTURE, SUMMARY, Store, StoreError, read_results
    from firmware_sim.campaign.study import load_study
    from firmware_sim.campaign.summary import failures, summary

    if scheduler is not None and workers is not None:
        common.fail("--workers is for this machine: leave it out, or --scheduler")
    try:
        loaded = load_study(study, allow_code=allow_code)
    except ConfigError as error:
        common.fail_with(error)
    folder = common.OUT / study.stem if out is None else out
    common.prepare_out(folder, FILES, keep=False)
    store = Store(folder)
    with common.failing(StoreError):
        store.begin(loaded, _about(loaded, folder, context.params), resume=resume)
        interrupted = _run(loaded, store, workers or len(os.sched_getaffinity(0)), scheduler)
        results = read_results(folder)
    groups = summary(results)
    failed = failures(results)
    content = {**results.about, "interrupted": interrupted, "groups": groups, "failures": failed}
    store.write_json(SUMMARY, content)
    draw(results, groups, folder / PICTURE)
    if json_:
        common.print_json(content)
    else:
        _print(loaded, groups, failed)
        Terminal().say(f"results: {shown(folder)}")
    if interrupted:
        again = ("campaign", study, "--resume", *(() if out is None else ("--out", out)))
        kept = f"{len(results.rows)} of {len(loaded.cases)} cases are kept"
        notes.say(f"interrupted: {kept}, --resume goes on from here")
        notes.lead_on(again, allow_code=allow_code)
        raise typer.Exit(ExitCode.INTERRUPTED)


def _about(loaded: "LoadedStudy", folder: Path, given: dict[str, Any]) -> dict[str, Any]:
    from firmware_sim.campaign.store import LEAVES_OUT, METRICS
    from firmware_sim.campaign.study import code_digest

    first = loaded.scenario_of(loaded.cases[0])
    return {
        **describe("campaign", loaded.study, folder, options=given, scenario=first),
        "code": code_digest(),
        "cases": len(loaded.cases),
        "keys": loaded.keys,
        "leaves_out": LEAVES_OUT[loaded.study.simulation],
        "metrics": METRICS,
    }


def _run(loaded: "LoadedStudy", store: Any, workers: int, scheduler: str | None) -> bool:
    from firmware_sim.campaign.driver import Count, Driver
    from firmware_sim.campaign.simulations import OtherCodeError

    bar = progress_bar(MofNCompleteColumn(), "{task.fields[failed]}")
    task = bar.add_task("cases", total=None, failed="")

    def progress(state: Count) -> None:
        failed = f"{state.failed} failed" if state.failed else ""
        bar.update(task, total=state.needed, completed=state.done, failed=failed)

    driver = Driver(loaded, store, progress)
    if not driver.count.needed:
        return False
    try:
        with bar:
            driver.run(workers, scheduler)
    except KeyboardInterrupt:
        return True
    except OtherCodeError as error:
        common.fail(error)
    except OSError as error:
        if scheduler is None:
            raise
        common.fail(f"--scheduler {scheduler}: {error}", ExitCode.SYSTEM)
    return False


def _print(loaded: "LoadedStudy", groups: list[dict[str, Any]], failed: dict[str, int]) -> None:
    from firmware_sim.campaign.store import LEAVES_OUT
    from firmware_sim.campaign.tables import pairs_table, runs_table

    console, study = Terminal(), loaded.study
    if any(group["runs"] for group in groups):
        console.table(runs_table(groups, f"{study.name}, simulation: {study.simulation}"))
    if any(group["paired"] for group in groups):
        console.table(pairs_table(groups))
    for reason, number in failed.items():
        console.say(reason, red=f"{number} cases without a result:")
    if left_out := LEAVES_OUT[study.simulation]:
        console.say(f"Not computed: {'; '.join(left_out)}.")
