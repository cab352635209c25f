"""Command line ``utank-hil``: one entry point of the group ``utank_hil.commands`` a command.

A command's module is imported when the command is named, so ``run`` starts without the bench, and a
package beside this one adds commands of its own.
"""

from utank_hil.console.interruptible import end_as_by_ctrl_c, quietly_interruptible

with quietly_interruptible():
    from functools import cache
    from importlib.metadata import EntryPoint, entry_points
    from typing import Any

    import typer
    from typer.core import TyperGroup

    import utank_hil.console.single_thread  # noqa: F401, first: it must run before numpy loads
    from utank_hil.console.common import Version, new_app
    from utank_hil.console.failures import failures_named

GROUP = "utank_hil.commands"


@cache
def commands() -> dict[str, EntryPoint]:
    """The installed commands by name: entry points of a function or of a `typer.Typer`."""
    return {point.name: point for point in sorted(entry_points(group=GROUP))}


class _Commands(TyperGroup):
    def list_commands(self, ctx: Any) -> list[str]:  # noqa: ARG002
        return list(commands())

    def get_command(self, ctx: Any, cmd_name: str) -> Any:  # noqa: ARG002
        if cmd_name not in commands():
            return None
        with quietly_interruptible():
            loaded = commands()[cmd_name].load()
        if not isinstance(loaded, typer.Typer):
            application = new_app()
            application.command(cmd_name)(loaded)
            loaded = application
        command = typer.main.get_command(loaded)
        command.name = cmd_name
        return command


app = new_app(
    "Hardware-in-the-loop controller stack for active U-tube anti-roll tanks.",
    cls=_Commands,
    completion=True,
)


@app.callback()
def _utank_hil(version: Version = False) -> None:
    pass


def main() -> None:
    """Run the command line."""
    end_as_by_ctrl_c()
    with failures_named():
        app()
