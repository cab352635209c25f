"""``utank-hil bus``: who is on the bus, and what of the ship's file is missing, wrong or double."""

import time
from collections.abc import Iterator
from pathlib import Path
from typing import Annotated, Any

import typer

from utank_hil.base.text_files import TextFileError
from utank_hil.canbus.frame import CHECK_BUS
from utank_hil.canbus.line_names import DEFAULT_BIT_RATE, LINES, SLCAN
from utank_hil.configuration.controller import ControllerConfig
from utank_hil.configuration.files import ConfigError, kind_of
from utank_hil.configuration.vessel import Vessel
from utank_hil.console.common import Json, argument, failing, load, option, print_json
from utank_hil.console.exit_codes import ExitCode
from utank_hil.console.terminal import Terminal, new_table, notes
from utank_hil.telemetry.bus_census import BusCensus
from utank_hil.telemetry.bus_files.frame import BusFrame, BusLogError, of_message
from utank_hil.telemetry.bus_files.log import READ, BusLog


def bus(
    place: Annotated[str, argument(f"CAN interface, or a log of it: {READ}.")],
    ship: Annotated[Path | None, option("Controller or ship whose file is compared.")] = None,
    interface: Annotated[
        str, option("With a log: the interface that it is of, as the ship's file has it.")
    ] = "",
    channel: Annotated[str | None, option("With a log of several buses: the one to list.")] = None,
    seconds: Annotated[
        float, option("How long to listen to an interface.", min=0.5, max=3600)
    ] = 5.0,
    bit_rate: Annotated[
        int | None, option("Of the bus, for its load.", min=10_000, max=1_000_000)
    ] = None,
    json_: Json = False,
) -> None:
    """List the nodes and messages on a bus; nothing is sent.

    With --ship, what its file expects is compared: exit code 1 if something is missing, wrong or
    double.

    **Example:** utank-hil bus can0 --ship configs/controllers/gpc.yaml
    """
    vessel, said = _ship(ship)
    rate = bit_rate or said or DEFAULT_BIT_RATE
    log = not place.startswith((SLCAN, *LINES)) and (
        Path(place).exists() or bool(Path(place).suffix)
    )
    census = BusCensus(rate, vessel, interface if log else place)
    code = ExitCode.USAGE if log else ExitCode.NO_BUS
    with failing(BusLogError, TextFileError), failing(OSError, code=code):
        for message in BusLog(Path(place), channel).frames() if log else _heard(place, seconds):
            census.take(message)
    problems = census.problems()
    if not log and not census.rows():
        notes.say(f"nothing came in {seconds:g} s: {CHECK_BUS}", yellow=f"{place}:")
    if json_:
        print_json(_as_json(census, problems))
    else:
        _print(census, problems, compared=vessel is not None)
    if problems:
        raise typer.Exit(ExitCode.REFUSED)


def _ship(path: Path | None) -> tuple[Vessel | None, int | None]:
    if path is None:
        return None, None
    with failing(ConfigError):
        kind = kind_of(path, {"controller": ControllerConfig, "ship": Vessel})
    if kind == "ship":
        return load(path, Vessel), None
    config = load(path, ControllerConfig)
    return config.vessel, config.bit_rate


def _heard(interface: str, seconds: float) -> Iterator[BusFrame]:
    from utank_hil.canbus.python_can import can
    from utank_hil.canbus.socketcan import open_bus, port_error

    listening = open_bus(interface, listens=True)
    listening_ends = time.monotonic() + seconds
    try:
        while (left_s := listening_ends - time.monotonic()) > 0:
            if (message := listening.recv(left_s)) is not None:
                yield of_message(message, interface)
    except can.CanError as error:
        raise port_error(interface, error) from error
    finally:
        listening.shutdown()


def _as_json(census: BusCensus, problems: list[tuple[str, str]]) -> dict[str, Any]:
    return {
        "duration_s": census.duration_s,
        "load": census.load,
        "messages": census.rows(),
        "versions": {
            node: {"catalogue": catalogue, "configuration": configuration}
            for node, (catalogue, configuration) in census.versions.items()
        },
        "names": {
            f"{source:#04x}": [f"{name:#018x}" for name in sorted(names)]
            for source, names in census.identities.items()
        },
        "canopen": {str(node): state for node, state in census.states.items()},
        "errors": dict(census.errors),
        "problems": [{"kind": kind, "text": text} for kind, text in problems],
    }


def _print(census: BusCensus, problems: list[tuple[str, str]], *, compared: bool) -> None:
    console = Terminal()
    table = new_table(None, "frames/s", "gap ms", "bytes", names=("id", "message", "node"))
    for row in census.rows():
        figures = f"{row['rate_hz']:.4g}", f"{row['longest_gap_ms']:.0f}"
        lengths = ",".join(map(str, row["bytes"]))
        table.add_row(row["id"], row["message"], row["node"], *figures, lengths)
    console.table(table)
    console.say(f"{census.duration_s:.3g} s, {census.load:.1%} of the bus in use")
    for node, (catalogue, configuration) in census.versions.items():
        console.say(f"{node}: catalogue {catalogue}, ship {configuration}")
    for source, names in census.identities.items():
        console.say(f"source {source:#04x}: NAME " + ", ".join(f"{each:#018x}" for each in names))
    for number, state in census.states.items():
        console.say(f"node {number}: {state}")
    for error, count in census.errors.items():
        console.say(f"{count}", yellow=f"{error}:")
    for kind, text in problems:
        console.say(text, red=f"{kind}:")
    if compared and not problems:
        console.say(green="All that the ship's file expects is there, and once.")
