"""A record: from a log, checked, and in normal form, channels side by side, gaps as NaN."""

from collections.abc import Mapping

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from utank_hil.base.arrays import FloatArray
from utank_hil.base.between import ALWAYS, Between

_SMALLEST, _LARGEST = 1e-60, 1e60  # Products of squares stay finite in this range.
_CLIPPED = 0.01  # largest share; at twice that a model of roll has errors of 2 %
_NOTHING = 1e-6  # Of a variance: less is rounding.
_FEWEST = 4  # Fewer equal samples are chance.


class IdentificationError(ValueError):
    """The record does not determine a model; the message says why and what would help."""


def stacked_record(u: FloatArray, y: FloatArray) -> tuple[FloatArray, int]:
    """Return outputs and inputs side by side, shape (N, m + r), and m; rows of gaps are all NaN."""
    columns = []
    for name, part in (("y", y), ("u", u)):
        array = np.asarray(part, dtype=np.float64)
        array = array[:, None] if array.ndim == 1 else array
        if array.ndim != 2 or array.shape[1] == 0:
            raise ValueError(f"{name} must have shape (N, channels), got {np.shape(part)}")
        columns.append(array)
    if len(columns[0]) != len(columns[1]):
        raise ValueError(f"y has {len(columns[0])} samples and u has {len(columns[1])}")
    z = np.hstack(columns)
    z[~np.isfinite(z).all(axis=1)] = np.nan
    return z, columns[0].shape[1]


def channel_scale(z: FloatArray, outputs: int) -> FloatArray:
    """RMS of each channel, (q,); IdentificationError for an empty, constant or clipped one."""
    good = z[np.isfinite(z[:, 0])]
    if len(good) == 0:
        raise IdentificationError("the record has no row without a gap")
    magnitude = np.abs(good).max(axis=0)
    relative = good / np.where(magnitude > 0, magnitude, 1.0)
    for c in np.flatnonzero(np.ptp(relative, axis=0) == 0).tolist():
        raise IdentificationError(f"{_name(c, outputs)} does not move in the whole record")
    for c in np.flatnonzero((magnitude < _SMALLEST) | (magnitude > _LARGEST)).tolist():
        raise IdentificationError(
            f"{_name(c, outputs)} holds values up to {magnitude[c]:.1e}; a unit is wrong, or they "
            "are no measurements"
        )
    for c in range(outputs):
        _refuse_clipped(relative[:, c], c)
    scale: FloatArray = magnitude * np.sqrt(np.mean(relative**2, axis=0))
    return scale


def _name(channel: int, outputs: int) -> str:
    return f"output {channel}" if channel < outputs else f"input {channel - outputs}"


def _refuse_clipped(output: FloatArray, number: int) -> None:
    """Refuse an output that stays at its largest or smallest value longer than an oscillation does.

    A sine of amplitude a with quantization step q is within the last step before its peak for at
    most sqrt(2 q / a) / pi of the time, and an irregular signal for less. The step is estimated
    from the values.
    """
    values, counts = np.unique(output, return_counts=True)
    # A low quantile is used: rare values leave wider gaps, rounding narrower ones.
    step = float(np.quantile(np.diff(values), 0.1))
    turning = 2 * np.sqrt(4 * step / (values[-1] - values[0])) / np.pi  # twice, for flat peaks
    for index, word in ((-1, "largest"), (0, "smallest")):
        share = counts[index] / len(output)
        if counts[index] >= _FEWEST and share > max(_CLIPPED, turning):
            raise IdentificationError(
                f"output {number} stays at its {word} value in {share:.1%} of the samples: its "
                "sensor is clipped or stuck; widen its range, give weaker pulses, or mark those "
                "samples as gaps (NaN)"
            )


def feedback_share(u: FloatArray, y: FloatArray, lags: int = 20) -> float:
    """Return how much better a command is predicted where past outputs are known, too: 0 to 1.

    `u` has shape (N,) and `y` (N, m); rows with NaN are gaps. The share of the variance that
    `lags` past commands leave open and as many outputs explain is 0 for pulses and near 1 for a
    linear law alone, but for what measured at chance. It is 0 where the record is too short to say.
    """
    z = np.column_stack([u, y])
    z = (z - np.nanmean(z, axis=0)) / np.nanstd(z, axis=0)
    windows = sliding_window_view(z, lags + 1, axis=0)
    windows = windows[np.isfinite(windows).all(axis=(1, 2))]
    past, now = windows[:, :, :-1], windows[:, 0, -1]
    if len(now) < 2 * past[:1].size:
        return 0.0

    def left_open(known: FloatArray) -> float:
        columns = np.column_stack([known.reshape(len(now), -1), np.ones(len(now))])
        error = now - columns @ np.linalg.lstsq(columns, now)[0]
        variance: float = float(error @ error) / (len(now) - columns.shape[1])
        return variance + _NOTHING

    return 1 - left_open(past) / left_open(past[:, :1])


def logged_samples(
    columns: Mapping[str, FloatArray],
    measured: tuple[str, ...],
    sample_time_s: float,
    between_s: Between = ALWAYS,
) -> FloatArray:
    """Return rows (mean command since the last sample, outputs...), the retuner's record.

    `columns`, of shape (n,), are those of one run (`telemetry.recording.read_recording`), of which
    rows may be missing. The outputs `measured` are among roll_rad, roll_rate_rad_s and level_m. The
    samples, shape (N, 1 + m), are at multiples of the sample time on the time axis of the
    recording, `between_s`; missing values are NaN. Where the sample time is no whole number of the
    steps between rows, outputs are interpolated from row to row.

    ValueError is raised if the recording lacks a column or the part is empty.
    """
    if "level_m" in measured and {"port_level_m", "starboard_level_m"} <= columns.keys():
        level_m = (columns["starboard_level_m"] - columns["port_level_m"]) / 2
        columns = {**columns, "level_m": level_m}
    for name in ("time_s", "pressure_command_pa", *measured):
        if name not in columns:
            raise ValueError(f"the recording has no {name}")
    time_s = columns["time_s"]
    low, high = max(float(time_s[0]), between_s[0]), min(float(time_s[-1]), between_s[1])
    first = int(np.ceil(low / sample_time_s - 1e-6))
    count = int(np.floor(high / sample_time_s + 1e-6)) - first + 1
    if count < 1:
        raise ValueError(f"the recording has nothing between {low:g} and {high:g} s")
    step_s = float(np.median(np.diff(time_s))) if len(time_s) > 1 else sample_time_s
    if abs(sample_time_s / step_s - round(sample_time_s / step_s)) > 1e-2:
        at_s = sample_time_s * np.arange(first, first + count, dtype=np.float64)
        return _between_rows(columns, measured, at_s, step_s)
    place = time_s / sample_time_s - first
    record = np.full((count, 1 + len(measured)), np.nan)
    # A command is held to the next row, so it belongs to the sample after it.
    ahead = np.floor(place + 1e-6).astype(np.int64) + 1
    inside = (ahead >= 0) & (ahead < count)
    sums = np.bincount(ahead[inside], columns["pressure_command_pa"][inside], minlength=count)
    numbers = np.bincount(ahead[inside], minlength=count)
    record[:, 0] = np.divide(sums, numbers, out=np.full(count, np.nan), where=numbers > 0)
    nearest = np.rint(place).astype(np.int64)
    exact = (np.abs(place - nearest) < 1e-3) & (nearest >= 0) & (nearest < count)
    for column, name in enumerate(measured, start=1):
        record[nearest[exact], column] = columns[name][exact]
    return record


def _between_rows(
    columns: Mapping[str, FloatArray], measured: tuple[str, ...], at_s: FloatArray, step_s: float
) -> FloatArray:
    """Rows of `logged_samples` at times between those of the recording's rows, a step apart."""
    time_s, command_pa = columns["time_s"], columns["pressure_command_pa"]
    lengths_s = np.diff(time_s)
    lost = (lengths_s > 1.5 * step_s) | ~np.isfinite(command_pa[:-1])
    held_pa_s, lost_s = (
        np.interp(at_s, time_s, np.concatenate(([0.0], np.cumsum(np.where(counted, value, 0.0)))))
        for counted, value in ((~lost, command_pa[:-1] * lengths_s), (lost, lengths_s))
    )
    record = np.full((len(at_s), 1 + len(measured)), np.nan)
    known = np.diff(lost_s) == 0.0
    record[1:, 0][known] = (np.diff(held_pa_s) / np.diff(at_s))[known]
    before = np.clip(np.searchsorted(time_s, at_s, "right") - 1, 0, len(lost) - 1)
    near = lengths_s[before] <= 1.5 * step_s
    for column, name in enumerate(measured, start=1):
        record[near, column] = np.interp(at_s[near], time_s, columns[name])
    return record
