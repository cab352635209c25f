"""What the adaptive fuzzy laws have in common: the brake, the nominal gain, refused parameters."""

import dataclasses

import numpy as np
import pytest

from utank_hil.control.fuzzy.adaptive import RobustFuzzy
from utank_hil.control.fuzzy.indirect import IndirectFuzzy, SmallGainFuzzy
from utank_hil.control.fuzzy.law import ErrorDynamics

COMMON = (ErrorDynamics(0.8, 0.6, 2.5), (0.5, 0.5, 2.0, 2.0), 2e-8)
LAWS = {
    "small gain": SmallGainFuzzy(*COMMON, 0.9, 0.4, adaptation=0.3, leakage=0.2, initial=0.1),
    "robust": RobustFuzzy(
        *COMMON, 0.9, 0.1, adaptation=(0.3, 0.2), leakage=(0.2, 0.1), initial=(0.1, 0.2)
    ),
    "indirect": IndirectFuzzy(*COMMON, adaptation_f=0.1, adaptation_g=0.1, leakage=0.02),
}
Y = np.array([0.1, 0.02, 0.5, 0.3])
every_law = pytest.mark.parametrize("law", LAWS.values(), ids=LAWS)


@every_law
def test_brake_is_pressure_against_the_level_rate_and_nothing_else(law):
    braked = dataclasses.replace(law, brake_pa_s_m=4e3)
    difference = braked.controller().step(Y) - law.controller().step(Y)
    np.testing.assert_allclose(difference, -4e3 * 0.3, rtol=1e-9)


@every_law
def test_pressure_is_acceleration_per_nominal_gain(law):
    twice = dataclasses.replace(law, gain_rad_s2_pa=2 * law.gain_rad_s2_pa)
    np.testing.assert_allclose(2 * twice.controller().step(Y), law.controller().step(Y))


@every_law
@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"gain_rad_s2_pa": 0.0}, "gain_rad_s2_pa must be positive"),
        ({"sample_time_s": np.nan}, "sample_time_s must be 0.001 to 10"),
        ({"brake_pa_s_m": -1.0}, "brake_pa_s_m must be zero or more"),
        ({"ranges": (0.5,)}, "ranges must be those of at least roll"),
        ({"ranges": (0.5,) * 5}, "level_rate_m_s, got 5 numbers"),
        ({"ranges": (0.5, 0.5), "brake_pa_s_m": 1e3}, "level rate as fourth"),
        ({"ranges": (0.5, 0.0, 1.0, 1.0)}, r"ranges\.1 must be positive"),
    ],
)
def test_parameters_out_of_range_are_refused_by_name(law, change, message):
    with pytest.raises(ValueError, match=message):
        dataclasses.replace(law, **change)
