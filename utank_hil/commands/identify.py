"""``utank-hil identify``: from a recording to a model, and to a configuration made for it.

Its first word is a file, or one of the tests of `identify_test`.
"""

import dataclasses
import math
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any, Final

import numpy as np
import typer
from rich.table import Table
from typer.core import TyperGroup

from utank_hil.assembly import retuning_task
from utank_hil.base.arrays import FloatArray
from utank_hil.base.between import ALWAYS
from utank_hil.base.finite import finite
from utank_hil.base.provenance import describe
from utank_hil.base.text_files import TextFileError, refuse_device
from utank_hil.commands.identified import CONTROLLER, VESSEL, IdentifiedShips, read_controller
from utank_hil.commands.identify_sea import sea
from utank_hil.commands.identify_test import decay, inclining_test, read_run, refuse
from utank_hil.configuration.controller import ControllerConfig
from utank_hil.console import common
from utank_hil.console.exit_codes import ExitCode
from utank_hil.console.terminal import Terminal, new_table
from utank_hil.dynamics.linear import state_matrices
from utank_hil.dynamics.ship import RollShip
from utank_hil.dynamics.tank import Tank
from utank_hil.identification import IdentificationError
from utank_hil.identification.record import feedback_share, logged_samples
from utank_hil.retuning import Candidate, Refusal
from utank_hil.retuning.redesign import Identification, RetuningTask, identify, judge

_LOADINGS: Final = (0.7, 1.3)  #: Of the roll period, as in the grid that a law is judged on.
LONG_ORDER: Final = 200  #: From which a model of roll and level remembers an irregular sea.
MOST_FEEDBACK: Final = 0.15
MOST_FEEDBACK_SHORT: Final = 0.05
"""Largest `feedback_share` for such a model, and for others. In 34 simulated records of two ships
periods were off by up to 50 deviations above, by 1.1 at most below (docs/identification.md)."""
QUANTILE: Final = 1.96  #: Number of standard deviations to either side of a 95 % interval.


def figures(
    found: Identification, answer: Candidate | Refusal, files: Mapping[str, Path]
) -> dict[str, Any]:
    """Return all results for ``--json``; deviations are relative standard deviations."""
    fit, validation = found.fit, found.validation
    return {
        "accepted": isinstance(answer, Candidate),
        "reasons": [] if isinstance(answer, Candidate) else list(answer.reasons),
        "wave_frequencies_rad_s": list(found.wave_frequencies_rad_s),
        "roll_period_s": 2 * math.pi / fit.ship.natural_frequency_rad_s,
        "roll_period_deviation": fit.period_deviation,
        "inertia_kg_m2": fit.ship.inertia_kg_m2,
        "stiffness_nm_rad": fit.ship.stiffness_nm_rad,
        "damping_nms_rad": fit.ship.damping_nms_rad,
        "tank_damping_ratio": fit.tank.damping_ratio,
        "deviations": fit.deviation.tolist(),
        "later_s": fit.extra_delay_s.tolist(),
        "pressure_over_command": fit.pressure_gain,
        "dispersion": fit.dispersion,
        "held_out_fit": finite(validation.one_step_fit.tolist()),
        "error_correlation": abs(validation.residual_correlation).max(axis=0).tolist(),
        "law": dataclasses.asdict(answer.summary) if isinstance(answer, Candidate) else None,
        "files": {name: str(path) for name, path in files.items()},
    }


def print_report(
    console: Terminal,
    found: Identification,
    task: RetuningTask,
    answer: Candidate | Refusal,
    files: Mapping[str, Path],
) -> None:
    """Print the ship, its uncertainty, the validation and the acceptance."""
    console.table(_ship_table(found, task))
    console.table(_mode_table(found, task))
    console.table(_check_table(found, task))
    periods_s = (2 * math.pi / x.natural_frequency_rad_s for x in (task.plant.ship, found.fit.ship))
    if unlike := unlike_period(*periods_s):
        console.say(unlike, yellow="warning:")
    waves = "no regular one found; an irregular sea is in the model of the errors."
    if found.wave_frequencies_rad_s:
        named = (f"{w:.4f} rad/s ({2 * math.pi / w:.2f} s)" for w in found.wave_frequencies_rad_s)
        waves = f"regular, {', '.join(named)}, taken out."
    console.say(f"Waves: {waves}")
    if isinstance(answer, Candidate):
        console.say(
            f"peak sensitivity {answer.summary.peak_sensitivity:.2f}; in the recorded waves "
            f"{answer.summary.roll_below_passive:.0%} less roll than passive.",
            green="Accepted:",
        )
    else:
        for reason in answer.reasons:
            console.say(reason, red="refused:")
    console.files(files)


def unlike_period(configured_s: float, found_s: float) -> str:
    """What a period says that no loading of the configured ship has; empty for another one."""
    scale = found_s / configured_s
    if _LOADINGS[0] <= scale <= _LOADINGS[1]:
        return ""
    return (
        f"the roll period found is {scale:.2f} times the configured one, and loadings have "
        f"{_LOADINGS[0]:g} to {_LOADINGS[1]:g}: another ship, or a record that is too short? Look "
        "into it before its files are used"
    )


def follows_motion(record: FloatArray, task: RetuningTask) -> str:
    """Say that a law was in charge, so that no deviation holds; empty if pulses prevail."""
    measured = task.design.predictor.measured
    remembers = task.order >= LONG_ORDER and {"roll_rad", "level_m"} <= {*measured}
    most = MOST_FEEDBACK if remembers else MOST_FEEDBACK_SHORT
    share = feedback_share(record[:, 0], record[:, 1:])
    if share <= most:
        return ""
    return (
        f"the command follows the motion ({share:.0%} of what is new in it, {most:.0%} at most): "
        "with a law in charge the ship can't be told from the law, and no interval above holds. "
        "Record pulses of the pump alone, or take their part by --from and --to"
    )


def _ship_table(found: Identification, task: RetuningTask) -> Table:
    fit = found.fit
    table = new_table("Ship and tank", "configured", "identified", "change", "± 95 %")
    before, after = task.plant.ship, fit.ship
    inertia, stiffness, damping, tank = fit.deviation.tolist()
    before_s, after_s = (2 * math.pi / x.natural_frequency_rad_s for x in (before, after))
    rows = (
        ("roll period, s", 1.0, before_s, after_s, fit.period_deviation),
        ("inertia, t m²", 1e3, before.inertia_kg_m2, after.inertia_kg_m2, inertia),
        ("stiffness, MN m/rad", 1e6, before.stiffness_nm_rad, after.stiffness_nm_rad, stiffness),
        ("damping, MN m s/rad", 1e6, before.damping_nms_rad, after.damping_nms_rad, damping),
        ("tank damping ratio", 1.0, task.plant.tank.damping_ratio, fit.tank.damping_ratio, tank),
    )
    for name, unit, configured, identified, deviation in rows:
        table.add_row(
            name,
            f"{configured / unit:.4g}",
            f"{identified / unit:.4g}",
            f"{identified / configured - 1:+.1%}" if configured else "",
            f"{QUANTILE * deviation:.2%}",
        )
    measured = task.design.predictor.measured
    later = ", ".join(
        f"{name} {1e3 * late_s:+.0f} ms"
        for name, late_s in zip(measured, fit.extra_delay_s.tolist(), strict=True)
    )
    table.caption = (
        f"delay against the configured one: {later}; "
        f"pressure {fit.pressure_gain - 1:+.1%} of the command; "
        f"misfit {fit.dispersion:.1f} times its uncertainty (limit {task.limits.dispersion:g})"
    )
    return table


def _mode_table(found: Identification, task: RetuningTask) -> Table:
    table = new_table("Modes of ship and tank together", "configured", "identified")
    configured = _modes(task.plant.ship, task.plant.tank)
    fitted = _modes(found.fit.ship, found.fit.tank)
    for number, ((w0, z0), (w1, z1)) in enumerate(zip(configured, fitted, strict=True), start=1):
        table.add_row(f"{number}: frequency, rad/s", f"{w0:.4f}", f"{w1:.4f}")
        table.add_row("   damping ratio", f"{z0:.4f}", f"{z1:.4f}")
    return table


def _modes(ship: RollShip, tank: Tank) -> list[tuple[float, float]]:
    poles = np.linalg.eigvals(state_matrices(ship, tank)[0])
    frequency = abs(poles)
    order = np.argsort(frequency)[::2]  # One of each pair is taken.
    return [(float(frequency[k]), float(-poles[k].real / frequency[k])) for k in order]


def _check_table(found: Identification, task: RetuningTask) -> Table:
    validation, limits = found.validation, task.limits
    table = new_table("On held-out data", "one-step\nfit", "errors\ncorrelated")
    for column, name in enumerate(task.design.predictor.measured):
        correlation = abs(validation.residual_correlation[:, column]).max()
        table.add_row(name, f"{validation.one_step_fit[column]:.3f}", f"{correlation:.2f}")
    table.caption = (
        f"{validation.rows} predictions; fit {limits.fit:g} or more and correlation "
        f"{limits.correlation:g} or less are asked for"
    )
    return table


ANY_PERIOD_S = (1.0, 60.0)
PICTURE = "identification.png"


def identify_log(
    context: typer.Context,
    log: Annotated[
        Path,
        common.argument(
            "With pulses of the pump in it: .rrd, .frames, .csv, .parquet, log of the bus."
        ),
    ],
    config: Annotated[
        Path, common.argument("Controller configuration: signals, design, ship to begin with.")
    ],
    run: common.Run = None,
    channel: common.Channel = None,
    from_s: common.From = None,
    to_s: common.To = None,
    order: Annotated[
        int | None, common.option("Of the ARX model, instead of the configuration's.", min=2)
    ] = None,
    out: common.Out = common.OUT,
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
    from utank_hil.telemetry.signal_files import even_rows, is_table

    part_s = common.chosen_part(from_s, to_s)
    loaded = common.load(config, ControllerConfig, allow_code=True)  # Code is refused, not run.
    with common.failing(TextFileError):
        refuse_device(log)  # before seconds of a design
    settings = loaded.retuning
    order = order or (120 if settings is None else settings.order)
    period_range_s = ANY_PERIOD_S if settings is None else settings.roll_period_range_s
    with common.failing(ValueError, at=config):
        task = retuning_task(loaded, order, period_range_s)
    content = read_controller(config)
    out = common.prepare_out(out, (PICTURE, VESSEL, CONTROLLER))
    measured, sample_time_s = task.design.predictor.measured, task.design.predictor.sample_time_s
    name, signals = read_run(
        log,
        ("time_s", "pressure_command_pa", *measured),
        (part_s[0] - sample_time_s, part_s[1] + sample_time_s),
        ("port_level_m", "starboard_level_m"),
        channel=channel,
        run=run,
    )
    with common.failing(OSError, ValueError):
        if is_table(log):
            signals, part_s = even_rows(log, signals, sample_time_s, part_s), ALWAYS
        record = logged_samples(signals, measured, sample_time_s, part_s)
    try:
        found = identify(record, task)
    except IdentificationError as error:
        refuse(str(error), json_)
    reason = follows_motion(record, task)
    answer = Refusal((reason,)) if reason else judge(record, found, task)
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


class _LogUnlessNamed(TyperGroup):
    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        named = not args or args[0] in self.commands or args[0] in ctx.help_option_names
        return super().parse_args(ctx, args if named else ["log", *args])


application = common.new_app(
    "Identify ship and tank from a recording (LOG CONFIG), from a test of the ship, or its sea.\n\n"
    "**Example:** utank-hil identify log out/gpc.frames configs/controllers/dpc.yaml",
    cls=_LogUnlessNamed,
)
application.command("log")(identify_log)
application.command("decay")(decay)
application.command("inclining")(inclining_test)
application.command("sea")(sea)
