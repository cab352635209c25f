"""Reading of plain numbers that another process wrote."""

import math

import numpy as np

from utank_hil.base.arrays import FloatArray


class NumberReader:
    """A cursor over an array of finite numbers.

    Parameters
    ----------
    values : ndarray, shape (N,)

    Raises
    ------
    ValueError
        If they are not finite; the methods: if there is not what is asked for.
    """

    def __init__(self, values: FloatArray) -> None:
        if not np.isfinite(values).all():
            raise ValueError("the answer holds numbers that are not finite")
        self._values = values
        self._next = 0

    def take(self, count: int) -> FloatArray:
        """The next `count` numbers."""
        taken = self._values[self._next : self._next + count]
        if len(taken) < count:
            raise ValueError("the answer is too short")
        self._next += count
        return taken

    def size(self, most: int, least: int = 1) -> int:
        """The next number as a dimension."""
        value = float(self.take(1)[0])
        if not (least <= value <= most and math.floor(value) == value):
            raise ValueError(f"the answer has a dimension of {value}")
        return int(value)

    def array(self, *shape: int) -> FloatArray:
        """The next numbers as a new array of this shape."""
        return self.take(math.prod(shape)).reshape(shape).copy()

    def end(self) -> None:
        """Refuse numbers left over."""
        if self._next != len(self._values):
            raise ValueError("the answer is too long")
