"""The least squares of a case against a search of share and zero."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from utank_hil.safety.monitors.sway import Misfit


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
