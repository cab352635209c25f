"""``utank-hil export``: other programs read the same frames and the same values."""

import csv
import json
import re
import tracemalloc
from collections.abc import Callable, Iterator
from itertools import chain, repeat
from pathlib import Path
from typing import Any

import can
import cantools
import numpy as np
import pyarrow.parquet
import pytest
from typer.testing import CliRunner, Result

from utank_hil.assembly import build_controller_node, build_law
from utank_hil.base.arrays import FloatArray
from utank_hil.canbus import Frame
from utank_hil.canbus.catalogue import DBC_PATH
from utank_hil.commands.export import export
from utank_hil.commands.identify import identify_log
from utank_hil.commands.replay import replay
from utank_hil.console.common import new_app
from utank_hil.identification.record import logged_samples
from utank_hil.nodes.signals import SIGNALS
from utank_hil.telemetry import logged_signals
from utank_hil.telemetry.frame_log import FrameLog, Kind
from utank_hil.telemetry.logged_signals import signal_parts, signal_table
from utank_hil.telemetry.recording import write_recording
from utank_hil.telemetry.replay import Entry, entries_of
from utank_hil.telemetry.replay_head import recorded_config
from utank_hil.telemetry.signal_files import (
    TABLE_SUFFIXES,
    even_rows,
    export_parts,
    read_signals,
    write_signals,
)

LOG = Path("tests/replay/every-mode.frames")
RETUNED = Path("tests/replay/retuned-and-undone.frames")
WIDE = {"TERM": "dumb", "COLUMNS": "300", "NO_COLOR": "1"}
DATABASE = cantools.database.load_file(DBC_PATH)
CANDUMP = re.compile(r"\((\d+\.\d{6})\) can0 ([0-9A-F]{8})#([0-9A-F]*) ([RT])")
READERS: dict[str, Callable[[Path], Any]] = {".asc": can.ASCReader, ".blf": can.BLFReader}

Logged = list[tuple[float, int, bytes, bool]]
"""Time in s, identifier, data, received."""


def invoke(command: Any, *words: object) -> Result:
    app = new_app()
    app.command()(command)
    return CliRunner(env=WIDE).invoke(app, [str(word) for word in words])


def exported(folder: Path, name: str) -> Path:
    file = folder / name
    result = invoke(export, LOG, "--to", file, "--json")
    assert result.exit_code == 0, result.stderr
    assert json.loads(result.stdout)["file"] == str(file)
    return file


def frames_in(file: Path) -> Logged:
    """Frames of a log, read by nothing of ours."""
    if file.suffix == ".log":
        lines = [CANDUMP.fullmatch(line) for line in file.read_text().splitlines()]
        return [(float(m[1]), int(m[2], 16), bytes.fromhex(m[3]), m[4] == "R") for m in lines if m]
    with READERS[file.suffix](file) as reader:
        return [(m.timestamp, m.arbitration_id, bytes(m.data), m.is_rx) for m in reader]


@pytest.fixture(scope="module")
def entries() -> list[Entry]:
    return list(entries_of(FrameLog(LOG).blocks()))


@pytest.mark.parametrize("name", ["a.log", "a.asc", "a.blf"])
def test_every_frame_is_in_the_log_in_its_order_with_its_time(
    tmp_path: Path, entries: list[Entry], name: str
) -> None:
    expected = [
        (time_ns * 1e-9, number, data, kind == Kind.RECEIVED)
        for number, data, kind, time_ns in entries
        if kind in (Kind.RECEIVED, Kind.SENT)
    ]
    found = frames_in(exported(tmp_path, name))
    assert [frame[1:] for frame in found] == [frame[1:] for frame in expected]
    begin_s = found[0][0]
    times = np.array([[a[0] - begin_s, b[0]] for a, b in zip(found, expected, strict=True)])
    assert np.abs(times[:, 0] - times[:, 1]).max() < 1.1e-6


def test_values_of_a_table_are_those_that_cantools_reads_of_the_frames(tmp_path: Path) -> None:
    signals = read_signals(exported(tmp_path, "a.csv"))["a"]
    frames = frames_in(exported(tmp_path, "a.blf"))
    names = {
        "SENSOR_MOTION": {"roll_rad": "roll_rad", "roll_rate_rad_s": "roll_rate_rad_s"},
        "SENSOR_TANK": {"port_level_m": "port_level_m"},
        "DRIVE_STATUS_1": {"speed_rad_s": "drive_status_1_speed_rad_s"},
        "CTRL_STATUS": {"mode": "mode", "bus_load": "bus_load"},
    }
    compared = 0
    for time_s, can_id, data, received in frames:
        message = DATABASE.get_message_by_frame_id(can_id)
        if message.name not in names:
            continue
        # seen from the next tick on; what the controller sends, from its own on
        tick = round(time_s / 0.01) if not received else int(np.ceil(time_s / 0.01 - 1e-9))
        if tick >= len(signals["time_s"]):
            continue
        decoded = message.decode(data, decode_choices=False)
        for signal, column in names[message.name].items():
            assert signals[column][tick] == pytest.approx(decoded[signal], abs=1e-12)
            compared += 1
    assert compared > 4000


def test_both_tables_hold_the_same_numbers_bit_for_bit(
    tmp_path: Path, entries: list[Entry]
) -> None:
    expected = signal_table(signal_parts(entries))
    with exported(tmp_path, "a.csv").open(newline="") as content:
        names, *rows = csv.reader(content)
    assert names == list(expected)
    by_csv = {n: [float(row[i] or "nan") for row in rows] for i, n in enumerate(names)}
    table = pyarrow.parquet.read_table(exported(tmp_path, "a.parquet"))
    assert table.column_names == list(expected)
    for name, values in expected.items():
        np.testing.assert_array_equal(np.array(by_csv[name]), values)
        np.testing.assert_array_equal(table.column(name).to_numpy(), values)
    for file in ("a.csv", "a.parquet"):
        again = read_signals(tmp_path / file)["a"]
        assert list(again) == list(expected)
        for name, values in expected.items():
            np.testing.assert_array_equal(again[name], values, err_msg=name)


def test_parts_of_a_table_are_the_whole_and_none_but_one_is_held(
    tmp_path: Path, entries: list[Entry], monkeypatch: pytest.MonkeyPatch
) -> None:
    whole = signal_table(signal_parts(entries))
    monkeypatch.setattr(logged_signals, "_PART", 97)
    for name, values in signal_table(signal_parts(entries)).items():
        np.testing.assert_array_equal(values, whole[name], err_msg=name)
    exported(tmp_path, "parts.csv")
    exported(tmp_path, "a.parquet")
    (found,) = read_signals(tmp_path / "parts.csv").values()
    assert list(found) == list(whole)
    for name, values in whole.items():
        np.testing.assert_array_equal(found[name], values, err_msg=name)
        np.testing.assert_array_equal(
            pyarrow.parquet.read_table(tmp_path / "a.parquet")[name].to_numpy(), values
        )

    def long_log() -> Iterator[Entry]:
        for turn in range(12):
            for each in entries:
                yield each._replace(time_ns=each.time_ns + turn * 14_000_000_000)

    monkeypatch.setattr(logged_signals, "_PART", 150)
    tracemalloc.start()
    try:
        rows = export_parts(tmp_path / "long.parquet", signal_parts(long_log()))
        _, most_bytes = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
    table = pyarrow.parquet.read_table(tmp_path / "long.parquet")
    assert table.num_rows == rows == 12 * 1400
    assert most_bytes < table.num_rows * table.num_columns * 8 / 6


def test_of_a_long_log_a_part_is_held_and_more_than_the_limit_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    measured, names = ("roll_rad", "level_m"), ("roll_rad", "port_level_m", "starboard_level_m")
    (whole,) = read_signals(LOG).values()
    monkeypatch.setattr(logged_signals, "_PART", 100)
    monkeypatch.setattr(logged_signals, "VALUES_LIMIT", 4000)
    (part,) = read_signals(
        LOG, names=(*names, "pressure_command_pa"), between_s=(1.8, 7.2)
    ).values()
    assert set(part) == {"time_s", "pressure_command_pa", *names}
    np.testing.assert_array_equal(
        logged_samples(part, measured, 0.2, (2.0, 7.0)),
        logged_samples(whole, measured, 0.2, (2.0, 7.0)),
    )
    with pytest.raises(ValueError, match=r"every-mode.frames: has more than .* values"):
        read_signals(LOG)
    with pytest.raises(ValueError, match="holds no tick between 100 and 101 s"):
        read_signals(LOG, between_s=(100.0, 101.0))


def test_of_frames_before_the_first_tick_the_last_of_each_message_are_held(
    entries: list[Entry],
) -> None:
    received = [each for each in entries if each.kind == Kind.RECEIVED]
    ticks = [each for each in entries if each.kind == Kind.TICK]
    tracemalloc.start()
    try:
        (part,) = signal_parts(chain(*repeat(received, 20), ticks[:3]))
        _, most_bytes = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
    (once,) = signal_parts(chain(received, ticks[:3]))
    np.testing.assert_array_equal(part["roll_rad"], once["roll_rad"])
    assert np.isfinite(once["roll_rad"]).all()
    assert most_bytes < 1 << 20


@pytest.mark.parametrize("rows", [70, 1000])
def test_a_value_is_held_for_two_seconds_and_then_unknown(
    entries: list[Entry], rows: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("utank_hil.telemetry.logged_signals._PART", rows)
    heard = [each for each in entries if each.kind == Kind.RECEIVED]
    ticks = [each for each in entries if each.kind == Kind.TICK][:400]
    table = signal_table(signal_parts(chain(heard, ticks)))
    assert np.flatnonzero(np.isfinite(table["roll_rad"])).tolist() == list(range(201))


def test_a_table_of_the_frames_shows_what_the_telemetry_showed(entries: list[Entry]) -> None:
    rows: list[FloatArray] = []
    with recorded_config(FrameLog(LOG).head) as config:
        node = build_controller_node(
            config, build_law(config), commissioned=True, sink=lambda row: rows.append(row.copy())
        )
    for number, data, kind, time_ns in entries:
        if kind == Kind.RECEIVED:
            node.receive(Frame(number, data), time_ns)
        elif kind == Kind.TICK:
            node.tick(time_ns)
    shown, found = np.array(rows), signal_table(signal_parts(entries))
    for name in ("time_s", "roll_rad", "roll_rate_rad_s", "starboard_level_m",
                 "pressure_actual_pa", "pump_power_w"):  # fmt: skip
        # before its first frame the node shows 0, the table that there is nothing
        np.testing.assert_array_equal(
            np.nan_to_num(found[name]), shown[:, SIGNALS.index(name)], err_msg=name
        )
    command = shown[:, SIGNALS.index("pressure_command_pa")]
    # as sent every second tick, in steps of 8 Pa
    np.testing.assert_allclose(found["pressure_command_pa"][::2], command[::2], atol=4.0)


@pytest.mark.evidence("a.asc", "a.log")
@pytest.mark.parametrize("name", ["a.log", "a.asc", "a.blf"])
def test_an_exported_log_of_the_bus_is_replayed_exactly(tmp_path: Path, name: str) -> None:
    config = "configs/controllers/gpc.yaml"
    result = invoke(replay, exported(tmp_path, name), "--config", config, "--json")
    assert result.exit_code == 0, result.stdout
    found = json.loads(result.stdout)
    assert found["exact"]
    assert found["ticks"] == 1400


def test_a_log_of_the_bus_needs_a_configuration_and_the_controllers_start(tmp_path: Path) -> None:
    file = exported(tmp_path, "a.log")
    assert "name its configuration by --config" in invoke(replay, file).stderr
    file.write_text("".join(file.read_text().splitlines(keepends=True)[50:]))
    result = invoke(replay, file, "--config", "configs/controllers/gpc.yaml")
    assert result.exit_code == 2
    assert "begins in the middle of a run" in result.stderr


def test_the_same_record_is_read_from_every_kind_of_log(tmp_path: Path) -> None:
    measured, part = ("roll_rad", "level_m"), (2.0, 12.0)
    (signals,) = read_signals(LOG).values()
    expected = logged_samples(signals, measured, 0.2, part)
    assert len(expected) == 51
    assert np.isfinite(expected).all()
    for name in ("a.log", "a.asc", "a.blf", "a.csv", "a.parquet"):
        file = exported(tmp_path, name)
        (signals,) = read_signals(file).values()
        if file.suffix in TABLE_SUFFIXES:
            signals = even_rows(file, signals, 0.2, part)
            record = logged_samples(signals, measured, 0.2)
        else:
            record = logged_samples(signals, measured, 0.2, part)
        np.testing.assert_array_equal(record[1:], expected[1:], err_msg=name)


@pytest.mark.evidence
def test_a_ship_is_identified_from_a_table_in_other_units(tmp_path: Path) -> None:
    (signals,) = read_signals(RETUNED).values()
    theirs = {
        "time_s": signals["time_s"] + 1000.0,
        "roll_deg": np.degrees(signals["roll_rad"]),
        "level_mm": 500 * (signals["starboard_level_m"] - signals["port_level_m"]),
        "pressure_command_kpa": signals["pressure_command_pa"] / 1e3,
        "wind_kn": np.full(len(signals["time_s"]), 12.0),
    }
    every = slice(3505, 16605, 10)  # ten rows a second
    write_signals(tmp_path / "t.csv", [{name: values[every] for name, values in theirs.items()}])
    words = (tmp_path / "t.csv", "configs/controllers/adaptive_dpc.yaml", "--order", 30, "--json")
    result = invoke(identify_log, *words, "--out", tmp_path / "out")
    assert result.exit_code in (0, 1), result.stderr
    assert json.loads(result.stdout)["roll_period_s"] == pytest.approx(7.5, rel=0.01)
    gap = tmp_path / "t.csv"
    lines = gap.read_text().splitlines(keepends=True)
    gap.write_text("".join(lines[:500] + lines[600:]))
    result = invoke(identify_log, *words, "--out", tmp_path / "out")
    assert result.exit_code == 2
    assert "t.csv: line 501: time_s goes from " in result.stderr


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ((LOG, "--to", "a.txt"), "its suffix says the format, one of .log, .asc, .blf, .csv"),
        ((LOG, "--to", LOG), "its suffix says the format"),
        ((LOG, "--to", "{}/a.csv", "--run", "x"), "--run is for recordings"),
        (("{}/none.frames", "--to", "{}/a.csv"), "none.frames"),
        (("{}/none.csv", "--to", "{}/a.blf"), "holds signals and no frames"),
        (("{}/none.csv", "--to", "{}/a.csv", "--from", 3), "a table is exported whole"),
        ((LOG, "--to", "{}/a.csv", "--channel", "can1"), "--channel is for logs of the bus"),
        ((LOG, "--to", "{}/a.csv", "--from", 3, "--until", 2), "--from 3 is not before --until"),
        ((LOG, "--to", "{}/a.blf", "--from", "nan"), "--from must be a number of s"),
        ((LOG, "--to", "{}/a.csv", "--from", 1e6), "no record of the log is within these times"),
        ((LOG, "--to", "{}/a.blf", "--from", 1e6), "no record of the log is within these times"),
    ],
)
def test_what_can_not_be_done_is_said_with_its_reason(
    tmp_path: Path, words: tuple[object, ...], said: str
) -> None:
    result = invoke(export, *(str(word).format(tmp_path) for word in words))
    assert result.exit_code == 2
    assert isinstance(result.exception, SystemExit)
    assert said in result.stderr
    assert not [*tmp_path.glob("a.*")]


@pytest.mark.parametrize("name", ["a.log", "a.csv"])
@pytest.mark.parametrize("damage", ["cut at byte", "damaged at byte"])
def test_a_log_that_is_not_whole_is_exported_up_to_there_and_that_is_said(
    tmp_path: Path, name: str, damage: str
) -> None:
    content = bytearray(LOG.read_bytes())
    content[-20] ^= 1
    broken = tmp_path / "broken.frames"
    broken.write_bytes(content[:-20] if "cut" in damage else content)
    result = invoke(export, broken, "--to", tmp_path / name, "--json")
    assert result.exit_code == 0
    assert f"broken.frames is {damage}" in json.loads(result.stdout)["cut"]
    assert f"broken.frames is {damage}" in result.stderr
    assert "left out" in result.stderr
    whole = invoke(export, LOG, "--to", tmp_path / f"whole-{name}", "--json")
    assert json.loads(whole.stdout)["cut"] == whole.stderr == ""


def test_a_recording_without_frames_names_the_log_beside_it(tmp_path: Path) -> None:
    file = tmp_path / "run-a.rrd"
    write_recording(file, ("time_s", "roll_rad"), {"dpc": np.zeros((3, 2))})
    file.with_suffix(".frames").write_bytes(LOG.read_bytes())
    result = invoke(export, file, "--to", tmp_path / "a.log")
    assert result.exit_code == 2
    assert f"give {file.with_suffix('.frames')}" in result.stderr
    assert invoke(export, file, "--to", tmp_path / "a.csv", "--run", "dpc").exit_code == 0
    assert (tmp_path / "a.csv").read_text().splitlines()[0] == "time_s,roll_rad"
    assert "it has dpc" in invoke(export, file, "--to", tmp_path / "b.csv", "--run", "x").stderr


@pytest.mark.parametrize("suffix", [".log", ".asc", ".blf", ".csv", ".parquet", ".rrd", ".frames"])
@pytest.mark.parametrize("content", [b"", b"nonsense\n", b"\xff\x00\x01" * 99, b"(1.0) can0 12"])
def test_a_file_of_nonsense_is_an_error_with_its_name(
    tmp_path: Path, suffix: str, content: bytes
) -> None:
    file = tmp_path / f"x{suffix}"
    file.write_bytes(content)
    result = invoke(export, file, "--to", tmp_path / "a.csv" if suffix != ".csv" else "b.parquet")
    assert result.exit_code == 2, result.exception
    assert isinstance(result.exception, SystemExit)
    assert f"x{suffix}" in result.stderr
