import numpy as np
import pytest

from tools.thesis.figure import Curve, Panel, Row, Verdict, peaks, printed_text


@pytest.mark.parametrize(
    ("printed", "ours", "deviation"),
    [
        (4.0, 5.0, 0.25),
        (-4.0, -3.0, -0.25),
        ((4.0, 5.0), 4.5, 0.0),
        ((4.0, 5.0), 6.0, 0.2),
        ((4.0, 5.0), 2.0, -0.5),
        (4.0, None, None),
    ],
)
def test_deviation_is_relative_and_zero_within_a_printed_range(printed, ours, deviation):
    found = Row("", "", printed, ours, "").deviation
    assert found == (deviation if deviation is None else pytest.approx(deviation))


def test_more_curves_than_can_be_told_apart_are_refused():
    curve = Curve("", np.zeros(2), np.zeros(2))
    assert Panel("", "", "", (curve,) * 4)
    for curves in ((), (curve,) * 5):
        with pytest.raises(ValueError, match="must have 1 to 4 curves"):
            Panel("", "", "", curves)


def test_peaks_are_inner_maxima():
    assert peaks([0, 1, 0, 2, 2, 1]) == 2
    assert peaks([0, 1, 2]) == 0


def test_texts():
    assert printed_text(Row("", "", (0.02, 0.04), None, "")) == "0.02 to 0.04"
    assert printed_text(Row("", "", (10.0, np.inf), None, "")) == "10 or more"
    assert printed_text(Row("", "", (0.0, 1.3), None, "")) == "less than 1.3"
    assert Verdict.of(True) is Verdict.HOLDS
    assert Verdict.of(False) is Verdict.FAILS
