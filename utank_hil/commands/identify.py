"""``utank-hil identify``: from a recording to a model, and to a configuration made for it."""

import dataclasses
import json
import math
import sys
from pathlib import Path
from typing import Annotated, Any

import typer
import yaml
from rich.console import Console
from rich.table import Table

from utank_hil.analysis.logged_samples import logged_samples
from utank_hil.analysis.retune import Identification, RetuningTask, identify, retune
from utank_hil.commands.common import OUT, Json, fail, load, notes, prepare_out, shown
from utank_hil.config import ControllerConfig, Vessel
from utank_hil.control import PredictiveDesign
from utank_hil.identification import IdentificationError, mode_confidence
from utank_hil.identification.acceptance import ModelLimits
from utank_hil.runtime.retuning import Answer, Candidate

ANY_PERIOD_S = (1.0, 60.0)
STATES = 4
PICTURE, VESSEL, CONTROLLER = (
    "identification.png",
    "identified_vessel.yaml",
    "identified_controller.yaml",
)


def identify_log(
    log: Annotated[Path, typer.Argument(help="Recording (.rrd) with pulses of the pump in it.")],
    config: Annotated[
        Path, typer.Argument(help="Controller configuration: signals, design, ship to begin with.")
    ],
    run: Annotated[
        str | None, typer.Option(help="Run of the recording; without it the last one.")
    ] = None,
    from_s: Annotated[float | None, typer.Option("--from", metavar="SECONDS")] = None,
    to_s: Annotated[float | None, typer.Option("--to", metavar="SECONDS")] = None,
    order: Annotated[
        int | None, typer.Option(min=2, help="Of the ARX model, instead of the configuration's.")
    ] = None,
    out: Annotated[Path, typer.Option(help="Folder for picture and configuration.")] = OUT,
    json_: Json = False,
) -> None:
    """Identify ship and tank from a recording, validate, and write a configuration for them.

    Exit code 0: model and law passed every check. 1: refused; the reasons are printed and no
    configuration is written. 2: a file is wrong.

    [bold]Example:[/bold] utank-hil identify out/bench.rrd configs/controllers/dpc.yaml --from 200
    """
    from utank_hil.analysis.identification_picture import draw_identification
    from utank_hil.telemetry import read_recording

    loaded = load(config, ControllerConfig)
    task = _task(loaded, order)
    prepare_out(out, (PICTURE, VESSEL, CONTROLLER))
    measured = task.design.predictor.measured
    try:
        runs = read_recording(log)
        name = list(runs)[-1] if run is None else run
        if name not in runs:
            fail(f"{log} has no run {name!r}; it has {', '.join(runs)}")
        sample_time_s = task.design.predictor.sample_time_s
        record = logged_samples(runs[name], measured, sample_time_s, from_s, to_s)
    except (OSError, ValueError) as error:
        fail(error)
    try:
        found = identify(record, task)
    except IdentificationError as error:
        notes.print(f"[red]refused:[/red] {error}", soft_wrap=True)
        if json_:
            sys.stdout.write(json.dumps({"accepted": False, "reasons": [str(error)]}) + "\n")
        raise typer.Exit(1) from None
    answer = retune(record, task)
    files = {
        "picture": draw_identification(record, found, task, out / PICTURE, f"{log.name}, {name}")
    }
    if isinstance(answer, Candidate):
        files.update(_write_config(config, loaded, found, out))
    if json_:
        sys.stdout.write(json.dumps(_as_json(found, answer, files)) + "\n")
    else:
        _print(found, task, answer, files)
    if not isinstance(answer, Candidate):
        raise typer.Exit(1)


def _task(config: ControllerConfig, order: int | None) -> RetuningTask:
    settings, design = config.retuning, config.law
    if not isinstance(design, PredictiveDesign) or "roll_rad" not in design.predictor.measured:
        fail("the configuration's law must be predictive and measure roll_rad")
    if order is None:
        order = 120 if settings is None else settings.order
    period_range_s = ANY_PERIOD_S if settings is None else settings.roll_period_range_s
    vessel = config.vessel
    return RetuningTask(
        design,
        vessel.ship,
        vessel.tank,
        config.delay_s,
        vessel.pump.lag_s,
        order,
        ModelLimits(period_range_s),
        config.limits.pressure_pa,
    )


def _write_config(
    config: Path, loaded: ControllerConfig, found: Identification, out: Path
) -> dict[str, Path]:
    """The identified vessel, and the configuration with it in place of the old one."""
    files = {"vessel": out / VESSEL, "config": out / CONTROLLER}
    vessel = loaded.vessel.model_copy(update={"ship": found.fit.ship, "tank": found.fit.tank})
    files["vessel"].write_text(yaml.safe_dump(_vessel_content(vessel), sort_keys=False))
    content = yaml.safe_load(config.read_text(encoding="utf-8"))
    content["vessel"] = files["vessel"].name
    files["config"].write_text(yaml.safe_dump(content, sort_keys=False))
    return files


def _vessel_content(vessel: Vessel) -> dict[str, Any]:
    """What a vessel's file holds; values at their defaults are left out."""
    content: dict[str, Any] = {"name": f"{vessel.name}, identified"}
    for key in ("ship", "tank", "pump"):
        part = getattr(vessel, key)
        content[key] = {
            field.name: getattr(part, field.name)
            for field in dataclasses.fields(part)
            if getattr(part, field.name) != field.default
        }
    return content


def _as_json(found: Identification, answer: Answer, files: dict[str, Path]) -> dict[str, Any]:
    modes = mode_confidence(found.okid, STATES)
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
        "dispersion": fit.dispersion,
        "held_out_fit": validation.one_step_fit.tolist(),
        "simulation_fit": validation.simulation_fit.tolist(),
        "whiteness_probability": validation.whiteness_probability.tolist(),
        "independence_probability": validation.independence_probability.ravel().tolist(),
        "modes": [
            {
                "frequency_rad_s": float(frequency),
                "frequency_std_rad_s": float(frequency_std),
                "damping_ratio": float(damping),
                "damping_ratio_std": float(damping_std),
            }
            for frequency, frequency_std, damping, damping_std in zip(
                modes.modes.frequency_rad_s,
                modes.frequency_std_rad_s,
                modes.modes.damping_ratio,
                modes.damping_ratio_std,
                strict=True,
            )
        ],
        "law": dataclasses.asdict(answer.summary) if isinstance(answer, Candidate) else None,
        "files": {name: str(path) for name, path in files.items()},
    }


def _print(
    found: Identification, task: RetuningTask, answer: Answer, files: dict[str, Path]
) -> None:
    console = Console(highlight=False)
    fit, validation = found.fit, found.validation
    table = Table(title="Ship and tank")
    for heading in ("", "configured", "identified", "± one standard deviation"):
        table.add_column(heading, justify="left" if not heading else "right")
    rows = (
        ("roll period, s", 2 * math.pi / task.ship.natural_frequency_rad_s,
         2 * math.pi / fit.ship.natural_frequency_rad_s, fit.period_deviation),
        ("inertia, t m²", task.ship.inertia_kg_m2 / 1e3, fit.ship.inertia_kg_m2 / 1e3,
         fit.deviation[0]),
        ("stiffness, MN m/rad", task.ship.stiffness_nm_rad / 1e6,
         fit.ship.stiffness_nm_rad / 1e6, fit.deviation[1]),
        ("damping, MN m s/rad", task.ship.damping_nms_rad / 1e6, fit.ship.damping_nms_rad / 1e6,
         fit.deviation[2]),
        ("tank damping ratio", task.tank.damping_ratio, fit.tank.damping_ratio, fit.deviation[3]),
    )  # fmt: skip
    for name, configured, identified, deviation in rows:
        table.add_row(name, f"{configured:.4g}", f"{identified:.4g}", f"{deviation:.1%}")
    console.print(table)
    checks = Table(title="On held-out data")
    for heading in ("", "one-step fit", "simulation fit", "largest error correlation"):
        checks.add_column(heading, justify="left" if not heading else "right")
    for column, name in enumerate(task.design.predictor.measured):
        checks.add_row(
            name,
            f"{validation.one_step_fit[column]:.3f}",
            f"{validation.simulation_fit[column]:.3f}",
            f"{abs(validation.residual_correlation[:, column]).max():.2f}",
        )
    console.print(checks)
    if isinstance(answer, Candidate):
        console.print(
            f"[green]Accepted:[/green] peak sensitivity {answer.summary.peak_sensitivity:.2f}; in "
            f"the recorded waves {answer.summary.roll_below_passive:.0%} less roll than passive."
        )
    else:
        for reason in answer.reasons:
            console.print(f"[red]refused:[/red] {reason}")
    for name, path in files.items():
        console.print(f"{name:>10}: {shown(path)}", soft_wrap=True)
