"""The picture of a bench, read back pixel by pixel, and what loading it must not load."""

from dataclasses import replace

import matplotlib.image
import numpy as np
import pytest

from utank_hil.canbus import Mode
from utank_hil.pictures import BenchCurve, draw_bench
from utank_hil.pictures.style import COLORS

pytestmark = pytest.mark.slow

BLUE = np.array([0x00, 0x72, 0xB2]) / 255
YELLOW_BAND = np.array([0xF0, 0xE4, 0x42]) / 255 * 0.35 + 0.65


def curve(name, seconds, amplitude_rad, peak_s):
    """A roll with one sample twice as high as the others."""
    time_s = np.arange(0.0, seconds, 0.2)
    roll = amplitude_rad * np.sin(0.5 * time_s)
    roll[np.argmin(np.abs(time_s - peak_s))] = 2 * amplitude_rad
    return BenchCurve(name, time_s, roll, 10 * roll, 1e5 * roll)


def pixels(image, color):
    close: np.ndarray = np.abs(image[..., :3] - color).max(axis=-1) < 0.02
    return close


def read(path):
    return np.asarray(matplotlib.image.imread(path))


def test_the_zoom_is_around_the_largest_roll_of_the_first_run(tmp_path):
    centres = []
    for peak_s in (300.0, 1500.0):
        curves = [curve("passive", 1800.0, 0.1, peak_s), curve("active", 1800.0, 0.05, 700.0)]
        assert draw_bench(curves, tmp_path / "a.png", "A storm") == tmp_path / "a.png"
        image = read(tmp_path / "a.png")
        centres.append(np.flatnonzero(pixels(image, YELLOW_BAND).any(axis=0)).mean())
        assert pixels(image, BLUE)[:, image.shape[1] // 2 :].sum() > 1000
    panel = 0.46 * image.shape[1]  # what half the picture leaves of itself to the plot
    assert centres[1] - centres[0] == pytest.approx(1200 / 1800 * panel, rel=0.05)


def test_a_short_run_needs_no_zoom(tmp_path):
    long, short = (
        read(draw_bench([curve("passive", seconds, 0.1, 50.0)], tmp_path / "a.png", "A run"))
        for seconds in (400.0, 100.0)
    )
    assert pixels(long, YELLOW_BAND).any()
    assert not pixels(short, YELLOW_BAND).any()
    assert short.shape[1] < long.shape[1]


def test_the_ship_without_a_tank_is_drawn_and_arming_and_fault_are_marked(tmp_path):
    passive, active = curve("passive", 300.0, 0.1, 50.0), curve("active", 300.0, 0.05, 50.0)
    plain = read(draw_bench([passive, active], tmp_path / "a.png", "A run"))
    empty = np.full_like(passive.time_s, np.nan)
    bare = BenchCurve("no tank", passive.time_s, 0.2 * np.cos(passive.time_s), empty, empty)
    drawn = read(draw_bench([passive, active], tmp_path / "a.png", "A run", bare=bare))
    light = np.array([0xBB, 0xBB, 0xBB]) / 255
    assert pixels(drawn, light).sum() > pixels(plain, light).sum() + 1000
    assert pixels(drawn, BLUE).sum() > 1000
    calm = replace(active, roll_rad=np.zeros_like(empty), level_m=empty, pressure_pa=empty)
    columns = {}
    for name, mode in (("none", None), ("armed", Mode.ACTIVE), ("fault", Mode.FAULT)):
        modes = None if mode is None else np.where(active.time_s < 150.0, Mode.PASSIVE, mode)
        image = read(draw_bench([passive, replace(calm, mode=modes)], tmp_path / "a.png", "A run"))
        blue = pixels(image, BLUE)[: int(0.85 * image.shape[0])].sum(axis=0)
        columns[name] = np.flatnonzero(blue > 100)
        middle = np.flatnonzero(blue).mean()  # the calm roll's line lies along the whole plot
    assert not len(columns["none"])
    assert columns["armed"] == pytest.approx(middle, abs=3)
    assert columns["fault"] == pytest.approx(middle, abs=3)


@pytest.mark.evidence
def test_what_retuning_did_is_a_lane_and_the_zoom_is_around_its_trial(tmp_path):
    curves = [curve("passive", 1800.0, 0.1, 300.0), curve("active", 1800.0, 0.05, 700.0)]
    plain = read(draw_bench(curves, tmp_path / "a.png", "A storm"))
    centres = []
    for trial_s in (600.0, 900.0):
        state = np.zeros(len(curves[1].time_s))
        for since_s, entered in ((-300.0, 1), (0.0, 3), (300.0, 4), (600.0, 0)):
            state[curves[1].time_s >= trial_s + since_s] = entered
        active = replace(curves[1], retuning=state)
        image = read(draw_bench([curves[0], active], tmp_path / "a.png", "A storm"))
        panel = image.shape[1] // 2
        assert image.shape[0] > plain.shape[0]
        band = np.flatnonzero(pixels(image, YELLOW_BAND)[:, :panel].any(axis=0))
        a_second = (band[-1] - band[0]) / 180.0  # what the zoom is wide
        centres.append(band.mean())
        # the lane lies below the plots: of each strength a stretch as long as the state lasted
        lane = image[int(0.85 * image.shape[0]) : int(0.93 * image.shape[0]), :panel]
        for strength in (0.25, 0.55, 1.0):
            columns = np.flatnonzero(
                pixels(lane, 1 - strength * (1 - BLUE)).sum(axis=0) > 15
            )  # not a letter
            assert columns[-1] - columns[0] == pytest.approx(300.0 * a_second, rel=0.05)
    assert centres[1] - centres[0] == pytest.approx(300.0 * a_second, rel=0.05)


def test_more_runs_than_colours_are_refused(tmp_path):
    for number in (0, len(COLORS) + 1):
        with pytest.raises(ValueError, match=f"got {number}"):
            draw_bench([curve("a", 10.0, 0.1, 5.0)] * number, tmp_path / "a.png", "None")
