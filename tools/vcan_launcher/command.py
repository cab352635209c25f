"""Becoming the command: the last step of both ways."""

import os
import signal
import sys
from typing import NoReturn


def execute(argv: list[bytes], env: dict[bytes, bytes]) -> NoReturn:
    """Replace this process by the command; 127 or 126 when it is missing or cannot be run."""
    for name in (signal.SIGPIPE, signal.SIGXFSZ):  # Python ignores these two; commands expect them
        signal.signal(name, signal.SIG_DFL)
    try:
        os.execvpe(argv[0], argv, env)
    except OSError as error:
        missing = isinstance(error, FileNotFoundError | NotADirectoryError)
        reason = "command not found" if missing else error.strerror
        sys.stderr.write(f"tools/vcan: {os.fsdecode(argv[0])}: {reason}\n")
        sys.stderr.flush()
        os._exit(127 if missing else 126)
