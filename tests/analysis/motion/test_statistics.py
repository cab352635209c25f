import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from utank_hil.analysis.motion.statistics import (
    pump_statistics,
    roll_statistics,
    significant_amplitude,
)
from utank_hil.sea import Sea, jonswap

TIME_S = np.arange(0, 200, 0.05)


@given(
    amplitude=st.floats(1e-3, 0.5),
    period_s=st.floats(5, 20),
    phase=st.floats(0, 6.28),
    mean=st.floats(-0.1, 0.1),
)
def test_sine_has_the_textbook_figures(amplitude, period_s, phase, mean):
    whole = period_s * math.floor(200 / period_s)
    time_s = np.linspace(0, whole, 4001)[:-1]
    signal = amplitude * np.sin(2 * math.pi * time_s / period_s + phase)
    statistics = roll_statistics(signal)
    assert statistics.rms_rad == pytest.approx(amplitude / math.sqrt(2), rel=1e-6)
    # the crest may lie half a sample beside the grid
    assert statistics.maximum_rad == pytest.approx(amplitude, rel=2e-3)
    assert statistics.significant_rad == pytest.approx(amplitude, rel=2e-3)
    # significant amplitude is of the motion about its mean; RMS is of the angle itself
    # (rounding of the mean decides which of the waves at the ends are whole)
    shifted = roll_statistics(signal + mean)
    assert shifted.significant_rad == pytest.approx(statistics.significant_rad, rel=2e-3)
    assert shifted.rms_rad == pytest.approx(math.hypot(amplitude / math.sqrt(2), mean), rel=1e-6)


def test_significant_amplitude_is_the_mean_of_the_highest_third_counted_by_hand():
    # six cycles of known heights, the last one not whole
    heights = [1.0, 5.0, 2.0, 6.0, 3.0, 4.0]
    cycle = np.sin(2 * math.pi * (np.arange(200) + 0.5) / 200)
    signal = np.concatenate([[-1e-9], *(height * cycle for height in heights), [-1e-9, 1e-9]])
    crest = cycle.max()
    assert significant_amplitude(signal) == pytest.approx(crest * (6.0 + 5.0) / 2, rel=1e-6)


def test_narrow_gaussian_sea_has_twice_its_standard_deviation():
    elevation = Sea.irregular(jonswap(4.0, 10.0, 7.0), 3, components=400).elevation
    signal = elevation.series(0.1, 36000)
    significant = significant_amplitude(signal)
    assert significant is not None
    # Rayleigh: mean of the highest third of the heights is 4.0 sigma; 3.7 to 4.0 in real seas
    assert significant / signal.std() == pytest.approx(1.92, abs=0.1)


@pytest.mark.parametrize(
    "signal", [np.zeros(10), np.ones(5), np.array([-1.0, 1.0]), np.arange(9.0)]
)
def test_record_without_a_whole_cycle_has_no_significant_amplitude(signal):
    assert significant_amplitude(signal) is None
    assert roll_statistics(signal).significant_rad is None


def test_empty_record_is_refused():
    with pytest.raises(ValueError, match="roll record is empty"):
        roll_statistics(np.empty(0))


def test_pump_figures_count_drawn_power_only():
    pressure = np.array([3.0, -4.0, 0.0, 0.0])
    power = np.array([10.0, -30.0, 20.0, 0.0])
    level = np.array([0.5, -2.0, 1.0, 0.0])
    statistics = pump_statistics(pressure, power, level)
    assert statistics.pressure_rms_pa == 2.5
    assert statistics.pressure_peak_pa == 4.0
    assert statistics.power_mean_w == 7.5
    assert statistics.power_peak_w == 20.0
    assert statistics.level_peak_m == 2.0
