"""Times of a log: steps, stray stamps and silences are found, said, and mended where one way is."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from utank_hil.telemetry.bus_files.frame import BusFrame, BusLogError, FrameKind
from utank_hil.telemetry.bus_files.log import OneClock

DAY_S = 86_400


def on_one_clock(times_s):
    """Return times in s on one clock, and the notes."""
    frames = [
        BusFrame(round(float(t) * 1e9), "can0", number, True, FrameKind.DATA, b"", 0)
        for number, t in enumerate(times_s)
    ]
    read: list[int] = []

    def source():
        for number, frame in enumerate(frames, start=1):
            read.append(number)
            yield frame

    clock = OneClock("a.log", source(), lambda: f"line {read[-1]}")
    found = list(clock)
    assert [frame.number for frame in found] == list(range(len(frames)))  # none is lost
    return np.array([frame.time_ns for frame in found]) * 1e-9, clock.notes


EVEN = np.arange(400) * 0.005


def test_a_log_in_order_is_left_as_it_is():
    for times in (EVEN, EVEN * 1000, np.arange(9) * 3600.0, np.zeros(5)):
        found, notes = on_one_clock(times)
        np.testing.assert_allclose(found, times, atol=1e-9)
        assert notes == []


@given(at=st.integers(20, 350), step_s=st.sampled_from([-7200.0, -0.5, 2 * DAY_S, 1.7e9, -DAY_S]))
def test_a_step_is_said_with_its_place_and_times_go_on(at, step_s):
    times = EVEN.copy() + 10.0
    times[at:] += step_s
    found, (note,) = on_one_clock(times)
    assert f"line {at + 1}: stamps step {'ahead' if step_s > 0 else 'back'} by" in note
    assert (np.diff(found) >= -1e-9).all()
    assert found[-1] - found[0] == pytest.approx(EVEN[-1], abs=0.0051)
    if step_s == -DAY_S:
        assert "midnight" in note
        np.testing.assert_allclose(found, EVEN + 10.0, atol=1e-6)


@given(
    at=st.integers(20, 350),
    count=st.integers(1, 16),
    off_s=st.sampled_from([2.5, -2.5, 0.2, 9e6, -1e4]),
)
def test_a_few_stray_stamps_are_taken_as_the_one_before(at, count, off_s):
    times = EVEN.copy()
    times[at : at + count] += off_s
    found, (note,) = on_one_clock(times)
    stray = "1 stamp is" if count == 1 else f"{count} stamps are"
    assert f"line {at + 1}: {stray} {off_s + 0.005:+.6f} s off those around" in note
    expected = EVEN.copy()
    expected[at : at + count] = EVEN[at - 1]
    np.testing.assert_allclose(found, expected, atol=1e-6)


def test_silence_is_kept_and_said():
    times = EVEN.copy()
    times[100:] += 60.0
    found, (note,) = on_one_clock(times)
    np.testing.assert_allclose(found, times, atol=1e-6)
    assert "line 101: no frame for 60.005000 s, the longest of 1 such gaps" in note


def test_frames_of_a_second_channel_that_come_in_late_are_kept_as_they_are():
    times = EVEN.copy()
    times[50:53] -= 0.2
    found, notes = on_one_clock(times)
    np.testing.assert_allclose(found, times, atol=1e-6)
    assert notes == []


def test_differences_and_times_without_order_are_refused():
    rng = np.random.default_rng(1)
    with pytest.raises(BusLogError, match=r"they count from the frame before \(candump -td\)"):
        on_one_clock(rng.uniform(0.0, 0.009, 400))
    with pytest.raises(BusLogError, match="more than 100 such steps"):
        on_one_clock(np.repeat(rng.uniform(0.0, 1e6, 200), 2))
