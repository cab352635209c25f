"""The blueprint: every column is to be seen, once a page, and mode and fault as a lane."""

from collections.abc import Iterator
from typing import Any

import pytest
import rerun.blueprint as rrb

from utank_hil.runtime.signals import SIGNALS
from utank_hil.telemetry.blueprint import make_blueprint
from utank_hil.telemetry.units import field_of

COLUMNS = (*SIGNALS, "true_roll_rad", "wave_moment_nm")
SHOWN = sorted(field_of(c).name for c in COLUMNS if c not in ("time_s", "mode", "fault"))


def views(part: rrb.Container | rrb.View) -> Iterator[rrb.View]:
    if isinstance(part, rrb.View):
        yield part
    else:
        for child in part.contents:
            yield from views(child)


def plotted(view: rrb.View, path: str) -> list[str]:
    """Names of the fields a plot draws of a run."""
    lines: Any = dict(view.visualizer_overrides)[path]
    return [mapping.selector.removeprefix(".") for line in lines for mapping in line.mappings]


@pytest.mark.parametrize("runs", [["live"], ["passive", "dpc", "gpc"]])
def test_every_column_of_every_run_is_plotted_once_a_page(runs: list[str]) -> None:
    pages = list(make_blueprint(COLUMNS, runs, span_s=(0.0, 60.0)).root_container.contents)
    assert len(pages) == 2
    for page in pages:
        plots = [view for view in views(page) if isinstance(view, rrb.TimeSeriesView)]
        for number, run in enumerate(runs, start=1):
            names = [name for plot in plots for name in plotted(plot, f"/{number}/{run}")]
            assert sorted(names) == SHOWN
        lanes = [view for view in views(page) if isinstance(view, rrb.StateTimelineView)]
        assert len(lanes) == 1
        (log,) = (view for view in views(page) if isinstance(view, rrb.TextLogView))
        assert log.contents == [f"/{number}/{run}/log" for number, run in enumerate(runs, start=1)]


def test_the_live_page_follows_and_a_recording_stands_still() -> None:
    live = make_blueprint(COLUMNS, ["live"])
    still = make_blueprint(COLUMNS, ["live"], span_s=(0.0, 60.0))
    assert live.time_panel.play_state == "following"
    assert still.time_panel.play_state == "paused"


def test_a_table_without_states_or_loop_signals_has_a_blueprint_too() -> None:
    body = make_blueprint(["time_s", "roll_rad"], ["a"], span_s=(0.0, 1.0)).root_container
    assert [view.name for view in views(body)] == ["Roll, °", "Roll, °"]
