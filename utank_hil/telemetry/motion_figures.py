"""Phase plane, roll (°) to the right and its rate (°/s) upwards, and spectra of five minutes."""

from collections import deque
from collections.abc import Sequence
from typing import Final

import numpy as np
import rerun as rr

from utank_hil.base.arrays import FloatArray
from utank_hil.telemetry.scene import Figure, send_at
from utank_hil.telemetry.viewer import TIMELINE

NEEDED: Final = ("time_s", "roll_rad", "roll_rate_rad_s")
STEP_S: Final = 0.2  #: Step between two samples of both figures.
SPECTRUM_S: Final = 20.0  #: Time between two spectra.
RECORD_S: Final = 300.0
SEGMENT: Final = 500  #: Length of an averaged segment in samples; the bands are 0.01 Hz apart.
BAND_HZ: Final = (0.02, 0.3)
PHASE_AXES: Final = "/phase_axes"
_CIRCLES_DEG: Final = (2.5, 5.0, 10.0)
_AXES: Final = (0x60, 0x60, 0x60)
_WORDS: Final = (0xB0, 0xB0, 0xB0)
_BAR_HZ: Final = 1 / (SEGMENT * STEP_S)


class MotionFigures(Figure):
    """Writes both figures of the run of an entity path; columns `NEEDED` are among its own.

    `beside` is the number of the run, and that of runs whose bars stand side by side.
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
        super().__init__(columns, STEP_S, batch_s)
        self._recording, self._path, self._color = recording, path, color
        self._beside = beside
        self._spectrum_due_s = -np.inf
        self._record: deque[float] = deque(maxlen=round(RECORD_S / STEP_S))
        dots = rr.Points2D.from_fields(colors=color, radii=rr.Radius.ui_points(2.0))
        recording.log(f"{path}/phase", dots, static=True, strict=True)
        _draw_axes(recording)

    def _draw(self, rows: FloatArray) -> None:
        needed = rows[:, [self._at[name] for name in NEEDED]]
        known = needed[np.isfinite(needed).all(axis=1)]
        if len(known):
            dots = rr.Points2D.columns(positions=np.rad2deg(known[:, 1:]) * [1.0, -1.0])
            send_at(self._recording, f"{self._path}/phase", known[:, 0], dots)
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
        self._recording.log(f"{self._path}/spectrum", bars, strict=True)
        self._recording.reset_time()


def spectrum(record: FloatArray) -> FloatArray:
    """Return the one-sided density at `band_hz`: mean of half overlapping segments, Hann windows.

    The record, shape (n,), has at least `SEGMENT` samples `STEP_S` apart; the density, shape (m,),
    is in squares of its unit per Hz.
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
    """Return the frequencies of a spectrum, shape (m,)."""
    frequency_hz: FloatArray = np.arange(SEGMENT // 2 + 1) / (SEGMENT * STEP_S)
    return frequency_hz[_in_band()]


def _in_band() -> slice:
    low, high = (round(edge * SEGMENT * STEP_S) for edge in BAND_HZ)
    return slice(low, high + 1)


def _draw_axes(recording: rr.RecordingStream) -> None:
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
