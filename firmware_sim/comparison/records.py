"""Recorded runs side by side, by means over batches of their records."""

import json
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np

from firmware_sim.comparison.difference import (
    Comparison,
    Difference,
    differing,
    independent,
    paired,
    same_runs,
)
from utank_hil.analysis.motion.confidence import batch_means, rms_batches
from utank_hil.arrays import FloatArray
from utank_hil.telemetry.recording import read_about, read_recording

BATCH_PERIODS: Final = 20
"""Mean periods of the roll in a batch: after so many a lightly damped ship has forgotten."""
MOST_BATCHES, LEAST_BATCHES = 30, 6
_WAVES: Final = ("sea", "voyage", "vessel")

Runs = dict[str, dict[str, FloatArray]]


def _roll_rad(run: dict[str, FloatArray]) -> FloatArray:
    return run.get("true_roll_rad", run["roll_rad"])


def _level_m(run: dict[str, FloatArray]) -> FloatArray:
    return run.get("true_level_m", (run["starboard_level_m"] - run["port_level_m"]) / 2)


def _pressure_pa(run: dict[str, FloatArray]) -> FloatArray:
    return run.get("true_pressure_pa", run["pressure_actual_pa"])


def _drawn_w(run: dict[str, FloatArray]) -> FloatArray:
    return np.maximum(run.get("true_shaft_power_w", run["pump_power_w"]), 0.0)


_FIGURES: Final[dict[str, tuple[Callable[[dict[str, FloatArray]], FloatArray], bool]]] = {
    "roll_rms_rad": (_roll_rad, True),
    "level_rms_m": (_level_m, True),
    "pressure_rms_pa": (_pressure_pa, True),
    "power_mean_w": (_drawn_w, False),
}
"""Figures of a record: what they are made from, and whether they are root mean squares."""


@dataclass(frozen=True, slots=True, eq=False)
class Record:
    """A recording.

    Attributes
    ----------
    path : Path
    about : dict
        Where it comes from; empty where it does not say.
    runs : dict
        Columns of each run.
    """

    path: Path
    about: dict[str, Any]
    runs: Runs

    @property
    def waves(self) -> str | None:
        """What the waves were, as text; None where it does not say."""
        scenario = self.about.get("configuration", {})
        if "sea" not in scenario:
            return None
        parts = {key: scenario.get(key) for key in _WAVES}
        # data files by what is in them: folders may differ
        text = json.dumps([parts, self.about.get("seed")], sort_keys=True)
        for name, digest in self.about.get("data", {}).items():
            text = text.replace(json.dumps(name), json.dumps(digest))
        return text

    def columns(self, run: str) -> dict[str, FloatArray]:
        """One run without the time that its scenario leaves out at the start."""
        columns = self.runs[run]
        settle_s = self.about.get("configuration", {}).get("settle_s", 0.0)
        kept = columns["time_s"] >= columns["time_s"][0] + settle_s
        return {name: values[kept] for name, values in columns.items()}


def read_record(path: Path) -> Record:
    """Read a recording.

    Raises
    ------
    ValueError
        If the file is none.
    """
    runs = read_recording(path)
    try:
        about = read_about(path)
    except ValueError:  # of an older version: it can be compared all the same
        about = {}
    return Record(path, about, runs)


def compare_records(reference: Path, others: list[Path]) -> list[Comparison]:
    """Compare recordings with the first one, run by run.

    Raises
    ------
    CompareError
        If they have no run in common.
    ValueError
        If a file is no recording.
    """
    first = read_record(reference)
    return [each for other in others for each in _compared(first, read_record(other))]


def _compared(first: Record, second: Record) -> list[Comparison]:
    found = []
    together = first.waves is not None and first.waves == second.waves
    for run in same_runs(list(first.runs), list(second.runs), str(second.path)):
        one, two = first.columns(run), second.columns(run)
        remarks = list(differing(first.about, second.about))
        same = together and _at_same_times(one, two)
        if not same:
            remarks.append("not the same waves at the same times: not paired")
        figures = {name: _figure(one, two, name, paired_=same) for name in _FIGURES}
        if figures["roll_rms_rad"].half_width is None:
            remarks.append(f"no interval: shorter than {LEAST_BATCHES * BATCH_PERIODS} rolls")
        found.append(Comparison(str(second.path), run, {}, figures, tuple(remarks)))
    return found


def _at_same_times(one: dict[str, FloatArray], two: dict[str, FloatArray]) -> bool:
    count = min(len(one["time_s"]), len(two["time_s"]))
    longest = max(len(one["time_s"]), len(two["time_s"]))
    return count == longest and bool(np.abs(one["time_s"] - two["time_s"]).max(initial=0) < 1e-3)


def _figure(
    one: dict[str, FloatArray], two: dict[str, FloatArray], name: str, *, paired_: bool
) -> Difference:
    of, is_rms = _FIGURES[name]
    counts = [_batches(each) for each in (one, two)]
    if paired_:
        counts = [min(counts)] * 2
    enough = min(counts) >= LEAST_BATCHES
    means = rms_batches if is_rms else batch_means
    values = [
        means(of(each), count if enough else 1)
        for each, count in zip((one, two), counts, strict=True)
    ]
    return paired(*values) if paired_ else independent(*values)


def _batches(run: dict[str, FloatArray]) -> int:
    """Batches of a run, each of `BATCH_PERIODS` rolls or more."""
    roll_rad = _roll_rad(run) - _roll_rad(run).mean()
    # noise crosses zero often: a roll is from well to port to well to starboard
    sides = np.sign(roll_rad[np.abs(roll_rad) > roll_rad.std() / 2])
    rolls = int(np.count_nonzero(np.diff(sides) > 0))
    return min(rolls // BATCH_PERIODS, MOST_BATCHES)
