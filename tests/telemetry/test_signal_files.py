"""Tables of anybody's: units from their names, times checked, errors with line and remedy."""

import math
from datetime import datetime
from decimal import Decimal
from pathlib import Path

import numpy as np
import pyarrow
import pytest
from hypothesis import given
from hypothesis import strategies as st
from others import field_case
from pyarrow import parquet

from utank_hil.base.text_files import TextFileError
from utank_hil.nodes.signals import SIGNALS
from utank_hil.telemetry.frame_log import LAYOUT, ROWS, BlockSink, FrameLogWriter, Kind
from utank_hil.telemetry.run_log import _packed
from utank_hil.telemetry.signal_files import even_rows, read_signals, require

PATH = Path("theirs.csv")


def written(folder, text):
    file = folder / "theirs.csv"
    file.write_text(text)
    return file


def read(folder, text):
    return read_signals(written(folder, text))["theirs"]


def test_units_are_read_from_the_names(tmp_path):
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


def test_a_name_of_a_column_that_is_no_text_is_refused_with_the_file(tmp_path):
    file = tmp_path / "a.parquet"
    parquet.write_table(pyarrow.table({"roll_rad": [0.0]}), file, store_schema=False)
    file.write_bytes(file.read_bytes().replace(b"roll_rad", b"roll_\xf2ad"))
    with pytest.raises(ValueError, match=r"a\.parquet: is no Parquet file that can be read"):
        read_signals(file)


def test_a_table_of_too_many_values_is_refused(tmp_path, monkeypatch):
    monkeypatch.setattr("utank_hil.base.text_files.VALUES_LIMIT", 100)
    text = "time_s,roll_rad\n" + "1,2\n" * 50
    assert len(read(tmp_path, text)["roll_rad"]) == 50
    with pytest.raises(ValueError, match=r"theirs\.csv: has more than 100 values"):
        read(tmp_path, text + "1,2\n")


@pytest.mark.parametrize("separator", [",", ";", "\t"])
def test_any_usual_separator_and_a_byte_order_mark_are_read(tmp_path, separator):
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
        ("time_s,a_m\n0,1_5\n", "line 2, a_m: '1_5' is no number"),
        ("time_s,a_m\n0,inf\n", "line 2, a_m: 'inf' is no number"),
        ("time_s,a_m\n0,١٥\n", "line 2, a_m: '١٥' is no number"),
        ("time_s,a_m\n0,0x1p3\n", "line 2, a_m: '0x1p3' is no number"),
        ("time_s,a_m\n0,-1e400\n", "line 2, a_m: -1e400 is too large"),
        ("time_s,a_m\n2026-05-01,1\n5,1\n", "time_s holds dates and numbers"),
        ("time_s,a_m\n,1\n2026-05-01,1\n", "time_s has no date in its first row"),
        ("time_s,roll_m\n0,2026-05-01\n", "line 2, roll_m: '2026-05-01' is no number"),
        ("time_s,,a_m\n0,3,1\n", "line 1 has no name for column 2"),
        ("time_s,roll_deg,roll_rad\n0,3,1\n", "roll_deg and roll_rad are one signal: remove"),
        ("time_ms,time_s\n0,3\n", "time_ms and time_s are one signal: remove"),
        ("0.0,1.0\n0.1,1.0\n", "line 1 holds the number 0.0: it must name the columns"),
        ("time_s,a_m,a_m\n0,1,2\n", "line 1 names 'a_m' twice"),
        ("time_s,roll_rad\n", "has a line of names and no rows"),
        ("\n", "line 1 must name the columns"),
    ],
)
def test_a_wrong_table_is_an_error_with_its_line(tmp_path, text, said):
    with pytest.raises(TextFileError, match=r"theirs\.csv: ") as error:
        read(tmp_path, text)
    assert said in str(error.value)


def test_times_are_read_as_dates_and_in_milliseconds(tmp_path):
    dates = "Time,a_m\n2026-05-01T00:00:00Z,1\n2026-05-01T02:00:00.25+02:00,2\n"
    np.testing.assert_allclose(read(tmp_path, dates)["time_s"], [0, 0.25], atol=1e-6)
    found = read(tmp_path, "time_ms,a_m,\n200,1,\n400,NaN,\n")
    np.testing.assert_allclose(found["time_s"], [0.2, 0.4])
    np.testing.assert_array_equal(found["a_m"], [1, np.nan])


def test_a_time_without_a_unit_is_named_with_its_remedy(tmp_path):
    columns = read(tmp_path, "Time,a_m\n0,1\n1,2\n")
    with pytest.raises(TextFileError, match="name 'Time' time_s if it is in seconds"):
        require(PATH, columns, "time_s")


@given(st.text(alphabet='time_sdegro,;\t\n\r"0159.eE+-_ \ufeff', max_size=80))
def test_any_text_is_a_table_or_a_clear_error(tmp_path_factory, text):
    file = tmp_path_factory.getbasetemp() / "any.csv"
    file.write_text(text, encoding="utf-8", newline="")
    try:
        columns = read_signals(file)["any"]
    except TextFileError as error:
        assert str(error).startswith(f"{file}: ")  # noqa: PT017
    else:
        assert len({len(values) for values in columns.values()}) == 1


def test_parquet_is_read_with_decimals_truth_and_dates(tmp_path):
    content = {
        "time_s": [datetime(2026, 5, 1), datetime(2026, 5, 1, 0, 0, 0, 100_000)],
        "pressure_command_kpa": [Decimal("0.742"), None],
        "armed": [True, False],
        "count": [2**53 + 1, 0],
        "remark": ["a", "b"],
    }
    file = tmp_path / "theirs.parquet"
    parquet.write_table(pyarrow.table(content), file)
    notes: list[str] = []
    found = read_signals(file, notes.append)["theirs"]
    np.testing.assert_allclose(found["time_s"], [0, 0.1], atol=1e-6)
    np.testing.assert_allclose(found["pressure_command_pa"], [742, np.nan])
    np.testing.assert_array_equal(found["armed"], [1, 0])
    assert notes == [f"{file}: columns that are no numbers are left out: remark (string)"]
    with pytest.raises(TextFileError, match="remark"):
        read_signals(file)


def test_a_damaged_parquet_file_is_named(tmp_path):
    file = tmp_path / "theirs.parquet"
    steps = np.arange(4000.0) // 7
    parquet.write_table(pyarrow.table({"time_s": steps}), file, use_dictionary=False)
    content = bytearray(file.read_bytes())
    content[100:600] = b"\xff" * 500
    file.write_bytes(content)
    with pytest.raises(TextFileError, match=r"theirs\.parquet: is no Parquet file"):
        read_signals(file)


@pytest.mark.parametrize(
    ("case", "said"),
    [
        ("08-csv-time_ms/trial.csv", ""),
        ("09-two-columns-for-one-signal/trial.csv", "roll_deg and roll_rad are one signal"),
        ("15-byte-order-mark/signals.csv", ""),
        ("34-table-without-time_s/probes.csv", "name 'Time' time_s if it is in seconds"),
        ("34-table-without-time_s/trial.csv", "name 'time' time_s if it is in seconds"),
        ("34-table-without-time_s/dates.parquet", ""),
        ("37-parquet-columns-left-out/decimals.parquet", ""),
        ("38-fields-that-are-no-numbers/fields.csv", "line 3, level_m: '1_5' is no number"),
    ],
)
def test_tables_that_people_had_trouble_with(case, said):
    path = field_case(case)
    if said:
        with pytest.raises(TextFileError, match=said):
            require(path, read_signals(path)[path.stem], "time_s")
    else:
        columns = read_signals(path)[path.stem]
        assert columns["time_s"][0] == 0
        assert np.median(np.diff(columns["time_s"])) == pytest.approx(0.2 if "csv" in case else 0.1)


def test_a_missing_column_is_named_with_what_there_is():
    columns = {"time_s": np.zeros(3), "roll_grad": np.zeros(3)}
    with pytest.raises(TextFileError, match="no column roll_rad or roll_deg; in SI units it has"):
        require(PATH, columns, "roll_rad")
    with pytest.raises(TextFileError, match="no column pressure_command_pa or pressure_comm"):
        require(PATH, columns, "pressure_command_pa")
    with pytest.raises(TextFileError, match="no column level_m, or port_level_m and starboard"):
        require(PATH, columns, "level_m")
    gauges = {"port_level_m": np.zeros(3), "starboard_level_m": np.zeros(3)}
    require(PATH, columns | gauges, "time_s", "level_m")


def table(time_s):
    return {"time_s": time_s, "roll_rad": np.arange(len(time_s), dtype=float)}


@given(
    begin_s=st.floats(-1e5, 1e6),
    per_sample=st.integers(1, 40),
    count=st.integers(3, 300),
    jitter=st.floats(0, 0.2),
    seed=st.integers(0, 99),
)
def test_even_times_are_put_on_the_grid_of_the_samples(begin_s, per_sample, count, jitter, seed):
    step_s = 0.2 / per_sample
    # one in the middle alone, so that the mean rate stays what it is
    off = np.zeros(count)
    off[1 + seed % (count - 2)] = jitter * step_s
    found = even_rows(PATH, table(begin_s + step_s * np.arange(count) + off), 0.2)
    np.testing.assert_allclose(found["time_s"], step_s * np.arange(count), atol=1e-9)
    np.testing.assert_array_equal(found["roll_rad"], np.arange(count))


def test_times_rounded_to_milliseconds_are_even_all_the_same():
    found = even_rows(PATH, table(np.round(np.arange(400) / 60, 3)), 0.2)
    np.testing.assert_allclose(found["time_s"], np.arange(400) / 60)


def test_a_part_is_taken_and_its_lines_are_those_of_the_file():
    time_s = np.arange(100) * 0.1
    found = even_rows(PATH, table(time_s), 0.2, (2.0, 5.0))
    np.testing.assert_array_equal(found["roll_rad"], np.arange(20, 51))
    time_s[40:] += 0.5
    with pytest.raises(TextFileError) as error:
        even_rows(PATH, table(time_s), 0.2, (2.0, math.inf))
    assert "line 42: time_s goes from 3.9 to 4.5, a gap where rows are 0.1 s" in str(error.value)
    assert "leave it out by --from 4.5 or --to 3.9" in str(error.value)
    assert len(even_rows(PATH, table(time_s), 0.2, (4.5, math.inf))["time_s"]) == 60


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
def test_uneven_times_are_refused_with_the_line_and_the_remedy(time_s, said):
    with pytest.raises(TextFileError, match=r"theirs\.csv: ") as error:
        even_rows(PATH, table(time_s), 0.2)
    assert said in str(error.value)


@pytest.mark.parametrize("devices", [None, {"motion": {"bus": "can1"}}])
def test_what_devices_of_other_makers_measured_is_read_from_the_run_s_telemetry(devices, tmp_path):
    """No frame of the catalogue says it; the telemetry has a row every 50 ms."""
    file = tmp_path / "run.frames"
    about = {"configuration": {"vessel": {"devices": devices}}}
    rows = np.full((6, len(SIGNALS)), np.nan)
    rows[:, SIGNALS.index("time_s")] = 0.05 * np.arange(6)
    rows[:, SIGNALS.index("roll_rad")] = 0.01 * np.arange(6)
    with FrameLogWriter(file, {"about": about, "columns": SIGNALS}) as log:
        sink = BlockSink(log)
        for now_ns in range(0, 300_000_000, 10_000_000):
            frame = LAYOUT.pack(0x132, bytes(8), Kind.RECEIVED, now_ns)
            sink.write(frame + LAYOUT.pack(0, b"", Kind.TICK, now_ns), now_ns)
        sink.flush()
        log.append(ROWS, _packed(rows))
    (columns,) = read_signals(file, names=("time_s", "roll_rad")).values()
    if devices is None:
        assert "roll_rad" not in columns
        return
    np.testing.assert_allclose(columns["time_s"], 0.01 * np.arange(30), atol=1e-12)
    np.testing.assert_allclose(columns["roll_rad"], 0.01 * (np.arange(30) // 5), atol=1e-12)
    part = read_signals(file, names=("time_s", "roll_rad"), between_s=(0.1, 0.2))["run"]
    assert part["roll_rad"][0] == pytest.approx(0.02)
