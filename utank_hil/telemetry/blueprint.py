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
    TIMELINE,
    has_state,
    log_path,
    run_paths,
    state_path,
)
from utank_hil.telemetry.units import UNITS, Field, Unit, field_of

HALF_WINDOW_S: Final = 60.0

# Okabe and Ito's colour-blind safe palette, in an order for a dark background
_PALETTE: Final = (
    (0xB0, 0xB0, 0xB0),
    (0xE6, 0x9F, 0x00),
    (0x56, 0xB4, 0xE9),
    (0x00, 0x9E, 0x73),
    (0xF0, 0xE4, 0x42),
    (0xCC, 0x79, 0xA7),
)


def make_blueprint(
    columns: Sequence[str], runs: Sequence[str], span_s: tuple[float, float] | None = None
) -> rrb.Blueprint:
    """Lay out the plots of one run, or of several on one time line.

    Parameters
    ----------
    columns : sequence of str
        Telemetry columns, as given to `RunLog`.
    runs : sequence of str
        Names of the runs; with several, a colour stands for a run, else for a signal.
    span_s : (float, float), optional
        First and last time of a finished recording, shown in one tab as a whole and in another
        around the cursor. By default the view is live and follows the newest data.
    """
    boundary = rr.TimeRangeBoundary
    body: rrb.Container
    if span_s is None:
        since = boundary.cursor_relative(seconds=-2 * HALF_WINDOW_S)
        body = _page("Live", since, boundary.cursor_relative(), columns, runs)
    else:
        first, last = (boundary.absolute(seconds=time_s) for time_s in span_s)
        before, after = (
            boundary.cursor_relative(seconds=seconds) for seconds in (-HALF_WINDOW_S, HALF_WINDOW_S)
        )
        body = rrb.Tabs(
            _page("Whole run", first, last, columns, runs),
            _page("At the cursor", before, after, columns, runs),
        )
    return rrb.Blueprint(
        body,
        rrb.TimePanel(
            state="collapsed", timeline=TIMELINE, play_state="paused" if span_s else "following"
        ),
        rrb.BlueprintPanel(state="collapsed"),
        rrb.SelectionPanel(state="collapsed"),
    )


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
