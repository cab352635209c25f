"""The README's animation: small, ten seconds long, and the ship in it rolls as recorded."""

from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from tools.documents import animation
from tools.documents.animation import animate
from utank_hil.nodes.signals import SIGNALS
from utank_hil.telemetry.recording import write_recording
from utank_hil.telemetry.scene import HULL, PUMP, WATER

pytestmark = pytest.mark.slow

VESSEL = {
    "tank": {"width_m": 17.0, "height_m": 5.0, "lz_m": 2.0, "headroom_m": 4.0},
    "pump": {"max_pressure_pa": 5e4},
}
ABOUT = {"configuration": {"vessel": VESSEL}}
SHIPPED = Path("docs/pictures/watch.gif").resolve()


def pixels(frame, color):
    """Columns and rows of the pixels of a colour, shape (2, n)."""
    near = np.abs(np.asarray(frame.convert("RGB")).astype(int) - color).max(axis=-1) < 40
    rows, columns = np.nonzero(near)
    return np.array([columns, rows])


def tilt_rad(points):
    """Slope of the upper edge of some pixels, downwards to the right."""
    columns = np.unique(points[0])
    columns = columns[len(columns) // 4 : -len(columns) // 4]  # of the deck, not of the sides
    tops = [points[1][points[0] == column].min() for column in columns]
    return float(np.arctan(np.polyfit(columns, tops, 1)[0]))


def test_the_ship_is_drawn_at_her_roll_with_water_and_pump(tmp_path, monkeypatch):
    monkeypatch.setattr(animation, "FRAMES_A_SECOND", 1)
    time_s = np.arange(0.0, 30.0, 0.05)
    rows = np.zeros((len(time_s), len(SIGNALS)))
    rows[:, SIGNALS.index("time_s")] = time_s
    roll_rad = np.where(np.abs(time_s - 15.0) < 2.0, 0.2, -0.1)
    rows[:, SIGNALS.index("roll_rad")] = rows[:, SIGNALS.index("twin_roll_rad")] = roll_rad
    rows[:, SIGNALS.index("port_level_m")] = 2.0
    rows[:, SIGNALS.index("starboard_level_m")] = -2.0
    rows[:, SIGNALS.index("pressure_actual_pa")] = 4e4
    file, picture = tmp_path / "a.rrd", tmp_path / "a.gif"
    write_recording(file, SIGNALS, {"a": rows}, about=ABOUT)
    animate(file, picture, [])
    with Image.open(picture) as drawn:
        for frame, expected_rad in ((1, 0.2), (0, -0.1)):  # equal ones are one
            drawn.seek(frame)
            hull = pixels(drawn, HULL)
            # the words above and below her are of the same colour
            hers = hull[:, (hull[1] > 35) & (hull[1] < 0.85 * drawn.height)]
            assert tilt_rad(hers) == pytest.approx(expected_rad, abs=0.02)
            water = pixels(drawn, WATER)
            port, starboard = (
                water[1][side].min()
                for side in (water[0] < 0.45 * drawn.width, water[0] > 0.55 * drawn.width)
            )
            assert port < starboard - 20
            assert len(pixels(drawn, PUMP)[0]) > 200


@pytest.mark.usefixtures("read_here")
def test_what_can_not_be_drawn_is_named(tmp_path):
    rows = np.zeros((3, len(SIGNALS)))
    rows[:, SIGNALS.index("time_s")] = range(3)
    file = tmp_path / "a.rrd"
    write_recording(file, SIGNALS, {"a": rows}, about=ABOUT)
    with pytest.raises(ValueError, match="has no run b; it has a"):
        animate(file, tmp_path / "a.gif", ["b"])
    write_recording(file, SIGNALS, {"a": rows}, about={})
    with pytest.raises(ValueError, match="of which ship"):
        animate(file, tmp_path / "a.gif", [])


def test_the_animation_of_the_readme_is_small_and_ten_seconds_long():
    assert SHIPPED.stat().st_size < 1e6
    with Image.open(SHIPPED) as drawn:
        assert drawn.n_frames * drawn.info["duration"] == 10_000
