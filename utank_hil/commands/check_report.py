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
from utank_hil.arrays import FloatArray
from utank_hil.commands.gate import JudgedLaw
from utank_hil.commands.remedy import remedy
from utank_hil.commands.tables import print_table
from utank_hil.configuration import Vessel
from utank_hil.configuration.plausibility import free_surface_nm_rad, holding
from utank_hil.control import BuiltLaw
from utank_hil.dynamics.linear import coupled_matrices, state_matrices
from utank_hil.dynamics.tank import GRAVITY_M_S2
from utank_hil.dynamics.valves import added_damping_ratio
from utank_hil.dynamics.water import water_moments

NO_LOOP = "The law closes no loop that quiets the roll: it has no margins."
DISSIPATES = (
    "The law throttles a valve, which can only take energy out of the water, whatever it measures: "
    "no loop can become unstable, and there are no margins. It may still roll the ship more than "
    "the valve at rest; see what a bench says."
)

LEAST_LOOP_GAIN = 0.05
"""Below it a law with all margins hardly acts; the shipped ones have 1.3 and more."""

Judged = dict[str, JudgedLaw]


def controller_json(judged: JudgedLaw) -> dict[str, Any]:
    """A controller as one JSON object."""
    config, report = judged.config, judged.robustness
    return {
        "name": config.name,
        "vessel": config.vessel.name,
        "ship": ship_figures(config.vessel),
        "configuration_version": config.vessel.version,
        "law": config.law.kind,
        "at_rest": _at_rest(judged.law),
        "dissipates": judged.law.dissipates,
        "limits": _finite(asdict(config.limits)),
        "robustness": None if report is None else _finite(asdict(report)),
        "delay_margin_searched_s": None if report is None else _searched_s(judged.law),
        "failures": list(judged.failures),
        "remedy": remedy(judged),
        "accepted": judged.accepted,
    }


def collection_json(collection: Any, judged: Judged) -> dict[str, Any]:
    """A file of several controllers, a scenario for one, as one JSON object."""
    vessel: Vessel = collection.vessel
    controllers = {name: controller_json(each) for name, each in judged.items()}
    return {
        "name": collection.name,
        "vessel": vessel.name,
        "ship": ship_figures(vessel),
        "figures": collection.figures(),
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
        reservoir is full or empty. Metacentric height and the water's share of the displacement
        are None where that is not given, what is of the pump without one: heel and head that its
        greatest pressure holds; power that holds it in still water; flow that moves the level from
        limit to limit at the roll period, and power of pressure and flow, without losses. Damping
        ratios that a valve adds, None without one.
    """
    ship, tank = vessel.ship, vessel.tank
    figures = tank_figures(ship, tank)
    _, _, stiffness = coupled_matrices(ship, tank)
    free = np.linalg.eigvals(state_matrices(ship, tank)[0])
    frequency = ship.natural_frequency_rad_s
    water_kg = float(water_moments(tank, 0.0).mass_kg)
    weight_n = ship.displacement_n or None
    return {
        "roll_period_s": 2 * math.pi / frequency,
        "tank_period_s": 2 * math.pi / tank.natural_frequency_rad_s,
        "gm_m": None if weight_n is None else ship.stiffness_nm_rad / weight_n,
        "water_kg": water_kg,
        "water_share": None if weight_n is None else water_kg * GRAVITY_M_S2 / weight_n,
        "roll_frequency_rad_s": frequency,
        "roll_damping_ratio": ship.damping_nms_rad / (2 * ship.inertia_kg_m2 * frequency),
        "tank_frequency_rad_s": tank.natural_frequency_rad_s,
        "tank_damping_ratio": tank.damping_ratio,
        "modes": [
            {
                "frequency_rad_s": abs(mode),
                "period_s": 2 * math.pi / abs(mode),
                "damping_ratio": -mode.real / abs(mode),
            }
            for mode in sorted(free.astype(complex), key=abs)
            if mode.imag >= 0
        ],
        "frequency_ratio": figures.frequency_ratio,
        "mass_ratio": figures.mass_ratio,
        "coupling_ratio": figures.coupling_ratio,
        "stability_taken": free_surface_nm_rad(ship, tank) / ship.stiffness_nm_rad,
        "level_limit_m": tank.level_limit_m,
        **_pump_figures(vessel, stiffness),
        **_valve_figures(vessel),
    }


def _valve_figures(vessel: Vessel) -> dict[str, float | None]:
    """Damping ratio that the valve adds to the water at half the greatest level."""
    if vessel.valve is None:
        return {"valve_damping_open": None, "valve_damping_shut": None}
    tank, losses = vessel.tank, vessel.valve.range(vessel.tank)
    half_m = tank.level_limit_m / 2
    return {
        "valve_damping_open": added_damping_ratio(tank, losses.open_loss, half_m),
        "valve_damping_shut": added_damping_ratio(tank, losses.shut_loss, half_m),
    }


def _pump_figures(vessel: Vessel, stiffness: FloatArray) -> dict[str, float | None]:
    """What the pump can do with this tank and ship."""
    pump, tank = vessel.pump, vessel.tank
    names = ("heel_rad", "head_m", "flow_m3_s", "power_asked_w", "power_held_w", "power_w")
    if pump is None:
        return {f"pump_{name}": None for name in names}
    pressure_pa = pump.max_pressure_pa
    heel_rad, _ = np.linalg.solve(stiffness, [0.0, tank.reservoir_area_m2 * pressure_pa])
    flow_m3_s = tank.reservoir_area_m2 * tank.level_limit_m * vessel.ship.natural_frequency_rad_s
    figures = (
        float(abs(heel_rad)),
        pressure_pa / (tank.density_kg_m3 * GRAVITY_M_S2),
        flow_m3_s,
        pressure_pa * flow_m3_s,
        holding(pump)[2],
        pump.max_power_w,
    )
    return {f"pump_{name}": value for name, value in zip(names, figures, strict=True)}


def _pump_rows(vessel: Vessel, figures: dict[str, Any]) -> list[tuple[str, str]]:
    if vessel.pump is None:
        return [("pump", "none")]
    return [
        ("pump's greatest pressure", f"{vessel.pump.max_pressure_pa / 1e3:.1f} kPa"),
        ("  in metres of water", f"{figures['pump_head_m']:.2f} m"),
        ("heel that it holds", f"{math.degrees(figures['pump_heel_rad']):.2f}°"),
        ("flow from full to empty at the roll period", f"{figures['pump_flow_m3_s']:.3g} m³/s"),
        ("power of pressure and flow, without losses", _power(figures["pump_power_asked_w"])),
        ("power to hold the pressure in still water", _power(figures["pump_power_held_w"])),
        ("power of the motor", _power(figures["pump_power_w"])),
    ]


def _valve_rows(vessel: Vessel, figures: dict[str, Any]) -> list[tuple[str, str]]:
    valve = vessel.valve
    if valve is None:
        return []
    return [
        (f"valve in the {valve.kind}, shut to open", f"{valve.opening_time_s:g} s"),
        ("  share left open when shut", f"{valve.leakage:.1%}"),
        ("  without command or power", valve.fail_position),
        (
            "  damping ratio it adds at half that level, open to shut",
            f"{figures['valve_damping_open']:.2g} to {figures['valve_damping_shut']:.2g}",
        ),
    ]


def print_controller(judged: JudgedLaw) -> None:
    """Print a controller's margins."""
    config, report = judged.config, judged.robustness
    console = Console(highlight=False)
    console.print(f"{config.name} for {config.vessel.name}: the configuration is valid.")
    console.print(ship_line(config.vessel), soft_wrap=True)
    if report is None:
        if judged.law.unjudged:
            _print_verdict(console, judged)
        else:
            text = DISSIPATES if judged.law.dissipates else NO_LOOP
            console.print(text, soft_wrap=True)
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
        _print_remedy(console, judged)
    else:
        console.print(_met(judged.law))


def _print_remedy(console: Console, judged: JudgedLaw, whose: str = "") -> None:
    found = remedy(judged)
    if found is not None:
        console.print(f"[yellow]remedy{whose}:[/yellow] {escape(found)}", soft_wrap=True)


def print_collection(kind: str, collection: Any, judged: Judged) -> None:
    """Print the margins of all controllers of a file."""
    console = Console(highlight=False)
    console.print(f"{collection.name}, {collection.vessel.name}: the {kind} is valid.")
    console.print(ship_line(collection.vessel), soft_wrap=True)
    for line in collection.meaning():
        console.print(line, soft_wrap=True)
    if not judged:  # a passive tank has no law
        return
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
        _print_remedy(console, one, f" of {escape(each)}")


def _verdict(judged: JudgedLaw) -> str:
    """The verdict on a law in a word."""
    if judged.failures:
        return "[yellow]accepted[/yellow]" if judged.accepted else "[red]refused[/red]"
    if judged.robustness is None:
        return "dissipates" if judged.law.dissipates else "no loop"
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
    share = figures["water_share"]
    gm_m = figures["gm_m"]
    taken = figures["stability_taken"]
    for text, value in (
        ("metacentric height GM", "no displacement" if gm_m is None else f"{gm_m:.2f} m"),
        ("water in the tank", _tonnes(figures["water_kg"])),
        ("  of the displacement", "" if share is None else f"{share:.2%}"),
        ("water's frequency per roll frequency", f"{figures['frequency_ratio']:.3f}"),
        ("mass ratio", f"{figures['mass_ratio']:.4f}"),
        ("coupling ratio", f"{figures['coupling_ratio']:.3f}"),
        ("stability taken by the free surface", f"{taken:.1%}"),
        ("  of GM", "" if gm_m is None else f"{taken * gm_m:.3f} m"),
        ("level at which a reservoir is full or empty", f"{figures['level_limit_m']:.2f} m"),
        *_valve_rows(vessel, figures),
        *_pump_rows(vessel, figures),
    ):
        if value:
            rest.add_row(text, value)
    print_table(console, rest)
    for assumption in vessel.assumptions:
        console.print(f"Assumed: {assumption}.", soft_wrap=True)


def ship_line(vessel: Vessel) -> str:
    """What the ship's numbers mean, in a line: a wrong unit shows."""
    figures = ship_figures(vessel)
    pump = "there is no pump"
    if vessel.pump is not None:
        pump = (
            f"the pump presses {figures['pump_head_m']:.2g} m of water, moves up to "
            f"{figures['pump_flow_m3_s']:.3g} m³/s and has {_power(figures['pump_power_w'])}"
        )
    if vessel.valve is not None:
        pump += f"; a valve in the {vessel.valve.kind} opens in {vessel.valve.opening_time_s:g} s"
    periods = " and ".join(f"{mode['period_s']:.3g}" for mode in figures["modes"])
    return (
        f"She rolls in {figures['roll_period_s']:.3g} s, with the water in {periods} s; "
        f"{_tonnes(figures['water_kg'])} of water take {figures['stability_taken']:.1%} of her "
        f"stability; {pump}."
    )


def _tonnes(mass_kg: float) -> str:
    return f"{mass_kg / 1e3:.3g} t"


def _power(power_w: float) -> str:
    return f"{power_w / 1e6:.2f} MW" if power_w >= 1e6 else f"{power_w / 1e3:.3g} kW"


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
