"""What the commands print for people: text as it is, and tables at any width."""

import os
import re
import shlex
import textwrap
import time
from collections.abc import Iterable, Mapping
from contextlib import AbstractContextManager, nullcontext, suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from rich.console import Console, ConsoleOptions, RenderableType
from rich.measure import Measurement
from rich.segment import Segment
from rich.table import Table
from rich.text import Text

if TYPE_CHECKING:
    from rich.progress import Progress, ProgressColumn

    from utank_hil.runners import LoopStatistics

_STEERS: Final = re.compile("[\0-\b\v-\x1f\x7f-\x9f\u202a-\u202e\u2066-\u2069]")
UNLIMITED: Final = 10_000  #: Columns, wider than any table.


INTERFACES: Final = Path("/sys/class/net")  #: Where Linux lists the network's interfaces.
_CAN: Final = "280"  # ARPHRD_CAN of <linux/if_arp.h>
_ALLOW_CODE: Final = frozenset({"bench", "campaign", "run"})  #: Commands with that option.
Command = tuple[str | Path, ...]


def run_command(controller: Path) -> list[Command]:
    """Return the command that runs a controller on this machine's CAN interface, if it has one."""
    kinds = {path.parent.name: path.read_text().strip() for path in INTERFACES.glob("*/type")}
    buses = sorted(name for name, kind in kinds.items() if kind == _CAN)
    return [("run", controller, "--bus", bus) for bus in buses[:1]]


def shown(path: Path) -> str:
    """A path as short as it can be said from here; whole in the root, a service's directory."""
    relative = os.path.relpath(path)
    outside = relative.startswith("..") or os.getcwd() == os.sep
    return os.path.normpath(path) if outside else relative


def new_table(
    title: str | None, *figures: str, names: Iterable[str] = ("",), caption: str | None = None
) -> Table:
    """A table without rows: columns of names to the left, of figures to the right."""
    table = Table(title=title, caption=caption)
    for heading in names:
        table.add_column(heading, no_wrap=True)
    for heading in figures:
        table.add_column(heading, justify="right", no_wrap=True)
    return table


def rows_table(
    title: str | None, rows: Iterable[tuple[str, str]], *, caption: str | None = None
) -> Table:
    """A table of names and their values, without headings."""
    table = new_table(title, "", caption=caption)
    table.show_header = False
    for name, value in rows:
        table.add_row(name, value)
    return table


class Terminal(Console):
    """Rich's console without its markup: names and paths are the user's, brackets and all."""

    def __init__(self, **options: Any) -> None:
        super().__init__(markup=False, emoji=False, highlight=False, **options)

    def render(
        self, renderable: RenderableType, options: ConsoleOptions | None = None
    ) -> Iterable[Segment]:
        """Yield what is shown; texts of files can't steer the terminal."""
        for segment in super().render(renderable, options):
            if segment.control:
                yield segment
            else:
                yield Segment(_STEERS.sub("\N{REPLACEMENT CHARACTER}", segment.text), segment.style)

    def say(self, text: str = "", *, red: str = "", yellow: str = "", green: str = "") -> None:
        """Print a line, however long, after words in a colour."""
        colours = {"red": red, "yellow": yellow, "green": green}
        parts = [Text(words, colour) for colour, words in colours.items() if words]
        self.print(*parts, *([text] if text or not parts else []), soft_wrap=True)

    def busy(self, words: str) -> AbstractContextManager[object]:
        """Show on a terminal what is being done."""
        return self.status(Text(words)) if self.is_terminal else nullcontext()

    def files(self, files: Mapping[str, Path]) -> None:
        """Print which files were written, by what they hold."""
        for name, path in files.items():
            self.say(f"{name:>10}: {shown(path)}")

    def lead_on(self, *commands: Command, allow_code: bool = False) -> None:
        """Print which commands come next, by their words, as they can be pasted into a shell.

        With `allow_code` those that design a law get the word, without which they refuse one that
        is code.
        """
        if commands:
            self.say("Next:")
        for command in commands:
            words = [shown(word) if isinstance(word, Path) else word for word in command]
            if allow_code and words[0] in _ALLOW_CODE:
                words.append("--allow-code")
            self.say(f"  utank-hil {shlex.join(words)}")

    def table(self, table: Table) -> None:
        """Print a table, or the same as a list where the terminal is too narrow: nothing is cut."""
        unlimited = self.options.update(max_width=UNLIMITED)  # else the answer is what there is
        if Measurement.get(self, unlimited, table).maximum <= self.width:
            self.print(table)
            return
        if table.title:
            self.print(table.title, style="italic")
        headings = [" ".join(str(column.header).split()) for column in table.columns]
        wide = max(len(heading) for heading in headings)
        for cells in zip(*(column.cells for column in table.columns), strict=True):
            name, *figures = cells
            self.print(name, style="bold")
            for heading, figure in zip(headings[1:], figures, strict=True):
                left = f"  {heading:{wide}}  "
                words = " ".join(str(figure).split())
                for line in textwrap.wrap(words, max(self.width - len(left), 20)):
                    self.print(left + line)
                    left = " " * len(left)
        if table.caption:
            self.print(table.caption, style="dim")
        self.print()


class _Notes(Terminal):
    """What goes to standard error; where that is full or gone, the command goes on without."""

    def print(self, *objects: Any, **how: Any) -> None:
        with suppress(OSError):
            super().print(*objects, **how)

    def on_broken_pipe(self) -> None:
        self.quiet = True


notes: Final = _Notes(stderr=True)  # progress, notes and errors; standard output is for results


def say_note(note: str) -> None:
    """Print what of a file was not read, or not written, as it stands."""
    notes.say(note, yellow="note:")


def timing_table(loops: "dict[str, LoopStatistics]") -> Table:
    """Table of how real-time loops kept their time, in microseconds."""
    figures = ("p50", "p99", "p99.9", "max", "ticks", "overruns,\nskipped")
    table = new_table("Deadlines, µs", *figures)
    for name, loop in loops.items():
        table.add_row(name)
        for what, histogram, counts in (
            ("wake-up late", loop.lateness, (str(loop.ticks), str(loop.overruns))),
            ("tick lasts", loop.duration, ("", str(loop.skipped))),
        ):
            summary = histogram.summary()
            times = [summary[key] / 1e3 for key in ("p50_ns", "p99_ns", "p99_9_ns", "max_ns")]
            table.add_row(f"  {what}", *(f"{time_us:.0f}" for time_us in times), *counts)
    return table


SAY_S: Final = 30.0  #: Between two lines of progress where no terminal shows a bar.


def progress_bar(*columns: "str | ProgressColumn") -> "Progress":
    """A bar with what these columns say before the remaining time; without a terminal, lines."""
    from rich.progress import BarColumn, Progress, TaskID, TextColumn, TimeRemainingColumn

    class Told(Progress):
        said_s = time.monotonic()

        def update(self, task_id: TaskID, **changes: Any) -> None:
            super().update(task_id, **changes)
            if self.disable and time.monotonic() - self.said_s >= SAY_S:
                self.said_s = time.monotonic()
                done = (f"{it.description.strip()} {it.percentage:.0f} %" for it in self.tasks)
                notes.say(", ".join(done))

    return Told(
        TextColumn("{task.description}", markup=False),
        BarColumn(),
        *columns,
        TimeRemainingColumn(),
        console=notes,
        disable=not notes.is_terminal,
    )
