"""Reader of wave spectra as the US National Data Buoy Center (NDBC) publishes them.

In the yearly archive (``41010w2019.txt``) the header has the frequencies, each line one spectrum::

    #YY  MM DD hh mm  .0200  .0325  .0375 ...
    2019 02 06 00 40   0.00   0.00   0.02 ...

Older years lack the ``#``, the minutes, or two digits of the year. Files of the last 45 days
(``41010.data_spec``) have pairs of density and frequency, newest first, after a separation
frequency that the directional files (``.swdir``) lack::

    #YY  MM DD hh mm Sep_Freq  < spec_1 (freq_1) spec_2 (freq_2) ... >
    2019 02 10 05 40 0.153 0.000 (0.033) 0.012 (0.038) ...

wavespectra's reader of these files is not used: it takes mean directions for a sea of 35.6 m, keeps
a doubled row, and refuses a year whose bands change (4.9, on the reported cases).

A missing value is ``MM``, 99.00 (densities only), 999 or 9999, with any number of decimals. A file
may be compressed with gzip, and may change its bands from row to row.
"""

import math
import re
from datetime import datetime
from pathlib import Path
from typing import NamedTuple

import numpy as np

from utank_hil.base.arrays import FloatArray
from utank_hil.base.text_files import NUMBER, lines_of, open_text
from utank_hil.dynamics.tank import GRAVITY_M_S2
from utank_hil.sea.measured import MeasuredSpectra
from utank_hil.sea.spectrum import Spectrum

PAIR = re.compile(r"(\S+)\s*\(\s*([^()\s]+)\s*\)")
QUANTITY = re.compile(r"\b(spec|alpha1|alpha2|r1|r2)_[1-9]")
"""The quantity in the header of a 45-day file: `spec` is density, `alpha1` mean direction."""
LETTER = re.compile(r"[0-9a-z]{5}([wdijk])[0-9]{4}", re.IGNORECASE)
"""The letter of the quantity in the name of a yearly file."""
LETTERS = {"w": "spec", "d": "alpha1", "i": "alpha2", "j": "r1", "k": "r2"}
HIGHEST_M = 30.0
"""Significant height above which a file holds no densities; the greatest ever measured is 19 m."""
TAIL_HZ, TAIL = 0.3, 0.1
"""Frequency from which waves are saturated, and a bound of Phillips's constant there: ten times
that of his equilibrium range (J. Fluid Mech. 4, 1958), which growing seas pass threefold."""
MOST_R1, MANY = 100.0, 10
"""Largest value of r1 or r2 in hundredths; so many different directions of a file go beyond."""
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
    named: bool = False  #: Whether the file names the quantity that it holds.


def load_ndbc(path: str | Path, direction_path: str | Path | None = None) -> MeasuredSpectra:
    """Load measured wave spectra, in NDBC's yearly or 45-day layout.

    ValueError is raised if no row can be used, or the file is one of another quantity; the message
    has file, line and reason. OSError is raised if a file cannot be read.

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
        Rows that can't be used are left out and named in its notes.
    """
    notes: list[str] = []
    rows = _rows(Path(path), "spec", notes)
    time, frequency, density = (np.array(part) for part in zip(*rows.values(), strict=True))
    direction = None
    if direction_path is not None:
        measured = _rows(Path(direction_path), "alpha1", notes)
        direction = np.full_like(density, np.nan)
        shared = [index for index, each in enumerate(rows) if each in measured]
        for index in shared:
            _, theirs, values = measured[time[index]]
            if _same(theirs, frequency[index]):
                size = min(len(values), direction.shape[1])  # Beyond it there are no bands.
                direction[index, :size] = values[:size]
            else:
                reason = f"directions of {time[index]} are of other frequencies than its densities"
                notes.append(f"{direction_path}: {reason}")
        if shared and not np.isfinite(direction).any():
            raise ValueError(f"{direction_path}: frequencies differ from those of {path}")
    bands_hz = frequency[0] if (frequency == frequency[0]).all() else frequency
    return MeasuredSpectra(str(path), time, bands_hz, density, direction, notes=tuple(notes))


_Row = tuple[np.datetime64, FloatArray, FloatArray]
"""Time, frequencies and values, filled up with nan to the most bands of the file."""


def _same(one: FloatArray, other: FloatArray) -> bool:
    return np.array_equal(one[np.isfinite(one)], other[np.isfinite(other)])


def _rows(path: Path, quantity: str, notes: list[str]) -> dict[np.datetime64, _Row]:
    """Return the rows of one file by time, sorted by it; others are named in `notes`."""
    missing = DENSITY_MISSING if quantity == "spec" else DIRECTION_MISSING
    lines, problems = _data_lines(path, quantity)
    used: dict[np.datetime64, DataLine] = {}
    values_of: dict[np.datetime64, FloatArray] = {}
    double: set[np.datetime64] = set()
    for line in lines:
        values = np.where(np.isin(line.values, missing), np.nan, line.values)
        why = _no_density(line, values) if quantity == "spec" else _no_direction(values)
        if why:
            problems.append(_error(path, line.number, why))
        elif line.time in used:
            first = used[line.time]
            equal = line[2:] == first[2:]
            double |= set() if equal else {line.time}
            reason = f"{line.time} stands in line {first.number} too"
            problems.append(_error(path, line.number, reason + (", the same" if equal else "")))
        elif np.isfinite(values).any():
            used[line.time], values_of[line.time] = line, values
    good = {time: used[time] for time in sorted(used) if time not in double}
    notes.extend(map(str, problems))
    if not good:
        reason = (
            "every value in the file is marked as missing" if lines else "no spectra in the file"
        )
        raise problems[0] if problems else ValueError(f"{path}: {reason}")
    if quantity == "alpha1" and not any(line.named for line in good.values()):
        _check_directions(path, np.concatenate([values_of[time] for time in good]))
    most = max(len(line.values) for line in good.values())
    return {
        time: (time, _padded(np.array(line.frequency_hz), most), _padded(values_of[time], most))
        for time, line in good.items()
    }


def _padded(values: FloatArray, size: int) -> FloatArray:
    return np.pad(values, (0, size - len(values)), constant_values=np.nan)


def _no_density(line: DataLine, values: FloatArray) -> str:
    """Return why values are no densities of a sea; empty if they may be."""
    if (values < 0).any():
        return f"density {values[values < 0][0]:g} is below 0"
    frequency, density = np.array(line.frequency_hz), np.nan_to_num(values)
    height_m = Spectrum(frequency, density).hs_m
    if height_m > HIGHEST_M:
        return f"waves of {height_m:.3g} m are higher than any sea's: is it a file of densities?"
    reason = breaking(frequency, density)
    return f"{reason}: is it a file of densities?" if reason else ""


def breaking(frequency_hz: FloatArray, density: FloatArray) -> str:
    """Say which density waves can't have without breaking; empty if they can have all."""
    saturated = TAIL * GRAVITY_M_S2**2 / (2 * np.pi) ** 4 / frequency_hz**5
    wrong = (frequency_hz >= TAIL_HZ) & (density > saturated)
    if not wrong.any():
        return ""
    which = f"density {density[wrong][-1]:g} at {frequency_hz[wrong][-1]:g} Hz"
    return f"{which} is more than waves of this frequency can have without breaking"


def _no_direction(values: FloatArray) -> str:
    wrong = (values < 0) | (values > 360)
    return f"direction {values[wrong][0]:g} is outside 0 to 360" if wrong.any() else ""


def _check_directions(path: Path, values: FloatArray) -> None:
    """Refuse values that are no mean directions, in a file that does not name its quantity."""
    greatest = np.nanmax(values)
    if greatest <= MOST_R1 and len(np.unique(values)) >= MANY:
        raise ValueError(
            f"{path}: no value is above {greatest:g}: is it a file of mean directions (alpha1), "
            "and not of r1, r2 or densities?"
        )


def _data_lines(path: Path, quantity: str) -> tuple[list[DataLine], list[ValueError]]:
    """Return the lines of data, and the reasons of those that can't be read."""
    letter = LETTER.match(path.name)
    named = letter is not None
    if letter:
        _check_quantity(path, "the name", LETTERS[letter[1].lower()], quantity)
    rows, problems = [], []
    header: tuple[int, tuple[float, ...]] | None = None  # time columns and frequencies
    with open_text(path) as text:
        for number, line in lines_of(path, text):
            titled = line.lstrip().startswith(("#", "YY"))
            written = QUANTITY.search(line) if titled else None
            if written:
                _check_quantity(path, f"line {number}", written[1], quantity)
                named = True
            try:
                if titled:
                    header = _header(line) or header
                elif line.strip():
                    found = _pairs(line) if "(" in line else _columns(line, header)
                    rows.append(DataLine(number, *found, named))
            except ValueError as error:
                problems.append(_error(path, number, str(error)))
                if titled:
                    raise problems[-1] from error
    return rows, problems


def _check_quantity(path: Path, place: str, found: str, wanted: str) -> None:
    if found != wanted:
        names = {"spec": "spectral densities", "alpha1": "mean directions (alpha1)"}
        raise ValueError(
            f"{path}: {place} says that it holds {names.get(found, found)}, and a file of "
            f"{names[wanted]} is wanted"
        )


def _header(line: str) -> tuple[int, tuple[float, ...]] | None:
    """Return number of time columns and frequencies; None for a line without frequencies."""
    words = line.replace("#", " ").split()
    names = [word for word in words if not word[0].isdigit() and word[0] != "."]
    if len(names) == len(words) or "(" in line:
        return None
    if words[: len(names)] != names or len(names) not in (4, 5):
        raise ValueError("header must be year, month, day, hour, minute, frequencies")
    return len(names), _checked(tuple(_number(word) for word in words[len(names) :]))


_Values = tuple[np.datetime64, tuple[float, ...], tuple[float, ...]]
"""Time, frequencies and values of a line."""


def _columns(line: str, header: tuple[int, tuple[float, ...]] | None) -> _Values:
    if header is None:
        reason = "no header line with frequencies stands before the data"
        raise ValueError(f"{reason}; if it is not NDBC's, make a table of it, kind: tabulated")
    words, (time_columns, frequency) = line.split(), header
    if len(words) != time_columns + len(frequency):
        found = len(words) - time_columns
        raise ValueError(f"{found} values for {len(frequency)} frequencies in the header")
    values = tuple(_number(word) for word in words[time_columns:])
    return _time(words[:time_columns]), frequency, values


def _pairs(line: str) -> _Values:
    lead = PAIR.sub("", line).split()  # The lead is time and separation frequency.
    if len(lead) not in (5, 6):
        raise ValueError("not of the form: year month day hour minute density (frequency)")
    pairs = [(_number(value), _number(frequency)) for value, frequency in PAIR.findall(line)]
    exact = tuple(ROUNDED_HZ.get(frequency, frequency) for _, frequency in pairs)
    return _time(lead[:5]), _checked(exact), tuple(value for value, _ in pairs)


def _checked(frequencies: tuple[float, ...]) -> tuple[float, ...]:
    if len(frequencies) < 2 or not np.all(np.diff((0.0, *frequencies)) > 0):
        raise ValueError("frequencies must be two or more, positive and increasing")
    return frequencies


def _time(words: list[str]) -> np.datetime64:
    try:
        year, *rest = (int(word) for word in words)
        moment = datetime(year + 1900 if year < 100 else year, *rest)  # type: ignore[arg-type]  # 3 or 4 integers
    except (ValueError, OverflowError) as error:
        raise ValueError(f"bad time {' '.join(words)!r}: {error}") from None
    return np.datetime64(moment, "s")


def _number(word: str) -> float:
    if word == "MM":
        return math.nan
    if not NUMBER.fullmatch(word) or math.isinf(float(word)):
        raise ValueError(f"{word!r} is not a finite number")
    return float(word)


def _error(path: Path, number: int, reason: str) -> ValueError:
    return ValueError(f"{path}, line {number}: {reason}")
