"""Exact sampling with delay and lag, against fine-grained integration of the same chain."""

import control
import numpy as np
import pytest

from utank_hil.dynamics import RollShip, Tank, coupled_model
from utank_hil.dynamics.sampling import sampled_model

SHIP = RollShip(1.9275e9, 1.9275e9 * 0.25, 4.87e7)
TANK = Tank(17.1, 4.88, 17.11, 6.22, lz_m=1.83, damping_ratio=0.10)
SYSTEM = coupled_model(SHIP, TANK)[["roll_rad", "level_m"], ["pressure_pa"]]
TS = 0.2


def chain(commands, delay_s, lag_s, substeps=40):
    """Outputs at t_k when commands[k], computed at t_k, is held from t_k + delay on (RK4)."""
    step = TS / substeps
    arrival = np.arange(len(commands)) * TS + delay_s
    a, b, c = SYSTEM.A, SYSTEM.B[:, 0], SYSTEM.C
    x, actual, outputs = np.zeros(4), 0.0, []

    def slope(x, actual, command):
        pressure = actual if lag_s else command
        return a @ x + b * pressure, (command - actual) / lag_s if lag_s else 0.0

    for k in range(len(commands)):
        outputs.append(c @ x)
        for i in range(substeps):
            middle = k * TS + (i + 0.5) * step  # arrivals fall between the fine steps
            came = np.searchsorted(arrival, middle, side="right")
            command = commands[came - 1] if came else 0.0
            k1 = slope(x, actual, command)
            k2 = slope(x + step / 2 * k1[0], actual + step / 2 * k1[1], command)
            k3 = slope(x + step / 2 * k2[0], actual + step / 2 * k2[1], command)
            k4 = slope(x + step * k3[0], actual + step * k3[1], command)
            x = x + step / 6 * (k1[0] + 2 * k2[0] + 2 * k3[0] + k4[0])
            actual += step / 6 * (k1[1] + 2 * k2[1] + 2 * k3[1] + k4[1])
    return np.array(outputs)


@pytest.mark.parametrize("lag_s", [0.0, 0.1])
@pytest.mark.parametrize("delay_s", [0.0, 0.05, 0.15, 0.2, 0.33, 0.4, 0.65])
def test_samples_equal_fine_grained_integration(delay_s, lag_s):
    commands = 1e4 * np.random.default_rng(1).normal(size=40)
    plant = sampled_model(SYSTEM, TS, delay_s, lag_s)
    # v(k + 1) is the command computed at t_k
    v = np.concatenate([[0.0], commands])[: len(commands)]
    x, samples = np.zeros(plant.nstates), []
    for value in v:
        samples.append(plant.C @ x + plant.D[:, 0] * value)
        x = plant.A @ x + plant.B[:, 0] * value
    fine = chain(commands, delay_s, lag_s)
    np.testing.assert_allclose(samples, fine, rtol=1e-7, atol=1e-7 * np.abs(fine).max())


@pytest.mark.parametrize(("delay_s", "acts_at_once"), [(0.05, True), (0.199, True), (0.2, False)])
def test_newest_command_is_felt_at_once_when_the_delay_is_below_a_sample(delay_s, acts_at_once):
    assert bool(np.any(sampled_model(SYSTEM, TS, delay_s, 0.0).D)) == acts_at_once


def test_delay_of_one_sample_is_the_plain_zero_order_hold():
    plant = sampled_model(SYSTEM, TS, TS, 0.0)
    plain = control.c2d(SYSTEM, TS, "zoh")
    frequencies = np.array([0.1, 0.5, 2.0, 10.0])
    np.testing.assert_allclose(
        plant(np.exp(1j * frequencies * TS)), plain(np.exp(1j * frequencies * TS)), rtol=1e-7
    )


def test_least_number_of_states():
    # delay below one sample costs none, the lag one, each further sample one
    sizes = [
        sampled_model(SYSTEM, TS, *times).nstates for times in ((0.05, 0), (0.05, 0.1), (0.5, 0.1))
    ]
    assert sizes == [4, 5, 7]


def test_names_of_the_signals_are_kept():
    plant = sampled_model(SYSTEM, TS, 0.05, 0.1)
    assert plant.output_labels == ["roll_rad", "level_m"]
    assert plant.input_labels == ["pressure_pa"]


@pytest.mark.parametrize(
    ("system", "arguments", "message"),
    [
        (SYSTEM, (0.0,), "sample_time_s"),
        (SYSTEM, (0.2, -0.1), "delay_s"),
        (SYSTEM, (0.2, 0.1, float("nan")), "lag_s"),
        (control.ss(0.5, 1, 1, 0, 0.2), (0.2,), "continuous"),
        (control.ss(-1, 1, 1, 1), (0.2,), "feed-through"),
    ],
)
def test_bad_input_is_refused_by_name(system, arguments, message):
    with pytest.raises(ValueError, match=message):
        sampled_model(system, *arguments)
