"""The rolling section: geometry against sines and cosines, and what reaches the recording."""

import math

import numpy as np
import pytest

from utank_hil.canbus.enumerations import Fault, Mode
from utank_hil.nodes.signals import SIGNALS
from utank_hil.telemetry.highlight import highlight_s
from utank_hil.telemetry.recording import write_recording
from utank_hil.telemetry.recording_reader import _chunks, read_recording
from utank_hil.telemetry.scene import PERIOD_S, SceneSize, scene_size

SIZE = SceneSize(width_m=17.0, height_m=5.0, lz_m=2.0, level_limit_m=4.0, pressure_pa=5e4)
VESSEL = {
    "tank": {"width_m": 17.0, "height_m": 5.0, "lz_m": 2.0, "headroom_m": 4.0},
    "pump": {"max_pressure_pa": 5e4},
}
ABOUT = {"configuration": {"vessel": VESSEL}}


def test_water_stands_at_its_levels_in_the_reservoirs():
    strips = SIZE.water(np.array([0.0, -1.0]), np.array([0.0, 1.0]))
    still = SIZE.lz_m - SIZE.height_m
    half_line = np.diff(strips[0, :2, 0, 0])[0] / 2
    port, starboard = strips[:, :8], strips[:, 8:]
    assert port[..., 0].mean() == pytest.approx(-8.5)
    assert starboard[..., 0].mean() == pytest.approx(8.5)
    np.testing.assert_allclose(strips[0, :, 1, 1] - half_line, still)
    np.testing.assert_allclose(port[1, :, 1, 1] - half_line, still + 1.0)  # lower: z is downwards
    np.testing.assert_allclose(starboard[1, :, 1, 1] - half_line, still - 1.0)
    np.testing.assert_allclose(strips[..., 0, 1], SIZE.lz_m)


def test_the_picture_holds_hull_and_limits_at_large_rolls():
    low, high = SIZE.height_range_m
    cosine, sine = math.cos(0.15), math.sin(0.15)
    for points in (SIZE.hull(), SIZE.limits().reshape(-1, 2)):
        at = points @ np.array([[cosine, sine], [-sine, cosine]])
        assert np.abs(at[:, 0]).max() < 1.15 * SIZE.reach_m
        assert low < at[:, 1].min() < at[:, 1].max() < high


def test_without_the_ship_or_a_signal_there_is_no_scene():
    assert scene_size(SIGNALS, ABOUT) == SIZE
    assert scene_size(SIGNALS, None) is None
    assert scene_size(SIGNALS, {"configuration": {}}) is None
    assert scene_size([name for name in SIGNALS if name != "twin_roll_rad"], ABOUT) is None
    without_pump = {"configuration": {"vessel": {**VESSEL, "pump": None}}}
    found = scene_size(SIGNALS, without_pump)
    assert found.pressure_pa == 0.0


def _rows(seconds):
    rows = np.zeros((round(seconds / 0.05), len(SIGNALS)))
    rows[:, SIGNALS.index("time_s")] = time_s = 0.05 * np.arange(len(rows))
    rows[:, SIGNALS.index("roll_rad")] = 0.1 * np.exp(-time_s / 50) * np.sin(time_s)
    rows[:, SIGNALS.index("mode")] = Mode.ACTIVE
    return rows


@pytest.mark.slow
def test_a_recording_has_pictures_in_time_and_words_on_a_change(tmp_path):
    rows = _rows(20.0)
    rows[round(7.03 / 0.05) :, SIGNALS.index("fault")] = Fault.LEVEL_LIMIT
    file = tmp_path / "a.rrd"
    write_recording(file, SIGNALS, {"run": rows}, about=ABOUT)
    drawn = {
        chunk.entity_path.removeprefix("/1/run/scene/"): chunk.to_record_batch()
        for component in ("Transform3D:quaternion", "LineStrips2D:strips")
        for chunk in _chunks(file, component)
        if not chunk.is_static
    }
    assert set(drawn) == {"ship", "twin", "ship/water"}
    assert {batch.num_rows for batch in drawn.values()} == {round(20.0 / PERIOD_S)}
    for name, signal in (("ship", "roll_rad"), ("twin", "twin_roll_rad")):
        turns = np.stack(drawn[name].column("Transform3D:quaternion").flatten().to_numpy(False))
        # about the axis into the picture: to the right and downwards, as positive roll is
        np.testing.assert_array_equal(turns[:, :2], 0.0)
        expected = rows[:: round(PERIOD_S / 0.05), SIGNALS.index(signal)]
        angles = 2 * np.arctan2(turns[:, 2], turns[:, 3])
        np.testing.assert_allclose(angles, expected, atol=1e-7)
    words = [
        (time, text)
        for chunk in _chunks(file, "TextDocument:text")
        if chunk.entity_path == "/1/run/words"
        for time, text in zip(
            chunk.to_record_batch().column("time").to_pylist(),
            chunk.to_record_batch().column("TextDocument:text").flatten().to_pylist(),
            strict=True,
        )
    ]
    assert all(text.startswith("# ACTIVE") for _, text in words)
    first = min(time for time, text in words if "LEVEL_LIMIT" in text)
    assert 7.0 <= first.total_seconds() <= 7.0 + 2 * PERIOD_S


@pytest.mark.slow
@pytest.mark.usefixtures("read_here")
def test_a_recording_opens_at_its_fault_or_else_at_most_roll(tmp_path):
    rows = _rows(20.0)
    calm, faulty = tmp_path / "calm.rrd", tmp_path / "faulty.rrd"
    write_recording(calm, SIGNALS, {"run": rows})
    assert highlight_s([*read_recording(calm).values()]) == pytest.approx(math.pi / 2, abs=0.05)
    rows[200:, SIGNALS.index("fault")] = Fault.LEVEL_LIMIT
    rows[:20, SIGNALS.index("fault")] = Fault.MOTION_SILENT  # awaited at the start
    rows[:20, SIGNALS.index("mode")] = Mode.INIT
    write_recording(faulty, SIGNALS, {"still": _rows(20.0), "run": rows})
    assert highlight_s([*read_recording(faulty).values()]) == pytest.approx(10.0)
