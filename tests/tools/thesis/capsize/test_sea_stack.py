import re

import numpy as np
import pytest

from tools.thesis.capsize.sea_stack import stacked_seas
from utank_hil.dynamics import WaveMoment
from utank_hil.sea import Sea, jonswap


def test_each_row_is_one_sea() -> None:
    moments = [
        Sea.irregular(jonswap(3.0, 9.0), seed, components=16).roll_moment(5e5) for seed in (1, 2, 3)
    ]
    stack = stacked_seas(moments)
    for row, moment in enumerate(moments):
        np.testing.assert_array_equal(stack.amplitude[row], moment.amplitude)
        np.testing.assert_array_equal(stack.frequency_rad_s[row], moment.frequency_rad_s)
        np.testing.assert_array_equal(stack.phase_rad[row], moment.phase_rad)


ONE = WaveMoment([1.0, 2.0], [0.5, 0.6], [0.0, 0.0])


@pytest.mark.parametrize(
    ("seas", "error", "reason"),
    [
        ([], ValueError, "seas is empty"),
        (ONE, TypeError, "a collection of single seas, got one WaveMoment: put it in a list"),
        ([Sea.regular(1.0, 0.6)], TypeError, "seas[0] is of type Sea and has no amplitude"),
        ([ONE, WaveMoment([1.0], [0.5], [0.0])], ValueError, "seas[1]: amplitude, frequency and"),
        ([WaveMoment([1.0], [0.5, 0.6], [0.0])], ValueError, "seas[0]: amplitude, frequency and"),
        ([WaveMoment([[1.0]], [[0.5]], [[0.0]])], ValueError, "got (1, 1)"),
    ],
)
def test_what_is_no_list_of_seas_is_refused_by_name(
    seas: object, error: type[Exception], reason: str
) -> None:
    with pytest.raises(error, match=re.escape(reason)):
        stacked_seas(seas)  # type: ignore[arg-type]
