"""Reconstruction of a law's samples from a recording."""

from collections.abc import Mapping

import numpy as np

from utank_hil.base.arrays import FloatArray


def logged_samples(
    columns: Mapping[str, FloatArray],
    measured: tuple[str, ...],
    sample_time_s: float,
    from_s: float | None = None,
    to_s: float | None = None,
) -> FloatArray:
    """Return rows (mean command since the last sample, outputs...), the retuner's record.

    ValueError is raised if the recording lacks a column or the part is empty.

    Parameters
    ----------
    columns : mapping of str to ndarray, shape (n,)
        Columns of one run from `telemetry.recording.read_recording`; rows may be missing.
    measured : tuple of str
        Outputs, among roll_rad, roll_rate_rad_s and level_m.
    sample_time_s : float
        Sample time; samples are at its multiples on the time axis of the recording.
    from_s, to_s : float, optional
        Start and end of the part to use.

    Returns
    -------
    ndarray, shape (N, 1 + m)
        Samples; NaN for missing values.
    """
    if "level_m" in measured and "port_level_m" in columns:
        level_m = (columns["starboard_level_m"] - columns["port_level_m"]) / 2
        columns = {**columns, "level_m": level_m}
    for name in ("time_s", "pressure_command_pa", *measured):
        if name not in columns:
            raise ValueError(f"the recording has no {name}")
    time_s = columns["time_s"]
    low = time_s[0] if from_s is None else max(from_s, float(time_s[0]))
    high = time_s[-1] if to_s is None else min(to_s, float(time_s[-1]))
    first = int(np.ceil(low / sample_time_s - 1e-6))
    count = int(np.floor(high / sample_time_s + 1e-6)) - first + 1
    if count < 1:
        raise ValueError(f"the recording has nothing between {low:g} and {high:g} s")
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
