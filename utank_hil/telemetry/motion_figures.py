"""Phase plane and spectra of the roll, as they are shown to the engineer.

In the phase plane a dot is a sample: roll in degrees to the right, its rate in degrees a second
upwards. Spectra are those of the last five minutes.
"""

from collections import deque
from collections.abc import Sequence
from typing import Final

import numpy as np
import rerun as rr

from utank_hil.base.arrays import FloatArray
from utank_hil.telemetry.scene import due_rows
from utank_hil.telemetry.viewer import TIMELINE

NEEDED: Final = ("time_s", "roll_rad", "roll_rate_rad_s")
STEP_S: Final = 0.2
"""Between two samples of both."""
SPECTRUM_S: Final = 20.0
"""Between two spectra."""
RECORD_S: Final = 300.0
SEGMENT: Final = 500
"""Samples of a segment, of which the squares are averaged: 0.01 Hz apart."""
BAND_HZ: Final = (0.02, 0.3)
PHASE_AXES: Final = "/phase_axes"
_CIRCLES_DEG: Final = (2.5, 5.0, 10.0)
_AXES: Final = (0x60, 0x60, 0x60)
_WORDS: Final = (0xB0, 0xB0, 0xB0)
_BAR_HZ: Final = 1 / (SEGMENT * STEP_S)


class MotionFigures:
    """Writes both figures of one run.

    Parameters
    ----------
    path : str
        Entity path of the run.
    columns : sequence of str
        Names of a row's values, `NEEDED` among them.
    color : tuple of int
        Of the run.
    batch_s : float
        As in `Scene`.
    beside : (int, int)
        The run's number among so many, whose bars stand beside one another.
    """

    def __init__(
        self,
        recording: rr.RecordingStream,
        path: str,
        columns: Sequence[str],
        color: tuple[int, int, int],
        batch_s: float,
        beside: tuple[int, int] = (0, 1),
    ) -> None:
        self._recording, self._path, self._color = recording, path, color
        self._beside = beside
        self._at = [columns.index(name) for name in NEEDED]
        self._due_s = self._spectrum_due_s = -np.inf
        self._held: list[FloatArray] = []
        self._most_held = batch_s / STEP_S
        self._record: deque[float] = deque(maxlen=round(RECORD_S / STEP_S))
        dots = rr.Points2D.from_fields(colors=color, radii=rr.Radius.ui_points(2.0))
        recording.log(phase_path(path), dots, static=True, strict=True)
        _draw_axes(recording)

    def write(self, rows: FloatArray) -> None:
        """Append what is due within these rows."""
        needed = rows[:, self._at]
        due, self._due_s = due_rows(needed[:, 0], self._due_s, STEP_S)
        self._held += list(needed[due])
        if len(self._held) >= self._most_held:
            self.close()

    def close(self) -> None:
        """Send what is held; idempotent."""
        if not self._held:
            return
        rows = np.stack(self._held)
        self._held.clear()
        known = rows[np.isfinite(rows).all(axis=1)]
        self._send(
            phase_path(self._path),
            known[:, 0],
            rr.Points2D.columns(positions=np.rad2deg(known[:, 1:]) * [1.0, -1.0]),
        )
        for time_s, roll_rad in known[:, :2]:
            self._record.append(roll_rad)
            if time_s >= self._spectrum_due_s and len(self._record) >= SEGMENT:
                self._spectrum_due_s = time_s + SPECTRUM_S
                self._draw_spectrum(time_s)

    def _draw_spectrum(self, time_s: float) -> None:
        density = spectrum(np.rad2deg(np.array(self._record)))
        self._recording.set_time(TIMELINE, duration=time_s)
        number, count = self._beside
        wide = np.full(len(density), _BAR_HZ / count)
        at_hz = band_hz() + (number - (count - 1) / 2) * wide
        bars = rr.BarChart(density, abscissa=at_hz, widths=wide, color=self._color)
        self._recording.log(spectrum_path(self._path), bars, strict=True)
        self._recording.reset_time()

    def _send(self, path: str, time_s: FloatArray, columns: rr.ComponentColumnList) -> None:
        if len(time_s):
            time_ns = np.rint(time_s * 1e9).astype("timedelta64[ns]")
            self._recording.send_columns(path, [rr.TimeColumn(TIMELINE, duration=time_ns)], columns)


def spectrum(record: FloatArray) -> FloatArray:
    """One-sided spectral density at `band_hz`: mean of half overlapping segments, Hann windows.

    Parameters
    ----------
    record : ndarray, shape (n,)
        Samples `STEP_S` apart, n at least `SEGMENT`.

    Returns
    -------
    ndarray, shape (m,)
        In squares of the record's unit per Hz.
    """
    half = SEGMENT // 2
    segments = np.stack(
        [record[end - SEGMENT : end] for end in range(len(record), SEGMENT - 1, -half)]
    )
    window = 0.5 - 0.5 * np.cos(2 * np.pi * np.arange(SEGMENT) / SEGMENT)
    segments = (segments - segments.mean(axis=1, keepdims=True)) * window
    powers: FloatArray = (np.abs(np.fft.rfft(segments)) ** 2).mean(axis=0)
    density: FloatArray = 2 * STEP_S / (window**2).sum() * powers
    return density[_in_band()]


def band_hz() -> FloatArray:
    """Frequencies of a spectrum, shape (m,)."""
    frequency_hz: FloatArray = np.arange(SEGMENT // 2 + 1) / (SEGMENT * STEP_S)
    return frequency_hz[_in_band()]


def _in_band() -> slice:
    low, high = (round(edge * SEGMENT * STEP_S) for edge in BAND_HZ)
    return slice(low, high + 1)


def _draw_axes(recording: rr.RecordingStream) -> None:
    """Circles with their degrees, for all runs."""
    turn = np.linspace(0.0, 2 * np.pi, 61)
    circle = np.column_stack([np.cos(turn), np.sin(turn)])
    far = 1.5 * _CIRCLES_DEG[-1]
    lines = [
        *(radius * circle for radius in _CIRCLES_DEG),
        np.array([[-far, 0.0], [far, 0.0]]),
        np.array([[0.0, -far], [0.0, far]]),
    ]
    thin = rr.Radius.ui_points(0.7)
    looks = rr.LineStrips2D(lines, colors=_AXES, radii=thin, draw_order=-1.0)
    recording.log(f"{PHASE_AXES}/circles", looks, static=True, strict=True)
    places = [[radius, 0.0] for radius in _CIRCLES_DEG]
    names = [f"{radius:g}" for radius in _CIRCLES_DEG]
    marks = rr.Points2D(places, labels=names, colors=_WORDS, radii=thin, show_labels=True)
    recording.log(f"{PHASE_AXES}/degrees", marks, static=True, strict=True)


def phase_path(path: str) -> str:
    """Entity path of a run's dots in the phase plane."""
    return f"{path}/phase"


def spectrum_path(path: str) -> str:
    """Entity path of a run's spectra."""
    return f"{path}/spectrum"
