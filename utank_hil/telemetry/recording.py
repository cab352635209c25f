"""Rerun recordings of a lockstep bench, written after it as a whole."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Final

import numpy as np
import rerun as rr

from utank_hil.base.arrays import FloatArray
from utank_hil.base.whole_file import write_whole
from utank_hil.telemetry import rerun_log
from utank_hil.telemetry.blueprint import columns_of, make_blueprint
from utank_hil.telemetry.events import Event
from utank_hil.telemetry.scene import scene_size

_BLOCK_ROWS: Final = 8192  #: Number of rows per chunk, the unit in which the viewer loads a file.


def write_recording(
    path: Path,
    columns: Sequence[str],
    runs: Mapping[str, FloatArray],
    events: Mapping[str, Sequence[Event]] | None = None,
    about: Mapping[str, Any] | None = None,
) -> None:
    """Write runs side by side on one time line into a `.rrd` file, with its blueprint.

    The columns are in SI units, `time_s` among them. `runs` has the rows of each, shape (n,
    columns), by name; the first is the reference. `events` are those of retuning and alarms,
    `time_ns` on the clock of `time_s`; `about` is the origin of the runs
    (`utank_hil.base.provenance`). Raises `ValueError` if a table or a column does not fit. Raises
    `OSError` if the file can't be written; it is then removed.
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
