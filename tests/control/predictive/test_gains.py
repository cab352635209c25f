"""GPC and DPC: the thesis's printed gains, brute-force prediction, deadbeat, dense optimum."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tools.thesis.linear_contest import DPC_ROLL, GPC_ROLL, PRINTED, PRINTED_ARX
from utank_hil.control import ARX, design_dpc, design_gpc
from utank_hil.control.predictive.law import predict

shapes = {
    "seed": st.integers(0, 2**32 - 1),
    "order": st.integers(1, 4),
    "outputs": st.integers(1, 3),
    "inputs": st.integers(1, 3),
}


def random_arx(seed: int, order: int, outputs: int, inputs: int) -> ARX:
    rng = np.random.default_rng(seed)
    return ARX(
        rng.normal(size=(order, outputs, outputs)) * 0.8 / order,
        rng.normal(size=(order + 1, outputs, inputs)),
        0.2,
    )


def brute_force(arx: ARX, past_u, past_y, future_u):
    """Outputs k ... by the plain recursion (3.6); pasts newest first."""
    u, y = list(past_u[::-1]), list(past_y[::-1])
    for sample in future_u:
        u.append(sample)
        now = arx.beta[0] @ sample
        for i in range(1, arx.order + 1):
            now = now + arx.alpha[i - 1] @ y[-i] + arx.beta[i] @ u[-1 - i]
        y.append(now)
    return np.array(y[arx.order :])


@pytest.mark.parametrize("prediction_horizon", [54, 60, 100])
def test_printed_dpc_gains_at_any_horizon(prediction_horizon):
    law = design_dpc(PRINTED_ARX, 50, prediction_horizon)
    np.testing.assert_allclose(law.input_gains[:, 0, 0], PRINTED[DPC_ROLL].input_gains, rtol=1e-4)
    np.testing.assert_allclose(law.output_gains[:, 0, 0], PRINTED[DPC_ROLL].roll_gains, rtol=1e-4)


def test_printed_gpc_gains():
    law = design_gpc(PRINTED_ARX)
    np.testing.assert_allclose(law.input_gains[:, 0, 0], PRINTED[GPC_ROLL].input_gains, rtol=1e-4)
    np.testing.assert_allclose(law.output_gains[:, 0, 0], PRINTED[GPC_ROLL].roll_gains, rtol=1e-4)


def test_default_dpc_is_the_printed_one():
    law = design_dpc(PRINTED_ARX)
    np.testing.assert_allclose(law.output_gains[:, 0, 0], PRINTED[DPC_ROLL].roll_gains, rtol=1e-4)


@given(**shapes, horizon=st.integers(1, 25))
def test_multi_step_prediction_equals_brute_force_recursion(seed, order, outputs, inputs, horizon):
    arx = random_arx(seed, order, outputs, inputs)
    rng = np.random.default_rng(seed + 1)
    past_u, past_y = rng.normal(size=(order, inputs)), rng.normal(size=(order, outputs))
    future = rng.normal(size=(horizon, inputs))
    prediction = predict(arx, horizon)
    predicted = (
        np.einsum("qpab,pb->qa", prediction.outputs, past_y)
        + np.einsum("qpab,pb->qa", prediction.inputs, past_u)
        + (prediction.future_inputs(horizon) @ future.ravel()).reshape(horizon, outputs)
    )
    expected = brute_force(arx, past_u, past_y, future)
    np.testing.assert_allclose(predicted, expected, atol=1e-9 * (1 + np.abs(expected).max()))


@given(
    **shapes,
    horizon=st.integers(2, 12),
    free=st.integers(1, 12),
    first=st.integers(0, 5),
    target=st.booleans(),
)
def test_gpc_is_the_dense_least_squares_optimum(
    seed, order, outputs, inputs, horizon, free, first, target
):
    arx = random_arx(seed, order, outputs, inputs)
    free, first = min(free, horizon), min(first, horizon - 1)
    rng = np.random.default_rng(seed + 2)
    output_weight, input_weight = rng.uniform(0.1, 5, outputs), rng.uniform(0.5, 5, inputs)
    past_u, past_y = rng.normal(size=(order, inputs)), rng.normal(size=(order, outputs))
    reference = rng.normal(size=(horizon, outputs)) * target

    def residual(plan):
        future = np.zeros((horizon, inputs))
        future[:free] = plan.reshape(free, inputs)
        deviation = (reference - brute_force(arx, past_u, past_y, future))[first:]
        return np.concatenate(
            [(np.sqrt(output_weight) * deviation).ravel(), (np.sqrt(input_weight) * future).ravel()]
        )

    base = residual(np.zeros(free * inputs))
    columns = np.array([residual(unit) - base for unit in np.eye(free * inputs)]).T
    best = np.linalg.lstsq(columns, -base, rcond=None)[0][:inputs]

    law = design_gpc(arx, free, horizon, output_weight, input_weight, first)
    u = (
        np.einsum("pab,pb->a", law.input_gains, past_u)
        + np.einsum("pab,pb->a", law.output_gains, past_y)
        + np.einsum("qab,qb->a", law.reference_gains, reference)
    )
    np.testing.assert_allclose(u, best, atol=1e-8 * (1 + np.abs(best).max()))


def close_loop(arx: ARX, law, past_u, past_y, steps):
    u, y = list(past_u[::-1]), list(past_y[::-1])
    for _ in range(steps):
        now = sum(law.input_gains[i] @ u[-1 - i] for i in range(arx.order))
        now = now + sum(law.output_gains[i] @ y[-1 - i] for i in range(arx.order))
        y.append(brute_force(arx, u[: -arx.order - 1 : -1], y[: -arx.order - 1 : -1], [now])[0])
        u.append(now)
    return np.array(u[arx.order :]), np.array(y[arx.order :])


@given(**shapes, spare=st.integers(0, 3))
def test_dpc_brings_random_systems_to_rest_in_finite_time(seed, order, outputs, inputs, spare):
    # As many inputs as the state needs: then the law that is applied anew each step follows its
    # own plan, and the outputs are zero from sample hc on.
    arx = random_arx(seed, order, outputs, inputs)
    states = order * outputs
    if states % inputs:
        inputs = 1
        arx = random_arx(seed, order, outputs, inputs)
    control_horizon = states // inputs
    law = design_dpc(arx, control_horizon, control_horizon + order + spare)
    rng = np.random.default_rng(seed + 3)
    past_u, past_y = rng.normal(size=(order, inputs)), rng.normal(size=(order, outputs))
    u, y = close_loop(arx, law, past_u, past_y, control_horizon + 10)
    rounding = 1e-9 * _amplification(arx, control_horizon)
    size = 1 + np.abs(y).max() + np.abs(u).max()
    assert np.abs(y[control_horizon:]).max() < rounding * size


def _amplification(arx: ARX, control_horizon: int) -> float:
    """How near the random system is to one that the inputs cannot bring to rest."""
    horizon = control_horizon + arx.order
    window = predict(arx, horizon).future_inputs(control_horizon)[control_horizon * arx.outputs :]
    values = np.linalg.svd(window, compute_uv=False)[: arx.order * arx.outputs]
    return float(values[0] / values[-1])


def test_relaxed_deadbeat_becomes_the_exact_one_as_its_weight_grows():
    arx = random_arx(11, 2, 2, 1)
    exact, relaxed = design_dpc(arx, 6, 9), design_dpc(arx, 6, 9, output_weight=1e10)
    np.testing.assert_allclose(relaxed.output_gains, exact.output_gains, rtol=1e-5)
    gentle = design_dpc(arx, 6, 9, output_weight=1e-3)
    assert np.abs(gentle.output_gains).max() < 0.5 * np.abs(exact.output_gains).max()


def test_longer_control_horizon_asks_for_less_pressure():
    arx = PRINTED_ARX
    effort = [np.abs(design_dpc(arx, hc, hc + 4).output_gains).max() for hc in (8, 25, 50)]
    assert effort == sorted(effort, reverse=True)


def test_dpc_does_not_depend_on_the_units_of_its_outputs():
    arx = random_arx(7, 2, 2, 1)
    scale = np.diag([1e8, 1.0])
    scaled = ARX(scale @ arx.alpha @ np.linalg.inv(scale), scale @ arx.beta, 0.2)
    law, same = design_dpc(arx, 4, 6), design_dpc(scaled, 4, 6)
    np.testing.assert_allclose(same.output_gains @ scale, law.output_gains, rtol=1e-6)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"control_horizon": 0}, "control_horizon"),
        ({"control_horizon": 10, "prediction_horizon": 9}, "prediction_horizon"),
        ({"output_weight": -1.0}, "output_weight must be zero or more"),
        ({"output_weight": [1.0, 2.0]}, "output_weight must be a number or have shape"),
        ({"input_weight": 0.0}, "input_weight must be positive"),
        ({"input_weight": np.nan}, "input_weight must be"),
        ({"first_output": 50}, "first_output must be 0 to 49"),
    ],
)
def test_bad_gpc_settings_are_refused_by_name(arguments, message):
    with pytest.raises(ValueError, match=message):
        design_gpc(PRINTED_ARX, **arguments)


def test_dpc_without_a_target_window_is_refused():
    with pytest.raises(ValueError, match="control_horizon < prediction_horizon"):
        design_dpc(PRINTED_ARX, 50, 50)
