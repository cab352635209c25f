"""Figures of the source as drawn: legends off the data, nothing cut."""

import numpy as np
import pytest
from matplotlib.figure import Figure as Canvas

from tools.thesis.figure import Curve, Figure, Panel
from tools.thesis.gallery import draw_figure

X = np.linspace(0, 100, 2001)
LONG = tuple(Curve(f"a law with a name of {n} words", X, np.sin(X / (n + 1))) for n in range(4))


@pytest.fixture
def canvas(monkeypatch):
    """The figures that were saved."""
    saved: list[Canvas] = []
    save = Canvas.savefig

    def keep(self, *arguments, **options):
        saved.append(self)
        save(self, *arguments, **options)

    monkeypatch.setattr(Canvas, "savefig", keep)
    return saved


@pytest.mark.evidence("1-1", "2-1", "2-2", "3-1", "3-2")
@pytest.mark.parametrize("columns", [1, 2])
@pytest.mark.parametrize("panels", [1, 2, 3])
def test_legends_stand_off_the_data_and_no_text_is_cut(columns, panels, canvas, tmp_path):
    panel = Panel("A title", "Time (s)", "Roll (°)", LONG, span=(0.0, 9.0), span_label="before")
    path = tmp_path / "x.png"
    draw_figure(Figure("", "", (panel,) * panels, columns=columns), path, "9.9  A figure")
    assert path.stat().st_size > 10_000
    (drawn,) = canvas
    shown = [axis for axis in drawn.axes if axis.get_visible()]
    assert len(shown) == panels
    for axis in shown:  # that nothing is cut, or below a legend, is held for every picture
        assert axis.get_legend().get_window_extent().y0 >= axis.get_window_extent().y1 - 1
