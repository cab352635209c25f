"""Command line ``utank-hil``: one entry point of the group ``utank_hil.commands`` a command.

A command's module is imported when the command is named, so ``run`` starts without the bench, and a
package beside this one adds commands of its own.
"""

from utank_hil.console.interruptible import end_as_by_ctrl_c, quietly_interruptible

with quietly_interruptible():
    import ast
    from functools import cache
    from importlib.metadata import EntryPoint, entry_points
    from importlib.util import find_spec
    from itertools import pairwise
    from pathlib import Path
    from typing import Any

    import typer
    from typer.core import TyperCommand, TyperGroup

    import utank_hil.console.single_thread  # noqa: F401, first: it must run before numpy loads
    from utank_hil.console.common import Version, fail, failures_named, new_app
    from utank_hil.console.exit_codes import ExitCode
    from utank_hil.console.terminal import notes

GROUP = "utank_hil.commands"


@cache
def commands() -> dict[str, EntryPoint]:
    """The installed commands by name: entry points of a function or of a `typer.Typer`."""
    return {point.name: point for point in sorted(entry_points(group=GROUP))}


def loaded(name: str) -> Any:
    """Import the module of a command and return the command."""
    with quietly_interruptible():
        found = commands()[name].load()
    if not isinstance(found, typer.Typer):
        application = new_app()
        application.command(name)(found)
        found = application
    command = typer.main.get_command(found)
    command.name = name
    return command


def _help(point: EntryPoint) -> str | None:
    """Docstring of a command's function, or the text of its `new_app`, read and not imported."""
    spec = find_spec(point.module)
    if spec is None or spec.origin is None:
        return None
    for node in ast.parse(Path(spec.origin).read_text(encoding="utf-8")).body:
        match node:
            case ast.FunctionDef(name=point.attr):
                return ast.get_docstring(node)
            case ast.Assign(
                targets=[ast.Name(id=point.attr)],
                value=ast.Call(args=[ast.Constant(value=str() as text), *_]),
            ):
                return text
    return None


class _Unloaded(TyperCommand):
    """A command that stands in a list; its module is imported once the command is parsed."""

    def make_context(self, info_name: Any, args: Any, parent: Any = None, **extra: Any) -> Any:
        if "--out=" in args or ("--out", "") in pairwise(args):
            fail("--out is empty; name a folder or file")  # a path of no letters is where one is
        return loaded(str(self.name)).make_context(info_name, args, parent, **extra)


class _Commands(TyperGroup):
    def invoke(self, ctx: Any) -> Any:
        try:
            return super().invoke(ctx)
        except KeyboardInterrupt:  # a command that keeps something handles it itself
            notes.say("interrupted before there was a result")
            raise typer.Exit(ExitCode.INTERRUPTED) from None

    def list_commands(self, ctx: Any) -> list[str]:  # noqa: ARG002
        return list(commands())

    def get_command(self, ctx: Any, cmd_name: str) -> Any:  # noqa: ARG002
        point = commands().get(cmd_name)
        return point and _Unloaded(cmd_name, help=_help(point), rich_markup_mode="markdown")


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
