"""Solver of small dense quadratic programmes with constant matrices, varying gradients and bounds.

::

    minimize 1/2 x'H x + f'x    subject to    lower <= (x, G x) <= upper

A dual active-set method (DAQP) is exact to rounding, needs few iterations when it starts from the
active set of the last solution, and allocates no memory during a solution.

References
----------
D. Arnström, A. Bemporad, D. Axehill, A dual active-set solver for embedded quadratic programming
using recursive LDL' updates, IEEE Transactions on Automatic Control 67 (2022) 4362-4369.
"""

import daqp
import numpy as np

from utank_hil.base.arrays import FloatArray

_OPTIMAL = 1


class ActiveSetSolver:
    """Warm-started solver of one family of programmes.

    Parameters
    ----------
    hessian : ndarray, shape (n, n)
        H, positive definite.
    rows : ndarray, shape (m, n)
        G.
    iteration_limit : int
        Limit on the iterations of a solution.
    """

    def __init__(self, hessian: FloatArray, rows: FloatArray, iteration_limit: int) -> None:
        bounds = len(hessian) + len(rows)
        self._model = daqp.Model()
        self._cold = np.zeros(bounds, dtype=np.int32)
        self._warm = True
        self.iterations = 0  #: Iterations of the last solution.
        flag, _ = self._model.setup(
            hessian, np.zeros(len(hessian)), rows, np.ones(bounds), -np.ones(bounds), self._cold
        )
        if flag < 0:
            raise ValueError(f"the quadratic programme cannot be set up (DAQP flag {flag})")
        self._model.settings = {"iter_limit": iteration_limit}

    @property
    def iteration_limit(self) -> int:
        """Limit on the iterations of a solution."""
        return int(self._model.settings["iter_limit"])

    def forget(self) -> None:
        """Discard the active set of the last solution."""
        self._warm = False

    def solve(
        self, gradient: FloatArray, lower: FloatArray, upper: FloatArray
    ) -> FloatArray | None:
        """Return the minimizer, or None if the iteration limit was reached.

        `gradient` has shape (n,); `lower` and `upper`, shape (n + m,), bound the variables, then
        the rows.
        """
        sense = None if self._warm else self._cold
        self._model.update(f=gradient, bupper=upper, blower=lower, sense=sense)
        x, _, flag, info = self._model.solve()
        self.iterations = int(info["iterations"])
        self._warm = flag == _OPTIMAL
        return np.array(x) if self._warm else None
