"""Common style and colours of the figures."""

import io
import json
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from utank_hil.base.provenance import headline
from utank_hil.base.whole_file import write_whole

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from matplotlib.typing import RcKeyType

# Dark grey for the reference, then Okabe and Ito's palette safe for colour-blind readers.
COLORS: Final = (
    "#555555", "#0072B2", "#D55E00", "#009E73", "#CC79A7", "#56B4E9", "#E69F00", "#000000",
)  # fmt: skip
DASHES: Final[tuple[str | tuple[float, tuple[float, ...]], ...]] = (
    "-", "-", (0, (5, 1.5)), (0, (1.5, 1)), (0, (6, 1.5, 1, 1.5)), "-", (0, (4, 1, 1, 1, 1, 1)),
    "-",
)  # fmt: skip
"""Strokes of the curves with these colours, which distinguish them in print without colour."""
DPI: Final = 130
TEXT_PT: Final = 10.0
WIDEST_IN: Final = 10.0  #: Greatest width of a picture; printed on A4, its text has seven points.
BELOW: "Final[dict[str, Any]]" = {"loc": "outside lower left", "ncols": 4, "frameon": False}
"""Arguments that place a legend where it covers no data."""
NO_TANK: Final = "#BBBBBB"
WRONG: Final = "#A40000"
HIGHLIGHT: Final = "#F0E442"
STYLE: "Final[dict[RcKeyType, Any]]" = {
    "font.size": TEXT_PT,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.edgecolor": "#888888",
    "axes.grid": True,
    "grid.color": "#E6E6E6",
    "grid.linewidth": 0.7,
    "axes.axisbelow": True,
    "xtick.color": "#555555",
    "ytick.color": "#555555",
}


@contextmanager
def picture(
    path: Path, title: str, size_in: tuple[float, float], about: Mapping[str, Any] | None = None
) -> "Iterator[Figure]":
    """Yield an empty figure with constrained layout; at the end its title is set and it is written.

    The origin of the data, `about` (`utank_hil.base.provenance`), is the file's text
    ``Description``.
    """
    import matplotlib as mpl
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    with mpl.rc_context(rc=STYLE):
        figure = Figure(figsize=size_in, layout="constrained")
        FigureCanvasAgg(figure)  # pyplot would need a window system and global state
        yield figure
        figure.suptitle(title, x=0.01, ha="left", fontsize=13, fontweight="bold")
        save_figure(figure, path, {} if about is None else {"Description": json.dumps(about)})


def save_figure(figure: "Figure", path: Path, metadata: Mapping[str, str]) -> None:
    """Write a figure as PNG, with the version that drew it and further metadata."""
    drawn = io.BytesIO()
    figure.savefig(drawn, format="png", dpi=DPI, metadata={"Software": headline(), **metadata})
    write_whole(path, drawn.getvalue())
