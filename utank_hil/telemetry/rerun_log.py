"""Log of telemetry rows in a Rerun recording.

A run is one entity, `/<number>/<name>`, with one component: a struct with a field for each column.
One entity for all signals makes the file two to three times smaller at a live recorder's batch
size. Changes of mode and fault are also logged by name, to a state lane and to a text log of
events.
"""

import json
import re
from collections.abc import Callable, Mapping, Sequence
from typing import Any, Final

import numpy as np
import pyarrow as pa  # It ships no annotations.
import rerun as rr

from utank_hil.base.arrays import FloatArray
from utank_hil.canbus.enumerations import Fault, Mode, RetuningState
from utank_hil.telemetry.events import Event, event_text, warns
from utank_hil.telemetry.scene import Scene, scene_size, send_at
from utank_hil.telemetry.units import field_of

APPLICATION: Final = "utank-hil"
TIME_COLUMN: Final = "time_s"
ABOUT: Final = "about"  #: Property that holds the origin (`utank_hil.base.provenance`) as JSON.
ARCHETYPE: Final = "telemetry"
COMPONENT: Final = "row"
STATE, RETUNING, LOG = "state", "retuning", "log"
"""Names, below a run's entity, of the lanes of its state and of retuning, and of its text log."""
STATE_COLUMNS: Final = ("mode", "fault")  #: Columns that make up the state lane of a run.
PICTURES_S: Final = 60.0
"""Length of the drawings that are written to a file at once; a kill loses them, not the rows."""
_ESCAPE: Final = re.compile(
    r"\\u\{(?P<code>[0-9A-Fa-f]+)\}|\\(?P<mark>.)"
)  # an escape in entity paths
_MODE_COLORS: Final = {
    Mode.INIT: 0x777777FF,
    Mode.STANDBY: 0x999999FF,
    Mode.PASSIVE: 0x0072B2FF,
    Mode.ACTIVE: 0x009E73FF,
    Mode.FAULT: 0xD55E00FF,
}


def _state_name(mode: float, fault: float) -> str:
    """Return a state's name, such as `FAULT: DRIVE_SILENT`; unknown values as numbers."""
    name = Mode(int(mode)).name if mode in set(Mode) else f"mode {mode:g}"
    if fault == Fault.NONE:
        return name
    return f"{name}: {Fault(int(fault)).name if fault in set(Fault) else f'fault {fault:g}'}"


def _retuning_name(state: float) -> str:
    return RetuningState(int(state)).name if state in set(RetuningState) else f"{state:g}"


def _level(mode: float, fault: float) -> rr.TextLogLevel:
    if mode == Mode.FAULT:
        return rr.TextLogLevel.ERROR
    return rr.TextLogLevel.INFO if fault == Fault.NONE else rr.TextLogLevel.WARN


class RunLog:
    """Writes the rows of one run.

    `path` is one of `run_paths`; `time_s` is among the columns of a row. With the ship in the run's
    origin, `about`, a scene is drawn, in batches of `batch_s`. `alone` says whether the recording
    has no other run. Raises `ValueError` if there is no `time_s`, or a column is not in SI units.
    """

    def __init__(
        self,
        recording: rr.RecordingStream,
        path: str,
        columns: Sequence[str],
        about: Mapping[str, Any] | None = None,
        batch_s: float = 0.0,
        *,
        alone: bool = True,
    ) -> None:
        self._recording, self._path = recording, path
        size = scene_size(columns, about)
        self._scene: Scene | None = None
        if size is not None:
            self._scene = Scene(recording, path, columns, size, batch_s, alone)
        self._time = columns.index(TIME_COLUMN)
        self._fields = [(i, field_of(c)) for i, c in enumerate(columns) if c != TIME_COLUMN]
        self._state = [columns.index(c) for c in STATE_COLUMNS if has_state(columns)]
        self._retuning = [columns.index("retuning")] if "retuning" in columns else []
        idle = np.full((1, 1), float(RetuningState.IDLE))
        self._last = {STATE: np.full((1, 2), np.nan), RETUNING: idle}  # Last states by lane.
        if self._state:
            colors = {_state_name(m, f): _MODE_COLORS[m] for m in Mode for f in Fault}
            style = rr.StateConfiguration(values=list(colors), colors=list(colors.values()))
            recording.log(f"{path}/{STATE}", style, static=True, strict=True)

    def write(self, rows: FloatArray) -> None:
        """Append rows, an array (n, width); NaN leaves a gap in the plot."""
        time_s = rows[:, self._time]
        row = pa.StructArray.from_arrays(
            [pa.array(rows[:, i] * field.unit.scale) for i, field in self._fields],
            names=[field.name for _, field in self._fields],
        )
        columns = rr.DynamicArchetype.columns(archetype=ARCHETYPE, components={COMPONENT: row})
        send_at(self._recording, self._path, time_s, columns)
        if self._state:
            changed, states, names = self._write_states(STATE, rows, self._state, _state_name)
            self._write_text(changed, names, [_level(*each) for each in states])
        if self._retuning:
            self._write_states(RETUNING, rows, self._retuning, _retuning_name)
        if self._scene is not None:
            self._scene.write(rows)

    def close(self) -> None:
        """Send the batched drawings; idempotent."""
        if self._scene is not None:
            self._scene.close()

    def write_events(self, events: Sequence[Event]) -> None:
        """Log events of retuning and alarms; `time_ns` is on the clock of the rows' `time_s`."""
        self._write_text(
            np.array([event.time_ns for event in events]) * 1e-9,
            [event_text(event) for event in events],
            [rr.TextLogLevel.WARN if warns(event) else rr.TextLogLevel.INFO for event in events],
        )

    def _write_states(
        self, lane: str, rows: FloatArray, places: list[int], name: Callable[..., str]
    ) -> tuple[FloatArray, FloatArray, list[str]]:
        """Log states where they change; return times, states and names of these changes."""
        states = rows[:, places]
        changed = (np.diff(states, axis=0, prepend=self._last[lane]) != 0).any(axis=1)
        self._last[lane] = states[-1:].copy()
        time_s, names = rows[changed, self._time], [name(*state) for state in states[changed]]
        if names:
            columns = rr.StateChange.columns(state=names)
            send_at(self._recording, f"{self._path}/{lane}", time_s, columns)
        return time_s, states[changed], names

    def _write_text(
        self, time_s: FloatArray, texts: list[str], levels: Sequence[rr.TextLogLevel]
    ) -> None:
        if texts:
            columns = rr.TextLog.columns(text=texts, level=[str(level) for level in levels])
            send_at(self._recording, f"{self._path}/{LOG}", time_s, columns)


def write_about(recording: rr.RecordingStream, about: Mapping[str, Any]) -> None:
    """Store a recording's origin, which the viewer shows."""
    recording.send_property(ABOUT, rr.TextDocument(json.dumps(about, indent=1)))


def has_state(columns: Sequence[str]) -> bool:
    """Whether these columns make a state lane."""
    return set(STATE_COLUMNS) <= set(columns)


def run_paths(runs: Sequence[str]) -> list[str]:
    """Return the entity path of each run; the number sets the drawing order in the viewer."""
    return [f"/{i}/{rr.escape_entity_path_part(run)}" for i, run in enumerate(runs, start=1)]


def run_of(path: str) -> str:
    """Return the run's name from its entity path."""
    escaped = path.split("/", 2)[2]
    return _ESCAPE.sub(lambda m: chr(int(m["code"], 16)) if m["code"] else m["mark"], escaped)
