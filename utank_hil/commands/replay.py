"""``utank-hil replay``: gives recorded inputs to the controller again."""

import math
from contextlib import nullcontext
from dataclasses import asdict
from itertools import groupby
from pathlib import Path
from typing import Annotated, Any, Final

import typer

from utank_hil.assembly import build_law
from utank_hil.base.finite import finite
from utank_hil.base.parameters import ParameterError
from utank_hil.base.provenance import kernels, machine
from utank_hil.configuration.controller import ControllerConfig
from utank_hil.console.common import (
    AllowCode,
    Channel,
    Json,
    argument,
    fail,
    load,
    option,
    print_json,
)
from utank_hil.console.exit_codes import ExitCode
from utank_hil.console.terminal import Terminal, say_note
from utank_hil.telemetry.bus_files.log import BusLog
from utank_hil.telemetry.bus_logs import LoggedController
from utank_hil.telemetry.explained_tick import ExplainedTick, Number
from utank_hil.telemetry.frame_comparison import ReplayResult
from utank_hil.telemetry.frame_log import SUFFIX, FrameLog
from utank_hil.telemetry.replay import LawVerdict, replay_log
from utank_hil.telemetry.replay import replay as run_replay
from utank_hil.telemetry.replay_head import ReplayHeadError, few, recorded_config


def replay(
    log: Annotated[
        Path,
        argument(
            f"Frame log ({SUFFIX}) of a run, its first part; or a log of the bus, such as "
            "candump's."
        ),
    ],
    config: Annotated[
        Path | None, option("Controller configuration to replay with, instead of the recorded one.")
    ] = None,
    channel: Channel = None,
    explain: Annotated[
        int | None,
        option("Print the way of a tick, from its frames to its command.", min=0, metavar="TICK"),
    ] = None,
    json_: Json = False,
    allow_code: AllowCode = False,
) -> None:
    """Hand a recorded bus to the controller again and compare every frame that it sends.

    The recorded law answers, by its numbers in the log; with --config, the law of that file. How
    far the law that is designed here is from the recorded one is said beside.

    Exit code 0: all frames are equal bit for bit. 1: a frame differs; the first difference is
    printed with its tick, message and signal, and what may be its cause. 2: the log or an option is
    wrong.

    **Example:** utank-hil replay out/gpc.frames --explain 6000
    """
    cut, elsewhere, here = "", "", kernels(machine())
    explained = None if explain is None else ExplainedTick(explain)
    named = None if config is None else load(config, ControllerConfig, allow_code=allow_code)
    try:
        if log.suffix.lower() == ".rrd":
            fail(f"{log} holds no frames: give a {SUFFIX} file, as run and bench --frames write it")
        if log.suffix.lower() != SUFFIX:
            (result, why), law = _replay_bus_log(BusLog(log, channel), named, explained), None
        else:
            recording = FrameLog(log)
            if not recording.first_part:
                fail(
                    f"{log} begins in the middle of a run, in which the controller's memory is "
                    "not known: give the run's first part"
                )
            with nullcontext(named) if named else recorded_config(recording.head) as chosen:
                result, why, law = replay_log(
                    recording, chosen, log.parent, as_recorded=named is None, explained=explained
                )
            cut, there = recording.cut, kernels(recording.head["about"].get("machine", {}))
            elsewhere = "" if there == here else there
    except (OSError, ValueError) as error:
        fail(f"{log}: {error}" if isinstance(error, ParameterError | ReplayHeadError) else error)
    if not result.ticks:
        fail(f"{log}: there is no tick in it to compare{f': {cut}' if cut else ''}")
    if result.lost_rows:
        why.insert(0, f"the recorder lost {result.lost_rows} rows of the log")
    if explained is not None and not explained.ended:
        fail(f"{log}: there is no tick {explain}: its ticks are 0 to {result.ticks - 1}")
    numbers = [] if explained is None else explained.numbers
    if json_:
        content = _as_json(result, why, cut, law, elsewhere)
        if explained is not None:
            content["explained"] = [number._asdict() for number in numbers]
        print_json(content)
    else:
        console = Terminal()
        if elsewhere:
            console.say(f"{elsewhere}; here {here}", yellow="another machine's log:")
        _print(console, result, why, cut, law)
        _print_numbers(console, numbers)
    raise typer.Exit(ExitCode.OK if result.exact else ExitCode.REFUSED)


def _replay_bus_log(
    log: BusLog, chosen: ControllerConfig | None, explained: ExplainedTick | None
) -> tuple[ReplayResult, list[str]]:
    if chosen is None:
        log.path.stat()  # of what is not there no more is said
        fail(
            f"{log.path} is no {SUFFIX} file, so it says nothing of the controller: name its "
            "configuration by --config"
        )
    said: list[str] = []
    controller = LoggedController(log, said)
    for text in said:
        say_note(text)
    if not controller.starts:
        fail(
            f"{log.path} begins in the middle of a run, or has no controller in it: its first "
            "frame of the controller must be the address claim, with which it starts"
        )
    result = run_replay(
        controller.entries(), chosen, build_law(chosen), open_end=True, explained=explained
    )
    if result.exact:
        return result, []
    return result, [
        "the log is one of the bus: when the controller was handed each frame is a guess, and "
        "answers of a retuner are not in it"
    ]


def _as_json(
    result: ReplayResult, why: list[str], cut: str, law: LawVerdict | None, elsewhere: str
) -> dict[str, Any]:
    return {
        "exact": result.exact,
        "ticks": result.ticks,
        "frames": result.frames,
        "different_frames": dict(result.different),
        "first_difference": result.first and asdict(result.first),
        "causes": why,
        "law": law and _law_as_json(law),
        "damaged_frames": [{"tick": tick, "message": message} for tick, message in result.damaged],
        "damaged": result.damaged_frames,
        "cut": cut,
        "other_machine": elsewhere,
    }


def _print_numbers(console: Terminal, numbers: list[Number]) -> None:
    for stage, those in groupby(numbers, key=lambda number: number.stage):
        console.say("", green=f"{stage}:")
        for name, recorded, replayed in ((n.name, n.recorded, n.replayed) for n in those):
            if recorded in ("", replayed):
                console.say(f"  {name} = {replayed}")
            else:
                console.say(f"recorded {recorded}, replayed {replayed}", red=f"  {name}:")


_LOOP: Final = (
    "predicted roll over that of the passive tank", "peak sensitivity", "gain margin",
    "phase margin, rad",
)  # fmt: skip


def _print_law(console: Terminal, law: LawVerdict) -> None:
    if law.why_not_recorded:
        console.say(f"the law designed here answered: {law.why_not_recorded}")
    if not law.differences:
        return
    known = [each.deviation for each in law.differences if math.isfinite(each.deviation)]
    size = f", by {max(known):.1e} of an array's largest element at most" if known else ""
    console.say(f"the law designed here is not the recorded one{size}:")
    for line in few([str(each) for each in law.differences]):
        console.say(f"  {line}")
    if law.loops is None:
        return
    for name, before, now in zip(_LOOP, *law.loops, strict=True):
        apart = 0.0 if before == now else now / before - 1
        console.say(f"  {name}: recorded {before:.6g}, designed here {now:.6g}, {apart:+.1e} of it")


def _law_as_json(law: LawVerdict) -> dict[str, Any]:
    """Return the law's verdict; the deviation of arrays that can't be compared is null."""
    return {
        "recorded_law_ran": not law.why_not_recorded,
        "why_not": law.why_not_recorded,
        "same_design": not law.differences,
        "loops": law.loops and finite([each._asdict() for each in law.loops]),
        "differences": finite([asdict(each) for each in law.differences]),
    }


def _print(
    console: Terminal, result: ReplayResult, why: list[str], cut: str, law: LawVerdict | None
) -> None:
    said = f"{result.ticks} ticks, {result.frames} frames of the controller"
    if result.first is None:
        console.say(said, green="equal bit for bit:")
    else:
        counts = ", ".join(f"{name} {count}" for name, count in result.different.items())
        console.say(f"{counts}, of {said}", red="different:")
        console.say(f"first at {result.first!s}")
    if why:
        console.say("not the same as when it was recorded:")
        for line in why:
            console.say(f"  {line}")
    elif result.first is not None and law is not None and not law.why_not_recorded:
        console.say("version, configuration and law are the same: the program was changed")
    if law is not None:
        _print_law(console, law)
    if result.damaged:
        each = [f"tick {tick}, {message}" for tick, message in result.damaged]
        text = f"{result.damaged_frames} received with a wrong checksum:"
        console.say("; ".join(few(each)), yellow=text)
    if cut:
        console.say("compared up to there", yellow=f"{cut}:")
