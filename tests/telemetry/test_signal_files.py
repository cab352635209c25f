"""Tables of anybody's: units from their names, times checked, errors with line and remedy."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from utank_hil.telemetry.signal_files import SignalFileError, even_rows, read_signals, require

PATH = Path("theirs.csv")


def written(folder: Path, text: str) -> Path:
    file = folder / "theirs.csv"
    file.write_text(text)
    return file


def read(folder: Path, text: str) -> dict[str, np.ndarray]:
    return read_signals(written(folder, text))["theirs"]


def test_units_are_read_from_the_names(tmp_path: Path) -> None:
    found = read(
        tmp_path,
        "time_s,roll_deg,pressure_command_kpa,port_level_mm,speed_rad_s,pressure_actual_bar\n"
        "0.0,180.0,25.0,-1500,3.0,0.5\n"
        "0.1,,24,1500,4.0,-0.5\n",
    )
    assert list(found) == [
        "time_s", "roll_rad", "pressure_command_pa", "port_level_m", "speed_rad_s",
        "pressure_actual_pa",
    ]  # fmt: skip
    np.testing.assert_allclose(found["roll_rad"], [np.pi, np.nan])
    np.testing.assert_allclose(found["pressure_command_pa"], [25e3, 24e3])
    np.testing.assert_allclose(found["port_level_m"], [-1.5, 1.5])
    np.testing.assert_allclose(found["pressure_actual_pa"], [5e4, -5e4])


@pytest.mark.parametrize("separator", [",", ";", "\t"])
def test_any_usual_separator_and_a_byte_order_mark_are_read(tmp_path: Path, separator: str) -> None:
    text = "\ufefftime_s,roll_rad\n0,1\n0.5,2\n\n".replace(",", separator)
    found = read(tmp_path, text)
    np.testing.assert_array_equal(found["time_s"], [0, 0.5])
    np.testing.assert_array_equal(found["roll_rad"], [1, 2])


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("time_s,roll_rad\n0,1\n0.1,x\n", "line 3, roll_rad: 'x' is no number"),
        ("time_s;roll_rad\n0;1\n0,1;1\n", "line 3, time_s: '0,1' is no number; write decimals"),
        ("time_s,roll_rad\n0,1\n0.1\n", "line 3 has 1 fields, line 1 names 2"),
        ("0.0,1.0\n0.1,1.0\n", "line 1 holds the number 0.0: it must name the columns"),
        ("time_s,a_m,a_m\n0,1,2\n", "line 1 names 'a_m' twice"),
        ("time_s,roll_rad\n", "has a line of names and no rows"),
        ("\n", "line 1 must name the columns"),
    ],
)
def test_a_wrong_table_is_an_error_with_its_line(tmp_path: Path, text: str, said: str) -> None:
    with pytest.raises(SignalFileError, match=r"theirs\.csv: ") as error:
        read(tmp_path, text)
    assert said in str(error.value)


def test_a_missing_column_is_named_with_what_there_is() -> None:
    columns = {"time_s": np.zeros(3), "roll_grad": np.zeros(3)}
    with pytest.raises(SignalFileError, match="no column roll_rad or roll_deg; it has time_s, rol"):
        require(PATH, columns, "roll_rad")
    with pytest.raises(SignalFileError, match="no column pressure_command_pa or pressure_comm"):
        require(PATH, columns, "pressure_command_pa")
    with pytest.raises(SignalFileError, match="no column level_m, or port_level_m and starboard"):
        require(PATH, columns, "level_m")
    gauges = {"port_level_m": np.zeros(3), "starboard_level_m": np.zeros(3)}
    require(PATH, columns | gauges, "time_s", "level_m")


def table(time_s: np.ndarray) -> dict[str, np.ndarray]:
    return {"time_s": time_s, "roll_rad": np.arange(len(time_s), dtype=float)}


@given(
    begin_s=st.floats(-1e5, 1e6),
    per_sample=st.integers(1, 40),
    count=st.integers(3, 300),
    jitter=st.floats(0, 0.2),
    seed=st.integers(0, 99),
)
def test_even_times_are_put_on_the_grid_of_the_samples(
    begin_s: float, per_sample: int, count: int, jitter: float, seed: int
) -> None:
    step_s = 0.2 / per_sample
    # one in the middle alone, so that the mean rate stays what it is
    off = np.zeros(count)
    off[1 + seed % (count - 2)] = jitter * step_s
    found = even_rows(PATH, table(begin_s + step_s * np.arange(count) + off), 0.2)
    np.testing.assert_allclose(found["time_s"], step_s * np.arange(count), atol=1e-9)
    np.testing.assert_array_equal(found["roll_rad"], np.arange(count))


def test_times_rounded_to_milliseconds_are_even_all_the_same() -> None:
    found = even_rows(PATH, table(np.round(np.arange(400) / 60, 3)), 0.2)
    np.testing.assert_allclose(found["time_s"], np.arange(400) / 60)


def test_a_part_is_taken_and_its_lines_are_those_of_the_file() -> None:
    time_s = np.arange(100) * 0.1
    found = even_rows(PATH, table(time_s), 0.2, 2.0, 5.0)
    np.testing.assert_array_equal(found["roll_rad"], np.arange(20, 51))
    time_s[40:] += 0.5
    with pytest.raises(SignalFileError) as error:
        even_rows(PATH, table(time_s), 0.2, 2.0)
    assert "line 42: time_s goes from 3.9 to 4.5, a gap where rows are 0.1 s" in str(error.value)
    assert "leave it out by --from 4.5 or --to 3.9" in str(error.value)
    assert len(even_rows(PATH, table(time_s), 0.2, 4.5)["time_s"]) == 60


@pytest.mark.parametrize(
    ("time_s", "said"),
    [
        (np.r_[0:1:0.1, 0.95, 1.1:2:0.1], "line 12: time_s is 0.047 s away from even"),
        (np.r_[0:1:0.1, 0.9, 1.0:2:0.1], "line 12: time_s goes from 0.9 to 0.9: times must rise"),
        (np.r_[0:1:0.1, np.nan, 1.1:2:0.1], "line 12 has no time"),
        (np.arange(50) * 0.15, "no whole number of such steps: resample"),
        (np.arange(50) * 0.5, "no whole number of such steps"),
        (np.arange(5000) * 0.1002, "no whole number of such steps"),
        (np.cumsum(0.1 + 0.04 * np.sin(np.arange(50) / 8)), "away from even steps"),
        (np.array([0.0, 0.1]), "2 rows between"),
    ],
)
def test_uneven_times_are_refused_with_the_line_and_the_remedy(
    time_s: np.ndarray, said: str
) -> None:
    with pytest.raises(SignalFileError, match=r"theirs\.csv: ") as error:
        even_rows(PATH, table(time_s), 0.2)
    assert said in str(error.value)
