import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from utank_hil.retuning.trial import NOISE_FLOOR, MovingWindow, WindowStatistics, worsening

BEFORE = WindowStatistics(0.02, 1e4, 2e4)


@given(
    window=st.integers(1, 30),
    samples=st.integers(1, 80),
    heel_rad=st.floats(-0.3, 0.3),
    steady_pa=st.floats(-4e4, 4e4),
    seed=st.integers(0, 1000),
)
def test_effort_is_that_of_the_latest_samples(
    window: int, samples: int, heel_rad: float, steady_pa: float, seed: int
) -> None:
    rng = np.random.default_rng(seed)
    rolls = heel_rad + 0.05 * rng.standard_normal(samples)
    pressures = steady_pa + 1e4 * rng.standard_normal(samples)
    moving = MovingWindow(window)
    assert moving.statistics == WindowStatistics(0.0, 0.0, 0.0)
    for k, (roll, pressure) in enumerate(zip(rolls, pressures, strict=True), start=1):
        moving.add(roll, pressure)
        part = slice(max(0, k - window), k)
        statistics = moving.statistics
        assert statistics.roll_rad == pytest.approx(rolls[part].std(), abs=1e-7)
        assert statistics.pressure_pa == pytest.approx(pressures[part].std(), abs=1e-2)
        assert statistics.pressure_rms_pa == pytest.approx(
            np.sqrt(np.mean(pressures[part] ** 2)), abs=1e-2
        )
        assert moving.full == (k >= window)
        assert moving.samples == k
    moving.clear()
    assert moving.statistics == WindowStatistics(0.0, 0.0, 0.0)


def test_a_storm_leaves_nothing_behind_in_the_sums() -> None:
    rng = np.random.default_rng(1)
    moving = MovingWindow(100)
    for roll in 0.3 + 0.2 * rng.standard_normal(100_000):
        moving.add(roll, 1e5 * roll)
    calm = 1e-3 * rng.standard_normal(100)
    for roll in calm:
        moving.add(roll, 1e5 * roll)
    assert moving.statistics.roll_rad == pytest.approx(calm.std(), rel=1e-4)
    assert moving.statistics.pressure_pa == pytest.approx(1e5 * calm.std(), rel=1e-4)


@pytest.mark.parametrize(
    ("roll", "pressure", "steady", "words"),
    [
        (1.2, 1.9, 1.9, ()),
        (1.3, 1.0, 1.0, ("roll",)),
        (0.5, 2.1, 1.0, ("about its mean",)),
        (0.5, 1.0, 2.1, ("pressure",)),
        (2, 3, 3, ("roll", "about its mean")),
    ],
)
def test_worsening_beyond_a_factor_is_named(
    roll: float, pressure: float, steady: float, words: tuple[str, ...]
) -> None:
    after = WindowStatistics(0.02 * roll, 1e4 * pressure, 2e4 * steady)
    found = worsening(BEFORE, after, 1.25, 2.0)
    assert len(found) == len(words)
    assert all(word in reason for word, reason in zip(words, found, strict=True))


def test_what_the_sensors_hardly_tell_is_no_worsening() -> None:
    assert worsening(WindowStatistics(0.0, 0.0, 0.0), NOISE_FLOOR, 1.25, 2.0) == ()
    assert worsening(WindowStatistics(0.0, 0.0, 0.0), WindowStatistics(1e-3, 0.0, 0.0), 1.25, 2.0)
