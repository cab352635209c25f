"""What the commands share: loading, failing, telling."""

import os
from pathlib import Path
from typing import Annotated, Final, NoReturn, TypeVar

import typer
from pydantic import BaseModel
from rich.console import Console
from rich.markup import escape

from utank_hil.config_files import ConfigError, load_config

ModelT = TypeVar("ModelT", bound=BaseModel)

CONFIGS: Final = Path(__file__).resolve().parents[2] / "configs"
OUT: Final = Path("out")

Json = Annotated[
    bool, typer.Option("--json", help="Print one JSON object on standard output and nothing else.")
]
View = Annotated[bool, typer.Option("--view", help="Open the Rerun viewer, or serve it locally.")]
Duration = Annotated[
    float | None, typer.Option("--duration", min=0.1, metavar="SECONDS", help="Length of a run.")
]

# progress, notes and errors; standard output is for results
notes: Final = Console(stderr=True, highlight=False)


def new_app(help_text: str) -> typer.Typer:
    """A command line in the project's style."""
    return typer.Typer(
        no_args_is_help=True,
        add_completion=False,
        pretty_exceptions_enable=False,
        rich_markup_mode="rich",
        context_settings={"help_option_names": ["-h", "--help"]},
        help=help_text,
    )


def fail(message: object) -> NoReturn:
    """Print an error and end with exit code 2."""
    notes.print("[red]error:[/red]", escape(str(message)), soft_wrap=True)
    raise typer.Exit(2)


def load(path: Path, model: type[ModelT]) -> ModelT:
    """Read a configuration, or list everything that is wrong with it and end with exit code 2."""
    try:
        return load_config(path, model)
    except ConfigError as error:
        for problem in error.problems:
            notes.print("[red]error:[/red]", escape(str(problem)), soft_wrap=True)
        raise typer.Exit(2) from None


def shown(path: Path) -> str:
    """A path as short as it can be said from here."""
    relative = os.path.relpath(path)
    return str(path) if relative.startswith("..") else relative
