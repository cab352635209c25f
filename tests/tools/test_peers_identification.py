"""What identification is compared by: records, errors, and a model less its wave."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.linalg import block_diag

from tools.peers.identification_records import (
    SAMPLE_TIME_S,
    WAVE_RAD_S,
    record,
    response,
    response_error,
    sampled_plant,
    without_mode,
)


def plant():
    system = sampled_plant()
    a, b, c, d = (np.asarray(part) for part in (system.A, system.B, system.C, system.D))
    return a, b[:, :1], c, d[:, :1]


def with_wave(seed, radius=1.0):
    """The plant beside an oscillator at the wave's frequency that the input hardly moves."""
    rng = np.random.default_rng(seed)
    a, b, c, d = plant()
    turn = WAVE_RAD_S * SAMPLE_TIME_S
    wave = radius * np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]])
    shift = np.linalg.qr(rng.normal(size=(6, 6)))[0] * rng.uniform(0.5, 2, 6)
    whole_b = np.vstack([b, 1e-8 * rng.normal(size=(2, 1))])
    whole_c = np.hstack([c, rng.normal(size=(2, 2))])
    return (
        shift @ block_diag(a, wave) @ np.linalg.inv(shift),
        shift @ whole_b,
        whole_c @ np.linalg.inv(shift),
        d,
    )


def test_the_true_plant_has_no_error_and_nothing_all_of_it():
    assert response_error(plant()) == pytest.approx(np.zeros(2), abs=1e-14)
    nothing = (np.zeros((1, 1)), np.zeros((1, 1)), np.zeros((2, 1)), np.zeros((2, 1)))
    assert response_error(nothing) == pytest.approx(np.ones(2))


@given(st.integers(0, 1000), st.floats(0.9999, 1.0001))
def test_less_the_wave_a_model_is_the_plant(seed, radius):
    model = without_mode(with_wave(seed, radius), WAVE_RAD_S)
    assert len(model[0]) == 4
    assert response_error(model).max() < 1e-7


def test_a_model_without_a_mode_there_is_left_alone():
    model = plant()
    assert without_mode(model, 1.1) is model


@pytest.mark.parametrize("sea", ["one wave", "storm"])
def test_a_sea_rolls_the_ship_as_much_as_the_pump_does(sea):
    _, calm = record(noise=0.0, sea="calm", seed=3)
    _, y = record(noise=0.0, sea=sea, seed=3)
    assert np.std((y - calm)[:, 0]) == pytest.approx(np.std(calm[:, 0]))


def test_response_is_that_of_a_sampled_oscillation():
    a, b, c, d = plant()
    steps, turn = 20_000, 0.7 * SAMPLE_TIME_S
    x, tail = np.zeros(4), []
    for k in range(steps):
        u = np.cos(turn * k)
        if k >= steps - 4000:
            tail.append(c @ x + d[:, 0] * u)
        x = a @ x + b[:, 0] * u
    k = np.arange(steps - 4000, steps)
    basis = np.column_stack([np.cos(turn * k), -np.sin(turn * k)])
    real, imaginary = np.linalg.lstsq(basis, np.array(tail), rcond=None)[0]
    assert response(a, b, c, d)[50] == pytest.approx(real + 1j * imaginary, rel=1e-6)
