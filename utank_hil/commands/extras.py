"""Commands of an installation of the controller alone: what is missing for one is said by name."""

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Final

from utank_hil.commands.common import notes
from utank_hil.commands.exit_codes import ExitCode

EXTRA_OF: Final = {
    "clarabel": "bench",
    "control": "bench",
    "dask": "bench",
    "distributed": "bench",
    "jinja2": "bench",
    "matplotlib": "bench",
    "numba": "bench",
    "pyarrow": "viewer",
    "rerun": "viewer",
    "rerun_cli": "viewer",
}
"""Packages that are not needed to run the controller, and the extra that installs each."""


@contextmanager
def extras_named() -> Iterator[None]:
    """End with the remedy where a package of an extra is not installed."""
    try:
        yield
    except ModuleNotFoundError as error:
        name = (error.name or "").partition(".")[0]
        if name not in EXTRA_OF:
            raise
        notes.print(
            f"[red]error:[/red] this needs {name}, which is not installed: "
            f"pip install 'utank-hil\\[{EXTRA_OF[name]}]'",
            soft_wrap=True,
        )
        raise SystemExit(ExitCode.USAGE) from None
