"""Laws that design themselves, shared by the processes of one test run."""

import fcntl
import hashlib
import pickle
from collections.abc import Callable
from functools import lru_cache
from pathlib import Path
from typing import Any


def shared(design: Callable[..., Any], folder: Path) -> Callable[..., Any]:
    """Like a function of what can be pickled, computed by the first process that asks.

    Parameters
    ----------
    design : callable
    folder : Path
        For the results, for as long as the source stays as it is.
    """

    @lru_cache(maxsize=16)
    def found(*arguments: Any) -> Any:
        name = hashlib.sha256(pickle.dumps(arguments)).hexdigest()
        with (folder / name).open("a+b") as file:
            fcntl.flock(file, fcntl.LOCK_EX)  # another process that asks meanwhile waits
            file.seek(0)
            if kept := file.read():
                return pickle.loads(kept)
            result = design(*arguments)
            file.write(pickle.dumps(result))
        return result

    found.__wrapped__ = design
    return found
