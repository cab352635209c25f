"""How many discarded samples are too many."""

import pytest

from utank_hil.safety.monitors.motion import SpikeCount


@pytest.mark.parametrize(("new", "found"), [(4, [False]), (5, [True, False]),
                                            (6, [True, True, False]),
                                            (99, [True, True, False])])  # fmt: skip
def test_more_than_four_are_too_many_and_one_a_second_is_forgotten(new, found):
    for quiet in range(3):
        count = SpikeCount()
        assert count.found is False
        assert not any(count.update(0, 1.0) for _ in range(quiet))
        seen = []
        for _ in found:
            seen.append(count.update(new, 1.0))
            assert count.found is seen[-1]
        assert seen == found


def test_a_second_is_a_second_in_steps_of_any_length():
    for steps in (1, 2, 4, 8):
        count = SpikeCount()
        assert not count.update(4, 0.125)
        for k in range(steps):
            assert not count.update(4, 1 / steps), k
        assert not count.update(5, 0.0)  # three and one
        assert count.update(6, 0.0)
