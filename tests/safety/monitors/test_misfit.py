"""The least squares of a case against a search of share and zero."""

import math
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from moving_ship import SHIP, TANK

from utank_hil.dynamics.linear import coupled_matrices
from utank_hil.safety.monitors.sway import Misfit, SlopePush


@given(
    share=st.floats(-1.0, 3.0), zero=st.floats(-2.0, 2.0), seed=st.integers(0, 1000),
    most=st.floats(0.5, 2.0),
)  # fmt: skip
def test_the_least_is_that_of_a_search(share, zero, seed, most):
    noise = np.random.default_rng(seed).standard_normal((2, 400))
    u = noise[0] - noise[0].mean()
    e = zero - share * u + 0.1 * noise[1]
    misfit, keep = Misfit(), 0.999
    for each in zip(e, u, strict=True):
        misfit.add(*each, keep)
    fade = keep ** np.arange(399, -1, -1)
    k, z = np.meshgrid(np.linspace(0, most, 201), np.linspace(-1, 1, 201))
    left = [np.sum(fade * a * b) for a, b in ((e, e), (e, u), (u, u), (e, 1), (u, 1), (1, fade**0))]
    ee, eu, uu, se, su, weight = left
    power = ee + 2 * k * eu + k**2 * uu - 2 * z * (se + k * su) + weight * z**2
    assert misfit.least(most, 1.0) == pytest.approx(power.min(), rel=0.02)
    assert misfit.least(0.0, 0.0) == pytest.approx(ee)


@pytest.mark.parametrize("size", [1.0, 1e-3])
def test_what_share_and_zero_explain_leaves_nothing_however_small_it_is(size):
    misfit = Misfit()
    for k in range(400):
        u = math.sin(0.1 * math.pi * k)
        misfit.add(size * (0.1 - 0.7 * u), size * u, 0.999)
    assert misfit.least(2.0, 1.0) == pytest.approx(0.0, abs=1e-3 * size**2 * misfit.weight)
    assert misfit.share == pytest.approx(0.7, rel=0.01)


G = 9.80665
W0 = math.sqrt(2 * G / TANK.effective_length_m)


def test_the_slope_is_the_roll_moment_over_the_stiffness_with_both_dampings():
    """Of one sample: the moment that is left of the ship's own equation is that of the waves."""
    quadratic = replace(SHIP, quadratic_damping_nms2_rad2=0.3 * SHIP.damping_nms_rad)
    mass, damping, stiffness = (each[0] for each in coupled_matrices(quadratic, TANK))
    for rate in (0.04, -0.04):
        roll, level = SimpleNamespace(value=0.1, rate=rate), (1.2, 0.3)
        push = SlopePush(quadratic, TANK, 0.1)
        share = 0.1 * W0 / (2 * math.pi * 3.0)  # of a mean over three periods of the tank
        of_roll, of_level = push.update(roll, 0.02, *level)
        own = mass[0] * 0.02 + stiffness[0] * 0.1 + damping[0] * rate
        own += quadratic.quadratic_damping_nms2_rad2 * abs(rate) * rate
        scale = G * TANK.width_m / quadratic.stiffness_nm_rad * (1 - share)
        assert of_roll == pytest.approx(scale * own)
        assert of_level == pytest.approx(scale * (mass[1] * level[1] + stiffness[1] * level[0]))


def test_a_steady_heel_is_no_slope_after_some_periods_and_anew_after_a_gap():
    push, heel = SlopePush(SHIP, TANK, 0.1), SimpleNamespace(value=0.1, rate=0.0)
    first = push.update(heel, 0.0, 0.5, 0.0)
    periods = 3.0
    for _ in range(round(periods * 2 * math.pi / W0 / 0.1)):
        after = push.update(heel, 0.0, 0.5, 0.0)
    assert after == pytest.approx([each / math.e for each in first], rel=0.01)
    push.restart()
    assert push.update(heel, 0.0, 0.5, 0.0) == first
