"""The share that pays: found with gains for less pressure, missed with shares of a command."""

import pytest

from tools.studies.less_pressure import GAINS, OF_COMMAND, OF_GAIN, roll_over_passive

pytestmark = pytest.mark.slow


def test_a_share_that_pays_is_found():
    """In waves of 8 s a small share of the command, or of the gain, rolls the ship more."""
    of_command, of_gain, gains = (
        roll_over_passive(way, 1.0, 3.0, 8.0, 400.0, 2)[0] for way in (OF_COMMAND, OF_GAIN, GAINS)
    )
    assert gains < 0.95
    assert min(of_command, of_gain) > 1.03


def test_a_ship_that_rolls_faster_than_its_file_says_is_quieted_too():
    assert roll_over_passive(GAINS, 0.85, 3.0, 8.0, 400.0, 2)[0] < 0.9
