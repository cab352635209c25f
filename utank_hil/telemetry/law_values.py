"""Numbers of a built law: saved with a recording, compared bit for bit, put back into a law.

A design is a search or a factorization whose last digits depend on the processor's kernels. A
recorded run is therefore repeated with its recorded numbers, not with a law designed anew.
"""

import base64
import copy
import math
import zlib
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any, Final, TypeVar, cast

import numpy as np
import numpy.typing as npt

Part = TypeVar("Part")
Values = dict[str, npt.NDArray[Any]]  #: Arrays by the path of attributes that leads to them.
_MOST_BYTES: Final = 1 << 28  #: Of an array or a data file; a bomb has more.
_DEEPEST: Final = 12  #: Depth at which a circle of objects ends. Chosen; no study.


class LawValuesError(ValueError):
    """Recorded numbers do not fit the law."""


@dataclass(frozen=True, slots=True)
class ValueDifference:
    """An array, or a number, that differs."""

    name: str  #: Path of attributes, with the index of the first element that differs.
    #: recorded, designed: exact values of that element; "missing" if there is none.
    recorded: str
    designed: str
    #: Largest deviation of an element, relative to the largest recorded one; infinite if no
    #: elements can be compared.
    deviation: float = math.inf

    def __str__(self) -> str:
        size = f", at most {self.deviation:.1e} of the largest" if self.deviation < math.inf else ""
        return f"{self.name}: recorded {self.recorded}, designed here {self.designed}{size}"


def law_values(controller: object) -> Values:
    """Return every number that a controller at rest holds: gains, models, weights, state."""
    return dict(_walk(controller, "", 0, set()))


def restored(controller: Part, values: Values) -> Part:
    """A copy of a resting controller with `values`; LawValuesError for arrays unlike its own."""
    own = law_values(controller)
    for name in dict.fromkeys((*values, *own)):
        there, here = values.get(name), own.get(name)
        if there is None or here is None or not _alike(there, here):
            raise LawValuesError(f"{name} is {_kind(there)} there and {_kind(here)} here")
    return cast(Part, _restored(controller, values, "", 0, {}))


def differences(recorded: Values, designed: Values) -> list[ValueDifference]:
    """Return each array that is not bit for bit the same, with its first element that differs."""
    found = []
    for name in dict.fromkeys((*recorded, *designed)):
        a, b = recorded.get(name), designed.get(name)
        if a is None or b is None or not _alike(a, b):
            found.append(ValueDifference(name, _said(a), _said(b)))
        elif a.tobytes() != b.tobytes():
            raw_a = np.ascontiguousarray(a).reshape(-1, 1).view(np.uint8)
            raw_b = np.ascontiguousarray(b).reshape(-1, 1).view(np.uint8)
            first = int(np.flatnonzero((raw_a != raw_b).any(axis=1))[0])
            at = [int(i) for i in np.unravel_index(first, a.shape)]
            place = f"{name}{at}" if at else name
            texts = repr(a.ravel()[first].item()), repr(b.ravel()[first].item())
            found.append(ValueDifference(place, *texts, _deviation(a, b)))
    return found


def packed(content: bytes) -> str:
    """Return bytes compressed, as text for JSON."""
    return base64.b85encode(zlib.compress(content, 9)).decode()


def unpacked(text: str) -> bytes:
    """Invert `packed`; ValueError for more than 256 MB, or for what `packed` does not give."""
    decompressor = zlib.decompressobj()
    try:
        content = decompressor.decompress(base64.b85decode(text), _MOST_BYTES)
    except zlib.error as error:
        raise ValueError(str(error)) from error
    if not decompressor.eof:
        raise ValueError(f"is cut, or holds more than {_MOST_BYTES >> 20} MB")
    return content


def encoded(values: Values) -> dict[str, Any]:
    """Return the values exactly, ready for JSON."""
    return {
        name: [str(value.dtype), list(value.shape), packed(value.tobytes())]
        for name, value in values.items()
    }


def decoded(content: Mapping[str, Any]) -> Values:
    """Invert `encoded`."""
    return {
        name: np.frombuffer(unpacked(data), np.dtype(dtype)).reshape(shape)
        for name, (dtype, shape, data) in content.items()
    }


def _alike(a: npt.NDArray[Any], b: npt.NDArray[Any]) -> bool:
    return a.shape == b.shape and a.dtype == b.dtype


def _kind(value: npt.NDArray[Any] | None) -> str:
    return "missing" if value is None else f"{value.dtype} of shape {value.shape}"


def _deviation(a: npt.NDArray[Any], b: npt.NDArray[Any]) -> float:
    """Return the largest deviation of `b` from `a`, relative to the largest element of `a`."""
    wide = np.complex128 if a.dtype.kind == "c" else np.float64
    a, b = a.astype(wide), b.astype(wide)
    deviation = np.abs(b - a, where=a != b, out=np.zeros(a.shape)).max()
    largest = np.abs(a[np.isfinite(a)]).max(initial=0.0)
    if deviation == 0:
        return 0.0
    return float(deviation / largest) if largest and math.isfinite(deviation) else math.inf


def _said(value: npt.NDArray[Any] | None) -> str:
    return _kind(value) if value is None or value.ndim else repr(value.item())


def _walk(
    value: object, path: str, depth: int, above: set[int]
) -> Iterator[tuple[str, npt.NDArray[Any]]]:
    if isinstance(value, bool | int | float | complex | np.number):
        yield path, np.asarray(value)
        return
    if isinstance(value, np.ndarray):
        if value.dtype.kind in "biufc":
            yield path, value
        return
    if depth == _DEEPEST or id(value) in above:
        return
    for name, part in _parts(value):
        yield from _walk(part, _path(path, name), depth + 1, above | {id(value)})


def _restored(
    value: object, values: Values, path: str, depth: int, done: dict[int, tuple[object, object]]
) -> object:
    """Return the value itself if it holds no numbers, else a copy with those of `values`."""
    if path in values:
        return _number_or_array(value, values[path])
    if depth == _DEEPEST:
        return value
    if id(value) in done:
        return done[id(value)][0]
    # The value is also kept, so that no other object gets its id.
    done[id(value)] = value, value
    before = dict(_parts(value))
    parts = {
        name: _restored(part, values, _path(path, name), depth + 1, done)
        for name, part in before.items()
    }
    if all(part is before[name] for name, part in parts.items()):
        return value
    new: Any
    if isinstance(value, Mapping):
        new = {name: parts[str(name)] for name in value}
    elif isinstance(value, list):
        new = list(parts.values())
    elif isinstance(value, tuple):
        make = getattr(type(value), "_make", tuple)
        new = make(parts.values())
    else:
        new = copy.copy(value)
        for name, part in parts.items():
            object.__setattr__(new, name, part)
        if derive := getattr(new, "derive", None):  # Values that follow from its numbers.
            derive()
    done[id(value)] = new, value
    return new


def _number_or_array(value: object, recorded: npt.NDArray[Any]) -> object:
    if not isinstance(value, np.ndarray):
        return recorded.item() if isinstance(value, bool | int | float | complex) else recorded[()]
    # Strides select the kernel of a product, and so its last bit.
    last = sum((size - 1) * step for size, step in zip(value.shape, value.strides, strict=True))
    memory = np.empty(max(last, 0) // value.itemsize + 1, value.dtype)
    new = np.lib.stride_tricks.as_strided(memory, value.shape, value.strides)
    new[...] = recorded
    return new


def _path(path: str, name: str) -> str:
    return f"{path}.{name.lstrip('_')}".lstrip(".")


def _parts(value: object) -> Iterator[tuple[str, object]]:
    if isinstance(value, str | bytes | type) or callable(value):
        return
    if isinstance(value, Mapping):
        yield from ((str(name), part) for name, part in value.items())
    elif isinstance(value, list | tuple):
        yield from ((str(index), part) for index, part in enumerate(value))
    else:
        yield from getattr(value, "__dict__", {}).items()
        for kind in type(value).__mro__:
            slots = kind.__dict__.get("__slots__", ())
            for name in (slots,) if isinstance(slots, str) else slots:
                if hasattr(value, name):
                    yield name, getattr(value, name)
