"""Layout of the Rerun viewer: plots, their places and colours."""

import itertools
from collections.abc import Iterator, Sequence
from typing import Final

import rerun as rr
import rerun.blueprint as rrb
from rerun.blueprint.encodings import ComponentSourceKind, VisualizerComponentMapping
from rerun.encodings import EntityPath

from utank_hil.telemetry.rerun_log import (
    ARCHETYPE,
    COMPONENT,
    STATE_COLUMNS,
    TIME_COLUMN,
    has_state,
    log_path,
    run_paths,
    state_path,
)
from utank_hil.telemetry.scene import SceneSize, scene_path, words_path
from utank_hil.telemetry.units import UNITS, Field, Unit, field_of
from utank_hil.telemetry.viewer import TIMELINE

HALF_WINDOW_S: Final = 60.0
MOST_SCENES: Final = 4
"""Of several runs, so many ships are shown side by side."""
WATCHED: Final = (
    ("roll_rad", "twin_roll_rad"),
    ("port_level_m", "starboard_level_m"),
    ("pressure_command_pa", "pressure_actual_pa"),
)
"""Columns of the watch's plots."""

# Okabe and Ito's colour-blind safe palette, in an order for a dark background
_PALETTE: Final = (
    (0xB0, 0xB0, 0xB0),
    (0xE6, 0x9F, 0x00),
    (0x56, 0xB4, 0xE9),
    (0x00, 0x9E, 0x73),
    (0xF0, 0xE4, 0x42),
    (0xCC, 0x79, 0xA7),
)

_COLOR_NAMES: Final = ("grey", "orange", "blue", "green", "yellow", "pink")


def make_blueprint(
    columns: Sequence[str],
    runs: Sequence[str],
    span_s: tuple[float, float] | None = None,
    size: SceneSize | None = None,
) -> rrb.Blueprint:
    """Lay out the views of one run, or of several on one time line.

    In the first tab, for the watch, the ship's section rolls beside words and a few plots around
    the cursor. The others, for the engineer, have every signal.

    Parameters
    ----------
    columns : sequence of str
        Telemetry columns, as given to `RunLog`.
    runs : sequence of str
        Names of the runs; with several, a colour stands for a run, else for a signal.
    span_s : (float, float), optional
        First and last time of a finished recording, shown in one tab as a whole and in another
        around the cursor. By default the view is live and follows the newest data.
    size : SceneSize, optional
        Of the scenes, if the runs have any; without, there is no tab for the watch.
    """
    boundary = rr.TimeRangeBoundary
    if span_s is None:
        around = boundary.cursor_relative(seconds=-3 * HALF_WINDOW_S), boundary.cursor_relative()
        pages: list[rrb.Container] = [_page("Live", *around, columns, runs)]
    else:
        first, last = (boundary.absolute(seconds=time_s) for time_s in span_s)
        around = (
            boundary.cursor_relative(seconds=-HALF_WINDOW_S),
            boundary.cursor_relative(seconds=HALF_WINDOW_S),
        )
        pages = [
            _page("Whole run", first, last, columns, runs),
            _page("At the cursor", *around, columns, runs),
        ]
    if size is not None:
        pages.insert(0, _watch(*around, runs, size))
    body = rrb.Tabs(*pages, active_tab=0)
    return rrb.Blueprint(
        body,
        rrb.TimePanel(
            state="collapsed", timeline=TIMELINE, play_state="paused" if span_s else "following"
        ),
        rrb.BlueprintPanel(state="collapsed"),
        rrb.SelectionPanel(state="collapsed"),
    )


def _watch(
    start: rr.TimeRangeBoundary,
    end: rr.TimeRangeBoundary,
    runs: Sequence[str],
    size: SceneSize,
) -> rrb.Container:
    """Lay out the ships, words below them, and the plots that a watch-keeper needs."""
    axis = rrb.TimeAxis(view_range=rr.TimeRange(start=start, end=end))
    bounds = rrb.VisualBounds2D(
        x_range=[-size.reach_m, size.reach_m], y_range=list(size.height_range_m)
    )
    shown = list(zip(run_paths(runs), runs, strict=True))[:MOST_SCENES]
    scenes = [
        rrb.Spatial2DView(origin=scene_path(path), name=run, visual_bounds=bounds)
        for path, run in shown
    ]
    words = [rrb.TextDocumentView(origin=words_path(path), name=run) for path, run in shown]
    if len(shown) == 1:
        plots = [_watched_plot([field_of(name) for name in names], runs, axis) for names in WATCHED]
        ship = rrb.Vertical(*scenes, *words, row_shares=[3, 2])
        return rrb.Horizontal(ship, rrb.Vertical(*plots), column_shares=[1, 1], name="Watch")
    return rrb.Vertical(
        rrb.Horizontal(*scenes),
        rrb.Horizontal(*words),
        _watched_plot([field_of(WATCHED[0][0])], runs[:MOST_SCENES], axis),
        row_shares=[4, 2, 4],
        name="Watch",
    )


def _watched_plot(
    fields: Sequence[Field], runs: Sequence[str], axis: rrb.TimeAxis
) -> rrb.TimeSeriesView:
    """A plot that names its colours in its title: a legend would hide what it is about."""
    plot = _plot(fields[0].unit, fields, runs, axis, legend=False)
    labels = runs if len(runs) > 1 else _short_labels([field.label for field in fields])
    names = _COLOR_NAMES if len(runs) > 1 else _COLOR_NAMES[1:]
    told = ", ".join(
        f"{label or fields[0].label} {name}" for label, name in zip(labels, names, strict=False)
    )
    plot.name = f"{fields[0].unit.plot}: {told}"
    return plot


def _page(
    name: str,
    start: rr.TimeRangeBoundary,
    end: rr.TimeRangeBoundary,
    columns: Sequence[str],
    runs: Sequence[str],
) -> rrb.Vertical:
    """Lay out all plots of a time range: main plots left, others right, states below."""
    axis = rrb.TimeAxis(view_range=rr.TimeRange(start=start, end=end))
    fields = [field_of(c) for c in columns if c not in (TIME_COLUMN, *STATE_COLUMNS)]
    groups = {unit: [field for field in fields if field.unit is unit] for unit in UNITS}
    main = [_plot(u, groups[u], runs, axis, True) for u in UNITS if groups[u] and u.main]
    side = [
        _plot(u, groups[u], runs, axis, len(runs) == 1) for u in UNITS if groups[u] and not u.main
    ]
    halves = [rrb.Vertical(*plots) for plots in (main, side) if plots]
    rows: list[rrb.Container | rrb.View] = [
        rrb.Horizontal(*halves, column_shares=[2, 1][: len(halves)])
    ]
    shares = [100]
    if has_state(columns):
        paths = run_paths(runs)
        lanes = [state_path(path) for path in paths]
        rows.append(
            rrb.Horizontal(
                rrb.StateTimelineView(contents=lanes, name="Mode and fault", time_view=axis),
                rrb.TextLogView(contents=[log_path(path) for path in paths], name="Events"),
                column_shares=[2, 1],
            )
        )
        shares.append(15 + 5 * len(runs))
    return rrb.Vertical(*rows, row_shares=shares, name=name)


def _plot(
    unit: Unit, fields: Sequence[Field], runs: Sequence[str], axis: rrb.TimeAxis, legend: bool
) -> rrb.TimeSeriesView:
    """Plot every field of a unit, of every run."""
    labels = _short_labels([field.label for field in fields])
    overrides: dict[EntityPath | str, list[rrb.Visualizer]] = {
        path: [
            _line(field, f"{run} {label}" if len(runs) > 1 else label or field.label, color)
            for field, label, color in zip(fields, labels, _colors(number, runs), strict=False)
        ]
        for number, (path, run) in enumerate(zip(run_paths(runs), runs, strict=True))
    }
    return rrb.TimeSeriesView(
        contents=run_paths(runs),
        overrides=overrides,
        name=unit.plot,
        axis_x=axis,
        plot_legend=rrb.PlotLegend(rrb.Corner2D.LeftTop, visible=legend),
    )


def _short_labels(labels: Sequence[str]) -> list[str]:
    """Drop the words that all labels of a plot share: its title has them."""
    words = [label.split() for label in labels]
    shared = set(words[0]).intersection(*words)
    return [" ".join(word for word in label if word not in shared) for label in words]


def _line(field: Field, name: str, color: tuple[int, int, int]) -> rrb.Visualizer:
    """Draw one field of a run's struct as a line."""
    source = VisualizerComponentMapping(
        "Scalars:scalars",
        ComponentSourceKind.SourceComponent,
        source_component=f"{ARCHETYPE}:{COMPONENT}",
        selector=f".{field.name}",
    )
    return rr.SeriesLines(
        names=name,
        colors=color,
        widths=1.5,
        aggregation_policy="MinMax",  # zoomed out, show the peaks, not their average
    ).visualizer(mappings=[source])


def _colors(run: int, runs: Sequence[str]) -> Iterator[tuple[int, int, int]]:
    """Colour by signal; with several runs by run, darker from signal to signal."""
    if len(runs) == 1:
        yield from itertools.cycle(_PALETTE[1:])
    for strength in itertools.chain((1.0, 0.6), itertools.repeat(0.35)):
        red, green, blue = (round(part * strength) for part in _PALETTE[run % len(_PALETTE)])
        yield red, green, blue
