"""Active-set solver against an interior-point one, and its budget."""

import clarabel
import numpy as np
import pytest
from scipy import sparse

from utank_hil.control.constrained.horizon import ActiveSetSolver


def interior_point(hessian, gradient, rows, lower, upper):
    n = len(hessian)
    g = np.vstack([np.eye(n), rows])
    settings = clarabel.DefaultSettings()
    settings.verbose = False
    settings.tol_gap_abs = settings.tol_gap_rel = settings.tol_feas = 1e-10
    return np.array(
        clarabel.DefaultSolver(
            sparse.csc_matrix(np.triu(hessian)),
            gradient,
            sparse.csc_matrix(np.vstack([g, -g])),
            np.concatenate([upper, -lower]),
            [clarabel.NonnegativeConeT(2 * len(g))],
            settings,
        )
        .solve()
        .x
    )


def family(rng, n, m):
    root = rng.normal(size=(n, n))
    hessian = root @ root.T / n + 0.1 * np.eye(n)
    return hessian, rng.normal(size=(m, n))


@pytest.mark.slow
def test_thousand_random_programmes_equal_an_interior_point_solver():
    rng = np.random.default_rng(1)
    worst = 0.0
    for _ in range(100):
        n, m = int(rng.integers(2, 12)), int(rng.integers(0, 12))
        hessian, rows = family(rng, n, m)
        solver = ActiveSetSolver(hessian, rows, 200)
        for _ in range(10):  # warm starts
            inside = rng.normal(size=n) * 0.3
            values = np.concatenate([inside, rows @ inside])
            lower = values - rng.uniform(0.01, 1, n + m)
            upper = values + rng.uniform(0.01, 1, n + m)
            gradient = rng.normal(size=n) * 3
            found = solver.solve(gradient, lower, upper)
            expected = interior_point(hessian, gradient, rows, lower, upper)
            worst = max(worst, np.abs(found - expected).max())
    assert worst < 1e-6


def test_too_small_a_budget_is_told_and_the_next_solution_is_right():
    rng = np.random.default_rng(2)
    hessian, rows = family(rng, 10, 10)
    bound = np.full(20, 0.01)
    solver = ActiveSetSolver(hessian, rows, 3)
    assert solver.solve(10 * rng.normal(size=10), -bound, bound) is None
    free = rng.normal(size=10)
    np.testing.assert_allclose(
        solver.solve(free, -1e3 * bound - 1e3, 1e3 * bound + 1e3),
        -np.linalg.solve(hessian, free),
        rtol=1e-9,
    )
