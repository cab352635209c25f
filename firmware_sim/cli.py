"""Command line ``firmware-sim``: the ship's side alone."""

from utank_hil.commands.interruptible import quietly_interruptible

with quietly_interruptible():
    import json
    import sys
    from dataclasses import asdict
    from pathlib import Path
    from typing import Annotated

    import typer
    from rich.console import Console

    import utank_hil.commands.single_thread  # noqa: F401, first: it must run before numpy loads
    from firmware_sim.run import RECORD_NS, RECORD_S, SECOND_NS
    from firmware_sim.scenario import Scenario
    from firmware_sim.ship_side import build_ship_side
    from firmware_sim.truth import TRUTH, TruthRecorder
    from utank_hil.analysis.motion.statistics import pump_statistics, roll_statistics
    from utank_hil.canbus import SocketCanPort
    from utank_hil.commands.common import Duration, Json, fail, load, new_app, notes
    from utank_hil.commands.tables import print_table
    from utank_hil.commands.timing import timing_table
    from utank_hil.runtime import (
        LoopStatistics,
        Node,
        RealTimeLoop,
        heard_by,
        real_time_scheduling,
        stop_on_signals,
    )
    from utank_hil.telemetry.table import Table

app = new_app("Ship emulator, sensors, pump drive and operator panel on a CAN bus.")


@app.command()
def firmware_sim(
    scenario: Annotated[Path, typer.Argument(help="Scenario file.")],
    bus: Annotated[str, typer.Option(help="SocketCAN interface, for example can0 or vcan0.")],
    seed: Annotated[
        int | None, typer.Option(min=0, help="Of waves and noise, instead of the scenario's.")
    ] = None,
    duration: Duration = None,
    operator: Annotated[
        bool, typer.Option(help="Let the scenario's operator act, or leave the panel to others.")
    ] = True,
    json_: Json = False,
) -> None:
    """Play ship, tank, sensors, pump drive and operator of a scenario until Ctrl-C.

    With [bold]utank-hil run[/bold] on the same bus this is a bench.

    [bold]Example:[/bold] firmware-sim configs/scenarios/storm.yaml --bus vcan0 --duration 120
    """
    loaded = load(scenario, Scenario)
    length_s = loaded.duration_s if duration is None else duration
    statistics = LoopStatistics()
    ship = build_ship_side(loaded, loaded.seed if seed is None else seed, loaded.operator)
    table = Table(len(TRUTH), -(-round(length_s * SECOND_NS) // RECORD_NS))
    nodes: list[Node] = [*ship.nodes] if operator else [ship.sensors, ship.drive]
    nodes.append(TruthRecorder(ship.plant, table, RECORD_NS))
    try:
        port = SocketCanPort(bus, heard_by(nodes))
    except OSError as error:
        fail(error)
    try:
        with stop_on_signals() as stop, real_time_scheduling() as scheduling:
            for line in scheduling.lines():
                notes.print(line, soft_wrap=True)
            notes.print(f"{loaded.name} on {bus}; Ctrl-C ends it.")
            RealTimeLoop(nodes, port, statistics=statistics).run(stop, round(length_s * SECOND_NS))
    finally:
        port.close()
    rows = table.rows
    if len(rows) == 0:
        fail("ended before the first sample")
    roll = roll_statistics(rows[:, TRUTH.index("true_roll_rad")])
    pump = pump_statistics(
        rows[:, TRUTH.index("true_pressure_pa")],
        rows[:, TRUTH.index("true_shaft_power_w")],
        rows[:, TRUTH.index("true_level_m")],
    )
    if json_:
        summary = {
            "duration_s": len(rows) * RECORD_S,
            "roll": asdict(roll),
            "pump": asdict(pump),
            "refused_commands": ship.drive.refused,
            "loop": statistics.summary(),
        }
        sys.stdout.write(json.dumps(summary) + "\n")
        return
    console = Console(highlight=False)
    print_table(console, timing_table({"ship": statistics}))
    console.print(
        f"roll RMS {roll.rms_rad:.4f} rad, largest {roll.maximum_rad:.4f} rad; "
        f"pressure RMS {pump.pressure_rms_pa / 1e3:.1f} kPa; "
        f"{ship.drive.refused} commands refused"
    )


def main() -> None:
    """Run the command line."""
    app()
