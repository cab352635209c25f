"""Reader of wave spectra as the US National Data Buoy Center (NDBC) publishes them.

In the yearly archive (``41010w2019.txt``) the header has the frequencies, each line one spectrum::

    #YY  MM DD hh mm  .0200  .0325  .0375 ...
    2019 02 06 00 40   0.00   0.00   0.02 ...

Older years lack the ``#``, the minutes, or two digits of the year. Files of the last 45 days
(``41010.data_spec``) have pairs of density and frequency, newest first, after a separation
frequency that the directional files (``.swdir``) lack::

    #YY  MM DD hh mm Sep_Freq  < spec_1 (freq_1) spec_2 (freq_2) ... >
    2019 02 10 05 40 0.153 0.000 (0.033) 0.012 (0.038) ...

A missing value is ``MM``, 99.00 (densities only), 999 or 9999, with any number of decimals.
"""

import re
from datetime import datetime
from pathlib import Path
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from utank_hil.base.arrays import FloatArray
from utank_hil.sea.measured import MeasuredSpectra

PAIR = re.compile(r"(\S+)\s*\(\s*([^()\s]+)\s*\)")
DENSITY_MISSING = (99.0, 999.0, 9999.0)
DIRECTION_MISSING = (999.0, 9999.0)

# The 45-day layout rounds the centres of NDBC's bands 0.0325, 0.0375 ... 0.0925 to 1 mHz.
ROUNDED_HZ = {round(0.033 + 0.005 * i, 3): round(0.0325 + 0.005 * i, 4) for i in range(13)}


class DataLine(NamedTuple):
    """One line of data."""

    number: int
    time: np.datetime64
    frequency_hz: tuple[float, ...]
    values: tuple[float, ...]


def load_ndbc(path: str | Path, direction_path: str | Path | None = None) -> MeasuredSpectra:
    """Load measured wave spectra, in NDBC's yearly or 45-day layout.

    Parameters
    ----------
    path : str or Path
        Spectral density file.
    direction_path : str or Path, optional
        Mean direction (alpha1) file of the same station, in either layout. Spectra missing in it
        have no direction.

    Returns
    -------
    MeasuredSpectra
        In order of time. Spectra without any value are left out; single missing values are nan.

    Raises
    ------
    ValueError
        If the file cannot be parsed; the message has file, line and reason.
    OSError
        If a file cannot be read.
    """
    time, frequency, density = _parse(Path(path), DENSITY_MISSING, "density", (0.0, np.inf))
    direction = None
    if direction_path is not None:
        direction_time, direction_frequency, measured = _parse(
            Path(direction_path), DIRECTION_MISSING, "direction", (0.0, 360.0)
        )
        if direction_frequency != frequency:
            raise ValueError(f"{direction_path}: frequencies differ from those of {path}")
        direction = np.full_like(density, np.nan)
        _, ours, theirs = np.intersect1d(time, direction_time, return_indices=True)
        direction[ours] = measured[theirs]
    return MeasuredSpectra(str(path), time, np.array(frequency), density, direction)


def _parse(
    path: Path, missing: tuple[float, ...], quantity: str, bounds: tuple[float, float]
) -> tuple[npt.NDArray[np.datetime64], tuple[float, ...], FloatArray]:
    """Return times, frequencies and values (N, F) of one file, sorted by time."""
    rows = _data_lines(path)
    seen: dict[np.datetime64, int] = {}
    for row in rows:
        if row.frequency_hz != rows[0].frequency_hz:
            raise _error(
                path, row.number, f"frequencies differ from those of line {rows[0].number}"
            )
        if row.time in seen:
            raise _error(path, row.number, f"{row.time} stands in line {seen[row.time]} too")
        seen[row.time] = row.number
    values = np.array([row.values for row in rows])
    values[np.isin(values, missing)] = np.nan
    for row, numbers in zip(rows, values, strict=True):
        wrong = (numbers < bounds[0]) | (numbers > bounds[1])
        if wrong.any():
            reason = f"{quantity} {numbers[wrong][0]:g} is outside {bounds[0]:g} to {bounds[1]:g}"
            raise _error(path, row.number, reason)
    time = np.array([row.time for row in rows])
    order = np.argsort(time)
    order = order[np.isfinite(values[order]).any(axis=1)]
    if order.size == 0:
        raise ValueError(f"{path}: every {quantity} in the file is marked as missing")
    return time[order], rows[0].frequency_hz, values[order]


def _data_lines(path: Path) -> list[DataLine]:
    rows = []
    header: tuple[int, tuple[float, ...]] | None = None  # time columns and frequencies
    for number, line in enumerate(
        path.read_text(encoding="utf-8", errors="replace").splitlines(), 1
    ):
        if not line.strip():
            continue
        if line.lstrip().startswith(("#", "YY")):
            header = _header(path, number, line) or header
        elif "(" in line:
            rows.append(_pairs(path, number, line))
        elif header is None:
            raise _error(path, number, "no header line with frequencies stands before the data")
        else:
            rows.append(_columns(path, number, line.split(), *header))
    if not rows:
        raise ValueError(f"{path}: no spectra in the file")
    return rows


def _header(path: Path, number: int, line: str) -> tuple[int, tuple[float, ...]] | None:
    """Return number of time columns and frequencies; None for a line without frequencies."""
    words = line.replace("#", " ").split()
    names = [word for word in words if not word[0].isdigit() and word[0] != "."]
    if len(names) == len(words) or "(" in line:
        return None
    if words[: len(names)] != names or len(names) not in (4, 5):
        raise _error(path, number, "header must be year, month, day, hour, minute, frequencies")
    frequencies = tuple(_number(path, number, word) for word in words[len(names) :])
    return len(names), _checked(path, number, frequencies)


def _columns(
    path: Path, number: int, words: list[str], time_columns: int, frequency: tuple[float, ...]
) -> DataLine:
    if len(words) != time_columns + len(frequency):
        found = len(words) - time_columns
        raise _error(path, number, f"{found} values for {len(frequency)} frequencies in the header")
    values = tuple(_number(path, number, word) for word in words[time_columns:])
    return DataLine(number, _time(path, number, words[:time_columns]), frequency, values)


def _pairs(path: Path, number: int, line: str) -> DataLine:
    lead = PAIR.sub("", line).split()  # The lead is time and separation frequency.
    if len(lead) not in (5, 6):
        raise _error(
            path, number, "not of the form: year month day hour minute density (frequency)"
        )
    pairs = PAIR.findall(line)
    frequencies = (_number(path, number, frequency) for _, frequency in pairs)
    exact = tuple(ROUNDED_HZ.get(frequency, frequency) for frequency in frequencies)
    values = tuple(_number(path, number, value) for value, _ in pairs)
    return DataLine(number, _time(path, number, lead[:5]), _checked(path, number, exact), values)


def _checked(path: Path, number: int, frequencies: tuple[float, ...]) -> tuple[float, ...]:
    steps = np.diff((0.0, *frequencies))
    if len(frequencies) < 2 or not np.all(steps > 0):
        raise _error(path, number, "frequencies must be two or more, positive and increasing")
    return frequencies


def _time(path: Path, number: int, words: list[str]) -> np.datetime64:
    try:
        year, *rest = (int(word) for word in words)
        moment = datetime(year + 1900 if year < 100 else year, *rest)  # type: ignore[arg-type]  # 3 or 4 integers
    except ValueError as error:
        raise _error(path, number, f"bad time {' '.join(words)!r}: {error}") from None
    return np.datetime64(moment, "s")


def _number(path: Path, number: int, word: str) -> float:
    if word == "MM":
        return np.nan
    try:
        value = float(word)
    except ValueError:
        raise _error(path, number, f"{word!r} is not a number") from None
    if not np.isfinite(value):
        raise _error(path, number, f"{word!r} is not a finite number")
    return value


def _error(path: Path, number: int, reason: str) -> ValueError:
    return ValueError(f"{path}, line {number}: {reason}")
