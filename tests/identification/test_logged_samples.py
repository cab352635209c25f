import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from utank_hil.identification.record import feedback_share, logged_samples

STEP_S = 0.05
COUNT = 400


def _columns(start_s=0.0):
    time_s = start_s + STEP_S * np.arange(COUNT)
    rng = np.random.default_rng(1)
    return {
        "time_s": time_s,
        "roll_rad": rng.standard_normal(COUNT),
        "port_level_m": -np.arange(COUNT) * 0.1,
        "starboard_level_m": np.arange(COUNT) * 0.1,
        "pressure_command_pa": rng.standard_normal(COUNT),
    }


def test_sample_is_the_output_then_and_the_mean_command_since_the_one_before():
    columns = _columns()
    record = logged_samples(columns, ("roll_rad", "level_m"), 0.2)
    assert record.shape == (100, 3)
    for k in range(1, 100):
        mean = np.mean(columns["pressure_command_pa"][4 * (k - 1) : 4 * k])
        assert record[k] == pytest.approx([mean, columns["roll_rad"][4 * k], 0.4 * k])
    assert np.isnan(record[0, 0])


def test_a_gauge_alone_beside_a_column_of_the_level_is_left_aside():
    columns = _columns()
    columns["level_m"] = columns.pop("starboard_level_m")
    record = logged_samples(columns, ("level_m",), 0.2)
    assert record[:, 1] == pytest.approx(columns["level_m"][::4])


@given(st.floats(0.0, 19.0), st.floats(0.0, 25.0))
def test_part_of_a_recording_is_that_part_of_the_whole(from_s, length_s):
    whole = logged_samples(_columns(), ("roll_rad",), 0.2)
    try:
        part = logged_samples(_columns(), ("roll_rad",), 0.2, (from_s, from_s + length_s))
    except ValueError:
        assert length_s < 0.2
        return
    first = int(np.ceil(from_s / 0.2 - 1e-6))
    same = np.nan_to_num(part[1:]) == np.nan_to_num(whole[first + 1 : first + len(part)])
    assert same.all()


def test_rows_that_were_lost_are_gaps():
    columns = _columns()
    kept = np.ones(COUNT, dtype=bool)
    kept[100:141] = False
    record = logged_samples(
        {name: value[kept] for name, value in columns.items()}, ("roll_rad",), 0.2
    )
    assert np.isnan(record[25:36, 1]).all()
    assert np.isfinite(record[1:25, 1]).all()
    assert np.isfinite(record[36:, 1]).all()


@pytest.mark.parametrize(
    ("measured", "part", "word"),
    [
        (("level_rate_m_s",), (0.0, 9.0), "level_rate_m_s"),
        (("roll_rad",), (30.0, math.inf), "nothing between"),
        (("roll_rad",), (5.0, 4.0), "nothing between"),
    ],
)
def test_what_is_not_in_the_recording_is_named(measured, part, word):
    with pytest.raises(ValueError, match=word):
        logged_samples(_columns(), measured, 0.2, part)


def test_a_sample_time_that_rows_do_not_divide_is_served_between_them():
    columns = _columns()
    columns["roll_rad"] = np.sin(0.6 * columns["time_s"])
    kept = np.ones(COUNT, dtype=bool)
    kept[200:240] = False
    columns = {name: value[kept] for name, value in columns.items()}
    record = logged_samples(columns, ("roll_rad",), 0.17)
    at_s = 0.17 * np.arange(len(record))
    there = (at_s < 9.95) | (at_s > 12.0)
    assert record[there, 1] == pytest.approx(np.sin(0.6 * at_s[there]), abs=2e-4)
    assert np.isnan(record[~there, 1]).all()
    # From 0.17 to 0.34 s: 0.03 s of the row at 0.15 s, 0.1 s of the next two, 0.04 s of the last.
    shares = np.array([0.03, 0.05, 0.05, 0.04]) / 0.17
    assert record[2, 0] == pytest.approx(shares @ columns["pressure_command_pa"][3:7])
    assert np.isnan(record[59:71, 0]).all()
    assert np.isfinite(record[1:58, 0]).all()


def _pushed(command, seconds=400.0):
    """Roll in a sea, pushed by what `command` gives for the last roll and the time's number."""
    random = np.random.default_rng(3)
    roll, rate, wave, rows = 0.0, 0.0, 0.0, []
    for k in range(round(seconds / 0.2)):
        u = command(roll, rate, k)
        wave += 0.2 * (random.standard_normal() - wave)
        rate += 0.2 * (-0.36 * roll - 0.06 * rate + 0.02 * wave + 0.01 * u)
        roll += 0.2 * rate
        rows.append((u, roll + 1e-4 * random.standard_normal()))
    return np.array(rows).T


def test_a_law_s_command_follows_the_motion_and_that_of_pulses_does_not():
    pulses = np.repeat(np.random.default_rng(1).choice([-1.0, 1.0], 400), 5)
    u, roll = _pushed(lambda *_: pulses[_[2]])
    assert abs(feedback_share(u, roll[:, None])) < 0.01
    u, roll = _pushed(lambda roll, rate, _: -5 * rate)
    assert feedback_share(u, roll[:, None]) > 0.5
    u[::30] = np.nan  # a gap is no command
    assert feedback_share(u, roll[:, None]) > 0.5
    assert feedback_share(u[:60], roll[:60, None]) == 0.0  # too short to say
