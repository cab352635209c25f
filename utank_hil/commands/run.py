"""``utank-hil run``: the deployed controller alone."""

import errno
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import asdict
from pathlib import Path
from typing import Annotated, Any, Final, NamedTuple

import typer

from utank_hil import canbus
from utank_hil.assembly import build_controller_node, retuner_process, works_of
from utank_hil.base.provenance import describe
from utank_hil.base.whole_file import claimed_files
from utank_hil.canbus.events import AlarmEvent
from utank_hil.canbus.frame import CHECK_BUS
from utank_hil.canbus.ports import BusPorts, open_port, why_other_bit_rate
from utank_hil.commands.announcer import LOG_NAME, Announcer
from utank_hil.commands.commissioning_record import why_not_commissioned
from utank_hil.commands.identified import IdentifiedShips, read_controller
from utank_hil.commands.lines import Lines, printed_lines
from utank_hil.commands.outward.outlets import Outlet, read_outlet
from utank_hil.commands.recording import RecordingSummary, RunRecording
from utank_hil.commands.service_manager import ServiceManager
from utank_hil.configuration.controller import ControllerConfig
from utank_hil.console import common
from utank_hil.console.admission import admit
from utank_hil.console.exit_codes import ExitCode
from utank_hil.console.loops import opened, scheduled
from utank_hil.console.terminal import Terminal, notes, shown, timing_table
from utank_hil.control import BuiltLaw
from utank_hil.nodes.controller import ControllerNode
from utank_hil.nodes.signals import ROW_TICKS
from utank_hil.retuning import Desk
from utank_hil.runners import LoopStatistics, Node, RealTimeLoop
from utank_hil.safety.faults import fault_text
from utank_hil.telemetry.events import Event, event_text
from utank_hil.telemetry.node_tap import NodeTap, Tapped
from utank_hil.telemetry.replay_head import replay_head

_REFUSALS: Final = (errno.ENOMEM, errno.EAGAIN, errno.EMFILE, errno.ENFILE, errno.ENOSPC)
LISTEN_S: Final = 0.35  #: Three cycles of a controller's status.
_LOOK_S: Final = 0.01  #: Time between two reads of the bus: a tick.
LOOK_TICKS: Final = 100  #: Ticks between two checks of the recorder.


def run(
    context: typer.Context,
    config: common.Config,
    bus: common.Bus,
    duration: common.Duration = None,
    out: Annotated[
        Path | None,
        common.option(
            "Folder for recording, log, and configurations of ships that retuning finds; "
            "without it there are none."
        ),
    ] = None,
    keep: Annotated[
        float | None,
        common.option(
            "Remove the folder's oldest recordings beyond so much; without it none are.",
            metavar="MB",
            min=0,
            max=1e9,  # A float without a limit may be infinite.
        ),
    ] = None,
    record: Annotated[
        Path | None,
        common.option(
            "Record of utank-hil commission, if it is not beside the configuration.", metavar="FILE"
        ),
    ] = None,
    outward: Annotated[
        list[str] | None,
        common.option(
            "Show alarms to the ship's systems: udp:// or iec450://ADDRESS:PORT (IEC 61162), "
            "modbus://ADDRESS:PORT; may be repeated.",
            metavar="URL",
        ),
    ] = None,
    json_: common.Json = False,
    allow_code: common.AllowCode = False,
) -> None:
    """Run the controller on a CAN bus until Ctrl-C; the pump is left at zero.

    It starts in STANDBY. Only an operator at the panel arms it, and only if utank-hil commission
    was passed with this vessel and these sensors; of a ship whose file says `emulated: true`, and
    whose nodes prove it, no record is asked for unless --record names one. Recordings are named by
    the time (UTC) of their start and go on in another file every hour; one that fails is reported,
    and the controller runs without. A controller that retunes itself prints each step with its
    reasons when it happens; so does one that raises an alarm, and both are logged in the folder of
    --out. A fault that is latched at the end, or a lost bus, has an exit code of its own
    (docs/deployment.md).

    **Example:** utank-hil run configs/controllers/gpc.yaml --bus can0 --out log
    """
    loaded = common.load(config, ControllerConfig, allow_code=allow_code)
    with common.failing(ValueError, at="--outward"):
        outlets = [read_outlet(each) for each in outward or ()]
    law = admit(loaded, config)
    if other := why_other_bit_rate(bus, loaded.bit_rate):
        common.fail(f"{config}: bit_rate: {other}")
    refused = why_not_commissioned(loaded, bus, config, record)
    _warn(loaded, refused)
    statistics = LoopStatistics()
    with _refusals_named(), ExitStack() as stack:
        unreached = "NOTIFY_SOCKET: the service manager can't be reached"
        with common.failing(OSError, at=unreached, code=ExitCode.SYSTEM):
            manager = stack.enter_context(ServiceManager())
        port, stop = stack.enter_context(opened(lambda: open_port(bus, loaded.vessel.foreign)))
        _refuse_beside_another(port, bus)
        announcer, recording = _outputs(
            stack, context, loaded, law, config, out, keep, outlets, commissioned=not refused
        )
        desks = Tapped(*_desks(stack, loaded), wanted=recording.keeps_records)
        told = _Told(stack.enter_context(printed_lines()), announcer, recording)
        node = build_controller_node(
            loaded,
            law,
            retuner=desks.retuner,
            estimating=desks.estimating,
            statistics=statistics,
            sink=recording.write,
            sink_every=ROW_TICKS,
            event_sink=told.event,
            commissioned=not refused,
        )
        on_bus: Node = node
        if recording.keeps_records:
            on_bus = NodeTap(node, recording.write_records, desks.taps, ROW_TICKS)

        def ended() -> bool:
            manager.progress(statistics.ticks)
            if statistics.ticks % LOOK_TICKS == 0:
                told.failures(port)
            return stop()

        with _in_real_time(f"{loaded.name} on {bus}", manager):
            with suppress(canbus.PortError):  # The loop meets the error too, and its node reacts.
                port.receive()  # Old frames must not look new.
            length_ns = None if duration is None else round(duration * 1e9)
            RealTimeLoop([on_bus], port, statistics=statistics).run(ended, length_ns)
    kept = None if out is None else recording.summary
    # The exit code reports the end if the output is full or gone (Rich ends by SystemExit).
    with suppress(OSError, SystemExit):
        unlogged = None if announcer is None else announcer.error
        if unlogged is not None:
            notes.say(unlogged, red="events were not logged:")
        if json_:
            common.print_json(_as_json(node, statistics, kept, refused) | {"log_error": unlogged})
        else:
            _print_summary(loaded.name, node, statistics, kept)
    raise typer.Exit(_code(node))


def _warn(loaded: ControllerConfig, refused: str) -> None:
    """Say what is unusual of this run."""
    if loaded.safety.overruns_in_ten is None:
        notes.say("safety.overruns_in_ten", yellow="repeated late ticks are not judged:")
    if loaded.vessel.emulated:
        notes.say("no node on board counts as one of this ship", yellow="vessel.emulated: true:")
    if refused:
        notes.say(refused, yellow="arming will be refused:")


def _desks(stack: ExitStack, loaded: ControllerConfig) -> tuple[Desk | None, Desk | None]:
    desks = stack.enter_context(retuner_process(loaded))
    if any(desk is not None and not desk.alive for desk in desks):
        notes.say("nothing will be retuned or estimated", red="the retuner did not start:")
    return desks


class _Told(NamedTuple):
    """Who hears of a run's events and failures."""

    lines: Lines
    announcer: Announcer | None
    recording: RunRecording

    def event(self, event: Event, start_ns: int) -> None:
        if isinstance(event, AlarmEvent):
            self.lines.tell(event, start_ns)
        if self.announcer is not None:
            self.announcer.write(event, start_ns)

    def failures(self, port: canbus.Port) -> None:
        for error in port.take_errors() if isinstance(port, BusPorts) else ():
            self.lines.say(f"a device's bus fails: {error}")
        if failure := self.recording.failure():
            self.lines.say(f"not recorded any longer: {failure}")
        if self.announcer is not None and (failure := self.announcer.failure()):
            self.lines.say(f"events are not logged any longer: {failure}")


def _refuse_beside_another(port: canbus.Port, bus: str) -> None:
    """Listen before talking: a second controller would take the drive out of operation."""
    catalogue = canbus.load_catalogue()
    sent = {
        catalogue.codec(message).can_id for message in (canbus.ControllerStatus, canbus.PumpCommand)
    }
    sent.add(catalogue.receiver(canbus.Heartbeat, canbus.Address.CONTROLLER).can_id)
    until_s, silent = time.monotonic() + LISTEN_S, True
    while time.monotonic() < until_s:
        with suppress(canbus.PortError):  # The loop meets it, too.
            for frame in port.receive():
                silent = False
                if frame.can_id in sent:
                    common.fail(
                        f"{bus}: another controller is on this bus: it sent 0x{frame.can_id:08X}; "
                        "end it first",
                        ExitCode.NO_BUS,
                    )
        time.sleep(_LOOK_S)
    if silent and not port.others:
        notes.say(f"nothing came in {LISTEN_S:g} s: {CHECK_BUS}", yellow=f"{bus}:")


@contextmanager
def _in_real_time(name: str, manager: ServiceManager) -> Iterator[None]:
    with scheduled(f"{name}; Ctrl-C ends it."):
        silent = "NOTIFY_SOCKET: the manager does not answer"
        with common.failing(OSError, at=silent, code=ExitCode.SYSTEM):
            manager.ready(name)
        try:
            yield
        finally:
            manager.stopping()  # The watchdog must not interrupt an error message.


@contextmanager
def _refusals_named() -> Iterator[None]:
    """End with a message and a restart by the service manager if the system refuses a resource.

    Any other error is a defect: it keeps its traceback, and also leads to a restart.
    """
    try:
        yield
    except OSError as error:
        if error.filename is None and error.errno not in _REFUSALS:
            raise
        common.fail(error, ExitCode.SYSTEM)


def _log(folder: Path) -> Path | None:
    try:
        folder.mkdir(parents=True, exist_ok=True)
        return claimed_files(folder.resolve(), LOG_NAME)[0]
    except OSError as error:
        notes.say(str(error), red="no log of events:")
        return None


def _outputs(
    stack: ExitStack,
    context: typer.Context,
    loaded: ControllerConfig,
    law: BuiltLaw,
    config: Path,
    out: Path | None,
    keep_mb: float | None,
    outlets: list[Outlet],
    *,
    commissioned: bool,
) -> tuple[Announcer | None, RunRecording]:
    """Start what logs, prints and records a run; what fails is said, and the run goes on."""
    retunes, estimates = (work is not None for work in works_of(loaded))
    log = ships = head = announcer = None
    if out is None:
        about = describe("run", loaded, Path.cwd(), options=context.params)
    else:
        log = _log(out)
        content = read_controller(config)
        ships = IdentifiedShips(out.resolve(), loaded.vessel, content)
        head = replay_head(
            "run",
            loaded,
            law,
            out,
            options=context.params,
            retuner=retunes,
            estimating=estimates,
            commissioned=commissioned,
        )
        about = head["about"]
    if out is not None or retunes or estimates or outlets:
        announcer = Announcer(ships, log, outlets)
        stack.callback(announcer.stop)
        if announcer.error is not None:
            notes.say(announcer.error, red="no log of events:")
    recording = RunRecording(
        out,
        events=None if announcer is None else announcer.ring,
        about=about,
        head=head,
        keep_bytes=None if keep_mb is None else round(keep_mb * 1e6),
        log=log,
    )
    stack.callback(recording.stop)
    if recording.summary.error is not None:
        notes.say(recording.summary.error, red="no recording:")
    return announcer, recording


def _as_json(
    node: ControllerNode,
    statistics: LoopStatistics,
    recording: RecordingSummary | None,
    refused: str,
) -> dict[str, Any]:
    return {
        "exit_code": _code(node),
        "mode": node.mode.name,
        "fault": node.fault.name,
        "not_commissioned": refused,
        "law_error": node.law.error,
        "fallbacks": node.law.fallbacks,
        "retuning": [event.as_json(node.start_ns) for event in node.law.events],
        "loop": statistics.summary(),
        "recording": None if recording is None else asdict(recording),
    }


def _code(node: ControllerNode) -> ExitCode:
    if node.measured.link_lost or node.fault is canbus.Fault.BUS_LOST:
        return ExitCode.BUS_LOST
    return ExitCode.FAULT if node.mode is canbus.Mode.FAULT else ExitCode.OK


def _print_summary(
    name: str, node: ControllerNode, statistics: LoopStatistics, recording: RecordingSummary | None
) -> None:
    console = Terminal()
    console.table(timing_table({name: statistics}))
    for event in node.law.events:
        console.say(f"{(event.time_ns - node.start_ns) * 1e-9:8.1f} s {event_text(event)}")
    what = "waiting for" if node.mode is canbus.Mode.INIT else "fault"  # INIT waits; that is none
    why = "" if node.fault is canbus.Fault.NONE else f", {what} {fault_text(node.fault)}"
    console.say(f"ended in {node.mode.name}{why}")
    if node.law.error:
        console.say(node.law.error, red="the law failed:")
    if node.law.fallbacks:
        console.say(f"{node.law.fallbacks} plans were not found in time; the one before went on")
    if recording is None:
        return
    _tell(console, recording)
    if recording.file is not None and recording.error is None and recording.rows != 0:
        console.lead_on(("report", Path(recording.file)))


def _tell(console: Terminal, recording: RecordingSummary) -> None:
    if recording.file is not None:
        said = f"recording: {shown(Path(recording.file))}"
        if recording.rows is not None:
            said += f", {recording.rows} rows, {recording.lost} lost"
        if recording.records_lost:
            said += f", {recording.records_lost} records of frames lost"
        if recording.parts is not None and recording.parts > 1:
            said += f", in {recording.parts} files"
        console.say(said)
    if recording.error is not None:
        console.say(recording.error, red="recording failed:")
