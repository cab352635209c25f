"""Sickness models against the tables and formulas of their sources, and against each other."""

import math
from statistics import NormalDist

import numpy as np
import pytest

from utank_hil.analysis.motion.comfort import (
    motion_sickness_dose,
    motion_sickness_incidence,
    vertical_weighting,
)

G = 9.80665
# ISO 2631-1:1997 table 3, W_f in thousandths
TABLE = {
    0.02: 24.2, 0.025: 37.7, 0.0315: 59.7, 0.04: 97.1, 0.05: 157, 0.063: 267, 0.08: 461,
    0.1: 695, 0.125: 895, 0.16: 1006, 0.2: 992, 0.25: 854, 0.315: 619, 0.4: 384, 0.5: 224,
    0.63: 116, 0.8: 53.0, 1.0: 23.5,
}  # fmt: skip


def test_weighting_is_the_standards_table():
    weight = 1e3 * np.abs(vertical_weighting(np.array(list(TABLE))))
    np.testing.assert_allclose(weight, list(TABLE.values()), rtol=3e-3)


def ohanlon_mccauley_1974(acceleration_m_s2: float, frequency_hz: float) -> float:
    """The older formula for two hours; RMS in g, as O'Hanlon and McCauley measured it."""
    mu = -0.819 + 2.32 * math.log10(2 * math.pi * frequency_hz) ** 2
    return 100 * NormalDist().cdf((math.log10(acceleration_m_s2 / G) - mu) / 0.4)


@pytest.mark.parametrize("frequency_hz", [0.14, 0.17, 0.2, 0.25])
@pytest.mark.parametrize("acceleration_g", [0.05, 0.1, 0.2])
def test_incidence_after_two_hours_agrees_with_the_older_formula(frequency_hz, acceleration_g):
    newer = motion_sickness_incidence(acceleration_g * G, frequency_hz, 7200)
    assert newer == pytest.approx(ohanlon_mccauley_1974(acceleration_g * G, frequency_hz), abs=6)


def test_incidence_by_hand():
    # 0.1 g at 0.2 Hz for two hours: z_a = -0.3328, z_t = 0.8542
    assert motion_sickness_incidence(0.1 * G, 0.2, 7200) == pytest.approx(29.70, abs=0.01)


def test_incidence_is_worst_near_a_sixth_of_a_hertz_and_grows_with_time():
    frequency = np.linspace(0.05, 0.5, 451)
    msi = [motion_sickness_incidence(1.0, f, 7200) for f in frequency]
    assert frequency[int(np.argmax(msi))] == pytest.approx(0.16, abs=0.01)
    times = [motion_sickness_incidence(1.0, 0.2, t) for t in (600, 3600, 7200, 14400)]
    assert times == sorted(times)
    assert motion_sickness_incidence(0.0, 0.2, 7200) == 0


@pytest.mark.parametrize("wrong", [(-1, 0.2, 60), (1, 0, 60), (1, 0.2, 0)])
def test_impossible_motion_is_refused(wrong):
    with pytest.raises(ValueError, match="motion sickness needs"):
        motion_sickness_incidence(*wrong)


def test_dose_of_a_sinusoid_is_its_weighted_rms_times_the_root_of_time():
    step_s, duration_s, frequency_hz = 0.05, 3600, 0.125
    time = np.arange(0, duration_s, step_s)
    heave = 7.0 + 0.5 * np.sin(2 * np.pi * frequency_hz * time)
    dose = motion_sickness_dose(heave, step_s)
    assert dose == pytest.approx(0.895 * 0.5 / math.sqrt(2) * 60, rel=1e-3)
