"""Encoding of messages between the loop and the retuner's process: MessagePack of typed values.

Decoding executes no code and refuses, with its place, what is not of the declared type and shape.
Arrays cross as shape and float64 numbers, bit for bit.
"""

import math
from typing import Annotated, Any, Final

import msgspec
import numpy as np

from utank_hil.base.arrays import FloatArray

OVERHEAD_BYTES: Final = 4096
"""Allowance for names, tags and shapes; a renewed law's, the largest, take some 600 bytes."""

_Shape = Annotated[tuple[Annotated[int, msgspec.Meta(ge=0, le=1 << 24)], ...],
                   msgspec.Meta(max_length=3)]  # fmt: skip


def encode(value: object) -> bytes:
    """Encode a struct, a dataclass or an array."""
    return msgspec.msgpack.encode(value, enc_hook=_plain)


def decoder(kind: Any, *, finite: bool) -> msgspec.msgpack.Decoder[Any]:
    """Return a decoder whose `decode` raises a ValueError or RecursionError for any other type.

    `finite` refuses numbers in arrays that are not finite.
    """
    return msgspec.msgpack.Decoder(kind, dec_hook=_finite_array_in if finite else _array_in)


def refuse_shapes(*parts: tuple[str, FloatArray, tuple[int, ...]]) -> None:
    """Raise a ValueError for the first array whose shape is not the one given beside it."""
    for name, array, shape in parts:
        if array.shape != shape:
            raise ValueError(f"{name} has the shape {array.shape} in the place of {shape}")


def refuse_sizes(**sizes: tuple[int, int, int]) -> None:
    """Raise a ValueError for the first dimension outside of its range: value, least and most."""
    for name, (value, least, most) in sizes.items():
        if not least <= value <= most:
            raise ValueError(f"{name} must be {least} to {most}, got {value}")


def _plain(value: object) -> object:
    if isinstance(value, np.ndarray):
        return value.shape, np.asarray(value, dtype="<f8").tobytes()
    if isinstance(value, np.generic):
        return value.item()
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
