"""What no command goes on without, said by name: a package, a file, room on a disk."""

import errno
import io
import os
import sys
from collections.abc import Iterator
from concurrent.futures import BrokenExecutor
from contextlib import contextmanager
from typing import Final

from utank_hil.console.common import why
from utank_hil.console.exit_codes import ExitCode
from utank_hil.console.terminal import notes

EXTRA_OF: Final = {
    "asammdf": "files",
    "fmpy": "models",
    **dict.fromkeys(("clarabel", "control", "jinja2"), "bench"),
    **dict.fromkeys(("matplotlib", "numba"), "bench"),
    **dict.fromkeys(("pyarrow", "rerun", "rerun_cli"), "viewer"),
}  #: Packages that are not needed to run the controller, and the extra that installs each.
KILLED: Final = "a process of this command was killed: too little memory?"


@contextmanager
def failures_named() -> Iterator[None]:
    """End in words where a package of an extra is not installed or a file can't be used.

    Signs that the terminal's encoding lacks become question marks. A standard stream that is closed
    is /dev/null: a file or the bus would get its number, and the text that is meant for it.
    """
    for number, name in enumerate(("stdin", "stdout", "stderr")):
        if getattr(sys, name) is None:
            mode = "w" if number else "r"
            stream = open(os.open(os.devnull, os.O_RDWR), mode, encoding="utf-8")  # noqa: SIM115
            setattr(sys, name, stream)
    if isinstance(sys.stdout, io.TextIOWrapper):
        sys.stdout.reconfigure(errors="replace")
    try:
        yield
    except ModuleNotFoundError as error:
        name = (error.name or "").partition(".")[0]
        if name not in EXTRA_OF:
            raise
        notes.say(
            f"this needs {name}, which is not installed: pip install 'utank-hil[{EXTRA_OF[name]}]'",
            red="error:",
        )
        raise SystemExit(ExitCode.USAGE) from None
    except BrokenExecutor:
        notes.say(KILLED, red="error:")
        raise SystemExit(ExitCode.SYSTEM) from None
    except OSError as error:
        if error.filename is None and error.errno != errno.ENOSPC:
            raise
        notes.say(why(error), red="error:")
        raise SystemExit(ExitCode.USAGE) from None
