"""Sparse solvers for the programme of the clairvoyant bound."""

import clarabel
import numpy as np

from tools.peers import peers_environment
from tools.peers.bound_programme import BoundProgramme
from utank_hil.base.arrays import FloatArray

with peers_environment():
    import osqp
    import piqp


def by_clarabel(programme: BoundProgramme, _limit_s: float) -> tuple[FloatArray, str, int]:
    """What the project does: solution, status, iterations."""
    settings = clarabel.DefaultSettings()
    settings.verbose = False
    limits = len(programme.right) - programme.equalities
    cones = [clarabel.ZeroConeT(programme.equalities), clarabel.NonnegativeConeT(limits)]
    solution = clarabel.DefaultSolver(
        programme.cost, programme.gradient, programme.rows, programme.right, cones, settings
    ).solve()
    return np.array(solution.x), str(solution.status), int(solution.iterations)


def by_piqp(programme: BoundProgramme, _limit_s: float) -> tuple[FloatArray, str, int]:
    """Proximal interior point."""
    e = programme.equalities
    solver = piqp.SparseSolver()
    solver.setup(
        P=programme.cost,
        c=programme.gradient,
        A=programme.rows[:e].tocsc(),
        b=programme.right[:e],
        G=programme.rows[e:].tocsc(),
        h_u=programme.right[e:],
    )
    status = solver.solve()
    return np.array(solver.result.x), status.name, int(solver.result.info.iter)


def by_osqp(programme: BoundProgramme, limit_s: float) -> tuple[FloatArray, str, int]:
    """Operator splitting, to 1e-5."""
    lower = programme.right.copy()
    lower[programme.equalities :] = -np.inf
    solver = osqp.OSQP()
    solver.setup(
        programme.cost,
        programme.gradient,
        programme.rows,
        lower,
        programme.right,
        verbose=False,
        eps_abs=1e-5,
        eps_rel=1e-5,
        max_iter=1_000_000,
        time_limit=limit_s,
    )
    result = solver.solve()
    return np.array(result.x, dtype=np.float64), str(result.info.status), int(result.info.iter)


SOLVERS = {"Clarabel (ours)": by_clarabel, "PIQP": by_piqp, "OSQP, 1e-5": by_osqp}
