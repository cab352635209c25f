from itertools import accumulate

from hypothesis import given
from hypothesis import strategies as st

from utank_hil.base.tick import Schedule

gaps = st.lists(st.integers(1, 700), min_size=1, max_size=60)


@given(st.integers(0, 10**12), st.integers(1, 200), gaps)
def test_due_once_at_the_first_look_at_or_after_each_point(start_ns, period_ns, gaps_ns):
    schedule = Schedule(period_ns)
    assert schedule.due(start_ns)
    passed = 0
    for now_ns in accumulate(gaps_ns, initial=start_ns):
        if now_ns == start_ns:
            assert not schedule.due(now_ns)
            continue
        points = (now_ns - start_ns) // period_ns
        assert schedule.due(now_ns) == (points > passed)
        passed = points
