"""A law by its matrices: its steps, and the same law in the loop's count."""

import control
import numpy as np
import pytest

from utank_hil.control.state_space import StateSpaceLaw
from utank_hil.dynamics.sampling import LinearModel

RNG = np.random.default_rng(1)
MODEL = LinearModel(
    0.3 * RNG.normal(size=(3, 3)),
    RNG.normal(size=(3, 2)),
    RNG.normal(size=(1, 3)),
    RNG.normal(size=(1, 2)),
    0.1,
)
LAW = StateSpaceLaw(MODEL)
GAIN = StateSpaceLaw(
    LinearModel(np.zeros((0, 0)), np.zeros((0, 2)), np.zeros((1, 0)), MODEL.D, 0.1)
)


def test_steps_are_the_response_of_python_control():
    y = RNG.normal(size=(2, 40))
    controller = LAW.controller()
    for _ in range(2):
        stepped = [controller.step(sample)[0] for sample in y.T]
        expected = control.forced_response(control.ss(*MODEL), inputs=y).outputs[0]
        np.testing.assert_allclose(stepped, expected, rtol=1e-12)
        controller.reset()


@pytest.mark.parametrize("law", [LAW, GAIN], ids=["dynamic", "static"])
def test_in_the_loops_count_the_command_comes_one_sample_later(law):
    model = law.matrices()
    assert not model.D.any()
    y = RNG.normal(size=(30, 2))
    controller, x = law.controller(), np.zeros(len(model.A))
    for sample in y:
        x = model.A @ x + model.B @ sample
        np.testing.assert_allclose(model.C @ x, controller.step(sample), rtol=1e-12)
    z = np.exp(1j * np.array([0.01, 0.5, 3.0]))
    for point, response in zip(z, law.response(z), strict=True):
        resolvent = np.linalg.solve(point * np.eye(len(model.A)) - model.A, model.B)
        np.testing.assert_allclose(response, model.C @ resolvent, rtol=1e-12)


def test_a_reference_is_taken_off_the_measurement():
    y, reference = np.array([3.0, -1.0]), np.array([1.0, 0.5])
    assert LAW.controller().step(y, reference) == LAW.controller().step(y - reference)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"dt": 0.0}, "must be discrete"),
        ({"A": np.ones((3, 2))}, r"A must have shape \(3, 3\), got \(3, 2\)"),
        ({"D": np.ones(2)}, r"D must have shape \(1, 2\), got \(2,\)"),
        ({"B": np.full((3, 2), np.nan)}, "B must be of finite numbers"),
    ],
)
def test_what_is_no_discrete_model_is_refused_by_name(change, message):
    with pytest.raises(ValueError, match=message):
        StateSpaceLaw(MODEL._replace(**change))
