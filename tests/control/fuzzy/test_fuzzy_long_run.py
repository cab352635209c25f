"""A day and more of waves: nothing the fuzzy laws learn drifts away."""

import math

import numpy as np
import pytest

from utank_hil.control.fuzzy.adaptive import RobustFuzzy
from utank_hil.control.fuzzy.indirect import IndirectFuzzy, SmallGainFuzzy
from utank_hil.control.fuzzy.law import ErrorDynamics

pytestmark = pytest.mark.slow

STEP_S = 0.1
COMMON = {
    "error": ErrorDynamics(0.59, 0.5, 2.5),
    "ranges": (math.pi / 6, math.pi / 6),
    "gain_rad_s2_pa": 2e-7,
    "sample_time_s": STEP_S,
}
LAWS = {
    "small gain": SmallGainFuzzy(gamma=0.9, rho=1.0, adaptation=0.02, leakage=0.1, **COMMON),
    "robust": RobustFuzzy(
        gamma=0.9, epsilon=0.1, adaptation=(0.02, 0.02), leakage=(0.1, 0.1), **COMMON
    ),
    "indirect": IndirectFuzzy(adaptation_f=0.1, adaptation_g=0.1, leakage=1e-3, **COMMON),
}


@pytest.mark.evidence
@pytest.mark.parametrize("seconds", [3e3, pytest.param(1e5, marks=pytest.mark.evidence)])
@pytest.mark.parametrize("name", LAWS)
def test_parameters_stay_bounded_over_hours_of_waves(name, seconds):
    # Patti-B's roll without a tank, and a pump that acts on roll directly, as (4.12) has it
    controller = LAWS[name].controller()
    rng = np.random.default_rng(0)
    frequency, phase = rng.uniform(0.45, 0.75, 8), rng.uniform(0, math.tau, 8)
    steps = round(seconds / STEP_S)
    wave = np.zeros(steps)
    for w, p in zip(frequency, phase, strict=True):
        wave += 0.006 * np.cos(w * STEP_S * np.arange(steps) + p)
    x = np.zeros(2)
    roll, rate = 0.0, 0.0
    size = np.zeros(steps // 1000)
    for k, push in enumerate(wave.tolist()):
        x[0], x[1] = roll, rate
        u = 2e-7 * float(controller.step(x)[0])
        spring = -0.3446 * roll + 1.082 * roll**3 - 0.0673 * abs(rate) * rate
        rate += STEP_S * (spring + u + push)
        roll += STEP_S * rate
        if k % 1000 == 0:
            size[k // 1000] = (
                np.linalg.norm(controller.drift) + np.linalg.norm(controller.gain)
                if name == "indirect"
                else max(controller.parameters)
            )
    assert abs(roll) < 0.3
    assert np.isfinite(size).all()
    first, second = size[: len(size) // 2], size[len(size) // 2 :]
    assert second.max() < 1.2 * first.max()
    assert first.max() < 20
