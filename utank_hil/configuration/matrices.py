"""Matrices of a discrete system, read from the files of python-control, numpy and MATLAB."""

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any, Final

import numpy as np
from pydantic import BeforeValidator

from utank_hil.control.state_space import SystemMatrices

_NAMES: Final = ("A", "B", "C", "D")
_SAMPLE_TIMES: Final = ("sample_time_s", "dt", "Ts")


def read_system(path: Path) -> dict[str, Any]:
    """Matrices and sample time of a file, by the keys of `SystemMatrices`.

    Parameters
    ----------
    path : Path
        ``.json`` (an object), ``.npz`` (`numpy.savez`) or ``.mat`` (MATLAB's ``save`` up to
        ``-v7``, `scipy.io.savemat`): A, B, C, D and the sample time as ``sample_time_s``, ``dt`` or
        ``Ts``.

    Raises
    ------
    ValueError
        If the file can't be read or holds no such system.
    """
    readers = {".json": _json, ".npz": _npz, ".mat": _mat}
    if path.suffix not in readers:
        raise ValueError(f"{path.name} must be a file of {', '.join(readers)}")
    try:
        content = readers[path.suffix](path)
    except OSError as error:
        raise ValueError(f"{path} can't be read: {error.strerror or error}") from error
    except Exception as error:  # Readers raise any exception at a damaged file.
        raise ValueError(f"{path} holds no matrices: {error}") from error
    found = [name for name in _SAMPLE_TIMES if name in content]
    missing = [name for name in _NAMES if name not in content]
    if missing or len(found) != 1:
        raise ValueError(
            f"{path.name} must hold A, B, C, D and one of {', '.join(_SAMPLE_TIMES)}; it has "
            f"{', '.join(sorted(content)) or 'nothing'}"
        )
    if isinstance(content[found[0]], bool) or np.asarray(content[found[0]]).dtype == bool:
        raise ValueError(f"{path.name}: {found[0]} must be a time in seconds, not true or false")
    try:
        (sample_time_s,) = np.asarray(content[found[0]], dtype=np.float64).ravel().tolist()
        rows = {name: _rows(content[name]) for name in _NAMES}
    except (TypeError, ValueError) as error:
        raise ValueError(f"{path.name} must hold matrices of real numbers: {error}") from error
    return {"sample_time_s": sample_time_s, **rows}


def _rows(matrix: Any) -> tuple[tuple[float, ...], ...]:
    if np.iscomplexobj(matrix):
        raise ValueError("a complex one is not")
    if np.size(matrix) == 0:
        return tuple(() for _ in range(len(np.atleast_2d(matrix)) if np.ndim(matrix) == 2 else 0))
    return tuple(map(tuple, np.atleast_2d(np.asarray(matrix, dtype=np.float64)).tolist()))


def _json(path: Path) -> Mapping[str, Any]:
    content = json.loads(path.read_text(encoding="utf-8"))
    if not isinstance(content, dict):
        raise ValueError("it is no object")
    return content


def _npz(path: Path) -> Mapping[str, Any]:
    with np.load(path, allow_pickle=False) as archive:
        return {name: archive[name] for name in archive.files}


def _mat(path: Path) -> Mapping[str, Any]:
    from scipy.io import loadmat  # Few configurations need this import.

    content: dict[str, Any] = loadmat(path, appendmat=False)
    return {name: value for name, value in content.items() if not name.startswith("__")}


def _from_file(content: Any) -> Any:
    return read_system(Path(content)) if isinstance(content, str) else content


SystemFile = Annotated[SystemMatrices, BeforeValidator(_from_file)]
"""The key ``system`` of a law: a data file, ``./law.npz``, or the matrices themselves."""
