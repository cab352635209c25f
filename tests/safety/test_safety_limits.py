"""The thresholds that a configuration gets if it says nothing, and the largest it may ask for."""

import dataclasses
import math

import pytest

from utank_hil.safety.monitors.thresholds import SensorFigures
from utank_hil.safety.safety_limits import SafetyLimits

# name: default, most
LIMITS = {
    "motion_age_ms": (40, 1000),
    "motion_2_age_ms": (None, 1000),
    "motion_spare_age_ms": (100, 1000),
    "hardwired_age_ms": (150, 1000),
    "tank_age_ms": (1000, 1000),
    "tank_degraded_age_ms": (100, 1000),
    "pump_age_ms": (1000, 1000),
    "pump_degraded_age_ms": (200, 1000),
    "forecast_age_ms": (600, 1000),
    "drive_age_ms": (60, 1000),
    "echo_age_ms": (100, 1000),
    "drive_enabled_within_ms": (40, 1000),
    "valve_age_ms": (60, 1000),
    "valve_echo_age_ms": (100, 1000),
    "valve_follows_within_ms": (100, 1000),
    "valve_off_within_ms": (300, 1000),
    "panel_age_to_arm_ms": (600, 1000),
    "panel_age_armed_ms": (5000, 10_000),
    "arming_timeout_ms": (2000, 10_000),
    "roll_limit_rad": (0.35, 0.7),
    "heel_limit_rad": (0.14, 0.28),
    "bus_load_limit": (0.8, 0.85),
    "long_overrun_ms": (50, 1000),
    "overruns_in_ten": (3, 10),
}


def test_thresholds_are_those_of_the_safety_manual():
    assert dataclasses.asdict(SafetyLimits()) == {
        name: default for name, (default, _) in LIMITS.items()
    }
    assert SafetyLimits(overruns_in_ten=None).overruns_in_ten is None


@pytest.mark.parametrize("name", LIMITS)
def test_no_threshold_is_beyond_what_switches_a_protection_off(name):
    most = LIMITS[name][1]
    least = {"overruns_in_ten": 1, "heel_limit_rad": 1e-3}.get(name, most * 1e-6)
    for value in (least, most):
        assert getattr(SafetyLimits(**{name: value}), name) == value
    above = most + 1 if name == "overruns_in_ten" else math.nextafter(most, math.inf)
    for value in (0, -1, above, math.nan):
        with pytest.raises(ValueError, match=name):
            SafetyLimits(**{name: value})


@pytest.mark.parametrize(
    ("name", "most"),
    [("roll_noise_rad", 2e-3), ("roll_rate_noise_rad_s", 1e-2), ("level_noise_m", 0.05)],
)
def test_no_noise_is_so_great_that_the_monitors_are_as_good_as_switched_off(name, most):
    """Degrees in the place of radians: a wrong sign of the rate took a minute to be found."""
    assert getattr(SensorFigures(**{name: most}), name) == most
    usual = getattr(SensorFigures(), name)  # a thousandth of it is a figure in another unit
    for value in (0, 1e-3 * usual, math.nextafter(most, math.inf), math.nan):
        with pytest.raises(ValueError, match=name):
            SensorFigures(**{name: value})
