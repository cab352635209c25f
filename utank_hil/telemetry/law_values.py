"""The numbers of a built law, to be kept with a recording and compared bit for bit."""

import base64
import zlib
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
import numpy.typing as npt

Values = dict[str, npt.NDArray[Any]]
"""Arrays by the path of attributes that leads to them."""

_DEEPEST: Final = 12


@dataclass(frozen=True, slots=True)
class ValueDifference:
    """One number that differs.

    Attributes
    ----------
    name : str
        Path of attributes, with the index in an array.
    recorded, replayed : str
        In decimals that tell every bit; "missing" where there is none.
    """

    name: str
    recorded: str
    replayed: str

    def __str__(self) -> str:
        return f"{self.name}: recorded {self.recorded}, replayed {self.replayed}"


def law_values(controller: object) -> Values:
    """Every number that a controller at rest holds: gains, models, weights, state.

    Attributes that hold no numbers, functions and the insides of compiled code are left out.
    """
    return dict(_walk(controller, "", 0, set()))


def differences(recorded: Values, replayed: Values) -> list[ValueDifference]:
    """The first differing number of each array that is not the same bit for bit."""
    found = []
    for name in dict.fromkeys((*recorded, *replayed)):
        a, b = recorded.get(name), replayed.get(name)
        if a is None or b is None or a.shape != b.shape or a.dtype != b.dtype:
            found.append(ValueDifference(name, _said(a), _said(b)))
        elif a.tobytes() != b.tobytes():
            raw_a = np.ascontiguousarray(a).reshape(-1, 1).view(np.uint8)
            raw_b = np.ascontiguousarray(b).reshape(-1, 1).view(np.uint8)
            first = int(np.flatnonzero((raw_a != raw_b).any(axis=1))[0])
            at = [int(i) for i in np.unravel_index(first, a.shape)]
            place = f"{name}{at}" if at else name
            values = repr(a.ravel()[first].item()), repr(b.ravel()[first].item())
            found.append(ValueDifference(place, *values))
    return found


def encoded(values: Values) -> dict[str, Any]:
    """Values ready for JSON, exact."""
    return {
        name: [str(value.dtype), list(value.shape), _packed(value.tobytes())]
        for name, value in values.items()
    }


def decoded(content: Mapping[str, Any]) -> Values:
    """The inverse of `encoded`."""
    return {
        name: np.frombuffer(zlib.decompress(base64.b85decode(data)), np.dtype(dtype)).reshape(shape)
        for name, (dtype, shape, data) in content.items()
    }


def _packed(data: bytes) -> str:
    return base64.b85encode(zlib.compress(data, 9)).decode()


def _said(value: npt.NDArray[Any] | None) -> str:
    if value is None:
        return "missing"
    return repr(value.item()) if value.ndim == 0 else f"{value.dtype} of shape {value.shape}"


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
        yield from _walk(
            part, f"{path}.{name.lstrip('_')}".lstrip("."), depth + 1, above | {id(value)}
        )


def _parts(value: object) -> Iterator[tuple[str, object]]:
    """What an object is made of, by name."""
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
