"""What is wrong with a picture, found in its pixels and in the boxes of its texts.

`conftest` has every picture that a test draws looked at.
"""

from itertools import combinations, pairwise

import numpy as np
from color_vision import alike
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.colors import to_rgb
from matplotlib.legend import Legend
from matplotlib.text import Text
from matplotlib.transforms import Bbox

SLACK_PX = 1.5
COLOR_SLACK = 0.06
TINT = 0.4
A4_IN = 180 / 25.4
"""Width between margins of 15 mm."""
LEAST_PRINTED_PT = 6.0
LEAST_LINE = 1.0
"""Width in points of a line whose colour must be seen: a thinner one is mixed with its ground."""


def flaws(figure):
    """Texts cut, too small, on one another; legends on data; curves not seen or not told apart."""
    image = drawn(figure)
    engine = figure.get_layout_engine()
    figure.set_layout_engine("none")  # what is hidden below must not move the rest
    found = [f"cut: {name!r}" for name, box in _texts(figure) if not _inside(box, figure)]
    found += [
        f"{one!r} lies on {other!r}"
        for (one, first), (other, second) in combinations(_texts(figure), 2)
        if _common(first, second)
    ]
    found += [
        f"ticks overlap: {one.get_text()!r}, {other.get_text()!r}"
        for axes in figure.axes
        for axis in (axes.xaxis, axes.yaxis)
        for one, other in pairwise(_tick_labels(axis))
        if _common(one.get_window_extent(), other.get_window_extent())
    ]
    printed = min(1.0, A4_IN / figure.get_figwidth())
    found += [
        f"too small in print: {text.get_text()!r}"
        for text in figure.findobj(Text)
        if text.get_text().strip() and text.get_fontsize() * printed < LEAST_PRINTED_PT
    ]
    found += [f"not seen: {name}" for name in _not_seen(figure, image)]
    found += [f"not told apart in grey: {names}" for names in _alike(figure)]
    found += [f"a legend covers {count} pixels of data" for count in _covered(figure) if count]
    figure.set_layout_engine(engine)
    return found


def drawn(figure):
    """The picture's pixels, shape (rows, columns, 3), 0 to 1."""
    canvas = figure.canvas
    assert isinstance(canvas, FigureCanvasAgg)
    canvas.draw()
    return np.asarray(canvas.buffer_rgba())[..., :3] / 255


def _texts(figure):
    """Words and boxes of what is written, but for tick labels."""
    ticks = {
        label
        for axes in figure.axes
        for axis in (axes.xaxis, axes.yaxis)
        for which in ("major", "minor")
        for label in axis.get_ticklabels(which=which)
    }
    return [
        (text.get_text(), text.get_window_extent())
        for text in figure.findobj(Text)
        if text.get_visible() and text.get_text().strip() and text not in ticks
        and not _hidden_offset(text, figure)
    ]  # fmt: skip


def _hidden_offset(text, figure):
    """Whether it belongs to axes that are not drawn."""
    return any(
        text in axes.findobj(Text) and not (axes.get_visible() and axes.axison)
        and text not in axes.texts and text is not axes.title
        for axes in figure.axes
    )  # fmt: skip


def _tick_labels(axis):
    """The labels that are drawn, in order."""
    low, high = sorted(axis.get_view_interval())
    return [
        label
        for place, label in zip(axis.get_majorticklocs(), axis.get_ticklabels(), strict=False)
        if label.get_visible() and label.get_text() and low <= place <= high
    ]


def _inside(box, figure):
    return bool(
        box.x0 >= -SLACK_PX
        and box.y0 >= -SLACK_PX
        and box.x1 <= figure.bbox.width + SLACK_PX
        and box.y1 <= figure.bbox.height + SLACK_PX
    )


def _common(one, other):
    common = Bbox.intersection(one, other)
    return common is not None and min(common.width, common.height) > SLACK_PX


def _data(axes):
    """What is drawn of numbers; a tint of the ground is none."""
    artists = [*axes.lines, *axes.patches, *axes.collections, *axes.images]
    return [artist for artist in artists if (artist.get_alpha() or 1.0) > TINT]


def _not_seen(figure, image):
    """Curves without a pixel of their colour within their axes."""
    for axes in figure.axes:
        part = _cut_out(image, axes.get_window_extent())
        for line in axes.lines:
            x, y = (np.asarray(data, dtype=float) for data in line.get_data())
            (left, right), (low, high) = sorted(axes.get_xlim()), sorted(axes.get_ylim())
            within = (x >= left) & (x <= right) & (y >= low) & (y <= high)
            plain = line.get_linestyle() == "-" and line.get_linewidth() >= LEAST_LINE
            if not within.any() or not plain or line.get_alpha() not in (None, 1.0):
                continue
            if np.ptp(x[within]) < 0.005 * (right - left):
                continue  # an upright stroke may lie below another's, or the axis
            if any(_same(line, other) for other in axes.lines if other is not line):
                continue  # of two that are equal one lies on the other
            if np.abs(part - to_rgb(line.get_color())).max(axis=-1).min() > COLOR_SLACK:
                yield f"{line.get_label()} in {axes.get_title(loc='left') or axes.get_ylabel()}"


def _alike(figure):
    """Named curves of one plot that differ in colour alone, and not enough for grey."""
    for axes in figure.axes:
        lines = [line for line in axes.lines if not str(line.get_label()).startswith("_")]
        strokes = [(line.get_color(), (*_dashes(line), line.get_marker())) for line in lines]
        for i, j in alike(strokes, grey=True):
            if not _same(lines[i], lines[j]):
                yield f"{lines[i].get_label()} and {lines[j].get_label()}"


def _dashes(line):
    """Strokes and gaps of a line; none of one that has no line."""
    offset, strokes = line._unscaled_dash_pattern
    return line.get_linestyle(), offset, *(strokes or ())


def _same(one, other):
    first, second = (np.asarray(line.get_xydata(), dtype=float) for line in (one, other))
    return first.shape == second.shape and np.allclose(first, second, rtol=1e-3, equal_nan=True)


def _covered(figure):
    """Pixels of data below each legend."""
    data = [artist for axes in figure.axes for artist in _data(axes) if artist.get_visible()]
    grounds = [axes.get_window_extent() for axes in figure.axes]
    grounds += [artist.get_window_extent() for artist in data if not artist.get_clip_on()]
    legends = [
        each
        for each in figure.findobj(Legend)
        if each.get_visible() and any(_common(each.get_window_extent(), box) for box in grounds)
    ]
    boxes = [legend.get_window_extent() for legend in legends]
    if not legends:
        return
    _show(legends, visible=False)
    with_data = drawn(figure)
    _show(data, visible=False)
    without = drawn(figure)
    _show([*legends, *data], visible=True)
    for box in boxes:
        differs = np.abs(_cut_out(with_data, box) - _cut_out(without, box)).max(axis=-1)
        yield int((differs > COLOR_SLACK).sum())


def _show(artists, *, visible):
    for artist in artists:
        artist.set_visible(visible)


def _cut_out(image, box):
    """The pixels within a box, whose rows count from below."""
    left, right = max(round(box.x0), 0), round(box.x1) + 1
    top, bottom = max(len(image) - round(box.y1) - 1, 0), max(len(image) - round(box.y0), 1)
    return image[top:bottom, left:right]
