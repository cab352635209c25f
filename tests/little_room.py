"""A disk that fills up while a file is written."""

import resource
import sys
from contextlib import contextmanager
from typing import Final

ROOM: Final = 1024


@contextmanager
def little_room():
    """No file can grow beyond `ROOM` bytes in here."""
    limits, none = resource.getrlimit(resource.RLIMIT_FSIZE), sys.dont_write_bytecode
    sys.dont_write_bytecode = True  # Python keeps what it wrote of it, and can't read it again
    resource.setrlimit(resource.RLIMIT_FSIZE, (ROOM, limits[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)
        sys.dont_write_bytecode = none
