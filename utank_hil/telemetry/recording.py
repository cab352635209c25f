"""Rerun recordings as a whole: written after a lockstep bench, and read back."""

import json
import subprocess
import tempfile
import warnings
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Final

import numpy as np
import numpy.typing as npt
import rerun as rr
from rerun.chunk import Chunk, RrdReader
from rerun.error_utils import RerunWarning

from utank_hil.base.arrays import FloatArray
from utank_hil.base.whole_file import write_whole
from utank_hil.canbus.enumerations import Fault, Mode, RetuningState
from utank_hil.canbus.events import RetuningEvent
from utank_hil.telemetry import rerun_log
from utank_hil.telemetry.blueprint import columns_of, make_blueprint
from utank_hil.telemetry.scene import scene_size
from utank_hil.telemetry.units import column_of
from utank_hil.telemetry.viewer import TIMELINE, rerun_binary, rerun_environment

_ROWS: Final = f"{rerun_log.ARCHETYPE}:{rerun_log.COMPONENT}"
_TEXT: Final = "TextDocument:text"
_BLOCK_ROWS: Final = 8192  #: Number of rows per chunk, the unit in which the viewer loads a file.


def write_recording(
    path: Path,
    columns: Sequence[str],
    runs: Mapping[str, FloatArray],
    events: Mapping[str, Sequence[RetuningEvent]] | None = None,
    about: Mapping[str, Any] | None = None,
) -> None:
    """Write runs side by side on one time line into a `.rrd` file, with its blueprint.

    The columns are in SI units, `time_s` among them. `runs` has the rows of each, shape (n,
    columns), by name; the first is the reference. `events` are those of retuning, `time_ns` on the
    clock of `time_s`; `about` is the origin of the runs (`utank_hil.base.provenance`). Raises
    `ValueError` if a table or a column does not fit. Raises `OSError` if the file can't be
    written; it is then removed.
    """
    for run, rows in runs.items():
        if rows.ndim != 2 or rows.shape[1] != len(columns):
            raise ValueError(f"run {run!r}: {rows.shape} is not (n, {len(columns)}), the columns")
        if len(rows) == 0:
            raise ValueError(f"run {run!r} has no rows")
    time = columns.index(rerun_log.TIME_COLUMN)
    time_s = np.concatenate([rows[:, time] for rows in runs.values()])
    shown, size = columns_of(columns, about), scene_size(columns, about)
    zero = {
        (run, column)
        for run, rows in runs.items()
        for column, values in zip(columns, rows.T, strict=True)
        if not np.nan_to_num(values).any()
    }  # Signals that are zero, or unknown, throughout.
    span_s = time_s.min(), time_s.max()
    blueprint = make_blueprint(shown, list(runs), span_s, size, zero)
    recording = rr.RecordingStream(rerun_log.APPLICATION, recording_id=path.stem)
    memory = recording.memory_recording()  # Rerun's writer of files waits forever on a full disk.
    # The recording comes first, because a browser shows what comes first.
    recording.send_blueprint(blueprint)
    if about is not None:
        rerun_log.write_about(recording, about)
    paths = rerun_log.run_paths(list(runs))
    for path_of_run, (run, rows) in zip(paths, runs.items(), strict=True):
        log = rerun_log.RunLog(
            recording, path_of_run, columns, about, rerun_log.PICTURES_S, alone=len(runs) == 1
        )
        for start in range(0, len(rows), _BLOCK_ROWS):
            log.write(rows[start : start + _BLOCK_ROWS])
        log.write_events((events or {}).get(run, ()))
        log.close()
    write_whole(path, memory.drain_as_bytes())


def read_recording(path: Path) -> dict[str, dict[str, FloatArray]]:
    """Read the runs of a recording, also of a live or a truncated one.

    Returns arrays, shape (n,), by run and column, in SI units; `time_s` is exact to 1 ns, the
    others to the rounding of their unit conversion. Raises `ValueError` if the file is no
    recording, or holds no telemetry.
    """
    blocks: dict[str, list[dict[str, FloatArray]]] = {}
    for chunk in _chunks(path, _ROWS):
        batch = chunk.to_record_batch()
        row = batch.column(_ROWS).flatten()
        block = {rerun_log.TIME_COLUMN: batch.column(TIMELINE).to_numpy().astype(np.int64) / 1e9}
        for field in row.type:
            column, unit = column_of(field.name)
            block[column] = row.field(field.name).to_numpy() / unit.scale
        blocks.setdefault(rerun_log.run_of(chunk.entity_path), []).append(block)
    if not blocks:
        raise ValueError(f"{path}: no telemetry in this recording")
    found = {}
    for run, parts in blocks.items():
        table = {column: np.concatenate([part[column] for part in parts]) for column in parts[0]}
        # Repair of a cut file may exchange blocks.
        order = np.argsort(table[rerun_log.TIME_COLUMN], kind="stable")
        found[run] = {column: values[order] for column, values in table.items()}
    return found


def read_about(path: Path) -> dict[str, Any]:
    """Read a recording's origin (`utank_hil.base.provenance`); ValueError if it has none."""
    for chunk in _chunks(path, _TEXT):
        if chunk.entity_path == f"/__properties/{rerun_log.ABOUT}":
            (text,) = chunk.to_record_batch().column(_TEXT).flatten().to_pylist()
            found: dict[str, Any] = json.loads(text)
            return found
    raise ValueError(f"{path}: this recording does not say where it comes from")


def _chunks(path: Path, component: str) -> list[Chunk]:
    """Return the chunks with a component; of a damaged file, those that can be read.

    A killed recorder leaves a truncated file. A warning names any other damage, as by a temporarily
    full disk or a power cut: rows may be missing in the middle.
    """
    try:
        return _read_chunks(path, component)
    except RuntimeError as error:
        damage = str(error)  # The error itself would keep the file open.
    with tempfile.TemporaryDirectory() as folder:
        intact = Path(folder) / path.name
        command = [rerun_binary(), "rrd", "optimize", "--continue-on-error"]
        command += [str(path), "-o", str(intact)]
        done = subprocess.run(command, env=rerun_environment(), check=False, capture_output=True)
        try:
            chunks = _read_chunks(intact, component)
        except (RuntimeError, ValueError):  # ValueError: nothing was left to write.
            chunks = []
    if not chunks:
        raise ValueError(f"{path}: {damage}")
    if done.stderr or "exceeds file size" not in damage:
        warnings.warn(f"{path} is damaged: rows may be missing", stacklevel=3)
    return chunks


def _read_chunks(path: Path, component: str) -> list[Chunk]:
    with warnings.catch_warnings():
        # A killed recorder leaves this; the rows are intact.
        warnings.filterwarnings("ignore", "RRD file has no footer", RerunWarning)
        reader = RrdReader(path)
    if not reader.recordings():
        return []
    return reader.stream().filter(components=component).to_chunks()


def highlight_s(file: Path) -> float:
    """Time of the first fault of any run, else of the first trial of a law, else of most roll."""
    runs = list(read_recording(file).values())
    faults = [_first(rows, in_service(rows) & (rows["fault"] != Fault.NONE)) for rows in runs]
    trials = [_first(rows, rows["retuning"] == RetuningState.TRIAL) for rows in runs]
    found = min(faults), min(trials), _largest_roll_s(runs)
    return next(time_s for time_s in found if np.isfinite(time_s))


def in_service(rows: dict[str, FloatArray]) -> npt.NDArray[np.bool_]:
    """Return the rows after start-up, during which a missing signal counts as a fault."""
    started: npt.NDArray[np.bool_] = (rows["mode"] != Mode.INIT) & (rows["mode"] != Mode.STANDBY)
    return started


def _first(rows: dict[str, FloatArray], happens: npt.NDArray[np.bool_]) -> float:
    at = np.flatnonzero(happens)
    return float(rows["time_s"][at[0]]) if len(at) else np.inf


def _largest_roll_s(runs: list[dict[str, FloatArray]]) -> float:
    rolls = [np.nan_to_num(np.abs(rows["roll_rad"])) for rows in runs]
    most = int(np.argmax([roll.max() for roll in rolls]))
    return float(runs[most]["time_s"][np.argmax(rolls[most])])
