"""What ``utank-hil check`` says of a controller, a scenario or a ship."""

import math
from dataclasses import asdict
from typing import Any

import numpy as np
from rich.console import Console
from rich.markup import escape
from rich.table import Table

from utank_hil.analysis.loop.margins import DELAY_SAMPLES, Margins
from utank_hil.analysis.loop.robustness import Robustness
from utank_hil.analysis.tank_design import tank_figures
from utank_hil.commands.gate import JudgedLaw
from utank_hil.commands.tables import print_table
from utank_hil.configuration import Vessel
from utank_hil.control import BuiltLaw
from utank_hil.dynamics.linear import STATES, coupled_matrices, state_matrices

NO_LOOP = "The law closes no loop that quiets the roll: it has no margins."

LEAST_LOOP_GAIN = 0.05
"""Below it a law with all margins hardly acts; the shipped ones have 1.3 and more."""

Judged = dict[str, JudgedLaw]


def controller_json(judged: JudgedLaw) -> dict[str, Any]:
    """A controller as one JSON object."""
    config, report = judged.config, judged.robustness
    return {
        "name": config.name,
        "vessel": config.vessel.name,
        "configuration_version": config.vessel.version,
        "law": config.law.kind,
        "at_rest": _at_rest(judged.law),
        "limits": _finite(asdict(config.limits)),
        "robustness": None if report is None else _finite(asdict(report)),
        "delay_margin_searched_s": None if report is None else _searched_s(judged.law),
        "failures": list(judged.failures),
        "accepted": judged.accepted,
    }


def collection_json(name: str, vessel: Vessel, judged: Judged) -> dict[str, Any]:
    """A file of several controllers, a scenario for one, as one JSON object."""
    controllers = {name: controller_json(each) for name, each in judged.items()}
    return {
        "name": name,
        "vessel": vessel.name,
        "configuration_version": vessel.version,
        "controllers": controllers,
        "accepted": all(each["accepted"] for each in controllers.values()),
    }


def ship_json(vessel: Vessel) -> dict[str, Any]:
    """A ship as one JSON object."""
    return {
        "name": vessel.name,
        "configuration_version": vessel.version,
        **ship_figures(vessel),
        "assumptions": list(vessel.assumptions),
        "limits": vessel.default_limits,
    }


def ship_figures(vessel: Vessel) -> dict[str, Any]:
    """What ship, tank and pump are to each other, by the linear model.

    Returns
    -------
    dict
        Frequencies in rad/s of the ship without water and of the water in a ship held still; the
        two motions that they make together (`modes`, from slow to fast); ratios as in
        `TankFigures`; share of the ship's stiffness that the free surface takes; level at which a
        reservoir is full or empty; heel that the pump's greatest pressure holds, None without a
        pump.
    """
    ship, tank = vessel.ship, vessel.tank
    figures = tank_figures(ship, tank)
    _, _, stiffness = coupled_matrices(ship, tank)
    free = np.linalg.eigvals(state_matrices(ship, tank)[0])
    frequency = ship.natural_frequency_rad_s
    pump_heel_rad = None
    if vessel.pump is not None:
        push = [0.0, tank.reservoir_area_m2 * vessel.pump.max_pressure_pa]
        heel_rad = np.linalg.solve(stiffness, push)[STATES.index("roll_rad")]
        pump_heel_rad = float(abs(heel_rad))
    free_surface_nm_rad = stiffness[0, 1] ** 2 / stiffness[1, 1]
    return {
        "roll_frequency_rad_s": frequency,
        "roll_damping_ratio": ship.damping_nms_rad / (2 * ship.inertia_kg_m2 * frequency),
        "tank_frequency_rad_s": tank.natural_frequency_rad_s,
        "tank_damping_ratio": tank.damping_ratio,
        "modes": [
            {"frequency_rad_s": abs(mode), "damping_ratio": -mode.real / abs(mode)}
            for mode in sorted(free.astype(complex), key=abs)
            if mode.imag >= 0
        ],
        "frequency_ratio": figures.frequency_ratio,
        "mass_ratio": figures.mass_ratio,
        "coupling_ratio": figures.coupling_ratio,
        "stability_taken": float(free_surface_nm_rad / ship.stiffness_nm_rad),
        "level_limit_m": tank.level_limit_m,
        "pump_heel_rad": pump_heel_rad,
    }


def print_controller(judged: JudgedLaw) -> None:
    """Print a controller's margins."""
    config, report = judged.config, judged.robustness
    console = Console(highlight=False)
    console.print(f"{config.name} for {config.vessel.name}: the configuration is valid.")
    if report is None:
        if judged.law.unjudged:
            _print_verdict(console, judged)
        else:
            console.print(NO_LOOP)
        return
    margin = report.nominal
    table = Table(title="Margins, delay and pump lag included")
    table.add_column("")
    table.add_column("value", justify="right")
    table.add_column("required", justify="right")
    table.add_row("peak sensitivity", f"{margin.peak_sensitivity:.2f}", "2 or less")
    table.add_row("  at", f"{margin.peak_frequency_rad_s:.2f} rad/s", "")
    table.add_row("pump gain factor", _gain(margin), "")
    table.add_row("phase margin", _phase(margin), "")
    table.add_row("delay margin", _delay(judged.law, margin), "over 20 ms")
    table.add_row("disk margin", f"{margin.disk_margin:.2f}", "")
    table.add_row("greatest loop gain", f"{margin.peak_loop_gain:.3g}", "")
    table.add_row("largest eigenvalue of the grid", f"{report.worst_radius:.4f}", "less than 1")
    table.caption = (
        "grid: roll period 0.7 to 1.3, or inertia 0.8 to 1.25;\n"
        "pump gain 0.8 to 1.2, 0 or 20 ms more delay"
    )
    print_table(console, table)
    for remark in _remarks(judged.law, report):
        console.print(remark, soft_wrap=True)
    _print_verdict(console, judged)


def _print_verdict(console: Console, judged: JudgedLaw) -> None:
    for failure in judged.failures:
        console.print(f"[red]missed:[/red] {escape(failure)}", soft_wrap=True)
    if judged.failures:
        verdict = "accepted by the configuration" if judged.accepted else "refused"
        console.print(f"This law is {verdict}.")
    else:
        console.print(_met(judged.law))


def print_collection(kind: str, name: str, vessel: Vessel, judged: Judged) -> None:
    """Print the margins of all controllers of a file."""
    console = Console(highlight=False)
    console.print(f"{name}, {vessel.name}: the {kind} is valid.")
    table = Table(title="Margins, delay and pump lag included")
    table.add_column("", no_wrap=True)
    for heading in (
        "peak\nsensitivity",
        "pump gain\nfactor",
        "phase\nmargin",
        "delay\nmargin",
        "largest\neigenvalue",
    ):
        table.add_column(heading, justify="right", no_wrap=True)
    table.add_column("", no_wrap=True)
    for each, one in judged.items():
        verdict = _verdict(one)
        if one.robustness is None:
            table.add_row(escape(each), *5 * ("",), verdict)
            continue
        report, margin = one.robustness, one.robustness.nominal
        table.add_row(
            escape(each),
            f"{margin.peak_sensitivity:.2f}",
            _gain(margin),
            _phase(margin),
            _delay(one.law, margin),
            f"{report.worst_radius:.4f}",
            verdict,
        )
    print_table(console, table)
    for each, one in judged.items():
        for remark in () if one.robustness is None else _remarks(one.law, one.robustness):
            console.print(f"{escape(each)}: {remark}", soft_wrap=True)
    for each, one in judged.items():
        for failure in one.failures:
            console.print(f"[red]missed by {escape(each)}:[/red] {escape(failure)}", soft_wrap=True)


def _verdict(judged: JudgedLaw) -> str:
    """The verdict on a law in a word."""
    if judged.failures:
        return "[yellow]accepted[/yellow]" if judged.accepted else "[red]refused[/red]"
    if judged.robustness is None:
        return "no loop"
    return "at rest" if judged.law.adapts else "[green]ok[/green]"


def print_ship(vessel: Vessel) -> None:
    """Print what ship, tank and pump are to each other."""
    figures = ship_figures(vessel)
    table = Table(title=f"{escape(vessel.name)}, linear model")
    table.add_column("")
    table.add_column("frequency\nrad/s", justify="right", no_wrap=True)
    table.add_column("period\ns", justify="right", no_wrap=True)
    table.add_column("damping\nratio", justify="right", no_wrap=True)
    motions = [
        ("roll of the ship without water", figures["roll_frequency_rad_s"], "roll_damping_ratio"),
        ("water in the ship held still", figures["tank_frequency_rad_s"], "tank_damping_ratio"),
    ]
    for text, frequency, damping in motions:
        table.add_row(text, *_motion(frequency, figures[damping]))
    for mode in figures["modes"]:
        motion = _motion(mode["frequency_rad_s"], mode["damping_ratio"])
        table.add_row("ship and water moving together", *motion)
    console = Console(highlight=False)
    console.print(f"{vessel.name}: the ship is valid.")
    print_table(console, table)
    rest = Table(show_header=False)
    rest.add_column()
    rest.add_column(justify="right", no_wrap=True)
    figures_of_pump = [("pump", "none")]
    if vessel.pump is not None:
        figures_of_pump = [
            ("pump's greatest pressure", f"{vessel.pump.max_pressure_pa / 1e3:.1f} kPa"),
            ("heel that it holds", f"{math.degrees(figures['pump_heel_rad']):.2f}°"),
        ]
    for text, value in (
        ("water's frequency per roll frequency", f"{figures['frequency_ratio']:.3f}"),
        ("mass ratio", f"{figures['mass_ratio']:.4f}"),
        ("coupling ratio", f"{figures['coupling_ratio']:.3f}"),
        ("stability taken by the free surface", f"{figures['stability_taken']:.1%}"),
        ("level at which a reservoir is full or empty", f"{figures['level_limit_m']:.2f} m"),
        *figures_of_pump,
    ):
        rest.add_row(text, value)
    print_table(console, rest)
    for assumption in vessel.assumptions:
        console.print(f"Assumed: {assumption}.", soft_wrap=True)


def _motion(frequency_rad_s: float, damping_ratio: float) -> tuple[str, str, str]:
    period_s = 2 * math.pi / frequency_rad_s
    return f"{frequency_rad_s:.3f}", f"{period_s:.2f}", f"{damping_ratio:.3f}"


def _gain(margin: Margins) -> str:
    high = f"{margin.gain_high:.2f}" if math.isfinite(margin.gain_high) else "any"
    return f"{margin.gain_low:.2f} to {high}"


def _phase(margin: Margins) -> str:
    if not math.isfinite(margin.phase_margin_rad):
        return "any"
    return f"{math.degrees(margin.phase_margin_rad):.0f}°"


def _delay(law: BuiltLaw, margin: Margins) -> str:
    if not math.isfinite(margin.delay_margin_s):
        return f"over {1e3 * _searched_s(law):.0f} ms"
    return f"{1e3 * margin.delay_margin_s:.0f} ms"


def _searched_s(law: BuiltLaw) -> float:
    """Extra delay up to which the loop was found stable, when no margin was found."""
    return 0.0 if law.linear is None else DELAY_SAMPLES * law.linear.sample_time_s


def _remarks(law: BuiltLaw, report: Robustness) -> list[str]:
    """Notes on the margins beside whether they are missed."""
    notes = [note for note in (_at_rest(law),) if note is not None]
    gain = report.nominal.peak_loop_gain
    if gain < LEAST_LOOP_GAIN and not law.adapts:
        notes.append(f"It hardly acts: its loop gain is {gain:.2g} at most.")
    return notes


def _met(law: BuiltLaw) -> str:
    """The verdict on a law that misses nothing."""
    if law.adapts:
        return "Met by what it starts from; [yellow]what it learns is not judged.[/yellow]"
    return "[green]All requirements are met.[/green]"


def _at_rest(law: BuiltLaw) -> str | None:
    """What the margins of a nonlinear law are those of; None for a linear one."""
    if not law.at_rest:
        return None
    learning = " with the parameters it starts from" if law.adapts else ""
    return f"The law is nonlinear: these are the margins of its slope at rest{learning}."


def _finite(values: dict[str, Any]) -> dict[str, Any]:
    """JSON has no infinity: an unlimited value is null."""
    return {
        name: _finite(value)
        if isinstance(value, dict)
        else (value if math.isfinite(value) else None)
        for name, value in values.items()
    }
