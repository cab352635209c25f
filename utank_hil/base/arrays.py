"""Array types used in annotations throughout."""

from typing import Final, TypeAlias

import numpy as np
import numpy.typing as npt

FloatArray: TypeAlias = npt.NDArray[np.float64]
ComplexArray: TypeAlias = npt.NDArray[np.complex128]
MOST_MEASURED: Final = 1e6
"""Magnitude from which a number is no measurement: no ship's roll in rad or level in m comes near.
"""


def plausible(y: FloatArray) -> FloatArray:
    """Return a measurement with 0 for each number that is none, so that no law remembers it."""
    if np.abs(y).max(initial=0.0) < MOST_MEASURED:  # False for NaN
        return y
    return np.where(np.abs(y) < MOST_MEASURED, y, 0.0)
