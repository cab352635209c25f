"""``utank-hil commission``: signs, zeros and scales at the quay, before anything may be armed."""

import math
from contextlib import ExitStack, suppress
from pathlib import Path
from typing import Annotated, Any, Final, NoReturn

import typer
from rich.text import Text

from utank_hil.assembly import build_commissioning_node
from utank_hil.base.tick import TICK_S
from utank_hil.canbus import AlarmState, Fault, PortError
from utank_hil.canbus.events import AlarmEvent, RetuningEvent
from utank_hil.canbus.ports import open_port, why_other_bit_rate
from utank_hil.commands import commissioning_record
from utank_hil.commands.lines import Lines, printed_lines
from utank_hil.configuration.controller import ControllerConfig
from utank_hil.console import common
from utank_hil.console.exit_codes import ExitCode
from utank_hil.console.loops import opened, scheduled
from utank_hil.console.terminal import Terminal, new_table, notes, shown
from utank_hil.nodes.commissioning.node import CommissioningNode, Stage
from utank_hil.runners import LoopStatistics, RealTimeLoop
from utank_hil.safety.faults import fault_text

SAY_TICKS: Final = 500  #: Ticks between two lines about one stage.


def commission(
    config: common.Config,
    channel: common.Bus,
    record: Annotated[
        Path | None,
        common.option(
            "Where the record goes; without it beside the configuration, with the ending "
            ".commissioning.json.",
            metavar="FILE",
        ),
    ] = None,
    json_: common.Json = False,
) -> None:
    """Check every sensor, the pump and the valve at the quay, and write the record of it.

    The ship is to lie still and upright, with slack moorings, and an operator at the panel. First
    the zeros are measured. Then the operator arms, and the pump pushes the water a little to and
    fro: with at most 12 % of its pressure limit, the level up to a fifth of its limit, the roll up
    to 2 degrees. Stop and disarm act as always. What is wrong is named with its remedy. Without a
    record that it was passed, utank-hil run refuses to arm (docs/commissioning.md).

    **Example:** utank-hil commission configs/controllers/gpc.yaml --bus can0
    """
    loaded = common.load(config, ControllerConfig, allow_code=True)  # The law is not built.
    if other := why_other_bit_rate(channel, loaded.bit_rate):
        common.fail(f"{config}: bit_rate: {other}")
    path = record or commissioning_record.record_path(config)
    if reason := commissioning_record.why_not_replaceable(path):
        common.fail(f"{reason}; choose another place with --record")
    common.require_writable(path, "--record")
    statistics = LoopStatistics()
    with ExitStack() as stack:
        bus = opened(lambda: open_port(channel, loaded.vessel.foreign))
        port, stop = stack.enter_context(bus)
        lines = stack.enter_context(printed_lines())

        def tell(event: RetuningEvent | AlarmEvent, start_ns: int) -> None:
            if not isinstance(event, AlarmEvent):
                return
            if event.code is not Fault.NOT_COMMISSIONED:
                lines.tell(event, start_ns)
            elif event.state is AlarmState.ACTIVE_UNACKNOWLEDGED:  # it says nothing of here and now
                lines.say("  not armed: wait until this asks for it")

        with common.failing(ValueError, at=f"{config}: vessel"):
            node = build_commissioning_node(loaded, statistics=statistics, event_sink=tell)
        guide = Guide(node, lines)
        notes.say(
            f"{loaded.name} on {channel}: about {node.duration_s:.0f} s; Ctrl-C ends it, and then "
            "nothing is recorded; once pump and valve move, an older record is void."
        )
        with scheduled():
            with suppress(PortError):  # The loop meets the error too, and its node reacts.
                port.receive()  # Old frames must not look new.
            RealTimeLoop([node], port, statistics=statistics).run(lambda: guide.look() or stop())
    if node.stage is not Stage.DONE:
        _give_up(node.stage, path)
    # The previous record is void from now on, whatever this commissioning yields.
    with suppress(OSError):  # What can't be removed can't be replaced either, and that is reported.
        commissioning_record.remove_record(path)
    made = commissioning_record.make_record(loaded, config, channel, node.checks(), node.ended)
    unwritten = ""
    try:
        commissioning_record.write_record(path, made)
    except OSError as error:
        left = "; remove the one that is there" if path.exists() else ""
        unwritten = f"{path}: the record can't be written: {error.strerror}{left}"
    # The exit code reports the end if the output is full or gone (Rich ends by SystemExit).
    with suppress(OSError, SystemExit):
        if json_:
            common.print_json({**made, "record": str(path)})
        else:
            _print(made, path, config, code=loaded.law.kind == "python")
    if unwritten:
        common.fail(unwritten)
    raise typer.Exit(ExitCode.OK if made["passed"] else ExitCode.REFUSED)


def _give_up(stage: Stage, path: Path) -> NoReturn:
    """End before all was checked; a record is void once pump and valve have moved."""
    what = "ended before all was checked; there is no new record"
    if stage in (Stage.MOVING, Stage.STOPPING):
        try:
            commissioning_record.remove_record(path)
        except OSError as error:
            common.fail(f"{what}, and the one before can't be removed: {error}; remove it")
        what += ", and the one before is removed"
    common.fail(what, ExitCode.INTERRUPTED)


class Guide:
    """Guides the operator through the stages while the loop runs, by `lines`."""

    def __init__(self, node: CommissioningNode, lines: Lines) -> None:
        self._node = node
        self._lines = lines
        self._stage: Stage | None = None
        self._ticks = 0

    def look(self) -> bool:
        """Report news before a tick; return whether all stages are done."""
        node = self._node
        self._ticks = self._ticks + 1 if node.stage is self._stage else 0
        if self._ticks % SAY_TICKS == 0:
            self._stage = node.stage
            if self._ticks == 0:
                self._lines.say(node.stage.value)
            elif node.stage is Stage.WAITING:
                why = node.missing or fault_text(node.node.fault)
                self._lines.say(f"  still {node.node.mode.name}: {why}")
            elif node.stage is Stage.ARM:
                self._lines.say("  waiting for the operator to arm")
            else:
                done_s = self._ticks * TICK_S
                self._lines.say(f"  {done_s:.0f} of {node.length_s:.0f} s")
        return node.stage is Stage.DONE


def _print(record: dict[str, Any], path: Path, config: Path, *, code: bool) -> None:
    console = Terminal()
    print_checks(console, f"Commissioning of {record['vessel']}", record["checks"])
    if record["ended"]:
        console.say(record["ended"], red="ended early:")
    where = f"record: {shown(path)}"
    if not record["passed"]:
        console.say(where, red="not passed: arming is refused;")
    else:
        console.say(where, green="passed;")
        named = ("--record", path) if path != commissioning_record.record_path(config) else ()
        following = ("run", config, "--bus", record["bus"], *named, "--out", "log")
        console.lead_on(following, allow_code=code)


def _rounded(value: float, places: int) -> str:
    return f"{round(value, places) + 0.0:g}"


def print_checks(console: Terminal, title: str, checks: list[dict[str, Any]]) -> None:
    """Print the checks of a record as a table, and the remedies of those that failed."""
    table = new_table(title, "measured", "expected", names=("check",))
    table.add_column("verdict", no_wrap=True)
    for check in checks:
        unit = "" if check["unit"] == "1" else f" {check['unit']}"
        found, off = check["measured"], check["tolerance"]
        places = max(1 - math.floor(math.log10(off)), 0) if off else 4  # two digits of what it may
        measured = "none" if found is None else f"{_rounded(found, places)}{unit}"
        expected = f"{_rounded(check['expected'], places)} ± {_rounded(off, places)}"
        verdict = "pass" if check["verdict"] == "pass" else Text("FAIL", "red")
        table.add_row(check["what"], measured, expected, verdict)
    console.table(table)
    for check in checks:
        if check["verdict"] != "pass":
            console.say(check["remedy"], red=f"{check['what']}:")
