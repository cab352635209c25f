"""Draw ten seconds of a bench's recording as the watch sees them: the README's animation.

Usage: python -m tools.documents.animation RECORDING.rrd PICTURE.gif [RUN ...]

RUN names the runs, by default the first and the last. The ten seconds are around the largest roll
of the first. Geometry and colours are those of the viewer (`utank_hil/telemetry/scene.py`).
"""

import argparse
from collections.abc import Mapping
from io import BytesIO
from pathlib import Path
from typing import Final

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure
from matplotlib.transforms import Affine2D
from PIL import Image

from utank_hil.base.arrays import FloatArray
from utank_hil.telemetry.recording_reader import read_about, read_recording
from utank_hil.telemetry.scene import (
    HULL,
    LIMIT,
    LINES,
    NEEDED,
    PUMP,
    RESERVOIR,
    SEA,
    TWIN,
    WATER,
    SceneSize,
)

SECONDS: Final = 10.0
FRAMES_A_SECOND: Final = 10
SIZE_IN: Final = (7.2, 3.1)
DPI: Final = 100
PALETTE: Final = 24  #: Colours of a frame: a third of the size of 256.
BACKGROUND: Final = "#0d0d0d"
WORDS: Final = "#e0e0e0"

Color = tuple[int, int, int]


class Section:
    """One ship in the picture; `show` sets it to an instant."""

    def __init__(self, axes: Axes, size: SceneSize, name: str) -> None:
        self._axes, self._size = axes, size
        top, bottom = size.height_range_m
        axes.set(xlim=(-size.reach_m, size.reach_m), ylim=(bottom, top), aspect="equal")
        axes.set_axis_off()
        axes.set_title(name, color=WORDS, fontsize=12)
        self._sea = self._lines([np.array([[-3.0, 0.0], [3.0, 0.0]]) * size.reach_m], SEA, 3.0)
        self._twin = self._lines([size.hull()], TWIN, 1.2)
        self._duct = self._lines([size.duct()], WATER, self._points(0.12 * size.width_m), "round")
        column_m = RESERVOIR * size.width_m / LINES
        self._water = self._lines([], WATER, self._points(1.4 * column_m))
        self._hull = self._lines([size.hull()], HULL, 2.5)
        self._limits = self._lines(list(size.limits()), LIMIT, 2.0)
        self._pump = axes.annotate(
            "",
            (0.0, 0.0),
            (0.0, 0.0),
            arrowprops={"color": _rgb(PUMP), "width": 4, "headwidth": 12},
        )
        self._roll = axes.text(
            0.0, bottom - 0.05 * size.width_m, "", color=WORDS, fontsize=12, ha="center", va="top"
        )

    def _points(self, length_m: float) -> float:
        """Width of a line that is so wide on the ship, in points."""
        box = self._axes.get_window_extent()
        low, high = self._axes.get_ylim()
        a_metre = min(box.width / (2 * self._size.reach_m), box.height / abs(high - low))
        return length_m * a_metre * 72 / DPI

    def _lines(
        self, lines: list[FloatArray], color: Color, width: float, ends: str = "butt"
    ) -> LineCollection:
        drawn = LineCollection(lines, colors=[_rgb(color)], linewidths=width, capstyle=ends)
        self._axes.add_collection(drawn)
        return drawn

    def show(self, now: Mapping[str, float]) -> None:
        """Turn ship and twin, and set water and pump, to the values of one row."""
        size, roll_rad = self._size, now["roll_rad"]
        # the ordinate points downwards, so a positive roll puts starboard down here as well
        turn = Affine2D().rotate(roll_rad) + self._axes.transData
        port, starboard = (np.array([now[f"{side}_level_m"]]) for side in ("port", "starboard"))
        self._water.set_segments(list(size.water(port, starboard)[0]))
        for part in (self._duct, self._water, self._hull, self._limits):
            part.set_transform(turn)
        self._twin.set_transform(Affine2D().rotate(now["twin_roll_rad"]) + self._axes.transData)
        self._roll.set_text(f"{np.degrees(roll_rad):+.1f}°")
        pushed = size.pressure_pa > 0 and abs(now["pressure_actual_pa"]) > 0.05 * size.pressure_pa
        self._pump.set_visible(pushed)
        if pushed:
            (vector,), (origin,) = size.arrow(np.array([now["pressure_actual_pa"]]))
            ends = Affine2D().rotate(roll_rad).transform([origin, origin + vector])
            self._pump.set_position(ends[0])
            self._pump.xy = tuple(ends[1])


def animate(recording: Path, picture: Path, names: list[str]) -> None:
    """Draw the animation.

    Raises `ValueError` if the recording has no such run, or does not say of which ship it is.
    """
    runs = read_recording(recording)
    names = names or list(dict.fromkeys((next(iter(runs)), list(runs)[-1])))
    size = SceneSize.of(read_about(recording))
    if size is None:
        raise ValueError(f"{recording}: does not say of which ship it is")
    unknown = [name for name in names if name not in runs]
    if unknown:
        raise ValueError(f"{recording}: has no run {unknown[0]}; it has {', '.join(runs)}")
    first = runs[names[0]]
    at_s = first["time_s"][np.nanargmax(np.abs(first["roll_rad"]))]
    times_s = at_s + np.arange(round(SECONDS * FRAMES_A_SECOND)) / FRAMES_A_SECOND - SECONDS / 2
    figure = Figure(figsize=SIZE_IN, dpi=DPI, facecolor=BACKGROUND)
    FigureCanvasAgg(figure)
    figure.subplots_adjust(left=0.01, right=0.99, bottom=0.09, top=0.9, wspace=0.02)
    axes = figure.subplots(1, len(names), squeeze=False)[0]
    sections = [Section(*each) for each in zip(axes, [size] * len(names), names, strict=True)]

    frames = []
    for time_s in times_s:
        for section, name in zip(sections, names, strict=True):
            run = runs[name]
            section.show({key: np.interp(time_s, run["time_s"], run[key]) for key in NEEDED})
        content = BytesIO()
        figure.savefig(content, format="png", facecolor=BACKGROUND)
        frame = Image.open(content).convert("RGB")
        frames.append(frame.quantize(PALETTE, dither=Image.Dither.NONE))
    frames[0].save(
        picture, save_all=True, append_images=frames[1:], duration=1000 // FRAMES_A_SECOND, loop=0
    )


def _rgb(color: Color) -> str:
    return "#{:02x}{:02x}{:02x}".format(*color)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("recording", type=Path)
    parser.add_argument("picture", type=Path)
    parser.add_argument("runs", nargs="*")
    given = parser.parse_args()
    animate(given.recording, given.picture, given.runs)
