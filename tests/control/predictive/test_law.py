"""The steppable predictive controller: its law, its memory and anti-windup."""

import control
import numpy as np
import pytest

from utank_hil.control import PredictiveLaw


def random_law(seed=0, taps=3, inputs=2, outputs=3, horizon=4):
    rng = np.random.default_rng(seed)
    return PredictiveLaw(
        rng.normal(size=(taps, inputs, inputs)) * 0.3,
        rng.normal(size=(taps, inputs, outputs)),
        rng.normal(size=(horizon, inputs, outputs)),
        0.2,
    )


def by_the_book(law, y, commanded=None):
    """The law's sums written out; `commanded` replaces what had been computed."""
    taps, inputs, outputs = law.output_gains.shape
    u = [np.zeros(inputs)] * taps
    past_y = [np.zeros(outputs)] * taps
    computed = []
    for k, sample in enumerate(y):
        past_y.append(sample)
        now = sum(law.input_gains[i] @ u[-1 - i] for i in range(taps)) + sum(
            law.output_gains[i] @ past_y[-1 - i] for i in range(taps)
        )
        computed.append(now)
        u.append(now if commanded is None else commanded[k])
    return np.array(computed)


@pytest.mark.parametrize(("taps", "inputs", "outputs"), [(1, 1, 1), (3, 2, 3), (40, 1, 2)])
def test_steps_follow_the_law_over_many_turns_of_the_memory(taps, inputs, outputs):
    law = random_law(1, taps, inputs, outputs)
    if taps == 40:
        law = PredictiveLaw(law.input_gains / 40, law.output_gains, law.reference_gains, 0.2)
    controller = law.controller()
    y = np.random.default_rng(2).normal(size=(2000, outputs))
    stepped = np.array([controller.step(sample) for sample in y])
    np.testing.assert_allclose(stepped, by_the_book(law, y), rtol=1e-9, atol=1e-9)


def test_what_was_really_commanded_enters_the_past():
    law = random_law(3)
    controller = law.controller()
    rng = np.random.default_rng(4)
    y, commanded = rng.normal(size=(1200, 3)), rng.normal(size=(1200, 2))
    stepped = []
    for sample, command in zip(y, commanded, strict=True):
        stepped.append(controller.step(sample))
        controller.applied(command)
    np.testing.assert_allclose(stepped, by_the_book(law, y, commanded), atol=1e-9)


def test_reference_for_the_whole_horizon_or_for_each_sample():
    law = random_law(9)
    constant = np.array([1.0, -2.0, 0.5])
    one = law.controller().step(np.zeros(3), constant)
    each = law.controller().step(np.zeros(3), np.tile(constant, (4, 1)))
    np.testing.assert_allclose(one, each)
    np.testing.assert_allclose(one, np.einsum("qab,b->a", law.reference_gains, constant))


def test_frequency_response_equals_that_of_the_state_space_form():
    law = random_law(10)
    z = np.exp(1j * np.array([0.01, 0.3, 2.0, np.pi]))
    system = control.ss(*law.matrices())
    for point, response in zip(z, law.response(z), strict=True):
        expected = system.C @ np.linalg.solve(point * np.eye(6) - system.A, system.B) + system.D
        np.testing.assert_allclose(response, expected, rtol=1e-10)
