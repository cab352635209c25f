"""The ship's section rolling, with the water in her tank: what a watch-keeper sees first.

Seen from aft, starboard to the right, centred in the ship's centre of gravity, to scale. The hull
around the tank is a sketch; tank, water, and roll are as recorded. A light outline is the passive
twin.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
import rerun as rr

from utank_hil.arrays import FloatArray
from utank_hil.canbus.enumerations import Fault, Mode
from utank_hil.runtime.faults import fault_text
from utank_hil.telemetry.viewer import TIMELINE

PERIOD_S: Final = 0.2
"""Between two pictures: a roll of some seconds moves smoothly, and an hour is 6 MB."""
WORDS_PERIOD_S: Final = 2.0
NEEDED: Final = (
    "roll_rad", "twin_roll_rad", "port_level_m", "starboard_level_m", "pressure_actual_pa",
)  # fmt: skip

# shares of the tank's width: of a reservoir, of the hull beyond it, of the keel below the duct
_RESERVOIR, _BEYOND, _KEEL = 0.16, 0.12, 0.14
_ARROW: Final = 0.6
"""Length of the arrow at the pump's greatest pressure, in widths of the tank."""
_LINES: Final = 8
"""That the water in a reservoir is drawn with."""

_HULL, _TWIN, _WATER = (0xE0, 0xE0, 0xE0), (0x70, 0x70, 0x70), (0x56, 0xB4, 0xE9)
_LIMIT, _PUMP, _SEA = (0xF0, 0xE4, 0x42), (0xE6, 0x9F, 0x00), (0x2A, 0x5C, 0x7A)


@dataclass(frozen=True, slots=True)
class SceneSize:
    """What is drawn, in metres below and to starboard of the centre of gravity.

    Attributes
    ----------
    width_m, height_m, lz_m : float
        Of the tank, see `utank_hil.dynamics.Tank`.
    level_limit_m : float
        Level at which a reservoir is full or empty.
    pressure_pa : float
        Greatest pressure of the pump; 0 without one.
    """

    width_m: float
    height_m: float
    lz_m: float
    level_limit_m: float
    pressure_pa: float

    @classmethod
    def of(cls, about: Mapping[str, Any] | None) -> "SceneSize | None":
        """From where a recording comes from (`utank_hil.provenance`); None if that says nothing."""
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
        middle, reach = 0.5 * self.width_m, 0.5 * _RESERVOIR * self.width_m
        still = self.lz_m - self.height_m
        return np.array(
            [
                [[side * middle - reach, still + level], [side * middle + reach, still + level]]
                for side in (-1, 1)
                for level in (-self.level_limit_m, self.level_limit_m)
            ]
        )

    def duct(self) -> FloatArray:
        """Middle line of the duct, upright, shape (2, 2)."""
        half = 0.5 * self.width_m
        return np.array([[-half, self.lz_m], [half, self.lz_m]])

    def water(self, port_m: FloatArray, starboard_m: FloatArray) -> FloatArray:
        """Upright lines that fill the reservoirs to their levels, shape (n, 2 `_LINES`, 2, 2)."""
        line = _RESERVOIR * self.width_m / _LINES
        across = (np.arange(_LINES) - (_LINES - 1) / 2) * line
        still, half = self.lz_m - self.height_m, 0.5 * self.width_m
        strips = np.empty((len(port_m), 2, _LINES, 2, 2))
        strips[..., 0] = np.array([-half, half])[:, None, None] + across[:, None]
        strips[..., 0, 1] = self.lz_m
        # a line ends in a half circle: its tip is at the level
        levels = np.column_stack([port_m, starboard_m])
        strips[..., 1, 1] = (still - levels + line / 2)[:, :, None]
        return strips.reshape(len(port_m), 2 * _LINES, 2, 2)


def turned(points: FloatArray, roll_rad: FloatArray) -> FloatArray:
    """Points of the ship, shape (..., k, 2), at each roll, shape (n,): shape (n, ..., k, 2)."""
    sine, cosine = np.sin(roll_rad), np.cos(roll_rad)
    turn = np.array([[cosine, -sine], [sine, cosine]]).transpose(2, 0, 1)
    return np.asarray(np.einsum("nij,n...j->n...i", turn, points))


class Scene:
    """Writes the scene of one run.

    Parameters
    ----------
    recording : rerun.RecordingStream
    path : str
        Entity path of the run.
    columns : sequence of str
        Names of a row's values.
    size : SceneSize
    """

    def __init__(
        self, recording: rr.RecordingStream, path: str, columns: Sequence[str], size: SceneSize
    ) -> None:
        self._recording, self._path, self._size = recording, path, size
        self._at = {name: columns.index(name) for name in columns}
        self._due_s = self._words_due_s = -np.inf
        self._said: tuple[float, float] = (np.nan, np.nan)
        thin = 0.004 * size.width_m
        line, duct = 0.7 * _RESERVOIR * size.width_m / _LINES, 0.06 * size.width_m
        style = rr.LineStrips2D.from_fields
        sea = [[-3 * size.reach_m, 0.0], [3 * size.reach_m, 0.0]]
        for name, looks in (
            ("sea", rr.LineStrips2D([sea], colors=_SEA, radii=2 * thin, draw_order=0.0)),
            ("twin", style(colors=_TWIN, radii=thin, draw_order=1.0)),
            ("duct", style(colors=_WATER, radii=duct, draw_order=2.0)),
            ("water", style(colors=_WATER, radii=line, draw_order=2.0)),
            ("hull", style(colors=_HULL, radii=2 * thin, draw_order=3.0)),
            ("limits", style(colors=_LIMIT, radii=2 * thin, draw_order=4.0)),
            ("pump", rr.Arrows2D.from_fields(colors=_PUMP, radii=4 * thin, draw_order=5.0)),
        ):
            recording.log(f"{scene_path(path)}/{name}", looks, static=True, strict=True)

    def write(self, rows: FloatArray) -> None:
        """Append the pictures and words that are due within these rows."""
        time_s = rows[:, self._at["time_s"]]
        due = []
        for row, now_s in enumerate(time_s):
            if now_s >= self._due_s - 1e-9:
                due.append(row)
                self._due_s = now_s + PERIOD_S
        if due:
            self._draw(rows[due])
        for row in rows[due]:
            self._say(row)

    def _draw(self, rows: FloatArray) -> None:
        size = self._size
        roll, twin, port, starboard, pressure = (rows[:, self._at[name]] for name in NEEDED)
        known = np.isfinite(roll)
        roll = np.where(known, roll, 0.0)
        frames = len(rows)
        hull = np.broadcast_to(size.hull(), (frames, *size.hull().shape))
        limits = np.broadcast_to(size.limits(), (frames, *size.limits().shape))
        self._strips("hull", rows, turned(hull, roll)[:, None])
        self._strips("twin", rows, turned(hull, np.where(np.isfinite(twin), twin, roll))[:, None])
        self._strips("limits", rows, turned(limits, roll))
        duct = np.broadcast_to(size.duct(), (frames, 2, 2))
        self._strips("duct", rows, turned(duct, roll)[:, None])
        water = size.water(np.nan_to_num(port), np.nan_to_num(starboard))
        self._strips("water", rows, turned(water, roll))
        if size.pressure_pa:
            length = _ARROW * size.width_m * np.nan_to_num(pressure) / size.pressure_pa
            along = np.column_stack([length, np.zeros(frames)])[:, None]
            below = np.broadcast_to([[0.0, size.lz_m]], (frames, 1, 2))
            vectors, origins = turned(along, roll)[:, 0], turned(below, roll)[:, 0]
            self._recording.send_columns(
                f"{scene_path(self._path)}/pump",
                [self._times(rows)],
                rr.Arrows2D.columns(vectors=vectors, origins=origins - vectors / 2),
            )

    def _strips(self, name: str, rows: FloatArray, strips: FloatArray) -> None:
        """Send strips of shape (n, strips of a picture, points, 2)."""
        flat = list(strips.reshape(-1, *strips.shape[2:]))
        columns = rr.LineStrips2D.columns(strips=flat).partition([strips.shape[1]] * len(rows))
        self._recording.send_columns(
            f"{scene_path(self._path)}/{name}", [self._times(rows)], columns
        )

    def _times(self, rows: FloatArray) -> rr.TimeColumn:
        time_ns = np.rint(rows[:, self._at["time_s"]] * 1e9).astype("timedelta64[ns]")
        return rr.TimeColumn(TIMELINE, duration=time_ns)

    def _say(self, row: FloatArray) -> None:
        """Write mode, roll beside the twin's and alarms in words, when due or changed."""
        now_s = row[self._at["time_s"]]
        state = (row[self._at["mode"]], row[self._at["fault"]])
        if state == self._said and now_s < self._words_due_s - 1e-9:
            return
        self._said, self._words_due_s = state, now_s + WORDS_PERIOD_S
        self._recording.send_columns(
            words_path(self._path),
            [self._times(row[None])],
            rr.TextDocument.columns(text=[self._words(row)], media_type=["text/markdown"]),
        )

    def _words(self, row: FloatArray) -> str:
        mode, fault = int(row[self._at["mode"]]), int(row[self._at["fault"]])
        lines = [f"# {Mode(mode).name if mode in set(Mode) else mode}"]
        if fault != Fault.NONE:
            lines.append(f"## {fault_text(Fault(fault)) if fault in set(Fault) else fault}")
        if "twin_roll_rms_rad" in self._at:
            roll, twin = (
                np.degrees(row[self._at[name]]) for name in ("roll_rms_rad", "twin_roll_rms_rad")
            )
            if np.isfinite(roll + twin):
                lines.append(f"Roll **{roll:.2f}°** RMS; without the pump **{twin:.2f}°**")
                share = 1 - roll / twin if twin > 0.05 else 0.0
                if abs(share) >= 0.005:
                    lines.append(f"**{abs(share):.0%} {'less' if share >= 0 else 'more'}**")
        return "\n\n".join(lines)


def scene_path(path: str) -> str:
    """Entity path of a run's scene."""
    return f"{path}/scene"


def words_path(path: str) -> str:
    """Entity path of a run's words."""
    return f"{path}/words"


def scene_size(columns: Sequence[str], about: Mapping[str, Any] | None) -> SceneSize | None:
    """What these columns show of the ship that they come from; None where it is not known."""
    shown = {*NEEDED, "time_s", "mode", "fault"} <= set(columns)
    return SceneSize.of(about) if shown else None
