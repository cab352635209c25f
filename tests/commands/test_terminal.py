"""Tables on narrow terminals: nothing is cut; paths are short."""

import io
import os
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st
from rich.table import Table

from utank_hil.console import terminal
from utank_hil.console.terminal import Terminal, new_table, progress_bar, shown, timing_table
from utank_hil.runners import LoopStatistics

CELLS = {"passive": ("2.08", "4.04"), "gpc": ("1.54", "")}


def printed(width: int) -> str:
    table = Table(title="A storm", caption="60 s to 120 s")
    table.add_column("", no_wrap=True)
    for heading in ("roll RMS\n°", "significant\n°"):
        table.add_column(heading, justify="right", no_wrap=True)
    for name, cells in CELLS.items():
        table.add_row(name, *cells)
    output = io.StringIO()
    Terminal(file=output, width=width).table(table)
    return output.getvalue()


@given(st.integers(24, 200))
def test_every_figure_and_heading_is_there_at_any_width(width: int) -> None:
    text = printed(width)
    assert "…" not in text
    for word in ("A storm", "60 s to 120 s", "roll RMS", "significant", *CELLS):
        assert word in text
    for cells in CELLS.values():
        for cell in cells:
            assert cell in text
    assert max(len(line) for line in text.splitlines()) <= width


@pytest.mark.parametrize(("width", "boxed"), [(80, True), (36, True), (35, False)])
def test_it_is_a_table_where_there_is_room(width: int, boxed: bool) -> None:
    assert ("┏" in printed(width)) is boxed


def test_an_empty_cell_has_no_line_of_its_own_in_a_list() -> None:
    text = printed(30)
    assert text.count("significant") == 1
    assert text.count("roll RMS") == 2


def test_what_rich_would_take_for_markup_or_a_picture_is_printed_as_it_is() -> None:
    output = io.StringIO()
    terminal = Terminal(file=output, width=40)
    name = "law [/b] [red] :warning:"
    terminal.say(name)
    terminal.say(f"{name} on a line that is longer than the terminal", red=f"{name}:")
    table = new_table(name, name, names=(name,), caption=name)
    table.add_row(name, name)
    terminal.table(table)
    lines = output.getvalue().splitlines()
    assert lines[:2] == [name, f"{name}: {name} on a line that is longer than the terminal"]
    assert output.getvalue().count(name) >= 6


@pytest.mark.parametrize(
    ("here", "said"),
    [
        ("/etc/utank-hil", "controller.yaml"),
        ("/etc", "utank-hil/controller.yaml"),
        ("/var/log", "/etc/utank-hil/controller.yaml"),
        # a service's directory is the root, where nobody is who reads its journal
        ("/", "/etc/utank-hil/controller.yaml"),
    ],
)
def test_a_path_is_said_as_short_as_it_holds(
    monkeypatch: pytest.MonkeyPatch, here: str, said: str
) -> None:
    monkeypatch.setattr(os, "getcwd", lambda: here)
    assert shown(Path("/etc/utank-hil/controller.yaml")) == said


def test_a_path_elsewhere_has_no_detours(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir("/usr")
    assert shown(tmp_path / "scenarios" / ".." / "gpc.yaml") == str(tmp_path / "gpc.yaml")


def test_a_list_s_long_words_go_on_below_themselves() -> None:
    table = new_table("Retuning", "ended in")
    table.add_column("because")
    reason = "the waves are known from a longer record, 18 minutes; renewed " * 3
    table.add_row("law", "RETUNED", reason.replace("; ", ";\n") + "x" * 40)
    output = io.StringIO()
    Terminal(file=output, width=60).table(table)
    lines = output.getvalue().splitlines()
    begin = next(n for n, line in enumerate(lines) if "because" in line)
    indent = lines[begin].index("the waves")
    assert [line[:indent].strip() for line in lines[begin : begin + 4]] == ["because", "", "", ""]
    assert " ".join(line[indent:] for line in lines[begin:] if line).split() == [
        *reason.split(), "x" * 40
    ]  # fmt: skip
    assert max(map(len, lines)) <= 60


def test_deadlines_of_a_law_with_a_long_name_fit_80_columns() -> None:
    loop = LoopStatistics(ticks=40_993, overruns=9600, skipped=17_338)
    for late_us, lasts_us in ((229, 2163), (413_019, 217_580)):
        loop.lateness.add(1000 * late_us)
        loop.duration.add(1000 * lasts_us)
    said = io.StringIO()
    console = Terminal(file=said, width=80)
    console.table(timing_table({"My yacht, self-tuned": loop}))
    rows = [line.replace("│", " ").split() for line in said.getvalue().splitlines() if "│" in line]
    assert rows[0] == ["My", "yacht,", "self-tuned"]
    assert [row[-1] for row in rows[1:]] == ["9600", "17338"]
    assert rows[1][-2] == "40993"
    assert [row[:2] for row in rows[1:]] == [["wake-up", "late"], ["tick", "lasts"]]


def test_where_no_terminal_is_progress_is_a_line_each_half_minute(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    now_s = [100.0]
    monkeypatch.setattr(terminal.time, "monotonic", lambda: now_s[0])
    with progress_bar() as bar:
        task = bar.add_task("faults", total=147)
        for now_s[0], done in ((129.0, 20), (130.0, 21), (131.0, 22), (159.0, 60), (161.0, 147)):
            bar.update(task, completed=done)
    printed = capsys.readouterr()
    assert printed.out == ""
    assert printed.err.splitlines() == ["faults 14 %", "faults 100 %"]
