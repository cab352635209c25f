"""The rolling section of the ship, with the water in its tank: a watch-keeper's first view.

It is drawn to scale, from aft, starboard to the right, centred in the ship's centre of gravity. The
hull is a sketch; tank, water, and roll are as recorded. A light outline is the passive twin.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
import rerun as rr

from utank_hil.base.arrays import FloatArray
from utank_hil.canbus.enumerations import Fault, Mode
from utank_hil.safety.faults import fault_text
from utank_hil.telemetry.viewer import TIMELINE

PERIOD_S: Final = 0.2  #: Time between two pictures: a roll of some seconds appears smooth.
WORDS_PERIOD_S: Final = 2.0  #: Time between two texts, long enough to read them.
NEEDED: Final = (
    "roll_rad", "twin_roll_rad", "port_level_m", "starboard_level_m", "pressure_actual_pa",
)  # fmt: skip
_RMS: Final = ("roll_rms_rad", "twin_roll_rms_rad")
RESERVOIR, _BEYOND, _KEEL = 0.16, 0.12, 0.14
"""Widths of reservoir and of hull beyond it, and depth of keel below the duct, in tank widths."""
_ARROW: Final = 0.6  #: Length of the arrow at the pump's greatest pressure, in tank widths.
LINES: Final = 8  #: Number of lines that fill the water of a reservoir.
HULL, TWIN, WATER = (0xE0, 0xE0, 0xE0), (0x70, 0x70, 0x70), (0x56, 0xB4, 0xE9)
LIMIT, PUMP, SEA = (0xF0, 0xE4, 0x42), (0xA0, 0x28, 0x00), (0x2A, 0x5C, 0x7A)


@dataclass(frozen=True, slots=True)
class SceneSize:
    """Dimensions of the scene, in metres below and to starboard of the centre of gravity."""

    #: width_m, height_m, lz_m: dimensions of the tank (`utank_hil.dynamics.Tank`).
    width_m: float
    height_m: float
    lz_m: float
    level_limit_m: float  #: Level at which a reservoir is full or empty.
    pressure_pa: float  #: Greatest pressure of the pump; 0 without one.

    @classmethod
    def of(cls, about: Mapping[str, Any] | None) -> "SceneSize | None":
        """Return the size that a recording's provenance states; None if it states none."""
        vessel = ((about or {}).get("configuration") or {}).get("vessel")
        if vessel is None:
            return None
        tank, pump = vessel["tank"], vessel["pump"]
        return cls(
            tank["width_m"],
            tank["height_m"],
            tank.get("lz_m", 0.0),
            min(tank.get("headroom_m", np.inf), tank["height_m"]),
            0.0 if pump is None else pump["max_pressure_pa"],
        )

    @property
    def reach_m(self) -> float:
        """Half the width of the picture."""
        return (0.5 + _BEYOND + 0.12) * self.width_m

    @property
    def height_range_m(self) -> tuple[float, float]:
        """Upper and lower end of the picture, with room for a rolling ship."""
        below = self.hull()[:, 1]
        room = 0.12 * self.width_m
        return float(below.min()) - room, float(below.max()) + room

    def hull(self) -> FloatArray:
        """Outline of the hull, upright, shape (n, 2)."""
        half = (0.5 + _BEYOND) * self.width_m
        deck = self.lz_m - self.height_m - self.level_limit_m - 0.05 * self.width_m
        keel = self.lz_m + _KEEL * self.width_m
        bilge = 0.2 * self.width_m
        turn = np.linspace(0.0, np.pi / 2, 5)
        starboard = np.column_stack(
            [half - bilge + bilge * np.cos(turn), keel - bilge + bilge * np.sin(turn)]
        )
        side = np.vstack([[half, deck], starboard])
        outline: FloatArray = np.vstack([side, side[::-1] * [-1.0, 1.0], side[:1]])
        return outline

    def limits(self) -> FloatArray:
        """Marks of full and empty at both reservoirs, shape (4, 2, 2)."""
        middle, reach = 0.5 * self.width_m, 0.5 * RESERVOIR * self.width_m
        still = self.lz_m - self.height_m
        return np.array(
            [
                [[side * middle - reach, still + level], [side * middle + reach, still + level]]
                for side in (-1, 1)
                for level in (-self.level_limit_m, self.level_limit_m)
            ]
        )

    def duct(self) -> FloatArray:
        """Centre line of the duct, upright, shape (2, 2)."""
        half = 0.5 * self.width_m
        return np.array([[-half, self.lz_m], [half, self.lz_m]])

    def water(self, port_m: FloatArray, starboard_m: FloatArray) -> FloatArray:
        """Return upright lines that fill the reservoirs, shape (n, 2 `LINES`, 2, 2)."""
        line = RESERVOIR * self.width_m / LINES
        across = (np.arange(LINES) - (LINES - 1) / 2) * line
        still, half = self.lz_m - self.height_m, 0.5 * self.width_m
        strips = np.empty((len(port_m), 2, LINES, 2, 2))
        strips[..., 0] = np.array([-half, half])[:, None, None] + across[:, None]
        strips[..., 0, 1] = self.lz_m
        # A line ends in a half circle, whose tip is at the level.
        levels = np.column_stack([port_m, starboard_m])
        strips[..., 1, 1] = (still - levels + line / 2)[:, :, None]
        return strips.reshape(len(port_m), 2 * LINES, 2, 2)

    def arrow(self, pressure_pa: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the pump's arrow along the duct: vectors and origins, shape (n, 2)."""
        length = _ARROW * self.width_m * pressure_pa / self.pressure_pa
        vectors = np.column_stack([length, np.zeros(len(length))])
        return vectors, [0.0, self.lz_m] - vectors / 2


class Scene:
    """Writes the scene of the run of an entity path; one shown `alone` has larger words.

    Drawings are sent in batches of `batch_s`, the last by `close`: small chunks cost a file more
    than their content.
    """

    def __init__(
        self,
        recording: rr.RecordingStream,
        path: str,
        columns: Sequence[str],
        size: SceneSize,
        batch_s: float,
        alone: bool,
    ) -> None:
        self._at = {name: columns.index(name) for name in columns}
        self._due_s = -np.inf
        self._held: list[FloatArray] = []
        self._most_held = batch_s / PERIOD_S
        self._recording, self._path, self._size = recording, path, size
        self._large = "#### " if alone else ""
        self._words_due_s = -np.inf
        self._said: tuple[float, float] = (np.nan, np.nan)
        self._stand()

    def write(self, rows: FloatArray) -> None:
        """Take rows with increasing times, and draw what is due within them."""
        time_s = rows[:, self._at["time_s"]]
        while (at := int(np.searchsorted(time_s, self._due_s - 1e-9))) < len(time_s):
            self._held.append(rows[at])
            self._due_s = time_s[at] + PERIOD_S
        if len(self._held) >= self._most_held:
            self.close()

    def close(self) -> None:
        """Send the last batch; idempotent."""
        if self._held:
            rows = np.stack(self._held)
            self._held.clear()
            self._draw(rows)

    def _stand(self) -> None:
        """Log the static content: the ship's parts, upright, and the style of moving parts."""
        size, place = self._size, f"{self._path}/scene"
        thin = 0.004 * size.width_m
        column = 0.7 * RESERVOIR * size.width_m / LINES
        strips, sea = rr.LineStrips2D, [[-3 * size.reach_m, 0.0], [3 * size.reach_m, 0.0]]
        duct, arrow = 0.06 * size.width_m, rr.Arrows2D.from_fields
        for name, looks in (
            ("sea", strips([sea], colors=SEA, radii=2 * thin, draw_order=0.0)),
            ("twin", strips([size.hull()], colors=TWIN, radii=thin, draw_order=1.0)),
            ("ship/duct", strips([size.duct()], colors=WATER, radii=duct, draw_order=2.0)),
            ("ship/water", strips.from_fields(colors=WATER, radii=column, draw_order=2.0)),
            ("ship/hull", strips([size.hull()], colors=HULL, radii=2 * thin, draw_order=3.0)),
            ("ship/limits", strips([*size.limits()], colors=LIMIT, radii=2 * thin, draw_order=4.0)),
            ("ship/pump", arrow(colors=PUMP, radii=4 * thin, draw_order=5.0)),
        ):
            self._recording.log(f"{place}/{name}", looks, static=True, strict=True)

    def _draw(self, rows: FloatArray) -> None:
        """Send the moving parts: roll of ship and twin, water and pump in ship axes, and words."""
        size = self._size
        roll, twin, port, starboard, pressure = (rows[:, self._at[name]] for name in NEEDED)
        roll = np.nan_to_num(roll)
        self._turn("ship", rows, roll)
        self._turn("twin", rows, np.where(np.isfinite(twin), twin, roll))
        water = size.water(np.nan_to_num(port), np.nan_to_num(starboard))
        strips = rr.LineStrips2D.columns(strips=water.reshape(-1, 2, 2).astype(np.float32))
        self._send("scene/ship/water", rows, strips.partition([water.shape[1]] * len(rows)))
        if size.pressure_pa:
            vectors, origins = size.arrow(np.nan_to_num(pressure))
            arrows = rr.Arrows2D.columns(vectors=vectors, origins=origins)
            self._send("scene/ship/pump", rows, arrows)
        news = rows[[self._is_news(row) for row in rows]]
        if len(news):
            words = [self._words(row) for row in news]
            markdown = ["text/markdown"] * len(news)
            self._send("words", news, rr.TextDocument.columns(text=words, media_type=markdown))

    def _turn(self, name: str, rows: FloatArray, roll_rad: FloatArray) -> None:
        """Rotate a part of the scene, and its children, to starboard."""
        zero, half_rad = np.zeros(len(rows)), roll_rad / 2
        turns = np.column_stack([zero, zero, np.sin(half_rad), np.cos(half_rad)])
        self._send(f"scene/{name}", rows, rr.Transform3D.columns(quaternion=turns))

    def _send(self, name: str, rows: FloatArray, columns: rr.ComponentColumnList) -> None:
        send_at(self._recording, f"{self._path}/{name}", rows[:, self._at["time_s"]], columns)

    def _is_news(self, row: FloatArray) -> bool:
        now_s = row[self._at["time_s"]]
        state = (row[self._at["mode"]], row[self._at["fault"]])
        if state == self._said and now_s < self._words_due_s - 1e-9:
            return False
        self._said, self._words_due_s = state, now_s + WORDS_PERIOD_S
        return True

    def _words(self, row: FloatArray) -> str:
        mode, fault = int(row[self._at["mode"]]), int(row[self._at["fault"]])
        lines = [f"# {Mode(mode).name if mode in set(Mode) else mode}"]
        if fault != Fault.NONE:
            text = fault_text(Fault(fault)) if fault in set(Fault) else str(fault)
            name, _, remedy = text.partition(": ")
            lines += [f"## {name}", f"{self._large}{remedy}"]
        if set(_RMS) <= self._at.keys():
            roll, twin = np.degrees([row[self._at[name]] for name in _RMS])
            if np.isfinite(roll + twin):
                said = f"Roll **{roll:.2f}°** RMS; without the pump **{twin:.2f}°**"
                share = 1 - roll / twin if twin > 0.05 else 0.0
                if abs(share) >= 0.005:
                    said += f": **{abs(share):.0%} {'less' if share >= 0 else 'more'}**"
                lines.append(said)
        return "\n\n".join(lines)


def send_at(
    recording: rr.RecordingStream, path: str, time_s: FloatArray, columns: rr.ComponentColumnList
) -> None:
    """Send rows of components to an entity, at times since the run's start."""
    time_ns = np.rint(time_s * 1e9).astype("timedelta64[ns]")
    index = rr.TimeColumn(TIMELINE, duration=time_ns)
    recording.send_columns(path, [index], columns, strict=True)


def scene_size(columns: Sequence[str], about: Mapping[str, Any] | None) -> SceneSize | None:
    """Return the size of the ship in these columns; None if unknown."""
    shown = {*NEEDED, "time_s", "mode", "fault"} <= set(columns)
    return SceneSize.of(about) if shown else None
