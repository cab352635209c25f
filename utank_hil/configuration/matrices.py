"""Matrices of a discrete system, read from the files of python-control, numpy and MATLAB."""

import json
import zlib
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any, Final
from zipfile import ZipFile

import numpy as np
from pydantic import BeforeValidator

from utank_hil.base.apart import apart
from utank_hil.base.text_files import open_text, unread
from utank_hil.control.state_space import SystemMatrices

_NAMES: Final = ("A", "B", "C", "D")
_SAMPLE_TIMES: Final = ("sample_time_s", "dt", "Ts")
_LIMIT_BYTES: Final = 1 << 26  #: Of a law's file; one of a hundred states has some 200 kB.
_MOST_ELEMENTS: Final = 1 << 20  #: Of a matrix; a law of a thousand states has as many.
_HDF5: Final = b"\x89HDF\r\n\x1a\n"
_MATLAB_73: Final = b"MATLAB 7.3"
_AS_STRUCT: Final = (
    "save its matrices: s = struct('A',sys.A,'B',sys.B,'C',sys.C,'D',sys.D,'Ts',sys.Ts); "
    "save('law.mat','s')"
)


def read_system(path: Path) -> dict[str, Any]:
    """Matrices and sample time of a file, by the keys of `SystemMatrices`.

    A file is ``.json`` (an object), ``.npz`` (`numpy.savez`) or ``.mat`` (MATLAB's ``save`` of any
    version, `scipy.io.savemat`): A, B, C, D and the sample time as ``sample_time_s``, ``dt`` or
    ``Ts``, at the top or as fields of its only variable. Matrices may be sparse, or complex with
    imaginary parts of zero; a vector is a column for B and a row for C. ValueError is raised if the
    file can't be read or holds no such system.
    """
    readers = {".json": _json, ".npz": _npz, ".mat": _mat}
    reader = readers.get(path.suffix.lower())
    if reader is None:
        raise ValueError(f"{path.name} must be a file of {', '.join(readers)}")
    try:
        content = _unwrapped(reader(path))
    except FileNotFoundError as error:
        raise ValueError(unread(error)) from error
    except OSError as error:
        raise ValueError(f"{path} can't be read: {error.strerror or error}") from error
    except ImportError as error:
        reason = "is of MATLAB 7.3: pip install 'utank-hil[files]', or save it with -v7"
        raise ValueError(f"{path} {reason}") from error
    except Exception as error:  # Readers raise any exception at a damaged file.
        raise ValueError(f"{path} holds no matrices: {error}") from error
    found = [name for name in _SAMPLE_TIMES if name in content]
    missing = [name for name in _NAMES if name not in content]
    if missing or len(found) != 1:
        raise ValueError(
            f"{path.name} must hold A, B, C, D and one of {', '.join(_SAMPLE_TIMES)}; it has "
            f"{', '.join(sorted(content)) or 'nothing'}"
        )
    sample_time_s = _sample_time_s(path, found[0], content[found[0]])
    matrices = {name: _matrix(path, name, content[name]) for name in _NAMES}
    return {"sample_time_s": sample_time_s, **_in_rows(matrices)}


def _sample_time_s(path: Path, name: str, value: Any) -> float:
    """Return the sample time; ValueError says what the value of another system means."""
    number = None if value is None or isinstance(value, bool | str) else np.asarray(value)
    if number is None or number.dtype.kind not in "iuf" or number.size != 1:
        raise ValueError(f"{path.name}: {name} must be a time in seconds, got {value!r}")
    seconds = float(number.ravel()[0])
    if seconds == 0:
        raise ValueError(f"{path.name}: {name} is 0, a continuous system: sample it first (c2d)")
    if seconds == -1:
        raise ValueError(f"{path.name}: {name} is -1, an unknown sample time: set it in seconds")
    return seconds


def _matrix(path: Path, name: str, value: Any) -> Any:
    """Return an array of real numbers; ValueError names the matrix and what it holds."""
    if np.prod(np.maximum(getattr(value, "shape", 0), 1), dtype=float) > _MOST_ELEMENTS:
        raise ValueError(f"{path.name}: {name} has more than {_MOST_ELEMENTS} elements")
    if hasattr(value, "toarray"):
        try:
            if value.format == "csc":  # which scipy has not checked; it would write past the array
                value.check_format()
            value = value.toarray()
        except ValueError as error:
            raise ValueError(f"{path.name}: {name} is no sparse matrix: {error}") from error
    try:
        matrix = np.asarray(value)
    except ValueError as error:
        raise ValueError(f"{path.name}: {name} must have rows of one length") from error
    if matrix.size and matrix.dtype.kind not in "iufc":
        raise ValueError(f"{path.name}: {name} must hold numbers, got {matrix.dtype}")
    if matrix.dtype.kind == "c":
        if np.any(matrix.imag != 0):
            raise ValueError(f"{path.name}: {name} must be real, and has imaginary parts")
        matrix = matrix.real
    if matrix.ndim > 2:
        raise ValueError(f"{path.name}: {name} must be a matrix, and has {matrix.ndim} dimensions")
    return matrix


def _in_rows(matrices: dict[str, Any]) -> dict[str, tuple[tuple[float, ...], ...]]:
    """Return matrices as rows, with a vector B as a column, and vectors C and D as a row."""
    states = len(np.atleast_2d(matrices["A"])) if matrices["A"].size else 0
    rows = {}
    for name, matrix in matrices.items():
        if matrix.size == 0:
            empty: tuple[float, ...] = ()
            rows[name] = (empty,) * (len(matrix) if matrix.ndim == 2 else 0)
            continue
        column = name == "B" and matrix.ndim == 1 and matrix.size == states
        shaped = matrix.reshape(-1, 1) if column else np.atleast_2d(matrix)
        rows[name] = tuple(map(tuple, np.asarray(shaped, dtype=np.float64).tolist()))
    return rows


def _unwrapped(content: Mapping[str, Any]) -> Mapping[str, Any]:
    """Return the fields of the only variable, if the content is one structure."""
    if len(content) != 1:
        return content
    (value,) = content.values()
    if isinstance(value, Mapping):
        return value
    fields = getattr(getattr(value, "dtype", None), "names", None)
    if fields and value.size == 1:
        return {name: value[name].item() for name in fields}
    return content


def _json(path: Path) -> Mapping[str, Any]:
    with open_text(path, _LIMIT_BYTES) as text:
        content = json.loads(text.read(), object_pairs_hook=_once, parse_constant=_no_number)
    if not isinstance(content, dict):
        raise ValueError("it is no object")
    for name in _NAMES:
        _refuse_truth(name, content.get(name))
    return content


def _once(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    content = dict(pairs)
    if len(content) < len(pairs):
        names = [name for name, _ in pairs]
        twice = next(name for name in names if names.count(name) > 1)
        raise ValueError(f"it has the key {twice!r} twice: remove one")
    return content


def _no_number(word: str) -> float:
    raise ValueError(f"{word} is no finite number")


def _refuse_truth(name: str, value: Any) -> None:
    """Refuse true and false in a matrix, which numpy takes as one and zero among numbers."""
    if isinstance(value, bool):
        raise ValueError(f"{name} has {str(value).lower()} in the place of a number")
    if isinstance(value, list):
        for item in value:
            _refuse_truth(name, item)


def _npz(path: Path) -> Mapping[str, Any]:
    with ZipFile(path) as parts:
        if sum(part.file_size for part in parts.infolist()) > _LIMIT_BYTES:
            raise ValueError(f"it unpacks to more than {_LIMIT_BYTES} bytes, the most that is read")
    with np.load(path, allow_pickle=False) as archive:
        return {name: archive[name] for name in archive.files}


def _mat(path: Path) -> Mapping[str, Any]:
    with path.open("rb") as file:
        head = file.read(512 + len(_HDF5))
    if head.startswith((_HDF5, _MATLAB_73)) or head[512:] == _HDF5:
        return _mat_73(path)
    from scipy.io.matlab import MatlabOpaque  # Few configurations need this import.

    content = read_mat(path)
    found = {name: value for name, value in content.items() if not name.startswith("__")}
    if any(isinstance(value, MatlabOpaque) for value in found.values()):
        raise ValueError(f"it holds a MATLAB object, not matrices: {_AS_STRUCT}")
    return found


def _mat_73(path: Path) -> Mapping[str, Any]:
    """Read a file of MATLAB 7.3, which is HDF5 with transposed matrices."""
    import h5py

    with h5py.File(path, "r") as file:
        if "#subsystem#" in file:
            raise ValueError(f"it holds a MATLAB object, not matrices: {_AS_STRUCT}")
        return {
            name: _of_hdf5(item, path) for name, item in file.items() if not name.startswith("#")
        }


def _of_hdf5(item: Any, path: Path) -> Any:
    """Return a variable: a structure as a mapping, a sparse or complex matrix as an array."""
    if "MATLAB_sparse" in item.attrs:
        from scipy.sparse import csc_array

        columns = _values(item["jc"], path)
        shape = (int(item.attrs["MATLAB_sparse"]), len(columns) - 1)
        if "data" not in item:  # All elements are zero.
            return csc_array(shape)
        data, rows = (_values(item[name], path) for name in ("data", "ir"))
        return csc_array((data, rows, columns), shape=shape)
    if hasattr(item, "items"):
        return {name: _of_hdf5(field, path) for name, field in item.items()}
    if item.attrs.get("MATLAB_empty"):  # The data are the dimensions, one of them zero.
        shape = _values(item, path).astype(int).tolist()
        return np.zeros(shape if 0 in shape else 0)
    if item.attrs.get("MATLAB_class", b"double") in (b"char", b"logical", b"cell"):
        kind = item.attrs["MATLAB_class"].decode()
        raise ValueError(f"{item.name.rpartition('/')[2]} is of MATLAB's class {kind}")
    return _values(item, path).T


def _values(item: Any, path: Path) -> Any:
    """Return numbers; ValueError if they are too many, or stand in another file."""
    if item.external or item.is_virtual or item.file.filename != str(path):
        raise ValueError(f"{item.name} stands in another file")
    if item.size > _MOST_ELEMENTS:
        raise ValueError(f"{item.name} has more than {_MOST_ELEMENTS} elements")
    values = item[()]
    return values["real"] + 1j * values["imag"] if values.dtype.names else values


def _from_file(content: Any) -> Any:
    return read_system(Path(content)) if isinstance(content, str) else content


SystemFile = Annotated[SystemMatrices, BeforeValidator(_from_file)]
"""The key ``system`` of a law: a data file, ``./law.npz``, or the matrices themselves."""


_COMPRESSED: Final = 15  #: Type of a compressed element.


def read_mat(path: Path, **options: Any) -> dict[str, Any]:
    """Read the variables of a file, with options of `scipy.io.loadmat`.

    ValueError is raised for a damaged file, and one that unpacks to more than `_LIMIT_BYTES`;
    OSError if it can't be opened.
    """
    try:
        _refuse_greater(path)
    except zlib.error as error:
        raise ValueError(str(error)) from error
    from scipy.io import loadmat  # Few configurations need this import.

    (content,) = apart(loadmat, str(path), appendmat=False, **options)
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
