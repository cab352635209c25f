"""Layout of the Rerun viewer: plots, their places and colours."""

from collections.abc import Collection, Mapping, Sequence
from typing import Any, Final

import rerun as rr
import rerun.blueprint as rrb
from rerun.blueprint.encodings import ComponentSourceKind, VisualizerComponentMapping
from rerun.encodings import EntityPath

from utank_hil.telemetry import rerun_log
from utank_hil.telemetry.scene import SceneSize
from utank_hil.telemetry.units import UNITS, Field, field_of
from utank_hil.telemetry.viewer import TIMELINE

HALF_WINDOW_S: Final = 60.0  #: Half the width of the plots around the cursor: some ten rolls.
MOST_SHADES: Final = 4  #: Most lines of a plot, and most ships that are shown side by side.
WATCH_SHARES: Final = {1: (5, 4), MOST_SHADES: (5, 7, 4)}
"""Relative heights of ships, words and plot, for one ship and for several, such that no remedy of a
fault is cut off."""
_ROLL: Final = ("Roll, °", ("roll_rad", "twin_roll_rad", "true_roll_rad"))
_LEVEL: Final = ("Tank level, m", ("port_level_m", "starboard_level_m", "true_level_m"))
_PRESSURE: Final = (
    "Pump pressure, kPa", ("pressure_command_pa", "pressure_actual_pa", "true_pressure_pa"),
)  # fmt: skip
WATCHED: Final = tuple((title, names[:2]) for title, names in (_ROLL, _LEVEL, _PRESSURE))
"""Titles and columns of the watch's plots."""
PARTS: Final = {
    "valve": ("valve_opening",),
    "pump": ("pressure_command_pa", "pressure_actual_pa", "pump_power_w"),
}  #: Columns of parts that a ship may lack.
ESTIMATES: Final = (
    "sea_verdict", "significant_height_m", "peak_period_s", "wave_moment_rms_rad",
    "wave_moment_deviation", "sea_age_s", "ship_verdict", "roll_period_s",
    "roll_period_deviation_s", "gm_m", "gm_deviation_m", "ship_age_s",
)  # fmt: skip
OTHERS: Final = "Others"
SUBJECTS: Final[dict[str, tuple[tuple[str, tuple[str, ...]], ...]]] = {
    "Motion": (
        _ROLL,
        ("Roll, RMS, °", ("roll_rms_rad", "twin_roll_rms_rad")),
        ("Roll rate, °/s", ("roll_rate_rad_s",)),
    ),
    "Tank and pump": (
        _LEVEL,
        _PRESSURE,
        ("Pump power, kW", ("pump_power_w", "true_shaft_power_w")),
        ("Valve opening, %", ("valve_opening",)),
    ),
    "Sea and ship": (
        ("Wave moment, MN m", ("wave_moment_nm",)),
        ("Significant wave height, m", ("significant_height_m",)),
        ("Wave peak period, s", ("peak_period_s",)),
        ("Roll period and its deviation, s", ("roll_period_s", "roll_period_deviation_s")),
        ("GM and its deviation, m", ("gm_m", "gm_deviation_m")),
    ),
    "Loop and bus": (
        ("Loop timing, ms", ("wakeup_lateness_s", "tick_duration_s")),
        ("Overruns", ("overruns",)),
        ("Bus load, %", ("bus_load",)),
    ),
}  #: Plots of the engineer's tabs: title and columns; the first column is shown for several runs.
# This is Okabe and Ito's colour-blind safe palette, in an order for a dark background.
_PALETTE: Final = {
    "grey": (0xB0, 0xB0, 0xB0),
    "orange": (0xE6, 0x9F, 0x00),
    "blue": (0x56, 0xB4, 0xE9),
    "green": (0x00, 0x9E, 0x73),
    "yellow": (0xF0, 0xE4, 0x42),
    "pink": (0xCC, 0x79, 0xA7),
}
_COLOR_NAMES: Final = tuple(_PALETTE)


def make_blueprint(
    columns: Sequence[str],
    runs: Sequence[str],
    span_s: tuple[float, float] | None = None,
    size: SceneSize | None = None,
    zero: Collection[tuple[str, str]] = (),
) -> rrb.Blueprint:
    """Lay out the views of one run, or of several on one time line.

    The first tab, for the watch, has the ships, words and a few plots around the cursor; without a
    `size` there is none. The others, for the engineer, have every signal by subject. A colour
    stands for a run if there are several, else for a signal. `span_s` is the first and last time of
    a finished recording, shown as a whole and around the cursor; by default the view follows the
    newest data. `zero` are run and column of signals that are zero throughout and are not plotted.
    """
    if span_s is None:
        around = _axis(-3 * HALF_WINDOW_S, 0.0)
        axes = {"Live": around}
    else:
        first, last = (rr.TimeRangeBoundary.absolute(seconds=time_s) for time_s in span_s)
        whole = rrb.TimeAxis(view_range=rr.TimeRange(start=first, end=last))
        around = _axis(-HALF_WINDOW_S, HALF_WINDOW_S)
        axes = {"At the cursor": around, "Whole run": whole}
    pages: list[rrb.Container] = []
    if size is not None:
        pages.append(_watch(around, runs, size))
    for name, axis in axes.items():
        for first_run in range(0, len(runs), MOST_SHADES):
            shown = range(first_run, min(first_run + MOST_SHADES, len(runs)))
            beside = "" if len(runs) <= MOST_SHADES else f": {', '.join(runs[i] for i in shown)}"
            pages.append(_subjects(f"{name}{beside}", axis, columns, runs, shown, zero))
    return rrb.Blueprint(
        rrb.Tabs(*pages, active_tab=0),
        rrb.TimePanel(
            state="collapsed", timeline=TIMELINE, play_state="paused" if span_s else "following"
        ),
        rrb.BlueprintPanel(state="collapsed"),
        rrb.SelectionPanel(state="collapsed"),
    )


def _axis(from_s: float, to_s: float) -> rrb.TimeAxis:
    from_to = (rr.TimeRangeBoundary.cursor_relative(seconds=each) for each in (from_s, to_s))
    return rrb.TimeAxis(view_range=rr.TimeRange(*from_to))


def columns_of(columns: Sequence[str], about: Mapping[str, Any] | None) -> list[str]:
    """Return the columns without those of parts that the recorded ship or controller lacks."""
    configuration = (about or {}).get("configuration", {})
    vessel = configuration.get("vessel") or {}
    missing = {
        name for part in PARTS if part in vessel and vessel[part] is None for name in PARTS[part]
    }
    if "sea_estimate" in configuration and configuration["sea_estimate"] is None:
        missing.update(ESTIMATES)
    return [column for column in columns if column not in missing]


def _watch(axis: rrb.TimeAxis, runs: Sequence[str], size: SceneSize) -> rrb.Container:
    across_m, upright_m = [-size.reach_m, size.reach_m], list(size.height_range_m)
    bounds = rrb.VisualBounds2D(x_range=across_m, y_range=upright_m)
    shown = list(zip(rerun_log.run_paths(runs), runs, strict=True))[:MOST_SHADES]
    scenes = [
        rrb.Spatial2DView(origin=f"{path}/scene", name=run, visual_bounds=bounds)
        for path, run in shown
    ]
    words = [rrb.TextDocumentView(origin=f"{path}/words", name=run) for path, run in shown]
    if len(shown) == 1:
        plots = [
            _plot(title, [field_of(name) for name in names], runs, range(1), axis)
            for title, names in WATCHED
        ]
        ship = rrb.Vertical(*scenes, *words, row_shares=WATCH_SHARES[1])
        return rrb.Horizontal(ship, rrb.Vertical(*plots), column_shares=[1, 1], name="Watch")
    return rrb.Vertical(
        rrb.Horizontal(*scenes),
        rrb.Horizontal(*words),
        _plot(WATCHED[0][0], [field_of("roll_rad")], runs, range(len(shown)), axis),
        row_shares=WATCH_SHARES[MOST_SHADES],
        name="Watch",
    )


def _subjects(
    name: str,
    axis: rrb.TimeAxis,
    columns: Sequence[str],
    runs: Sequence[str],
    shown: range,
    zero: Collection[tuple[str, str]],
) -> rrb.Container:
    """Lay out all plots of a time range, one tab per subject, with states and events below."""
    left = {
        column: [i for i in shown if (runs[i], column) not in zero]
        for column in columns
        if column not in (rerun_log.TIME_COLUMN, *rerun_log.STATE_COLUMNS)
    }
    left = {column: those for column, those in left.items() if those}
    paths = [rerun_log.run_paths(runs)[i] for i in shown]
    tabs: list[rrb.Container | rrb.View] = []
    for subject, plots in SUBJECTS.items():
        views: list[rrb.View] = []
        for title, wanted in plots:
            fields = [field_of(column) for column in wanted if column in left]
            if len(shown) > 1:
                fields = fields[:1]  # The other fields have plots of their own.
            if fields:
                views.append(_plot(title, fields, runs, left[fields[0].column], axis))
            for field in fields:
                del left[field.column]
        if views:
            tabs.append(rrb.Vertical(*views, name=subject))
    others = _others({field_of(column): those for column, those in left.items()}, runs, axis)
    if others:
        tabs.append(rrb.Grid(*others, name=OTHERS))
    rows: list[rrb.Container | rrb.View] = [rrb.Tabs(*tabs, active_tab=0)] if tabs else []
    if rerun_log.has_state(columns):
        lanes = [
            f"{path}/{lane}" for path in paths for lane in (rerun_log.STATE, rerun_log.RETUNING)
        ]
        title = "Mode and fault, retuning"
        states = rrb.StateTimelineView(contents=lanes, name=title, time_view=axis)
        events = rrb.TextLogView(
            contents=[f"{path}/{rerun_log.LOG}" for path in paths], name="Events"
        )
        rows.append(rrb.Horizontal(states, events, column_shares=[2, 1]))
    return rrb.Vertical(*rows, row_shares=[100, 14 + 5 * len(shown)][: len(rows)], name=name)


def _others(
    fields: Mapping[Field, Sequence[int]], runs: Sequence[str], axis: rrb.TimeAxis
) -> list[rrb.View]:
    """Return plots of the remaining signals: one per unit, or for several runs one per signal."""
    most = MOST_SHADES if len(runs) == 1 else 1
    groups = [[field for field in fields if field.unit.plot == plot]
              for plot in dict.fromkeys(unit.plot for unit in UNITS)]  # fmt: skip
    return [
        _plot(group[0].unit.plot, group[first : first + most], runs, fields[group[first]], axis)
        for group in groups
        for first in range(0, len(group), most)
    ]


def _plot(
    title: str,
    fields: Sequence[Field],
    runs: Sequence[str],
    shown: Sequence[int],
    axis: rrb.TimeAxis,
) -> rrb.TimeSeriesView:
    """Plot fields of runs, or of one; the title names the colours: a legend would cover data."""
    paths = rerun_log.run_paths(runs)
    if len(runs) > 1:
        colors = {i: [run_color(i)] for i in shown}
        named = [(runs[i], _COLOR_NAMES[i % MOST_SHADES]) for i in shown]
    else:
        colors = {0: list(_PALETTE.values())[1:]}
        labels = _short_labels([field.label for field in fields])
        named = list(zip(labels, _COLOR_NAMES[1:], strict=False))
        named = [(label, color) for label, color in named if label]
    overrides: dict[EntityPath | str, list[rrb.Visualizer]] = {
        paths[i]: [
            _line(field, f"{runs[i]} {field.label}", color)
            for field, color in zip(fields, colors[i], strict=False)
        ]
        for i in shown
    }
    if len(runs) > 1 and title == fields[0].unit.plot:
        title = f"{fields[0].label}: {title}"
    key = ", ".join(f"{label} {color}" for label, color in named)
    return rrb.TimeSeriesView(
        contents=[paths[i] for i in shown],
        overrides=overrides,
        name=f"{title}: {key}" if key else title,
        axis_x=axis,
        plot_legend=rrb.PlotLegend(visible=False),
    )


def _short_labels(labels: Sequence[str]) -> list[str]:
    """Drop the words that all labels of a plot share; the title has them."""
    words = [label.split() for label in labels]
    shared = set(words[0]).intersection(*words)
    short = [" ".join(word for word in label if word not in shared) for label in words]
    return [label or "measured" for label in short] if len(short) > 1 else short


def _line(field: Field, name: str, color: tuple[int, int, int]) -> rrb.Visualizer:
    source = VisualizerComponentMapping(
        "Scalars:scalars",
        ComponentSourceKind.SourceComponent,
        source_component=f"{rerun_log.ARCHETYPE}:{rerun_log.COMPONENT}",
        selector=f".{field.name}",
    )
    return rr.SeriesLines(
        names=name,
        colors=color,
        widths=1.5,
        aggregation_policy="MinMax",  # Peaks, not averages, are shown when zoomed out.
    ).visualizer(mappings=[source])


def run_color(number: int) -> tuple[int, int, int]:
    """Return the colour of a run among several, counted from 0; the reference is grey."""
    return _PALETTE[_COLOR_NAMES[number % MOST_SHADES]]
