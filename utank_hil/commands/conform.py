"""``utank-hil conform``: puts one device of a ship's file through its profile."""

import math
import select
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Annotated

import typer

from utank_hil.assembly import key_of
from utank_hil.base.tick import TICK_S
from utank_hil.commands.commission import print_checks
from utank_hil.commands.commissioning_record import listed, made_with, write_record
from utank_hil.configuration.devices import ROLES
from utank_hil.configuration.vessel import Vessel
from utank_hil.console import common
from utank_hil.console.exit_codes import ExitCode
from utank_hil.console.loops import opened
from utank_hil.console.terminal import Terminal, notes, shown
from utank_hil.nodes.commissioning import conformance
from utank_hil.runners import RealTimeLoop


def conform(
    device: Annotated[str, common.argument("Its key in section devices, as motion or pump.")],
    channel: common.Bus,
    ship: Annotated[Path, common.option("Ship whose section devices has the device.")],
    record: Annotated[Path | None, common.option("Where the record goes.", metavar="FILE")] = None,
    seconds: Annotated[
        float, common.option("How long to measure a sensor's pace.", min=1.0, max=3600)
    ] = 10.0,
    hand_s: Annotated[
        float | None,
        common.option("Wait so long for each step by hand, not for Enter.", min=0.5, max=600),
    ] = None,
    json_: common.Json = False,
) -> None:
    """Put a device of another maker through its profile, and write the record of it.

    A sensor: rate and jitter, validity, signs by hand, silence. A drive: its configuration read
    back, what it must refuse, its time to stop; the pump turns. A valve: its way, and that it goes
    to its fail position by itself. A panel: its buttons. Nothing else may command it. Exit code 1
    if it does not conform.

    **Example:** utank-hil conform pump --bus can2 --ship configs/ships/thesis_first_devices.yaml
    """
    from utank_hil.canbus.socketcan import SocketCanPort

    vessel = common.load(ship, Vessel)
    path = record or Path(f"{device}.conformance.json")
    common.require_writable(path, "--record")
    nobody: list[bool] = []
    trial, silent = trial_of(vessel, device, ship, asks(hand_s, nobody), seconds)
    with opened(lambda: SocketCanPort(channel, standard=True, receive_only=silent)) as (port, stop):
        RealTimeLoop([trial], port).run(lambda: trial.done or bool(nobody) or stop())
    if nobody:
        common.fail("the input has ended: use --hand-s where nobody is there")
    if not trial.done:
        common.fail("ended before all was checked; there is no record", ExitCode.INTERRUPTED)
    passed, checks = all(each.passed for each in trial.checks), listed(trial.checks)
    made = {
        **made_with(vessel, ship, channel),
        "device": device,
        "profile": getattr(vessel.devices, device).profile,
        "passed": passed,
        "checks": checks,
    }
    write_record(path, made)
    if json_:
        common.print_json({**made, "record": str(path)})
    else:
        console = Terminal()
        print_checks(console, f"{device} of {vessel.name}", checks)
        said = {"green": "conforms;"} if passed else {"red": "does not conform;"}
        console.say(f"record: {shown(path)}", **said)
    raise typer.Exit(ExitCode.OK if passed else ExitCode.REFUSED)


def trial_of(
    vessel: Vessel, device: str, file: Path, ask: conformance.Ask, seconds: float
) -> tuple[conformance.Trial, bool]:
    """The trial of a device on the first interface, and whether nothing may be sent there."""
    devices = vessel.devices
    names = (*ROLES, "pump")
    if device not in names:
        common.fail(f"no device {device!r}: there are {', '.join(names)}")
    if devices is None or getattr(devices, device).native:
        common.fail(f"{file}: devices.{device} is native: utank-hil commission checks it")
    if device == "pump":
        assert vessel.pump is not None  # else the file would have been refused
        return conformance.DriveTrial(devices.pump.plan(0, vessel.pump), vessel.pump, ask), False
    section = devices.devices()[device]
    silent = section.bus in devices.receive_only
    plan = section.plan(ROLES[device], device, 0, silent=silent)
    if device == "valve":
        assert vessel.valve is not None  # likewise
        return conformance.ValveTrial(plan, vessel.valve, ask, seconds), silent
    key = key_of(vessel.foreign) if device == "panel" else b""
    return conformance.SensorTrial(plan, ask, seconds, key), silent


def asks(hand_s: float | None, nobody: list[bool]) -> conformance.Ask:
    """Ask on the terminal; a step is done at Enter, or after so many seconds.

    Where the input has ended, `nobody` is filled.
    """

    def ask(what: str) -> Callable[[], bool]:
        if hand_s is not None:
            notes.say(f"{what}: within {hand_s:g} s.")
            ticks = iter(range(math.ceil(hand_s / TICK_S)))
            return lambda: next(ticks, None) is None
        notes.say(f"{what}, then press Enter.")

        def entered() -> bool:
            if not select.select([sys.stdin], [], [], 0)[0]:
                return False
            line = sys.stdin.readline()
            if not line:
                nobody.append(True)
            return bool(line)

        return entered

    return ask
