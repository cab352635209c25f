"""``utank-hil identify``: from a recording to a model, and to a configuration made for it.

Its first word is a file, or one of the tests of `identify_test`.
"""

import math
from pathlib import Path
from typing import Annotated, Any

import typer
from typer.core import TyperGroup

from utank_hil.assembly import retuning_task
from utank_hil.base.provenance import describe
from utank_hil.commands.identified import CONTROLLER, VESSEL, IdentifiedShips, read_controller
from utank_hil.commands.identify_report import figures, print_report
from utank_hil.commands.identify_test import decay, inclining_test, refuse
from utank_hil.configuration.controller import ControllerConfig
from utank_hil.console import common
from utank_hil.console.exit_codes import ExitCode
from utank_hil.console.terminal import Terminal, say_note
from utank_hil.identification import IdentificationError
from utank_hil.identification.record import logged_samples
from utank_hil.retuning import Candidate
from utank_hil.retuning.redesign import RetuningTask, identify, judge

ANY_PERIOD_S = (1.0, 60.0)
PICTURE = "identification.png"


def identify_log(
    context: typer.Context,
    log: Annotated[
        Path,
        typer.Argument(
            help="With pulses of the pump in it: .rrd, .frames, .csv, .parquet, log of the bus."
        ),
    ],
    config: Annotated[
        Path, typer.Argument(help="Controller configuration: signals, design, ship to begin with.")
    ],
    run: common.Run = None,
    channel: common.Channel = None,
    from_s: common.From = None,
    to_s: common.To = None,
    order: Annotated[
        int | None, typer.Option(min=2, help="Of the ARX model, instead of the configuration's.")
    ] = None,
    out: Annotated[Path, typer.Option(help="Folder for picture and configuration.")] = common.OUT,
    json_: common.Json = False,
) -> None:
    """Identify ship and tank from a recording, validate, and write a configuration for them.

    A table of anybody's (.csv, .parquet) names its columns with their units: time_s,
    pressure_command_pa or _kpa, roll_rad or roll_deg (docs/how-to/logs.md).

    Exit code 0: model and law passed every check. 1: refused; the reasons are printed and no
    configuration is written, nor left from an earlier time. 2: a file or an option is wrong.

    **Example:** utank-hil identify log out/bench.rrd configs/controllers/dpc.yaml --from 200
    """
    from utank_hil.pictures.identification import draw_identification
    from utank_hil.telemetry.signal_files import even_rows, is_table, read_signals, require

    for option, value in (("--from", from_s), ("--to", to_s)):
        if value is not None and not math.isfinite(value):
            common.fail(f"{option} must be a number of seconds, got {value}")
    loaded = common.load(config, ControllerConfig, allow_code=True)  # Code is refused, not run.
    task = _task(loaded, order)
    content = read_controller(config)
    out = common.prepare_out(out, (PICTURE, VESSEL, CONTROLLER))
    measured = task.design.predictor.measured
    try:
        runs = read_signals(log, say_note, channel=channel)
        name = common.chosen_run(log, runs, run)
        sample_time_s = task.design.predictor.sample_time_s
        signals = runs[name]
        require(log, signals, "time_s", "pressure_command_pa", *measured)
        if is_table(log):
            signals = even_rows(log, signals, sample_time_s, from_s, to_s)
            from_s = to_s = None
        record = logged_samples(signals, measured, sample_time_s, from_s, to_s)
    except (OSError, ValueError) as error:
        common.fail(error)
    try:
        found = identify(record, task)
    except IdentificationError as error:
        refuse(str(error), json_)
    answer = judge(record, found, task)
    about = describe("identify", loaded, out, options=context.params)
    title = f"{log.name}, {name}"
    files = {"picture": draw_identification(record, found, task, out / PICTURE, title, about)}
    if isinstance(answer, Candidate):
        ships = IdentifiedShips(out, loaded.vessel, content)
        files |= ships.write_to((out / VESSEL, out / CONTROLLER), found.fit.ship, found.fit.tank)
    if json_:
        common.print_json(about | figures(found, answer, files))
    else:
        print_report(Terminal(), found, task, answer, files)
    if not isinstance(answer, Candidate):
        raise typer.Exit(ExitCode.REFUSED)


def _task(config: ControllerConfig, order: int | None) -> RetuningTask:
    settings = config.retuning
    if order is None:
        order = 120 if settings is None else settings.order
    period_range_s = ANY_PERIOD_S if settings is None else settings.roll_period_range_s
    try:
        return retuning_task(config, order, period_range_s)
    except ValueError as error:
        common.fail(error)


class _LogUnlessNamed(TyperGroup):
    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        named = not args or args[0] in self.commands or args[0] in ctx.help_option_names
        return super().parse_args(ctx, args if named else ["log", *args])


application = common.new_app(
    "Identify ship and tank from a recording (LOG CONFIG), or from a test of the ship.",
    cls=_LogUnlessNamed,
)
application.command("log")(identify_log)
application.command("decay")(decay)
application.command("inclining")(inclining_test)
