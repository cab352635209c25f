"""The strokes that may share a plot are told apart in grey and without red or green cones."""

import pytest
from color_vision import LEAST_DIFFERENCE, alike, difference

from utank_hil.pictures.style import COLORS, DASHES
from utank_hil.telemetry.blueprint import _PALETTE, MOST_SHADES, run_color
from utank_hil.telemetry.scene import HULL, LIMIT, PUMP, SEA, TWIN, WATER


def shade(color):
    return tuple(part / 255 for part in color)


def test_differences_are_those_of_the_colour_space():
    for grey in (False, True):
        assert difference("black", "white", grey=grey) == pytest.approx(100.0, abs=0.01)
        assert difference("#777777", "#777777", grey=grey) == 0
    # as light as one another
    orange_and_blue = [("#E69F00", "-"), ("#56B4E9", "-"), ("#56B4E9", "--")]
    assert alike(orange_and_blue, grey=True) == [(0, 1)]
    assert alike(orange_and_blue, grey=False) == []
    # red and green, to who lacks their cones
    assert alike([("#A03C28", "-"), ("#5A5A1E", "-")], grey=False) == [(0, 1)]


@pytest.mark.parametrize("grey", [False, True])
def test_the_runs_of_a_picture_are_told_apart(grey):
    assert alike(list(zip(COLORS, DASHES, strict=True)), grey=grey) == []


def test_the_runs_and_signals_of_a_viewers_plot_are_told_apart():
    assert (
        alike([(shade(run_color(number)), "") for number in range(MOST_SHADES)], grey=False) == []
    )
    signals = list(_PALETTE.values())[1 : 1 + MOST_SHADES]
    assert alike([(shade(color), "") for color in signals], grey=False) == []


def test_the_parts_of_the_ships_section_are_told_apart():
    for one, other in ((WATER, HULL), (WATER, PUMP), (WATER, LIMIT), (HULL, TWIN), (SEA, WATER)):
        assert difference(shade(one), shade(other), grey=False) >= LEAST_DIFFERENCE
    for other in (WATER, HULL):  # the arrow is as wide as the water that it lies in
        assert difference(shade(PUMP), shade(other), grey=True) >= 3 * LEAST_DIFFERENCE
