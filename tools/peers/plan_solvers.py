"""Quadratic-programme solvers behind one method, each set up once as its documentation advises.

All but do-mpc are handed the same dense matrices (OSQP and Clarabel in sparse form) and, for each
programme, new vectors only. `solve` returns the first command, as a part of the greatest pressure.
"""

from collections.abc import Callable
from typing import Protocol

import clarabel
import daqp
import numpy as np
from scipy import sparse

from tools.peers import peers_environment
from tools.peers.plan_programmes import Programme, ProgrammeFamily
from utank_hil.base.arrays import FloatArray
from utank_hil.control.constrained.active_set import ActiveSetSolver

with peers_environment():
    import osqp
    import piqp
    import quadprog

_FREE = 1e30  # for solvers that do not take infinity


class PlanSolver(Protocol):
    """Something that solves one programme after the other."""

    def solve(self, programme: Programme) -> float:
        """First command of the best plan; NaN if none was found."""


class ProjectSolver:
    """What the project does: DAQP, kept and warm-started."""

    def __init__(self, family: ProgrammeFamily) -> None:
        self._solver = ActiveSetSolver(family.hessian, family.rows, iteration_limit=1000)

    def solve(self, programme: Programme) -> float:
        """Solve by an active set that starts from the last one."""
        lower = np.maximum(programme.lower, -_FREE)
        upper = np.minimum(programme.upper, _FREE)
        x = self._solver.solve(programme.gradient, lower, upper)
        return np.nan if x is None else float(x[0])


class ColdDaqp:
    """DAQP, set up anew for each programme."""

    def __init__(self, family: ProgrammeFamily) -> None:
        self._hessian, self._rows = family.hessian, family.rows
        self._sense = np.zeros(len(family.hessian) + len(family.rows), dtype=np.int32)

    def solve(self, programme: Programme) -> float:
        """Solve by an active set that starts empty."""
        x, _, flag, _ = daqp.solve(
            self._hessian,
            programme.gradient,
            self._rows,
            np.minimum(programme.upper, _FREE),
            np.maximum(programme.lower, -_FREE),
            self._sense.copy(),
        )
        return float(x[0]) if flag == 1 else np.nan


class Quadprog:
    """Goldfarb and Idnani's dual method; cold, since it knows nothing else. The reference too."""

    def __init__(self, family: ProgrammeFamily) -> None:
        self._hessian = family.hessian
        both = np.vstack([np.eye(len(family.hessian)), family.rows])
        self._rows = np.vstack([both, -both])

    def solve(self, programme: Programme) -> float:
        """Solve from the unconstrained optimum."""
        return float(self.certified(programme)[0][0])

    def certified(self, programme: Programme) -> tuple[FloatArray, float]:
        """The solution, and by how much it misses the conditions of optimality."""
        bounds = np.concatenate([programme.lower, -programme.upper])
        finite = np.isfinite(bounds)
        rows, bounds = self._rows[finite], bounds[finite]
        found = quadprog.solve_qp(self._hessian, -programme.gradient, rows.T, bounds)
        x, multipliers = found[0], found[4]
        slope = self._hessian @ x + programme.gradient - multipliers @ rows
        slack = rows @ x - bounds
        return x, float(
            max(
                np.abs(slope).max(),
                -slack.min(),
                -multipliers.min(),
                np.abs(slack * multipliers).max(),
            )
        )


class Piqp:
    """Proximal interior point, dense, its data updated."""

    def __init__(self, family: ProgrammeFamily) -> None:
        self._family, self._ready = family, False
        self._solver = piqp.DenseSolver()

    def solve(self, programme: Programme) -> float:
        """Update the vectors and solve."""
        n = len(programme.gradient)
        lower, upper = programme.lower, programme.upper
        vectors = {
            "c": programme.gradient,
            "h_l": lower[n:],
            "h_u": upper[n:],
            "x_l": lower[:n],
            "x_u": upper[:n],
        }
        if self._ready:
            self._solver.update(**vectors)
        else:
            self._solver.setup(P=self._family.hessian, G=self._family.rows, **vectors)
            self._ready = True
        status = self._solver.solve()
        found = status == piqp.PIQP_SOLVED
        return float(self._solver.result.x[0]) if found else np.nan


class Osqp:
    """Operator splitting, warm-started.

    Parameters
    ----------
    tolerance : float
        Absolute and relative; 1e-3 is OSQP's own.
    polish : bool
        Solve once more with the constraints that were found active.
    """

    def __init__(self, family: ProgrammeFamily, tolerance: float, polish: bool) -> None:
        self._family, self._tolerance, self._polish = family, tolerance, polish
        self._solver: osqp.OSQP | None = None

    def solve(self, programme: Programme) -> float:
        """Update the vectors and solve from the last solution."""
        gradient, lower, upper = programme.gradient, programme.lower, programme.upper
        if self._solver is None:
            self._solver = osqp.OSQP()
            self._solver.setup(
                sparse.csc_matrix(np.triu(self._family.hessian)),
                gradient,
                sparse.csc_matrix(np.vstack([np.eye(len(gradient)), self._family.rows])),
                lower,
                upper,
                verbose=False,
                warm_starting=True,
                eps_abs=self._tolerance,
                eps_rel=self._tolerance,
                polishing=self._polish,
                max_iter=20_000,
            )
        else:
            self._solver.update(q=gradient, l=lower, u=upper)
        result = self._solver.solve()
        found = result.info.status_val == osqp.SolverStatus.OSQP_SOLVED
        return float(result.x[0]) if found else np.nan


class Clarabel:
    """Interior point, its data updated."""

    def __init__(self, family: ProgrammeFamily) -> None:
        self._hessian = sparse.csc_matrix(np.triu(family.hessian))
        both = np.vstack([np.eye(len(family.hessian)), family.rows])
        self._rows = np.vstack([both, -both])
        self._settings = clarabel.DefaultSettings()
        self._settings.verbose = False
        self._settings.presolve_enable = False  # or the data cannot be updated
        self._finite: np.ndarray | None = None
        self._solver: clarabel.DefaultSolver | None = None

    def solve(self, programme: Programme) -> float:
        """Update the vectors and solve."""
        bounds = np.concatenate([programme.upper, -programme.lower])
        if self._solver is None:
            self._finite = np.isfinite(bounds)
            self._solver = clarabel.DefaultSolver(
                self._hessian,
                programme.gradient,
                sparse.csc_matrix(self._rows[self._finite]),
                bounds[self._finite],
                [clarabel.NonnegativeConeT(int(self._finite.sum()))],
                self._settings,
            )
        else:
            self._solver.update(q=programme.gradient, b=bounds[self._finite])
        solution = self._solver.solve()
        found = solution.status == clarabel.SolverStatus.Solved
        return float(solution.x[0]) if found else np.nan


SOLVERS: dict[str, Callable[[ProgrammeFamily], PlanSolver]] = {
    "DAQP, kept and warm (ours)": ProjectSolver,
    "DAQP, set up each time": ColdDaqp,
    "quadprog": Quadprog,
    "PIQP": Piqp,
    "OSQP, warm, 1e-3": lambda family: Osqp(family, 1e-3, polish=False),
    "OSQP, warm, 1e-5, polished": lambda family: Osqp(family, 1e-5, polish=True),
    "Clarabel": Clarabel,
}
