"""The bytes of what passes between the loop and the retuner's process: MessagePack of typed values.

Decoding executes no code. What is not of the declared type and shape is refused with its place.
Arrays cross as their shape and their float64 numbers, bit for bit.
"""

import math
from typing import Annotated, Any, Final

import msgspec
import numpy as np

from utank_hil.base.arrays import FloatArray

OVERHEAD_BYTES: Final = 4096
"""Names, tags and shapes in a message; those of a renewed law, the most, are some 600 bytes."""

_Shape = Annotated[tuple[Annotated[int, msgspec.Meta(ge=0, le=1 << 24)], ...],
                   msgspec.Meta(max_length=3)]  # fmt: skip


def encode(value: object) -> bytes:
    """Encode a struct, a dataclass or an array."""
    return msgspec.msgpack.encode(value, enc_hook=_array_out)


def decoder(kind: Any, *, finite: bool) -> msgspec.msgpack.Decoder[Any]:
    """Decoder of a type; its `decode` raises a ValueError, or a RecursionError, for anything else.

    Parameters
    ----------
    finite : bool
        Whether numbers in arrays must be finite.
    """
    return msgspec.msgpack.Decoder(kind, dec_hook=_finite_array_in if finite else _array_in)


def refuse_shapes(*parts: tuple[str, FloatArray, tuple[int, ...]]) -> None:
    """Refuse arrays, given with their names and the shapes that they must have.

    Raises
    ------
    ValueError
        For the first that has another shape.
    """
    for name, array, shape in parts:
        if array.shape != shape:
            raise ValueError(f"{name} has the shape {array.shape} in the place of {shape}")


def refuse_sizes(**sizes: tuple[int, int, int]) -> None:
    """Refuse dimensions, by name, that are not in their range: value, least and most.

    Raises
    ------
    ValueError
        For the first that is out of its range.
    """
    for name, (value, least, most) in sizes.items():
        if not least <= value <= most:
            raise ValueError(f"{name} must be {least} to {most}, got {value}")


def _array_out(value: object) -> tuple[tuple[int, ...], bytes]:
    if isinstance(value, np.ndarray):
        return value.shape, np.asarray(value, dtype="<f8").tobytes()
    raise NotImplementedError(f"{type(value).__name__} does not pass between processes")


def _array_in(kind: type, value: object) -> FloatArray:  # noqa: ARG001 - msgspec's signature
    shape, data = msgspec.convert(value, tuple[_Shape, bytes])
    if 8 * math.prod(shape) != len(data):
        raise ValueError(f"{len(data)} bytes are no array of shape {shape}")
    return np.frombuffer(data, dtype="<f8").astype(np.float64).reshape(shape)


def _finite_array_in(kind: type, value: object) -> FloatArray:
    array = _array_in(kind, value)
    if not np.isfinite(array).all():
        raise ValueError("an array holds numbers that are not finite")
    return array
