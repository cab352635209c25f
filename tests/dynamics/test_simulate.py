from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from roll_energy import LEVERS, PATTI, PATTI_TANK, THESIS_SHIP, THESIS_TANK

from tools.thesis.batch import simulate_batch
from tools.thesis.reference import simulate_reference
from tools.thesis.simulate import WaveMoment, simulate
from utank_hil.dynamics import RollModel

SHIP = replace(THESIS_SHIP, damping_nms_rad=4.87e7, restoring_odd_nm=(-2e8,))
TANK = replace(THESIS_TANK, damping_ratio=0.1)
MODEL = RollModel(SHIP, TANK)
SEA = WaveMoment(
    np.array([1.5e7, 1e7, 8e6]), np.array([0.45, 0.62, 0.9]), np.array([0.3, 2.0, -1.2])
)


def moment(t):
    return sum(a * np.cos(w * t + p) for a, w, p in zip(*SEA, strict=True))


def largest(run, reference):
    """Largest difference relative to each state's size."""
    return np.max(np.abs(run - reference).max(axis=0) / np.abs(reference).max(axis=0))


@pytest.fixture(scope="module")
def reference():
    return simulate_reference(
        MODEL, 60.0, (0.3, 0, -1.0, 0), wave_moment_nm=moment, samples=61, tolerance=1e-13
    ).state


@pytest.mark.slow
def test_runge_kutta_converges_with_order_four(reference):
    steps = np.array([0.1, 0.05, 0.04, 0.025, 0.02])
    errors = [
        np.abs(
            simulate(
                MODEL, 60.0, (0.3, 0, -1.0, 0), wave=SEA, step_s=step, record_every=round(1 / step)
            ).state
            - reference
        ).max()
        for step in steps
    ]
    order = np.polyfit(np.log(steps), np.log(errors), 1)[0]
    assert order == pytest.approx(4.0, abs=0.1)


def test_compiled_run_equals_the_adaptive_reference(reference):
    run = simulate(MODEL, 60.0, (0.3, 0, -1.0, 0), wave=SEA, step_s=0.01, record_every=100)
    np.testing.assert_allclose(run.time_s, np.arange(61.0), rtol=1e-14)
    assert largest(run.state, reference) < 1e-8


@pytest.mark.parametrize("ship", [SHIP, PATTI, LEVERS], ids=["thesis", "patti", "levers"])
def test_compiled_accelerations_equal_the_model(ship):
    from utank_hil.dynamics.kernels import Held, accelerations

    ship = replace(ship, quadratic_damping_nms2_rad2=3e8, offset_moment_nm=1e6, wind_moment_nm=-2e6)
    tank = replace(TANK, quadratic_loss=2.0)
    model = RollModel(ship, tank)
    rng = np.random.default_rng(3)
    states = rng.uniform(-1, 1, (500, 4)) * [1.4, 0.5, 4.8, 3]
    pressure, wave, sway = rng.uniform(-1, 1, (3, 500)) * [[5e4], [2e7], [0.3]]
    expected = model.derivative(states, pressure, wave, 3e4, 9.80665 * sway)
    area_m2 = tank.reservoir_area_m2
    values = [
        accelerations(
            Held(model.coefficients, *model.packed[1:], area_m2 * p, area_m2 * 3e4),
            *state,
            w,
            s,
            0.0,
        )
        for state, p, w, s in zip(states, pressure, wave, sway, strict=True)
    ]
    scale = np.abs(expected[:, [1, 3]]).max(axis=0)
    assert np.max(np.abs(values - expected[:, [1, 3]]) / scale) < 1e-13


@given(st.floats(-20, 20))
def test_compiled_sine_and_cosine_are_exact_to_rounding(angle):
    from utank_hil.dynamics.kernels import sine_cosine

    sine, cosine = sine_cosine(angle)
    assert abs(sine - np.sin(angle)) < 2e-15
    assert abs(cosine - np.cos(angle)) < 2e-15


@pytest.mark.parametrize("restitution", [0.0, 0.3, 1.0])
def test_strikes_equal_the_reference(restitution):
    tank = replace(PATTI_TANK, headroom_m=0.4, restitution=restitution, damping_ratio=0.05)
    model = RollModel(PATTI, tank)
    wave = WaveMoment([1e4], [0.6], [0.3])
    exact = simulate_reference(
        model,
        30.0,
        (0.2, 0, 0, 0),
        wave_moment_nm=lambda t: 1e4 * np.cos(0.6 * t + 0.3),
        samples=1501,
    )
    run = simulate(model, 30.0, (0.2, 0, 0, 0), wave=wave, step_s=0.02)
    assert len(run.impacts) == len(exact.impacts) >= 2
    np.testing.assert_allclose(run.impacts, exact.impacts, rtol=1e-6)
    assert largest(run.state, exact.state) < 1e-7
    finer = simulate(model, 30.0, (0.2, 0, 0, 0), wave=wave, step_s=0.01, record_every=2)
    assert largest(finer.state, exact.state) < largest(run.state, exact.state) / 8
    assert np.abs(run.state[:, 2]).max() <= 0.4


@pytest.mark.parametrize("restitution", [0.0, 0.3])
def test_pressed_against_the_stop_equals_the_reference(restitution):
    """The pump lifts the water to the roof, holds it there, and lets it go as the ship rolls."""
    tank = replace(TANK, headroom_m=0.5, restitution=restitution)
    model = RollModel(SHIP, tank)
    exact = simulate_reference(
        model, 60.0, (0.05, 0, 0, 0), pressure_pa=lambda _: 1e4, samples=601, tolerance=1e-11
    )
    run = simulate(model, 60.0, (0.05, 0, 0, 0), pressure_pa=1e4, step_s=0.01, record_every=10)
    pressed = np.abs(exact.state[:, 2] - 0.5) < 1e-9
    assert 100 < pressed.sum() < 400
    assert largest(run.state, exact.state) < 1e-5


def test_inputs_are_held_between_samples():
    """Piecewise constant pressure and valve loss against restarted reference runs."""
    pressure, loss = [2e4, -3e4, 1e4], [0.0, 2e3, 1e4]
    run = simulate(
        MODEL,
        4.0,
        (0.1, 0, 0.5, 0),
        pressure_pa=pressure,
        valve_loss_pa_per_m2_s2=loss,
        hold_s=1.0,
        step_s=0.01,
    )
    state = np.array([0.1, 0, 0.5, 0])
    for p, extra in zip([*pressure, 1e4], [*loss, 1e4], strict=True):
        from scipy.integrate import solve_ivp

        state = solve_ivp(
            lambda _, x, p=p, extra=extra: MODEL.derivative(x, p, 0.0, extra),
            (0, 1),
            state,
            rtol=1e-10,
            atol=1e-12,
        ).y[:, -1]
    np.testing.assert_allclose(run.state[-1], state, rtol=1e-6)


def test_phasors_do_not_drift():
    """Seen through a ship of huge inertia: its roll rate is the integral of the wave moment."""
    ship = replace(SHIP, inertia_kg_m2=1e22, stiffness_nm_rad=1.0, damping_nms_rad=0.0)
    wave = WaveMoment([1e16], [0.5], [np.pi / 2])  # -sin: the rate is 2e-6 (cos 0.5 t - 1)
    run = simulate(RollModel(ship, TANK), 10_000.0, wave=wave, record_every=50)
    np.testing.assert_allclose(
        run.state[:, 1], 2e-6 * (np.cos(0.5 * run.time_s) - 1), atol=2e-6 * 1e-6
    )


def random_batch(runs=7, waves=12):
    rng = np.random.default_rng(9)
    sea = WaveMoment(
        rng.uniform(1e6, 6e6, (runs, waves)),
        np.linspace(0.3, 1.2, waves),
        rng.uniform(0, 6, (runs, waves)),
    )
    return sea, rng.normal(0, 0.1, (runs, 4))


def test_batch_equals_single_runs_to_the_last_bit():
    sea, initial = random_batch()
    batch = simulate_batch(MODEL, 30.0, initial, wave=sea, record_every=25)
    for n, start in enumerate(initial):
        wave = WaveMoment(sea.amplitude[n], sea.frequency_rad_s, sea.phase_rad[n])
        run = simulate(MODEL, 30.0, start, wave=wave, record_every=25)
        np.testing.assert_array_equal(batch.history[n], run.state[:-1])
        np.testing.assert_array_equal(batch.state[n], run.state[-1])
    np.testing.assert_allclose(batch.time_s, run.time_s[:-1])


def test_batch_does_not_depend_on_cores():
    import numba

    sea, initial = random_batch()
    full = simulate_batch(MODEL, 60.0, initial, wave=sea)
    threads = numba.get_num_threads()
    numba.set_num_threads(1)
    try:
        alone = simulate_batch(MODEL, 60.0, initial, wave=sea)
    finally:
        numba.set_num_threads(threads)
    np.testing.assert_array_equal(full.state, alone.state)
    assert full.history.shape == (7, 0, 4)


def test_capsized_ships_stop_where_they_capsized():
    model = RollModel(PATTI, PATTI_TANK)
    initial = np.array([[0.05, 0, 0, 0], [0.5, 0.5, 0, 0]])
    batch = simulate_batch(model, 50.0, initial)
    assert batch.capsized_s[0] == np.inf
    assert 0 < batch.capsized_s[1] < 50
    assert batch.max_roll_rad[1] >= np.pi / 2 > batch.max_roll_rad[0]
    run = simulate(model, 50.0, initial[1])
    assert run.capsized_s == run.time_s[-1] == batch.capsized_s[1]
    np.testing.assert_array_equal(run.state[-1], batch.state[1])
    assert np.all(np.abs(run.state[:-1, 0]) < np.pi / 2)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"duration_s": 1.01}, "duration_s must be a whole number of steps"),
        ({"duration_s": 1.0, "step_s": 0.0}, "step_s must be positive"),
        ({"duration_s": 1.0, "initial": [0, 0]}, "initial"),
        ({"duration_s": 1.0, "wave": WaveMoment([1.0, 2.0], [1.0], [0.0])}, "wave"),
        ({"duration_s": 1.0, "record_every": 0}, "record_every"),
    ],
)
@pytest.mark.parametrize("run", [simulate, simulate_batch])
def test_bad_arguments_are_refused_by_name(run, arguments, message):
    with pytest.raises(ValueError, match=message):
        run(MODEL, **arguments)


def test_a_pressure_s_hold_must_be_whole_steps():
    with pytest.raises(ValueError, match="hold_s must be a whole number"):
        simulate(MODEL, 1.0, hold_s=0.03)


def test_batches_of_unequal_lengths_are_refused():
    with pytest.raises(ValueError, match="one per run"):
        simulate_batch(MODEL, 1.0, np.zeros((2, 4)), wave=WaveMoment(np.ones((3, 1)), [1.0], [0.0]))


def test_the_sea_s_harmonics_are_taken_as_they_are():
    from utank_hil.sea import Harmonics

    sea = simulate(MODEL, 10.0, wave=Harmonics(*SEA))
    np.testing.assert_array_equal(sea.state, simulate(MODEL, 10.0, wave=SEA).state)
