"""The level observer: exact where its model is, hardly late where the ship pushes, quiet."""

import numpy as np
import pytest

from utank_hil.control import LevelObserver
from utank_hil.dynamics import Tank

TANK = Tank(17.1, 4.88, 17.11, 6.22, lz_m=1.83, damping_ratio=0.10)
PERIOD_S = 0.02


def swing(duration_s, push_m_s2):
    """Level, rate and pressure of the tank's own equation with a push of the ship (fine Euler)."""
    inertia = TANK.density_kg_m3 * TANK.effective_length_m
    level, rate, rows = 1.0, 0.0, []
    for k in range(round(duration_s / 1e-3)):
        time_s = k * 1e-3
        pressure = 40e3 * np.sin(0.7 * time_s)
        if k % 20 == 0:
            rows.append((level, rate, pressure))
        force = pressure - 2 * 9806.65 * level - TANK.loss_pa_per_m_s * rate
        rate += 1e-3 * (force / inertia + push_m_s2 * np.sin(0.55 * time_s))
        level += 1e-3 * rate
    return np.array(rows)


def observe(record, noise_m=0.0):
    rng = np.random.default_rng(0)
    observer, found, pressure = LevelObserver(TANK, PERIOD_S), [], 0.0
    for level, _, now in record:
        observer.update(level + noise_m * rng.normal(), pressure)
        pressure = now
        found.append((observer.level_m, observer.rate_m_s))
    return np.array(found)


def test_converges_to_the_truth_where_its_model_holds():
    record = swing(60, 0.0)
    error = (observe(record) - record[:, :2])[-1000:]
    assert np.abs(error[:, 0]).max() < 1e-3
    assert np.abs(error[:, 1]).max() < 0.01


def test_rate_is_hardly_late_when_the_ship_pushes():
    record = swing(120, 0.25)  # a roll of 5 degrees
    found = observe(record)[-3000:]
    error = np.std(found[:, 1] - record[-3000:, 1])
    assert error < 0.1 * np.std(record[-3000:, 1])


def test_gauge_noise_hardly_reaches_the_rate():
    record = swing(60, 0.0)
    quiet, noisy = observe(record), observe(record, 0.005)
    assert np.std((noisy - quiet)[500:, 1]) < 0.02


@pytest.mark.parametrize("lost_of", [2, 3, 4, 5, 10])
@pytest.mark.parametrize("told", [False, True])
def test_rate_is_right_though_measurements_are_lost(lost_of, told):
    record = swing(60, 0.25)
    observer, found, pressure, periods = LevelObserver(TANK, PERIOD_S), [], 0.0, 0
    for k, (level, _, now) in enumerate(record):
        periods += 1
        if k % lost_of:  # all but one are lost
            if told:
                observer.predict(pressure)
        else:
            observer.update(level, pressure, periods)
            periods = 0
        pressure = now
        found.append((observer.level_m, observer.rate_m_s))
    error = np.array(found) - record[:, :2]
    if not told:  # looked at when a measurement has come
        error = error[::lost_of]
    error = error[len(error) // 2 :]
    assert np.std(error[:, 1]) < 0.13 * np.std(record[:, 1])
    assert np.std(error[:, 0]) < 0.03


def test_starts_anew_at_the_level_after_a_second_without_measurements():
    observer = LevelObserver(TANK, PERIOD_S)
    for level in np.linspace(0, 1, 50):
        observer.update(level, 0.0)
    assert observer.rate_m_s > 0.5
    while observer.next_due_s < np.inf:
        observer.predict(0.0)
    observer.update(-1.0, 0.0, 51)
    assert (observer.level_m, observer.rate_m_s) == (-1.0, 0.0)
    assert observer.next_due_s == PERIOD_S


def test_bad_settings_are_refused():
    with pytest.raises(ValueError, match="must be positive"):
        LevelObserver(TANK, 0.0)
