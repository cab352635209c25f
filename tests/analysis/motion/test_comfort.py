"""Apparent gravity against rigid-body kinematics in an inertial frame; criteria by hand."""

import math

import numpy as np
import pytest

from utank_hil.analysis.motion.comfort import (
    NORDFORSK_1987,
    allowed_work,
    apparent_gravity,
    comfort,
    motion_induced_interruptions,
)

pytestmark = pytest.mark.slow

G, STEP_S = 9.80665, 0.02
TIME = np.arange(0, 600, STEP_S)


def rolling(amplitude_deg: float, frequency_rad_s: float = 0.6):
    amplitude = math.radians(amplitude_deg)
    roll = amplitude * np.sin(frequency_rad_s * TIME)
    rate = amplitude * frequency_rad_s * np.cos(frequency_rad_s * TIME)
    return roll, rate


def test_apparent_gravity_is_gravity_minus_the_places_acceleration_in_space():
    roll, rate = rolling(25.0)
    height, starboard = 9.0, 4.0
    # the place in space, y to starboard and z down with the ship upright, and its acceleration
    cosine, sine = np.cos(roll), np.sin(roll)
    space = np.array([starboard * cosine + height * sine, starboard * sine - height * cosine])
    force = np.array([[0.0], [G]]) - np.gradient(np.gradient(space, STEP_S, axis=1), STEP_S, axis=1)
    expected = (cosine * force[0] + sine * force[1], -sine * force[0] + cosine * force[1])
    found = apparent_gravity(roll, rate, STEP_S, height, starboard)
    for mine, theirs in zip(found, expected, strict=True):
        np.testing.assert_allclose(mine[5:-5], theirs[5:-5], atol=2e-3)


def test_small_roll_feels_g_plus_height_times_frequency_squared():
    roll, rate = rolling(1.0)
    found = comfort(roll, rate, STEP_S, height_m=10.0)
    rms = math.radians(1.0) / math.sqrt(2)
    assert found.lateral_rms_m_s2 == pytest.approx((G + 10 * 0.6**2) * rms, rel=2e-3)
    assert found.gravity_angle_rms_rad == pytest.approx((1 + 10 * 0.6**2 / G) * rms, rel=2e-3)


def test_off_the_centre_line_roll_lifts_the_deck():
    roll, rate = rolling(5.0)
    found = comfort(roll, rate, STEP_S, height_m=0.0, starboard_m=8.0)
    rms = 8 * 0.6**2 * math.radians(5.0) / math.sqrt(2)
    assert found.vertical_rms_m_s2 == pytest.approx(rms, rel=0.02)
    centre = comfort(roll, rate, STEP_S, height_m=0.0)
    assert found.sickness_dose_m_s15 > 5 * centre.sickness_dose_m_s15
    assert found.sickness_percent > centre.sickness_percent


def test_a_ship_at_rest_is_comfortable():
    still = np.zeros(500)
    found = comfort(still, still, STEP_S, height_m=10.0, starboard_m=5.0)
    assert found.lateral_rms_m_s2 == found.sickness_percent == found.interruptions_per_min == 0
    assert found.allowed_work == tuple(limit.work for limit in NORDFORSK_1987)


def test_interruptions_count_both_sides_and_begin_at_the_tipping_angle():
    for amplitude_deg, tips in ((13.9, 0.0), (14.2, 2.0)):  # atan(0.25) = 14.04 degrees
        roll, rate = rolling(amplitude_deg, 2 * np.pi / 10)
        found = motion_induced_interruptions(*apparent_gravity(roll, 0 * rate, STEP_S, 0.0), STEP_S)
        assert found == pytest.approx(tips * 6, abs=0.2)  # six rolls a minute


@pytest.mark.evidence
def test_interruptions_in_gaussian_roll_are_rices_rate_of_crossings():
    rng = np.random.default_rng(5)
    time = np.arange(0, 40_000, 0.1)
    frequency = 0.6 + 0.05 * rng.standard_normal(150)
    phase = rng.uniform(0, 2 * np.pi, 150)
    lateral = np.cos(np.outer(time, frequency) + phase).sum(axis=1)
    lateral *= 1.2 / lateral.std()
    vertical = np.full_like(lateral, G)
    zero_crossing_s = 2 * np.pi / math.sqrt(np.mean(frequency**2))
    rice = 2 * 60 / zero_crossing_s * math.exp(-((0.25 * G) ** 2) / (2 * 1.2**2))
    assert motion_induced_interruptions(lateral, vertical, 0.1) == pytest.approx(rice, rel=0.1)


def test_work_is_limited_by_the_worst_of_three_motions():
    gentle = math.radians(1.9), 0.02 * G, 0.01 * G
    assert len(allowed_work(*gentle)) == 5
    assert allowed_work(math.radians(3.5), *gentle[1:]) == (
        "light manual work",
        "heavy manual work",
    )
    assert allowed_work(gentle[0], 0.08 * G, gentle[2]) == ("light manual work",)
    assert allowed_work(*gentle[:2], 0.3 * G) == ()


# NORDFORSK 1987 as printed: roll in degrees, lateral and vertical acceleration in g, RMS
PRINTED = {
    "light manual work": (6.0, 0.10, 0.20),
    "heavy manual work": (4.0, 0.07, 0.15),
    "intellectual work": (3.0, 0.05, 0.10),
    "transit passengers": (2.5, 0.04, 0.05),
    "cruise liner": (2.0, 0.03, 0.02),
}


@pytest.mark.parametrize("work", PRINTED)
@pytest.mark.parametrize("motion", range(3))
def test_work_ends_at_each_printed_limit(work: str, motion: int) -> None:
    roll_deg, lateral_g, vertical_g = PRINTED[work]
    limits = [math.radians(roll_deg), lateral_g * G, vertical_g * G]
    for share, allowed in ((0.99, True), (1.01, False)):
        rms = [0.0, 0.0, 0.0]
        rms[motion] = share * limits[motion]
        assert (work in allowed_work(*rms)) == allowed


def test_sickness_is_of_the_same_exposure_however_long_the_record() -> None:
    roll, rate = rolling(5.0)
    long = comfort(roll, rate, STEP_S, height_m=0.0, starboard_m=8.0)
    short = comfort(*(x[: len(x) // 4] for x in (roll, rate)), STEP_S, 0.0, 8.0)
    assert short.sickness_dose_m_s15 == pytest.approx(long.sickness_dose_m_s15, rel=0.12)
    assert short.sickness_percent == pytest.approx(long.sickness_percent, rel=0.12)
