"""Programmes set up by hand from the formulas, against what the project's controller answers."""

import clarabel
import numpy as np
import pytest
from scipy import sparse

from tools.peers import plan_programmes
from tools.peers.plan_programmes import ProgrammeFamily, constrained_design, constrained_law, sail


@pytest.fixture(scope="module", params=[False, True], ids=["shipped knots", "every sample"])
def sailed(request):
    design, config = constrained_design(request.param)
    law = constrained_law(design, config)
    return law, ProgrammeFamily(law), sail(law, config, design.measured, 40.0)


def solution(family, programme):
    """By an interior point, sharply."""
    both = np.vstack([np.eye(len(family.hessian)), family.rows])
    rows, bounds = np.vstack([both, -both]), np.concatenate([programme.upper, -programme.lower])
    finite = np.isfinite(bounds)
    settings = clarabel.DefaultSettings()
    settings.verbose = False
    settings.tol_gap_abs = settings.tol_gap_rel = settings.tol_feas = 1e-11
    found = clarabel.DefaultSolver(
        sparse.csc_matrix(np.triu(family.hessian)),
        programme.gradient,
        sparse.csc_matrix(rows[finite]),
        bounds[finite],
        [clarabel.NonnegativeConeT(int(finite.sum()))],
        settings,
    ).solve()
    return np.array(found.x)


@pytest.mark.slow
def test_programmes_by_hand_have_the_commands_of_the_controller(sailed):
    law, family, steps = sailed
    limited = [step for step in steps if step.limited]
    assert len(limited) > 20
    for step in limited:
        first = solution(family, family.programme(step))[0] * law.limits.pressure_pa
        assert first == pytest.approx(step.first_pa, abs=1.0)  # of 50 kPa


def test_steps_that_touch_no_limit_are_the_unconstrained_optimum(sailed):
    law, family, steps = sailed
    free = [step for step in steps if not step.limited]
    assert len(free) > 20
    for step in free:
        programme = family.programme(step)
        best = -np.linalg.solve(family.hessian[:-1, :-1], programme.gradient[:-1])
        assert best[0] * law.limits.pressure_pa == pytest.approx(step.first_pa, abs=1e-5)
        plan = np.append(best, 0.0)
        values = np.concatenate([plan, family.rows @ plan])
        assert (values >= programme.lower - 1e-9).all()
        assert (values <= programme.upper + 1e-9).all()


def test_a_plan_in_states_has_the_level_of_the_programme(sailed):
    law, family, steps = sailed
    step = next(step for step in steps if step.limited)
    programme, horizon = family.programme(step), law.horizon
    plan = np.random.default_rng(1).uniform(-1, 1, len(horizon.knots))
    commands = horizon.interpolation @ plan * law.limits.pressure_pa
    x, levels = programme.state, []
    for command, offset in zip(commands, programme.level_offset_m, strict=True):
        y = law.model.C @ x + law.model.D[:, 0] * command
        levels.append(y[law.level_output] + offset)
        x = law.model.A @ x + law.model.B[:, 0] * command
    rows = family.rows[-len(family.held) :] @ np.append(plan, 0.0)
    free = -family.level_m - programme.lower[-len(family.held) :]
    assert np.array(levels)[family.held] == pytest.approx(rows + free, abs=1e-9)


def test_a_configuration_with_a_power_limit_is_refused(tmp_path, monkeypatch):
    shipped = plan_programmes.CONTROLLER
    text = shipped.read_text().replace("limits: {", "limits: {power_w: 1.0e+6, ")
    text = text.replace("../ships", str(plan_programmes.CONFIGS / "ships"))
    limited = tmp_path / "limited.yaml"
    limited.write_text(text)
    monkeypatch.setattr(plan_programmes, "CONTROLLER", limited)
    with pytest.raises(ValueError, match=r"limited\.yaml: .* without power limit"):
        constrained_design()
