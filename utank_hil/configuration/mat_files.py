"""Files of MATLAB up to version 7, read by scipy in a process of its own.

scipy's reader is compiled and trusts the file: of a thousand damaged ones ten end its process
with a segmentation fault (1.17.1; a data type that does not exist, an element that is missing).
"""

import pickle
import subprocess
import sys
import zlib
from pathlib import Path
from typing import Any, Final

_LIMIT_BYTES: Final = 1 << 26  #: Unpacked; a law of a hundred states has some 200 kB.
_LONGEST_S: Final = 60.0  #: A file of the greatest size takes 2 s.
_COMPRESSED: Final = 15  #: Type of a compressed element.
_CHILD: Final = """
import pickle, sys, warnings
warnings.simplefilter("ignore")
from scipy.io import loadmat
options = pickle.loads(sys.stdin.buffer.read())
try:
    content = loadmat(sys.argv[1], appendmat=False, **options)
except Exception as error:
    content = str(error) or type(error).__name__
pickle.dump(content, sys.stdout.buffer)
"""


def read_mat(path: Path, **options: Any) -> dict[str, Any]:
    """Read the variables of a file, with options of `scipy.io.loadmat`.

    ValueError is raised for a damaged file, and one that unpacks to more than `_LIMIT_BYTES`;
    OSError if it can't be opened.
    """
    try:
        _refuse_greater(path)
        command = [sys.executable, "-P", "-c", _CHILD, str(path.absolute())]
        read = subprocess.run(
            command, input=pickle.dumps(options), capture_output=True, timeout=_LONGEST_S
        )
    except OSError:
        raise
    except Exception as error:  # zlib raises its own at a damaged file.
        raise ValueError(f"{error}" or type(error).__name__) from error
    if read.returncode < 0:
        raise ValueError(f"it is damaged: scipy's reader ends at it by signal {-read.returncode}")
    if read.returncode > 0:
        raise RuntimeError(f"the process that reads {path}: {read.stderr.decode()}")
    content = pickle.loads(read.stdout)
    if isinstance(content, str):
        raise ValueError(content)
    return dict(content)


def _refuse_greater(path: Path) -> None:
    with path.open("rb") as file:
        order: Any = "big" if file.read(128)[126:] == b"MI" else "little"
        left = _LIMIT_BYTES
        while len(tag := file.read(8)) == 8:
            size = int.from_bytes(tag[4:], order)
            if int.from_bytes(tag[:4], order) == _COMPRESSED:
                left -= len(zlib.decompressobj().decompress(file.read(size), left + 1))
            else:
                file.seek(size, 1)
            if left < 0:
                raise ValueError(
                    f"it unpacks to more than {_LIMIT_BYTES} bytes, the most that is read"
                )
