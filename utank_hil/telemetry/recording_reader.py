"""Rerun recordings, also damaged ones, read back in a process of their own.

Rerun's reader trusts the file: of some hundred thousand damaged ones it aborts on a few.
"""

import json
import subprocess
import tempfile
import warnings
from collections.abc import Callable, Iterator
from contextlib import suppress
from pathlib import Path
from typing import Any, Final

import numpy as np

from utank_hil.base.apart import apart
from utank_hil.base.arrays import FloatArray
from utank_hil.telemetry.units import column_of
from utank_hil.telemetry.viewer import TIMELINE, rerun_binary, rerun_environment

TIME_COLUMN: Final = "time_s"
_Block = tuple[str, dict[str, FloatArray]]


_MAGIC: Final = b"RRF"  #: First bytes of a recording; its version follows.


def read_recording(path: Path) -> dict[str, dict[str, FloatArray]]:
    """Read the runs of a recording, also of a live or a truncated one.

    Returns arrays, shape (n,), by run and column, in SI units; `time_s` is exact to 1 ns, the
    others to the rounding of their unit conversion. Raises `ValueError` if the file is no
    recording, or holds no telemetry.
    """
    blocks: dict[str, list[dict[str, FloatArray]]] = {}
    for run, block in _read(path, _blocks):
        blocks.setdefault(run, []).append(block)
    if not blocks:
        raise ValueError(f"{path}: no telemetry in this recording")
    found = {}
    for run, parts in blocks.items():
        table = {column: np.concatenate([part[column] for part in parts]) for column in parts[0]}
        # Repair of a cut file may exchange blocks.
        order = np.argsort(table[TIME_COLUMN], kind="stable")
        found[run] = {column: values[order] for column, values in table.items()}
    return found


def read_about(path: Path) -> dict[str, Any]:
    """Read a recording's origin (`utank_hil.base.provenance`); ValueError if it has none."""
    for text in _read(path, _origins):
        with suppress(ValueError, RecursionError):
            found = json.loads(text)
            if isinstance(found, dict):
                return found
    raise ValueError(f"{path}: this recording does not say where it comes from")


def _read(path: Path, items: Callable[[Path], Iterator[Any]]) -> list[Any]:
    """Return the items of a recording; of a damaged one, those that can be read.

    A killed recorder leaves a truncated file. A warning names any other damage, as by a temporarily
    full disk or a power cut: rows may be missing in the middle.
    """
    rerun = rerun_binary()
    if path.is_file():
        with path.open("rb") as file:
            if file.read(len(_MAGIC)) != _MAGIC:
                raise ValueError(f"{path}: is no recording (.rrd): it begins otherwise")
    try:
        return list(apart(items, path))
    except ValueError as error:
        damage = str(error)
    with tempfile.TemporaryDirectory() as folder:
        intact = Path(folder) / path.name
        command = [rerun, "rrd", "optimize", "--continue-on-error"]
        command += [str(path), "-o", str(intact)]
        done = subprocess.run(command, env=rerun_environment(), check=False, capture_output=True)
        try:
            found = list(apart(items, intact))
        except ValueError:  # Nothing was left to write, or that can't be read either.
            found = []
    if not found:
        raise ValueError(f"{path}: {damage}")
    if done.stderr or "exceeds file size" not in damage:
        warnings.warn(f"{path} is damaged: rows may be missing", stacklevel=3)
    return found


def _blocks(path: Path) -> Iterator[_Block]:
    """Yield a run's name and some of its rows by column, in SI units."""
    from utank_hil.telemetry import rerun_log  # It imports Rerun, as is done in this process only.

    rows = f"{rerun_log.ARCHETYPE}:{rerun_log.COMPONENT}"
    for chunk in _chunks(path, rows):
        batch = chunk.to_record_batch()
        row = batch.column(rows).flatten()
        block = {TIME_COLUMN: batch.column(TIMELINE).to_numpy().astype(np.int64) / 1e9}
        for field in row.type:
            column, unit = column_of(field.name)
            block[column] = row.field(field.name).to_numpy() / unit.scale
        yield rerun_log.run_of(chunk.entity_path), block


def _origins(path: Path) -> Iterator[str]:
    """Yield the origin of a recording, as JSON."""
    from utank_hil.telemetry import rerun_log

    text = "TextDocument:text"
    for chunk in _chunks(path, text):
        if chunk.entity_path == f"/__properties/{rerun_log.ABOUT}":
            yield from chunk.to_record_batch().column(text).flatten().to_pylist()


def _chunks(path: Path, component: str) -> list[Any]:
    from rerun.chunk import RrdReader

    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # A killed recorder leaves no footer; the rows are intact.
        reader = RrdReader(path)
    if not reader.recordings():
        return []
    return list(reader.stream().filter(components=component).to_chunks())
