"""``utank-hil check``: is a configuration fit to be used, and how robust is its law."""

import json
import math
import sys
from dataclasses import asdict
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.console import Console
from rich.table import Table

from utank_hil.analysis.robustness import Robustness, robustness
from utank_hil.commands.common import Json, fail, load, notes
from utank_hil.config import ControllerConfig
from utank_hil.config_laws import build_law


def check(
    config: Annotated[Path, typer.Argument(help="Controller configuration.")],
    json_: Json = False,
) -> None:
    """Validate a controller configuration, design its law and print its margins.

    Exit code 0: fit to be used. 1: the law misses the required margins. 2: the file is wrong;
    every error is listed with file, key and reason.

    [bold]Example:[/bold] utank-hil check configs/controllers/gpc.yaml
    """
    loaded = load(config, ControllerConfig)
    report = judge(loaded)
    failures = () if report is None else report.failures()
    if json_:
        sys.stdout.write(json.dumps(_as_json(loaded, report)) + "\n")
    else:
        _print(loaded, report)
    if failures and not loaded.accept_low_margins:
        raise typer.Exit(1)


def judge(config: ControllerConfig) -> Robustness | None:
    """Robustness of a configuration's law; None if it is nonlinear or has no loop."""
    vessel = config.vessel
    built = build_law(config.law, vessel, config.delay_s, config.limits)
    if built.linear is None:
        return None
    return robustness(
        built.linear,
        vessel.ship,
        vessel.tank,
        built.measured,
        config.delay_s,
        vessel.pump.lag_s,
    )


def refuse_low_margins(config: ControllerConfig) -> None:
    """End the command if the law misses its margins and the configuration does not accept that."""
    report = judge(config)
    failures = () if report is None else report.failures()
    for failure in failures:
        notes.print(f"[yellow]{config.name}, margins:[/yellow]", failure, soft_wrap=True)
    if failures and not config.accept_low_margins:
        fail(
            f"{config.name}: the law misses its margins; redesign it, or set "
            "accept_low_margins: true"
        )


def _as_json(config: ControllerConfig, report: Robustness | None) -> dict[str, Any]:
    return {
        "name": config.name,
        "vessel": config.vessel.name,
        "configuration_version": config.vessel.version,
        "robustness": None if report is None else _finite(asdict(report)),
        "failures": [] if report is None else list(report.failures()),
        "accepted": config.accept_low_margins or report is None or not report.failures(),
    }


def _finite(values: dict[str, Any]) -> dict[str, Any]:
    """JSON has no infinity: an unlimited margin is null."""
    return {
        name: _finite(value)
        if isinstance(value, dict)
        else (value if math.isfinite(value) else None)
        for name, value in values.items()
    }


def _print(config: ControllerConfig, report: Robustness | None) -> None:
    console = Console(highlight=False)
    console.print(f"{config.name} for {config.vessel.name}: the configuration is valid.")
    if report is None:
        console.print("The law is nonlinear or passive: it has no margins of a linear loop.")
        return
    margin = report.nominal
    table = Table(title="Margins, delay and pump lag included")
    table.add_column("")
    table.add_column("value", justify="right")
    table.add_column("required", justify="right")
    table.add_row("peak sensitivity", f"{margin.peak_sensitivity:.2f}", "2 or less")
    table.add_row("  at", f"{margin.peak_frequency_rad_s:.2f} rad/s", "")
    table.add_row("gain margin", f"{margin.gain_low:.2f} to {margin.gain_high:.2f}", "")
    table.add_row("phase margin", f"{math.degrees(margin.phase_margin_rad):.0f}°", "")
    table.add_row("delay margin", f"{1e3 * margin.delay_margin_s:.0f} ms", "over 20 ms")
    table.add_row("disk margin", f"{margin.disk_margin:.2f}", "")
    table.add_row(
        "largest eigenvalue, roll period 0.7 to 1.3, gain 0.8 to 1.2",
        f"{report.worst_radius:.4f}",
        "less than 1",
    )
    console.print(table)
    for failure in report.failures():
        console.print(f"[red]missed:[/red] {failure}")
    if report.failures():
        verdict = "accepted by the configuration" if config.accept_low_margins else "refused"
        console.print(f"This law is {verdict}.")
    else:
        console.print("[green]All requirements are met.[/green]")
