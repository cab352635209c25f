"""The bound's programme, taken from the project, is the one that it solves."""

import clarabel
import numpy as np
import pytest

from tools.peers.bound_programme import bound_programme
from tools.peers.plan_programmes import CONTROLLER
from utank_hil.configuration import ControllerConfig, load_config


@pytest.fixture(scope="module")
def programme():
    return bound_programme(load_config(CONTROLLER, ControllerConfig).vessel, 60.0)


def test_doing_nothing_leaves_the_roll_of_the_passive_tank(programme):
    nothing = np.zeros(programme.rows.shape[1])
    assert programme.roll_rms_deg(nothing) == pytest.approx(np.sqrt(programme.passive_deg2))


def test_its_solution_keeps_the_limits_and_rolls_less(programme):
    settings = clarabel.DefaultSettings()
    settings.verbose = False
    limits = len(programme.right) - programme.equalities
    cones = [clarabel.ZeroConeT(programme.equalities), clarabel.NonnegativeConeT(limits)]
    x = np.array(
        clarabel.DefaultSolver(
            programme.cost, programme.gradient, programme.rows, programme.right, cones, settings
        )
        .solve()
        .x
    )
    assert programme.violation(x) < 1e-8
    assert programme.roll_rms_deg(x) < 0.8 * np.sqrt(programme.passive_deg2)
    # the first unknowns are the motion at the first sample: a step of it breaks the equations
    beyond = x.copy()
    beyond[0] += 0.1
    assert programme.violation(beyond) > 0.05
