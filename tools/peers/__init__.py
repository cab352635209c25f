"""The project beside published packages, which live in an environment of their own.

`make peers` makes that environment, `.cache/peers`, from `requirements.lock` here, on top of the
project's own; `compare_*.py` here run in it.
"""

from collections.abc import Iterator
from contextlib import contextmanager


@contextmanager
def peers_environment() -> Iterator[None]:
    """Say what to do when an import of a published package fails.

    Raises
    ------
    SystemExit
        In place of `ModuleNotFoundError`.
    """
    try:
        yield
    except ModuleNotFoundError as error:
        raise SystemExit(
            f"{error.name} is not in this environment: run `make peers`, "
            f"then run it with .cache/peers/bin/python"
        ) from None
