"""Cases that other people reported: each gives its right value, or an error with its place."""

import csv
import json
import re
from collections import Counter
from itertools import groupby
from typing import Any

import can
import numpy as np
import pytest
from others import field_case
from typer.testing import CliRunner

from utank_hil.commands.export import export
from utank_hil.commands.replay import replay
from utank_hil.console.common import new_app
from utank_hil.telemetry.bus_files.frame import BusFrame, FrameKind
from utank_hil.telemetry.bus_files.log import BusLog, OneClock
from utank_hil.telemetry.signal_files import read_signals

WIDE = {"TERM": "dumb", "COLUMNS": "400", "NO_COLOR": "1"}
GPC = "configs/controllers/gpc.yaml"
LINE = re.compile(r"\((\d+)\.(\d{6})\) (\S+) (\S+?)( [RT])?")
"""A line of candump, read by nothing of ours."""


def invoke(command, *words):
    app = new_app()
    app.command()(command)
    return CliRunner(env=WIDE).invoke(app, [str(word) for word in words])


def exported(case, to, *words, code=0):
    """Export a case and return what was said."""
    result = invoke(export, field_case(case), "--to", to, *words)
    assert result.exit_code == code, (result.stderr, result.exception)
    assert isinstance(result.exception, SystemExit | None)
    return result.stderr


def lines_in(file):
    """Return microseconds, channel and frame of each line of candump."""
    found = [LINE.fullmatch(line) for line in file.read_text().splitlines()]
    assert all(found)
    return [(int(m[1] + m[2]), m[3], m[4]) for m in found if m]


def replayed(case):
    result = invoke(replay, field_case(case), "--config", GPC, "--json")
    assert result.exit_code in (0, 1), result.stderr
    found: dict[str, Any] = json.loads(result.stdout)
    return found


def test_01_a_clock_that_steps_back_loses_no_frame(tmp_path):
    case = "01-candump-clock-steps-back/steps.log"
    said = exported(case, tmp_path / "a.csv")
    assert "line 301: stamps step back by 7199.990560 s" in said
    (columns,) = read_signals(tmp_path / "a.csv").values()
    assert len(columns["time_s"]) == 153
    assert np.isfinite(columns["roll_rad"]).sum() > 140
    assert "600 frames" in exported(case, tmp_path / "a.asc")
    times = np.array([message.timestamp for message in can.ASCReader(tmp_path / "a.asc")])
    assert len(times) == 600
    assert (np.diff(times) >= 0).all()


def test_02_one_stamp_ahead_moves_one_frame(tmp_path):
    said = exported("02-candump-one-stamp-ahead/hop.log", tmp_path / "a.csv")
    assert "line 253: 1 stamp is +2.500568 s off" in said
    (found,) = read_signals(tmp_path / "a.csv").values()
    (whole,) = read_signals(field_case("02-candump-one-stamp-ahead/ref.log")).values()
    assert max(len(list(same)) for _, same in groupby(found["roll_rad"])) == 3
    for name, values in whole.items():
        different = ~((found[name] == values) | np.isnan(values))
        assert different.sum() <= 1, name


def test_frames_of_a_quiet_bus_keep_their_times():
    stamps_ns = [ms * 1_000_000 for k in range(200) for ms in (75 * k, 75 * k + 25, 75 * k + 37)]
    frames = [BusFrame(each, "can0", 5, False, FrameKind.DATA, b"", 0) for each in stamps_ns]
    clock = OneClock("quiet.log", frames, lambda: "a line")
    assert [frame.time_ns for frame in clock] == stamps_ns
    assert clock.notes == []


def test_03_a_clock_of_1970_that_is_set_ends_at_once(tmp_path):
    said = exported("03-candump-1970-then-ntp/ntp.log", tmp_path / "a.csv")
    assert "line 61: stamps step ahead by 1759999988.000576 s" in said
    assert len((tmp_path / "a.csv").read_text().splitlines()) == 31


@pytest.mark.parametrize("name", ["zero_message", "zero_other"])
def test_04_an_object_without_size_is_an_error_with_its_place(tmp_path, name):
    case = f"04-blf-object-of-size-zero/{name}.blf"
    said = exported(case, tmp_path / "a.csv", code=2)
    assert "is damaged after frame 100" in said
    assert "an object of 0 bytes" in said
    exported(case, tmp_path / "a.log", code=2)
    assert not list(tmp_path.iterdir())


def test_05_relative_stamps_are_added_up():
    (relative,) = read_signals(field_case("05-asc-timestamps-relative/relative.asc")).values()
    (absolute,) = read_signals(field_case("05-asc-timestamps-relative/absolute.asc")).values()
    for name, values in absolute.items():
        np.testing.assert_array_equal(relative[name], values, err_msg=name)


def test_06_of_two_buses_one_is_chosen(tmp_path):
    case = "06-two-buses-in-one-log/both.log"
    said = exported(case, tmp_path / "a.csv", code=2)
    assert "can0 (465 frames), can1 (462 frames): choose by --channel" in said
    exported(case, tmp_path / "a.csv", "--channel", "can0")
    exported("06-two-buses-in-one-log/can0.log", tmp_path / "b.csv")
    assert (tmp_path / "a.csv").read_text() == (tmp_path / "b.csv").read_text()
    assert "no frames of channel can7 in it; it has can0, can1" in exported(
        case, tmp_path / "c.csv", "--channel", "can7", code=2
    )
    exported(case, tmp_path / "both.blf")  # a copy has both
    channels = Counter(message.channel for message in can.BLFReader(tmp_path / "both.blf"))
    assert channels == {0: 465, 1: 462}


@pytest.mark.parametrize("name", ["cut_in_id", "cut_in_data"])
def test_07_a_cut_log_is_read_up_to_there(tmp_path, name):
    case = f"07-log-cut-in-its-last-line/{name}.log"
    said = exported(case, tmp_path / "a.log")
    assert f"{name}.log is cut in line 200; what follows in it is left out" in said
    whole = field_case(case).read_text().splitlines()[:199]
    assert (tmp_path / "a.log").read_text().splitlines() == whole


def test_17_texts_of_candump_and_asc_are_read_or_their_line_is_named(tmp_path):
    folder = "17-candump-as-on-the-screen"
    exported(f"{folder}/screen.log", tmp_path / "screen.log")
    exported(f"{folder}/comment.log", tmp_path / "comment.log")
    assert lines_in(tmp_path / "screen.log") == lines_in(tmp_path / "comment.log")
    assert exported(f"{folder}/comma.asc", tmp_path / "comma.log").count("note") == 0
    assert len(lines_in(tmp_path / "comma.log")) == 95
    said = exported(f"{folder}/named.asc", tmp_path / "named.log")
    assert "23 lines are not understood and left out, the first line 13" in said
    assert "'SENSOR_MOTION' is no identifier" in said
    assert "log with numeric identifiers" in said


def test_28_29_a_copy_keeps_times_and_order(tmp_path):
    for case in (
        "28-bus-logged-before-the-controller-starts/early.log",
        "29-times-of-the-controllers-frames/jitter.log",
    ):
        for suffix in (".log", ".asc", ".blf"):
            copy = tmp_path / f"a{suffix}"
            exported(case, copy)
            again = tmp_path / "again.log"
            assert invoke(export, copy, "--to", again).exit_code == 0
            before, after = lines_in(field_case(case)), lines_in(again)
            assert [line[2] for line in after] == [line[2] for line in before]
            origin = before[0][0] // 1000 * 1000 if suffix == ".asc" else 0
            times = np.array([(a[0] + origin, b[0]) for a, b in zip(after, before, strict=True)])
            assert (times[:, 0] == times[:, 1]).all()


def test_30_31_a_copy_keeps_every_kind(tmp_path):
    for case in (
        "30-frames-of-other-kinds-go-missing/mixed.log",
        "31-candump-error-frames-become-data/errors.log",
    ):
        exported(case, tmp_path / "a.log")
        assert lines_in(tmp_path / "a.log") == lines_in(field_case(case))
        exported(case, tmp_path / "a.blf")
        with can.BLFReader(tmp_path / "a.blf") as messages:
            theirs = [
                (m.is_error_frame, m.is_remote_frame, m.is_extended_id, m.arbitration_id, m.dlc)
                for m in messages
            ]
        assert theirs == [
            (
                frame.startswith("2"),
                "#R" in frame,
                len(frame.partition("#")[0]) == 8,
                int(frame.partition("#")[0], 16) & 0x1FFFFFFF,
                int(frame[-1]) if "#R" in frame else len(frame.partition("#")[2]) // 2,
            )
            for _, _, frame in lines_in(field_case(case))
        ]
        assert "error frames are written without" in exported(case, tmp_path / "a.asc")
        kinds = Counter(
            (m.is_error_frame, m.is_remote_frame) for m in can.ASCReader(tmp_path / "a.asc")
        )
        assert kinds == Counter(line[:2] for line in theirs)
    assert replayed("31-candump-error-frames-become-data/errors.log")["exact"]


def test_32_a_head_is_not_needed(tmp_path):
    folder = "32-asc-without-a-header"
    for name, count in (("whole", 150), ("no_header", 150), ("no_events", 150), ("one_frame", 1)):
        exported(f"{folder}/{name}.asc", tmp_path / f"{name}.log")
        assert len(lines_in(tmp_path / f"{name}.log")) == count
    assert lines_in(tmp_path / "no_header.log") == lines_in(tmp_path / "whole.log")
    assert replayed(f"{folder}/no_header.asc")["exact"]


@pytest.mark.parametrize(
    "name", ["as_recorded.asc", "all_tx.asc", "upper_case.asc", "panel_on_the_same_pc.log"]
)
def test_33_identifiers_say_what_the_controller_sent(name):
    found = replayed(f"33-asc-in-which-everything-is-transmitted/{name}")
    assert (found["exact"], found["ticks"], found["frames"]) == (True, 76, 71)


def test_36_frames_are_read_whatever_their_file_is_called(tmp_path):
    folder = "36-what-a-refusal-says-of-the-file"
    exported(f"{folder}/trace.trc", tmp_path / "trace.log")
    exported(f"{folder}/frames.txt", tmp_path / "frames.log")
    trace, frames = lines_in(tmp_path / "trace.log"), lines_in(tmp_path / "frames.log")
    assert [line[2] for line in trace] == [line[2] for line in frames]
    begin_us = frames[0][0] - trace[0][0]
    assert max(abs(a[0] - b[0] - begin_us) for a, b in zip(frames, trace, strict=True)) <= 100
    assert replayed(f"{folder}/trace.trc")["exact"]


def test_39_raw_length_codes_are_kept(tmp_path):
    exported("39-candump-with-raw-length-codes/len8.log", tmp_path / "a.log")
    original = lines_in(field_case("39-candump-with-raw-length-codes/len8.log"))
    assert lines_in(tmp_path / "a.log") == original
    assert sum(line[2].endswith("_C") for line in original) == 1


def test_46_lines_that_are_not_understood_are_counted(tmp_path):
    said = exported("46-asc-lines-that-vanish/mixed.asc", tmp_path / "a.log")
    assert "59 lines are not understood and left out, the first line 14" in said
    assert "'0x08FF3082' is no identifier" in said
    assert len(lines_in(tmp_path / "a.log")) == 141


@pytest.mark.parametrize(
    ("name", "stamp"),
    [
        ("infinite", "1e400"),
        ("nan", "nan"),
        ("exponent", "1.780000000001e9"),
        ("underscore", "1_780_000_000.103"),
    ],
)
def test_47_stamps_that_are_no_times_are_refused(tmp_path, name, stamp):
    to = tmp_path / "a.csv"
    said = exported(f"47-candump-stamps-that-are-no-times/{name}.log", to, code=2)
    assert f"{name}.log: line 51: '{stamp}' is no time in seconds" in said
    assert not to.exists()


def test_a_part_of_a_log_is_read_by_its_times(tmp_path):
    case = "02-candump-one-stamp-ahead/ref.log"
    exported(case, tmp_path / "a.log", "--from", 1, "--until", 2)
    whole, part = lines_in(field_case(case)), lines_in(tmp_path / "a.log")
    begin = whole[0][0]
    assert part == [line for line in whole if 1_000_000 <= line[0] - begin <= 2_000_000]
    said = exported(case, tmp_path / "b.log", "--from", 100, code=2)
    assert "no frames between --from and --until; the last is at 4.12168 s" in said


def test_a_source_that_fails_leaves_what_was_there_before(tmp_path):
    (tmp_path / "a.log").write_text("kept")
    exported("47-candump-stamps-that-are-no-times/nan.log", tmp_path / "b.log", code=2)
    assert not (tmp_path / "b.log").exists()
    bad = tmp_path / "bad.log"
    bad.write_text("nonsense\n")
    assert invoke(export, bad, "--to", tmp_path / "a.log").exit_code == 2
    assert (tmp_path / "a.log").read_text() == "kept"


def written(folder, name, frames):
    from utank_hil.telemetry.bus_files.writing import write_frames

    write_frames(folder / name, frames)
    return folder / name


def test_a_stranger_with_the_controllers_identifier_is_received_where_marks_can_be_believed(
    tmp_path,
):
    log = BusLog(field_case("33-asc-in-which-everything-is-transmitted/as_recorded.asc"))
    frames = list(log.frames())
    own = next(frame for frame in frames if frame.sent and frame.time_ns > 300_000_000)
    foreign = own._replace(sent=False, time_ns=own.time_ns + 5_000_000)
    place = next(i for i, frame in enumerate(frames) if frame.time_ns > foreign.time_ns)
    file = written(tmp_path, "a.asc", [*frames[:place], foreign, *frames[place:]])
    result = json.loads(invoke(replay, file, "--config", GPC, "--json").stdout)
    assert "frame" not in (result["first_difference"] or {}).values()  # none is too many
    assert result["frames"] == 71


def test_stamps_that_stand_still_are_refused(tmp_path, monkeypatch):
    monkeypatch.setattr("utank_hil.telemetry.bus_logs._MOST", 400)
    text = field_case("02-candump-one-stamp-ahead/ref.log").read_text()
    moving, still = (lines := text.splitlines())[:60], lines[60:] * 2
    stamp = moving[-1].partition(" ")[0]
    still = [f"{stamp} {line.partition(' ')[2]}" for line in still]
    (tmp_path / "still.log").write_text("\n".join([*moving, *still, ""]))
    result = invoke(export, tmp_path / "still.log", "--to", tmp_path / "a.csv")
    assert result.exit_code == 2
    assert "still.log: more than 400 frames within one tick of 10 ms" in result.stderr


def test_rows_of_a_csv_are_all_there(tmp_path):
    exported("28-bus-logged-before-the-controller-starts/early.log", tmp_path / "a.csv")
    with (tmp_path / "a.csv").open() as content:
        rows = list(csv.DictReader(content))
    assert float(rows[0]["time_s"]) == 0.0
    assert rows[0]["roll_rad"] != ""  # what came before the controller is known at its start
