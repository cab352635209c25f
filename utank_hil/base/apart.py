"""Readers of compiled libraries in a process of their own, which a damaged file may end.

scipy's reader of MATLAB files, asammdf and Rerun trust the file: of a thousand damaged ones up to
ten end their process with a signal, and the program with it.
"""

import os
import pickle
import subprocess
import sys
from collections.abc import Callable, Iterator
from multiprocessing.connection import Connection
from typing import Any, Final

_LONGEST_S: Final = 60.0  #: Without an item; the greatest file that is read takes 2 s.
_MOST_BYTES: Final = 1 << 32  #: Of memory, addresses that are only reserved included.
_CHILD: Final = f"""
import pickle, resource, sys
from multiprocessing.connection import Connection
resource.setrlimit(resource.RLIMIT_AS, ({_MOST_BYTES}, {_MOST_BYTES}))
sys.path[:], module, name, arguments, options = pickle.load(sys.stdin.buffer)
with Connection(int(sys.argv[1]), readable=False) as out:
    try:
        found = getattr(__import__(module, fromlist=[name]), name)(*arguments, **options)
        for item in found if hasattr(found, "__next__") else [found]:
            out.send(("item", item))
        out.send(("end", ""))
    except Exception as error:
        text = str(error).strip()
        if not text or not isinstance(error, (OSError, RuntimeError, ValueError)):
            text = type(error).__name__ + ": " + text
        out.send(("error", text.splitlines()[0][:300]))
"""


def apart(function: Callable[..., Any], *arguments: Any, **options: Any) -> Iterator[Any]:
    """Yield the items of a generator that runs in a process of its own, or a function's result.

    `function` is one of a module, its arguments and items are pickled. What it prints is not seen.
    ValueError is raised with the text of an exception in it, for its end by a signal, for a minute
    without an item and for more than 4 GiB of memory.
    """
    receive, send = os.pipe()
    command = [sys.executable, "-P", "-c", _CHILD, str(send)]
    with (
        Connection(receive, writable=False) as items,
        subprocess.Popen(
            command, stdin=subprocess.PIPE, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
            pass_fds=[send], env=os.environ | {"OPENBLAS_NUM_THREADS": "1"},
        ) as process,
    ):  # fmt: skip
        os.close(send)
        try:
            assert process.stdin is not None
            named = function.__module__, function.__qualname__
            process.stdin.write(pickle.dumps((sys.path, *named, arguments, options)))
            process.stdin.close()
            while True:
                if not items.poll(_LONGEST_S):
                    raise ValueError(f"its reader does not go on for {_LONGEST_S:g} s")
                kind, content = items.recv()
                if kind == "error":
                    raise ValueError(content)
                if kind == "end":
                    return
                yield content
        except (EOFError, BrokenPipeError) as error:
            end = process.wait()
            reason = f"its reader ends by {f'signal {-end}' if end < 0 else f'exit code {end}'}"
            raise ValueError(f"it is damaged: {reason}") from error
        finally:
            process.kill()
