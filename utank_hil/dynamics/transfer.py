"""Transfer functions of linear models at many points, with bounded memory."""

from typing import TYPE_CHECKING, Final

import numpy as np

from utank_hil.base.arrays import ComplexArray
from utank_hil.dynamics.sampling import LinearModel

if TYPE_CHECKING:
    from control import StateSpace

_AT_ONCE: Final = 1_000_000  # Elements of the resolvents held at a time: 16 MB.


def state_space_response(system: "StateSpace | LinearModel", points: ComplexArray) -> ComplexArray:
    """Transfer function C (p I - A)^-1 B + D of a model at complex points s (or z).

    The points have shape (N,), the result (N, outputs, inputs).
    """
    a, b, c, d = system.A, system.B, system.C, system.D
    points = np.asarray(points, dtype=np.complex128)
    unit, b_complex = np.eye(len(a)), b.astype(np.complex128)
    response = np.empty((len(points), *d.shape), dtype=np.complex128)
    chunk = max(1, _AT_ONCE // max(1, a.size))
    for first in range(0, len(points), chunk):
        part = slice(first, first + chunk)
        resolvent = points[part, None, None] * unit - a
        response[part] = c @ np.linalg.solve(resolvent, b_complex) + d
    return response
