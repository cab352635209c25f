"""Command line ``firmware-sim``: the ship's side alone."""

from utank_hil.console.interruptible import quietly_interruptible

with quietly_interruptible():
    import math
    from dataclasses import asdict
    from functools import partial
    from pathlib import Path
    from typing import Annotated

    import utank_hil.console.single_thread  # noqa: F401, first: it must run before numpy loads
    from utank_hil.console.common import failures_named

    with failures_named():
        from firmware_sim import ship_side
        from firmware_sim.run import RECORD_NS, RECORD_S, SECOND_NS, ship_port
        from firmware_sim.scenario import Scenario
        from firmware_sim.truth import TRUTH, MemoryLog, TruthRecorder
        from utank_hil import runners
        from utank_hil.analysis.motion.statistics import pump_statistics, roll_statistics
        from utank_hil.console import common
        from utank_hil.console.common import fail
        from utank_hil.console.exit_codes import ExitCode
        from utank_hil.console.loops import opened, scheduled
        from utank_hil.console.terminal import Terminal, timing_table

app = common.new_app("Ship emulator, sensors, pump drive and operator panel on a CAN bus.")


@app.command()
def firmware_sim(
    scenario: Annotated[Path, common.argument("Scenario file.")],
    bus: Annotated[str, common.option("CAN interface, for example can0 or vcan0.")],
    seed: common.Seed = None,
    duration: common.Duration = None,
    without: Annotated[
        str,
        common.option(
            "Emulated nodes to leave out, with hardware in their place: some of "
            f"{', '.join(ship_side.NODE_NAMES)}.",
            metavar="NODES",
        ),
    ] = "",
    json_: common.Json = False,
    allow_code: common.AllowCode = False,
    version: common.Version = False,  # noqa: ARG001, ends the command when it is read
) -> None:
    """Emulate ship, tank, sensors, pump drive and operator of a scenario until Ctrl-C.

    With **utank-hil run** on the same bus this is a bench. Hardware on the bus takes the
    place of nodes that are left out; without the drive, the ship's pump gives the pressure that the
    real drive reports.

    **Example:** firmware-sim configs/scenarios/storm.yaml --bus vcan0 --without panel
    """
    loaded = common.load(scenario, Scenario, allow_code=True)  # laws are not built from it
    if loaded.fmu is not None and not allow_code:
        fail(f"{scenario}: fmu.file: runs native code: allow it by --allow-code if you trust it")
    if loaded.faults:
        fail(f"{scenario}: faults: are for the bench in simulated time: leave them out")
    length_s = loaded.duration_s if duration is None else duration
    seed = loaded.seed if seed is None else seed
    ship_side.load_compiled_code(loaded, seed)
    ship = ship_side.build_ship_side(loaded, seed, loaded.operator)
    log = MemoryLog(len(TRUTH), -(-round(length_s * SECOND_NS) // RECORD_NS))
    with common.failing(ValueError, at="--without"):
        nodes = ship.without([name.strip() for name in without.split(",") if name.strip()])
    statistics = runners.LoopStatistics()
    emulated = ", ".join(node.name for node in nodes if node.name in ship_side.NODE_NAMES)
    emulated = emulated or "no node, nothing is sent"
    words = f"{loaded.name} on {bus}, emulated: {emulated}; Ctrl-C ends it."
    nodes.append(TruthRecorder(ship.plant, log, RECORD_NS))
    port_of = partial(ship_port, bus, nodes, loaded.vessel.foreign)
    with opened(port_of) as (port, stop), scheduled(words):
        runners.RealTimeLoop(nodes, port, statistics=statistics).run(
            stop, round(length_s * SECOND_NS)
        )
    if len(log.rows) == 0:
        fail("ended before the first sample", ExitCode.INTERRUPTED)
    roll_rad, level_m, pressure_pa, power_w = (
        log.rows[:, TRUTH.index(f"true_{name}")]
        for name in ("roll_rad", "level_m", "pressure_pa", "shaft_power_w")
    )
    roll, pump = roll_statistics(roll_rad), pump_statistics(pressure_pa, power_w, level_m)
    hardware = {node.name: node for node in nodes if isinstance(node, ship_side.ExternalNode)}
    external = hardware.get(ship_side.EXTERNAL_DRIVE)
    if json_:
        common.print_json(
            {
                "duration_s": len(log.rows) * RECORD_S,
                "roll": asdict(roll),
                "pump": asdict(pump),
                "refused_commands": None if external else ship.refused_commands,
                "reported_pressure_share": external and external.reported_share,
                "loop": statistics.summary(),
            }
        )
        return
    console = Terminal()
    console.table(timing_table({"ship": statistics}))
    drive = f"{ship.refused_commands} commands refused"
    if external is not None:
        drive = f"pressure reported in {external.reported_share:.1%} of the time"
    console.say(
        f"roll RMS {math.degrees(roll.rms_rad):.2f}°, largest "
        f"{math.degrees(roll.maximum_rad):.2f}°; "
        f"pressure RMS {pump.pressure_rms_pa / 1e3:.1f} kPa; {drive}"
    )


def main() -> None:
    """Run the command line."""
    with failures_named():
        app()
