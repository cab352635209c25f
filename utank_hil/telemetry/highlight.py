"""Where something happens in a recording."""

from collections.abc import Mapping, Sequence

import numpy as np
import numpy.typing as npt

from utank_hil.base.arrays import FloatArray
from utank_hil.canbus.enumerations import Fault, Mode, RetuningState

Columns = Mapping[str, FloatArray]


def highlight_s(runs: Sequence[Columns]) -> float:
    """Time of the first fault of any run, else of the first trial of a law, else of most roll."""
    faults = [_first(rows, in_service(rows) & (rows["fault"] != Fault.NONE)) for rows in runs]
    trials = [_first(rows, rows["retuning"] == RetuningState.TRIAL) for rows in runs]
    found = min(faults), min(trials), _largest_roll_s(runs)
    return next(time_s for time_s in found if np.isfinite(time_s))


def in_service(rows: Columns) -> npt.NDArray[np.bool_]:
    """Return the rows after start-up, during which a missing signal counts as a fault."""
    started: npt.NDArray[np.bool_] = (rows["mode"] != Mode.INIT) & (rows["mode"] != Mode.STANDBY)
    return started


def _first(rows: Columns, happens: npt.NDArray[np.bool_]) -> float:
    at = np.flatnonzero(happens)
    return float(rows["time_s"][at[0]]) if len(at) else np.inf


def _largest_roll_s(runs: Sequence[Columns]) -> float:
    rolls = [np.nan_to_num(np.abs(rows["roll_rad"])) for rows in runs]
    most = int(np.argmax([roll.max() for roll in rolls]))
    return float(runs[most]["time_s"][np.argmax(rolls[most])])
