"""The controller that does nothing."""

import numpy as np
import pytest

from utank_hil.control import PassiveController


def test_pressure_is_zero_for_each_pump():
    np.testing.assert_array_equal(PassiveController(2).step(np.ones(3)), np.zeros(2))


@pytest.mark.parametrize("bad", [{"inputs": 0}, {"sample_time_s": -1.0}, {"sample_time_s": np.nan}])
def test_what_is_no_pump_or_no_time_is_refused_by_name(bad):
    with pytest.raises(ValueError, match=f"{next(iter(bad))} must be"):
        PassiveController(**bad)
