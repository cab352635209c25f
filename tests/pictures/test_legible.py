"""Flaws put into a picture are found, and a sound one has none."""

import numpy as np
import pytest
from legible import flaws
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

pytestmark = pytest.mark.slow


def sound():
    figure = Figure(figsize=(6.0, 4.0), layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.add_subplot()
    axes.plot([0, 1, 2], [0, 1, 0], color="#D55E00", label="a")
    axes.set_xlabel("Time (s)")
    axes.set_title("Title", loc="left")
    figure.legend(loc="outside lower left")
    return figure


def test_a_sound_picture_has_none():
    assert flaws(sound()) == []


def test_each_flaw_is_found():
    cut, overlapping, covered, ticks, hidden, small, grey = (sound() for _ in range(7))
    cut.text(0.98, 0.5, "a long word")
    overlapping.text(0.5, 0.52, "one")
    overlapping.text(0.51, 0.52, "two")
    covered.axes[0].legend(loc="upper center")
    ticks.axes[0].set_xticks(np.linspace(0, 2, 15), [f"a label {n}" for n in range(15)])
    hidden.axes[0].fill_between([0, 2], [-1, -1], [2, 2], color="white", zorder=9)
    small.text(0.5, 0.6, "tiny", fontsize=5)
    grey.axes[0].plot([0, 1, 2], [1, 0, 1], color="#009E73", label="b")
    for figure, expected in (
        (small, "too small in print: 'tiny'"),
        (grey, "not told apart in grey: a and b"),
        (cut, "cut: 'a long word'"),
        (overlapping, "'one' lies on 'two'"),
        (covered, "a legend covers"),
        (ticks, "ticks overlap: 'a label 0'"),
        (hidden, "not seen: a in Title"),
    ):
        found = flaws(figure)
        assert any(each.startswith(expected) for each in found), (expected, found)
