"""Runs on this machine, found by their rings in shared memory and streamed to viewers."""

from collections.abc import Mapping
from contextlib import ExitStack
from dataclasses import dataclass
from typing import Any, Final

import rerun as rr

from utank_hil.base.closing import Closing
from utank_hil.nodes.signals import SIGNALS
from utank_hil.telemetry import rerun_log
from utank_hil.telemetry.blueprint import columns_of, make_blueprint
from utank_hil.telemetry.events import EventReader
from utank_hil.telemetry.ring import RingKind, RingReader, RowReader, ring_names
from utank_hil.telemetry.scene import scene_size
from utank_hil.telemetry.viewer import LOOPBACK, hold_port, live_url, port_of

LIVE_RUN: Final = "live"  #: Name of a live run.
MEMORY: Final = "64MiB"  #: History for late viewers, which bounds the memory of the stream.
_START_S: Final = 5.0  #: Time in which the server of a stream starts, even on a busy machine.


@dataclass(frozen=True, slots=True)
class LiveRun:
    """A run whose writer lives."""

    ring: str  #: Name of its telemetry ring.
    events: str | None  #: Name of its ring of events.
    pid: int  #: Id of its process.
    about: Mapping[str, Any]  #: Origin of its rows (`utank_hil.base.provenance`); empty if unknown.

    def __str__(self) -> str:
        name = self.about.get("configuration", {}).get("name", self.ring)
        return f"{self.pid}: {self.about.get('command', 'process')}, {name}"


def live_runs() -> list[LiveRun]:
    """Return the runs of this machine that this user may read, without those of killed writers."""
    found: list[tuple[str, int, Mapping[str, Any]]] = []
    events: dict[int, str] = {}
    for name in ring_names():
        try:
            with RingReader(name) as ring:
                if ring.ended:
                    continue
                if ring.kind is RingKind.EVENTS:
                    events[ring.writer_pid] = name
            with RowReader(name) as rows:
                if rows.columns == SIGNALS:
                    found.append((name, rows.writer_pid, rows.about or {}))
        except OSError:  # It has ended, is of another version or kind, or belongs to another user.
            continue
    return [LiveRun(ring, events.get(pid), pid, about) for ring, pid, about in found]


class LiveStream(Closing):
    """Streams a run to viewers at `url`, on loopback, also to those that connect late.

    OSError is raised if the run has ended meanwhile, or another program took the port.
    """

    def __init__(self, run: LiveRun) -> None:
        with ExitStack() as stack:
            self._ring = stack.enter_context(RowReader(run.ring))
            self._events = None if run.events is None else EventReader(run.events)
            if self._events is not None:
                stack.enter_context(self._events)
            port = port_of(stack.enter_context(hold_port()))
            self.url = live_url(port)
            sink = rr.GrpcServerSink(LOOPBACK, port, server_memory_limit=MEMORY)
            columns, size = self._ring.columns, scene_size(self._ring.columns, run.about)
            stream = rr.RecordingStream(rerun_log.APPLICATION, recording_id=run.ring)
            stack.callback(stream.disconnect)
            layout = make_blueprint(columns_of(columns, run.about), [LIVE_RUN], size=size)
            stream.set_sinks(sink, default_blueprint=layout)
            if run.about:
                rerun_log.write_about(stream, run.about)
            (path,) = rerun_log.run_paths([LIVE_RUN])
            self._log = rerun_log.RunLog(stream, path, columns, run.about)
            try:
                stream.flush(timeout_sec=_START_S)
            except RuntimeError as error:  # Otherwise viewers would show the other program.
                again = "start it again: it takes another"
                raise OSError(f"port {port} of this machine was taken; {again}") from error
            self._stack = stack.pop_all()

    def send(self) -> bool:
        """Send new rows and events; return whether more may come."""
        ended = self._ring.ended
        rows = self._ring.read_rows()
        if len(rows):
            self._log.write(rows)
        if self._events is not None:
            self._log.write_events(self._events.read_events())
        return not ended

    def close(self) -> None:
        """End the stream; idempotent."""
        self._stack.close()
