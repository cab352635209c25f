"""Differences of means, paired or independent: of recordings by batch, of campaigns by case."""

import json
import math
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np

from firmware_sim.campaign.store import METRICS, Results, read_results
from firmware_sim.campaign.summary import groups_of
from firmware_sim.plant_kernel import CAPSIZE_RAD
from utank_hil.analysis.motion.statistics import batch_means, mean_interval, rms_batches
from utank_hil.base.arrays import FloatArray
from utank_hil.canbus.enumerations import Mode
from utank_hil.telemetry.frame_log import SUFFIX, FrameLog
from utank_hil.telemetry.recording_reader import read_about
from utank_hil.telemetry.signal_files import read_signals, require


class CompareError(ValueError):
    """Error for inputs that cannot be compared; the message contains reason and remedy."""


@dataclass(frozen=True, slots=True)
class Difference:
    """Figure of one run beside that of another."""

    reference: float
    value: float
    difference: float  #: `value` minus `reference`.
    #: Half width of the difference's 95 % confidence interval; None with too few values.
    half_width: float | None
    count: int  #: Number of pairs, or of values on the smaller side.
    paired: bool  #: Whether both sides met the same waves.


@dataclass(frozen=True, slots=True)
class Comparison:
    """Run beside the reference run of the same name."""

    source: str  #: Origin of the run.
    run: str
    figures: dict[str, Difference]
    parameters: dict[str, Any]  #: Values of the keys that a campaign varies.
    remarks: tuple[str, ...] = ()  #: Remarks on the validity of the comparison.


def difference(reference: FloatArray, values: FloatArray, *, paired: bool) -> Difference:
    """Difference of means, of values `paired` by index, or of independent ones (Welch)."""
    count, width = min(len(reference), len(values)), None
    if count > 1 and np.ptp(reference) == 0 == np.ptp(values):
        width = 0.0
    elif count > 1 and paired:
        width = mean_interval(values - reference).half_width
    elif count > 1:
        from scipy.stats import ttest_ind

        interval = ttest_ind(values, reference, equal_var=False).confidence_interval(0.95)
        width = float(interval.high - interval.low) / 2
    first, second = float(np.mean(reference)), float(np.mean(values))
    return Difference(first, second, second - first, width, count, paired)


def compare_campaigns(reference: Path, others: list[Path]) -> list[Comparison]:
    """Compare campaigns with the first one, group by group and run by run.

    Cases of the same waves are paired. Raises `CompareError` if the campaigns vary different keys
    or share no group, and `StoreError` if a folder is no campaign.
    """
    first = read_results(reference)
    return [each for other in others for each in _campaigns_compared(first, other)]


def _campaigns_compared(first: Results, path: Path) -> list[Comparison]:
    second = read_results(path)
    if set(first.keys) != set(second.keys):
        here, there = (", ".join(each.keys) or "nothing" for each in (second, first))
        reason = f"varies {here}, the reference {there}: only like can be compared"
        raise CompareError(f"{path}: {reason}")
    kinds = [each.about["configuration"]["simulation"] for each in (first, second)]
    codes = [each.about["code"] for each in (first, second)]
    remarks = tuple(
        f"different {words}: {one} and {other}"
        for words, (one, other) in (
            ("kinds of simulation", kinds),
            ("versions of the program", codes),
        )
        if one != other
    )
    groups = {tuple(sorted(group.parameters.items())): group for group in groups_of(second)}
    waves = [{case["case"]: case["waves"] for case in each.cases} for each in (first, second)]
    found = []
    for group in groups_of(first):
        other = groups.get(tuple(sorted(group.parameters.items())))
        if other is None:
            continue
        for run in (run for run in group.runs if run in other.runs):
            sides = [
                {cases[row["case"]]: row for row in each.of_run(run) if not row["mark"]}
                for each, cases in ((group, waves[0]), (other, waves[1]))
            ]
            figures = {metric: _of_metric(metric, *sides) for metric in METRICS}
            known = {metric: figure for metric, figure in figures.items() if figure is not None}
            found.append(Comparison(str(path), run, known, group.parameters, remarks))
    if not found:
        raise CompareError(f"{path}: has no run at the same values of {', '.join(first.keys)}")
    return found


def _of_metric(metric: str, *sides: Mapping[str, Mapping[str, float]]) -> Difference | None:
    """Difference of a metric by the waves of its cases; None where one side lacks it."""
    values = [
        {waves: row[metric] for waves, row in side.items() if not math.isnan(row[metric])}
        for side in sides
    ]
    if not all(values):
        return None
    common = [waves for waves in values[0] if waves in values[1]]
    chosen = [[each[waves] for waves in common or each] for each in values]
    return difference(*(np.array(each) for each in chosen), paired=bool(common))


BATCH_PERIODS: Final = 40
"""Batch length in mean roll periods: after it a lightly damped ship has no memory.

With half of it, the 95 % interval of an hour contains the true difference of two ships of 2.5 % and
5 % damping in 91 % of all hours, in waves with a peak as in white noise; with 40 in 93 to 94 %."""
LEAST_PERIODS: Final = 20
"""Batch length in mean roll periods for a shorter record, down to `LEAST_BATCHES`. Chosen; no
study."""
MOST_BATCHES, LEAST_BATCHES = 30, 6  #: Most and least batches of a run. Chosen; no study.
_WAVES: Final = ("sea", "voyage")
"""Sections of a scenario that draw the waves, together with the seed."""

CHARGE_ALIKE: Final = 0.1
"""Difference of the share of time in charge above which a remark is made. Chosen; no study."""

LEAST_KNOWN: Final = 0.9
"""Least share of known values in a column for a figure to be made from it. Chosen; no study."""

Columns = dict[str, FloatArray]
Runs = dict[str, Columns]

_FIGURES: Final = {
    "roll_rms_rad": ("true_roll_rad", "roll_rad"),
    "level_rms_m": ("true_level_m", "level_m", "starboard_level_m"),
    "pressure_rms_pa": ("true_pressure_pa", "pressure_actual_pa"),
    "power_mean_w": ("true_shaft_power_w", "pump_power_w"),
}  #: Figures of a record, each with its candidate columns; the first one in both records is used.


@dataclass(frozen=True, slots=True, eq=False)
class Record:
    """Recording."""

    path: Path
    about: dict[str, Any]  #: Provenance; empty where the file has none.
    runs: Runs

    @property
    def scenario(self) -> dict[str, Any]:
        """Scenario; empty where the record has none, as one of a ship at sea."""
        for key in ("scenario_configuration", "configuration"):  # a log has it beside the law's
            found = self.about.get(key)
            if isinstance(found, dict) and "sea" in found:
                return found
        return {}

    @property
    def waves(self) -> str | None:
        """Description of the waves as text; None where the record has none."""
        if not self.scenario:
            return None
        parts = {key: self.scenario.get(key) for key in _WAVES}
        # data files count by content: folders may differ
        text = json.dumps([parts, self.about.get("seed")], sort_keys=True)
        for name, digest in self.about.get("data", {}).items():
            text = text.replace(json.dumps(name), json.dumps(digest))
        return text

    def columns(self, run: str) -> Columns:
        """Columns of one run without the initial time that its scenario leaves out."""
        columns = self.runs[run]
        settle_s = self.scenario.get("settle_s", 0.0)
        kept = columns["time_s"] >= columns["time_s"][0] + settle_s
        return {name: values[kept] for name, values in columns.items()}


def read_record(path: Path) -> Record:
    """Read a recording, bus log or table; `ValueError` for others, no roll, or times that fall."""
    runs = read_signals(path)
    for columns in runs.values():
        require(path, columns, "time_s", "roll_rad")
        if not (np.diff(columns["time_s"]) >= 0).all():  # NaN is not, either
            reason = "times must rise: sort the rows, and leave out those without a time"
            raise CompareError(f"{path}: {reason}")
    about: dict[str, Any] = {}
    with suppress(ValueError, KeyError):  # a file of an older version has no provenance
        if path.suffix == SUFFIX:
            about = FrameLog(path).head["about"]
        elif path.suffix == ".rrd":
            about = read_about(path)
    return Record(path, about, runs)


def compare_records(reference: Path, others: list[Path]) -> list[Comparison]:
    """Compare runs with the first's; CompareError if none is shared, ValueError for others."""
    first = read_record(reference)
    return [each for other in others for each in _records_compared(first, read_record(other))]


def _records_compared(first: Record, second: Record) -> list[Comparison]:
    found = []
    if len(first.runs) == len(second.runs) == 1:  # a log has no names of runs
        pairs = [(next(iter(first.runs)), next(iter(second.runs)))]
    else:
        pairs = [(run, run) for run in first.runs if run in second.runs]
        if not pairs:
            has, wanted = (", ".join(each.runs) for each in (second, first))
            raise CompareError(
                f"{second.path}: has the runs {has}; the reference has {wanted}: none of one name"
            )
    for run, other in pairs:
        one, two = first.columns(run), second.columns(other)
        remarks = []
        codes = first.about.get("code"), second.about.get("code")
        if codes[0] != codes[1]:
            remarks.append(f"different versions of the program: {codes[0]} and {codes[1]}")
        capsized = [
            f"run {name} of {path}"
            for path, name, each in ((first.path, run, one), (second.path, other, two))
            if np.nanmax(np.abs(each.get("true_roll_rad", 0.0)), initial=0.0) >= CAPSIZE_RAD
        ]
        if capsized:
            remarks.append(f"not compared: the ship capsized in {' and '.join(capsized)}")
            found.append(Comparison(str(second.path), run, {}, {}, tuple(remarks)))
            continue
        remarks += _in_charge(run, one, two)
        times = one["time_s"], two["time_s"]
        apart = _why_apart(first, second, *times)
        same = not apart
        if apart:
            remarks.append(f"{apart}: not paired")
        counts = [batch_count(each) for each in (one, two)]
        if same:
            counts = [min(counts)] * 2
        figures = {}
        for name, columns in _FIGURES.items():
            known = _known(one, two, columns)
            if known is not None:
                figures[name] = _figure(*_without_gaps(*known, same), name, counts, paired=same)
        if not figures:
            raise CompareError(
                f"{second.path}: run {other} has no column of which it and run {run} of "
                f"{first.path} know {LEAST_KNOWN:.0%} of the values"
            )
        if min(counts) < LEAST_BATCHES:
            remarks.append(f"no interval: shorter than {LEAST_BATCHES * LEAST_PERIODS} rolls")
        found.append(Comparison(str(second.path), run, figures, {}, tuple(remarks)))
    return found


def _why_apart(first: Record, second: Record, one_s: FloatArray, two_s: FloatArray) -> str:
    """Why two runs can't be paired; empty if they can."""
    unknown = [str(each.path) for each in (first, second) if each.waves is None]
    if unknown:
        return f"waves unknown, as no scenario is in {' and '.join(unknown)}"
    if first.waves != second.waves:
        return "not the same waves"
    if len(one_s) != len(two_s) or np.abs(one_s - two_s).max(initial=0) >= 1e-3:
        return "the same waves, but not at the same times"
    return ""


def _in_charge(run: str, one: Columns, two: Columns) -> list[str]:
    if "mode" not in one or "mode" not in two:
        return []
    first, second = (float(np.mean(each["mode"] == Mode.ACTIVE)) for each in (one, two))
    if abs(first - second) <= CHARGE_ALIKE:
        return []
    return [f"run {run}: in charge for {first:.0%} of the time in the first, {second:.0%} in this"]


def _known(
    one: Columns, two: Columns, names: tuple[str, ...]
) -> tuple[FloatArray, FloatArray] | None:
    """First column with few gaps in both; sensors start after the log."""
    for name in names:
        if name in one and name in two:
            both = one[name], two[name]
            if all(np.isfinite(each).mean() >= LEAST_KNOWN for each in both):
                return both
    return None


def _without_gaps(one: FloatArray, two: FloatArray, same: bool) -> tuple[FloatArray, FloatArray]:
    """Both columns without NaN rows; with equal times (`same`), pairwise."""
    kept_one, kept_two = np.isfinite(one), np.isfinite(two)
    if same:
        kept_one = kept_two = kept_one & kept_two
    return one[kept_one], two[kept_two]


def _figure(
    one: FloatArray, two: FloatArray, name: str, counts: list[int], *, paired: bool
) -> Difference:
    enough = min(counts) >= LEAST_BATCHES
    if name == "power_mean_w":
        one, two = np.maximum(one, 0.0), np.maximum(two, 0.0)  # regenerated power counts as zero
    means = batch_means if name == "power_mean_w" else rms_batches
    values = [
        means(each, count if enough else 1) for each, count in zip((one, two), counts, strict=True)
    ]
    return difference(*values, paired=paired)


def batch_count(run: Columns) -> int:
    """Number of batches in a run, each of `BATCH_PERIODS` or at least `LEAST_PERIODS` rolls."""
    roll_rad = run.get("true_roll_rad", run["roll_rad"])
    roll_rad = roll_rad[np.isfinite(roll_rad)]
    if not len(roll_rad):
        return 0
    roll_rad = roll_rad - roll_rad.mean()
    # noise crosses zero often: a roll is counted from well to port to well to starboard
    sides = np.sign(roll_rad[np.abs(roll_rad) > roll_rad.std() / 2])
    rolls = int(np.count_nonzero(np.diff(sides) > 0))
    least = min(rolls // LEAST_PERIODS, LEAST_BATCHES)
    return min(max(rolls // BATCH_PERIODS, least), MOST_BATCHES)
