import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from utank_hil.retuning.law_bank import SampleHistory


@given(
    capacity=st.integers(1, 12),
    samples=st.integers(0, 60),
    asked=st.integers(0, 20),
    outputs=st.integers(1, 3),
)
def test_latest_rows_are_those_of_a_list(
    capacity: int, samples: int, asked: int, outputs: int
) -> None:
    history, rows = SampleHistory(capacity, outputs), []
    for k in range(samples):
        y = np.arange(outputs) + 10.0 * k
        history.add(-float(k), y, fresh=k % 3 > 0)
        rows.append([-float(k), *y])
        kept = min(asked, capacity, len(rows))
        expected = np.array(rows[len(rows) - kept :]).reshape(kept, 1 + outputs)
        latest = history.latest(asked)
        assert np.array_equal(latest, expected)
        assert latest.flags.c_contiguous
        expected[[(k - kept + 1 + i) % 3 == 0 for i in range(kept)], 1:] = np.nan
        assert np.array_equal(history.record(asked), expected, equal_nan=True)
    assert history.count == samples
