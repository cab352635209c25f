import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from firmware_sim.truth import MemoryLog


@given(promised=st.integers(0, 60), offered=st.integers(0, 90))
def test_rows_are_kept_up_to_the_promised_length(promised, offered):
    log = MemoryLog(2, promised)
    row = np.zeros(2)
    for index in range(offered):
        row[:] = index, -index
        log.write(row)
    expected = np.array([(i, -i) for i in range(min(offered, promised))])
    np.testing.assert_array_equal(log.rows, expected.reshape(-1, 2))


def test_rows_are_copied_and_of_the_tables_width():
    log = MemoryLog(3, 2)
    row = np.ones(3)
    log.write(row)
    row[:] = 7.0
    assert log.rows.tolist() == [[1.0, 1.0, 1.0]]
    with pytest.raises(ValueError, match="shape"):
        log.write(np.ones(4))
