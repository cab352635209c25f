"""The blueprint: every column is to be seen, once a page, and mode and fault as a lane."""

from typing import Any

import pytest
import rerun.blueprint as rrb

from utank_hil.nodes.signals import SIGNALS
from utank_hil.telemetry.blueprint import (
    _COLOR_NAMES,
    ESTIMATES,
    MOST_SHADES,
    PARTS,
    columns_of,
    make_blueprint,
)
from utank_hil.telemetry.rerun_log import run_paths
from utank_hil.telemetry.scene import SceneSize
from utank_hil.telemetry.units import field_of

SIZE = SceneSize(17.0, 5.0, 2.0, 4.0, 5e4)
COLUMNS = (*SIGNALS, "true_roll_rad", "wave_moment_nm")
SHOWN = sorted(field_of(c).name for c in COLUMNS if c not in ("time_s", "mode", "fault"))


def views(part):
    if isinstance(part, rrb.View):
        yield part
    else:
        for child in part.contents:
            yield from views(child)


def plotted(view, path):
    """Names of the fields a plot draws of a run."""
    lines: Any = dict(view.visualizer_overrides).get(path, [])
    return [mapping.selector.removeprefix(".") for line in lines for mapping in line.mappings]


def plots_of(page):
    return [view for view in views(page) if isinstance(view, rrb.TimeSeriesView)]


RUNS = ["live"], ["passive", "dpc", "gpc"], ["passive", "a", "b", "c", "d", "e"]


@pytest.mark.parametrize("runs", RUNS, ids=len)
def test_every_column_of_every_run_is_plotted_once_a_range(runs):
    pages = list(make_blueprint(COLUMNS, runs, span_s=(0.0, 60.0)).root_container.contents)
    assert len(pages) == 2 * -(-len(runs) // MOST_SHADES)
    for start in ("At the cursor", "Whole run"):
        here = [page for page in pages if page.name.startswith(start)]
        plots = [plot for page in here for plot in plots_of(page)]
        for path in run_paths(runs):
            assert sorted(name for plot in plots for name in plotted(plot, path)) == SHOWN
    logs = [view for page in pages[: len(pages) // 2] for view in views(page)
            if isinstance(view, rrb.TextLogView)]  # fmt: skip
    assert sorted(path for view in logs for path in view.contents) == [
        f"{path}/log" for path in run_paths(runs)
    ]


@pytest.mark.parametrize("runs", RUNS, ids=len)
def test_no_plot_has_a_legend_or_too_many_shades_and_titles_name_each(runs):
    blueprint = make_blueprint(COLUMNS, runs, span_s=(0.0, 60.0), size=SIZE)
    for plot in plots_of(blueprint.root_container):
        legend: Any = plot.properties["PlotLegend"]
        assert not legend.visible.as_arrow_array()[0].as_py()
        lines = [each for group in plot.visualizer_overrides.values() for each in group]
        assert 1 <= len(lines) <= MOST_SHADES
        if len(lines) > 1:
            assert sum(plot.name.count(color) for color in _COLOR_NAMES) == len(lines), plot.name


def test_what_is_zero_throughout_is_left_out():
    zero = {("a", "overruns"), ("a", "pump_power_w"), ("b", "pump_power_w")}
    page = make_blueprint(COLUMNS, ["a", "b"], zero=zero).root_container.contents[0]
    for path, missing in (("/1/a", {"overruns", "pump_power_kw"}), ("/2/b", {"pump_power_kw"})):
        names = [name for plot in plots_of(page) for name in plotted(plot, path)]
        assert sorted(names) == sorted(set(SHOWN) - missing)


def test_what_the_ship_has_not_is_not_shown():
    vessel = {"pump": {}, "valve": None}
    about = {"configuration": {"vessel": vessel, "sea_estimate": None}}
    assert set(COLUMNS) - set(columns_of(COLUMNS, about)) == {"valve_opening", *ESTIMATES}
    assert columns_of(COLUMNS, None) == list(COLUMNS)
    assert set(ESTIMATES) | {name for part in PARTS.values() for name in part} <= set(SIGNALS)


def test_the_live_page_follows_and_a_recording_stands_still():
    live = make_blueprint(COLUMNS, ["live"])
    still = make_blueprint(COLUMNS, ["live"], span_s=(0.0, 60.0))
    assert live.time_panel.play_state == "following"
    assert still.time_panel.play_state == "paused"


def test_a_table_without_states_or_loop_signals_has_a_blueprint_too():
    body = make_blueprint(["time_s", "roll_rad"], ["a"], span_s=(0.0, 1.0)).root_container
    assert [view.name for view in views(body)] == ["Roll, °", "Roll, °"]
