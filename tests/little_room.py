<<<<<<< HEAD
"""A disk that fills up while a file is written."""
=======
"""A disk that is full."""
>>>>>>> 740ee8d (Move what command lines share to console/, the report to report/)

import resource
from collections.abc import Iterator
from contextlib import contextmanager
<<<<<<< HEAD
from typing import Final

ROOM: Final = 1024
=======

ROOM = 1024
"""Bytes that a file can have."""
>>>>>>> 740ee8d (Move what command lines share to console/, the report to report/)


@contextmanager
def little_room() -> Iterator[None]:
<<<<<<< HEAD
    """No file can grow beyond `ROOM` bytes in here."""
=======
    """No file can grow beyond `ROOM`, as on a disk that fills up while it is written."""
>>>>>>> 740ee8d (Move what command lines share to console/, the report to report/)
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (ROOM, limits[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)
