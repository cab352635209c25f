"""Progress bars of commands: on standard error, and on a terminal only."""

from rich.progress import BarColumn, Progress, ProgressColumn, TextColumn, TimeRemainingColumn

from utank_hil.console.terminal import notes


def progress_bar(*columns: str | ProgressColumn) -> Progress:
    """A bar with what these columns say between it and the remaining time."""
    return Progress(
        TextColumn("{task.description}", markup=False),
        BarColumn(),
        *columns,
        TimeRemainingColumn(),
        console=notes,
        disable=not notes.is_terminal,
    )
