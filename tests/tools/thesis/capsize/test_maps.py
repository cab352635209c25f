from pathlib import Path

import numpy as np
import pytest
from matplotlib.image import imread

from tools.thesis.capsize.contest import PATTI_B
from tools.thesis.capsize.maps import capsize_map, phase_grid
from tools.thesis.capsize.picture import draw_capsize_maps
from tools.thesis.capsize.threshold import safe_basin, without_tank
from utank_hil.dynamics import RollModel, RollShip, Tank

pytestmark = pytest.mark.slow

BARE = without_tank(PATTI_B)


@pytest.fixture(scope="module")
def bare_map():
    return capsize_map(
        "bare", BARE, 0.6, 3e4, np.array([0.0, 3e4, 1e5]), *phase_grid(BARE, 25), 60.0
    )


def test_the_grid_holds_the_whole_basin_but_its_tails():
    """On the upper and lower edge, and on the right edge above and the left edge below, no start
    is safe; the tails of incoming trajectories leave through the other edges."""
    roll, rate = phase_grid(BARE, 25)
    safe = safe_basin(BARE, roll, rate, 60.0)
    assert 0.1 < safe.mean() < 0.6
    assert not safe[rate > 0, -1].any()
    assert not safe[rate < 0, 0].any()
    assert not safe[-1].any()
    assert not safe[0].any()


def test_trajectories_begin_at_the_saddles_and_capsize_or_come_in(bare_map):
    saddles = [e.roll_rad for e in bare_map.equilibria if not e.stable]
    assert len(bare_map.trajectories) == 2 * len(saddles) == 4
    starts = [path[0, 0] for path in bare_map.trajectories]
    np.testing.assert_allclose(starts, np.outer(saddles, (0.98, 1.02)).ravel())
    ends = [abs(path[-1, 0]) > np.pi / 2 for path in bare_map.trajectories]
    assert ends == [False, True, False, True]


def test_area_and_basin_agree_and_fall_with_the_wave(bare_map):
    assert bare_map.area[0] == 1
    assert bare_map.area[0] > bare_map.area[1] > bare_map.area[2]
    coarse = (slice(None, None, 4), slice(None, None, 4))
    counted = bare_map.in_waves[coarse].sum() / bare_map.calm[coarse].sum()
    assert bare_map.area[1] == pytest.approx(counted, rel=1e-12)


def test_a_ship_that_cannot_capsize_is_refused():
    first = RollShip(1.9275e9, 4.81875e8, damping_nms_rad=4.82e7)
    tank = Tank(17.1, 4.88, 17.11, 6.22, lz_m=1.83, damping_ratio=0.1)
    with pytest.raises(ValueError, match="no angle of vanishing stability below 89 degrees"):
        phase_grid(RollModel(first, tank), 25)


def test_the_picture_shows_every_basin(bare_map, tmp_path: Path):
    path = draw_capsize_maps([bare_map, bare_map._replace(name="again")], tmp_path / "a.png", "A")
    pixels = imread(path)[..., :3]
    for color in ((0xDC, 0xE9, 0xF3), (0x7F, 0xB2, 0xD8)):
        near = np.abs(pixels - np.array(color) / 255).max(axis=-1) < 0.01
        assert near.mean() > 0.005
    with pytest.raises(ValueError, match="1 to 8 maps"):
        draw_capsize_maps([], tmp_path / "b.png", "B")
