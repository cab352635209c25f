"""A frame log that is cut or damaged anywhere is whole up to a second before."""

import random
import struct
import zlib
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from little_room import little_room
from packed_zeros import packed_zeros

from utank_hil.telemetry.frame_log import (
    LAYOUT,
    RECORD,
    BlockSink,
    FrameLog,
    FrameLogError,
    FrameLogWriter,
    Kind,
)

TICK_NS = 10_000_000
SECOND_NS = 1_000_000_000
HEAD = {"about": {"version": "1"}, "law": [1.5, 2.5]}


def tick(number, source):
    """What a tick has: some noisy frames, the tick, an answer."""
    time_ns = number * TICK_NS
    frames = [
        LAYOUT.pack(0x08FF3082 + i, source.randbytes(8), Kind.RECEIVED, time_ns - i)
        for i in range(3)
    ]
    sent = LAYOUT.pack(0x08FF1080, source.randbytes(8), Kind.SENT, time_ns)
    return b"".join([*frames, LAYOUT.pack(0, b"", Kind.TICK, time_ns), sent])


def write_log(file, ticks, *, small=False, seed=1):
    """Write a log; all its records, and (size of the file, time in ns) after each tick."""
    source = random.Random(seed)
    whole, sizes = b"", []
    with FrameLogWriter(file, HEAD, small=small) as writer:
        sink = BlockSink(writer)
        for number in range(ticks):
            records = tick(number, source)
            whole += records
            sink.write(records, number * TICK_NS)
            sizes.append((file.stat().st_size, number * TICK_NS))
        sink.flush()
    return whole, sizes


def read(path):
    log = FrameLog(path)
    blocks = list(log.blocks())
    return np.concatenate(blocks) if blocks else np.empty(0, dtype=RECORD), log


def sealed(*blocks):
    """A log of these blocks, each with the right checksum."""
    parts = [b"UTANKHIL frames 1\n"]
    for kind, payload in blocks:
        checksum = zlib.crc32(payload, zlib.crc32(kind))
        parts += [struct.pack("<4sII", kind, len(payload), checksum), payload]
    return b"".join(parts)


@pytest.mark.parametrize(
    "head",
    [b"", b"no zlib", zlib.compress(b"{"), zlib.compress(b"\xff"), zlib.compress(b"[1]"),
     zlib.compress(b"[" * 99_999), zlib.compress(b'{"a": 1}')[:-3],
     packed_zeros(1 << 29)],
)  # fmt: skip
def test_a_sealed_head_that_says_nothing_is_refused_by_its_file(tmp_path, head):
    path = tmp_path / "theirs.frames"
    path.write_bytes(sealed((b"HEAD", head)))
    with pytest.raises(FrameLogError, match=r"theirs\.frames"):
        FrameLog(path)


@pytest.mark.parametrize(
    ("kind", "payload"),
    [(b"BUSZ", b"no zlib"), (b"BUSZ", zlib.compress(b"\xff")), (b"BUSX", b"no xz"),
     (b"BUSZ", zlib.compress(b"\x02\0\0\0" + bytes(23))), (b"BUSZ", zlib.compress(b"")),
     (b"BUSZ", packed_zeros(1 << 29)), (b"ELSE", b"of nobody")],
)  # fmt: skip
def test_a_sealed_block_that_holds_no_records_ends_the_log_and_is_said(tmp_path, kind, payload):
    write_log(tmp_path / "a.frames", 60)
    whole = (tmp_path / "a.frames").read_bytes()
    (tmp_path / "a.frames").write_bytes(whole + sealed((kind, payload))[18:])
    records, log = read(tmp_path / "a.frames")
    assert len(records) == 60 * 5
    assert log.cut.startswith("a.frames ")


@pytest.mark.parametrize("small", [False, True])
def test_a_whole_log_gives_back_head_and_records(tmp_path, small):
    whole, _ = write_log(tmp_path / "a.frames", 230, small=small)
    records, log = read(tmp_path / "a.frames")
    assert records.tobytes() == whole
    assert (log.head, log.cut, log.first_part) == (HEAD, "", True)


def test_cut_at_200_random_bytes_it_lacks_less_than_a_second(tmp_path):
    file = tmp_path / "a.frames"
    whole, sizes = write_log(file, 2000)
    content = file.read_bytes()
    begin = sizes[0][0]
    for place in random.Random(2).sample(range(begin, len(content)), 200):
        cut = tmp_path / "cut.frames"
        cut.write_bytes(content[:place])
        records, log = read(cut)
        assert whole.startswith(records.tobytes())
        # the latest tick at which the log had not yet grown past this byte
        reached_ns = max(time_ns for size, time_ns in sizes if size <= place)
        last_ns = int(records["time_ns"][-1]) if len(records) else 0
        assert reached_ns - last_ns < SECOND_NS
        assert bool(log.cut) == (place not in {size for size, _ in sizes})


@given(st.data())
def test_a_flipped_bit_ends_the_reading_before_it(tmp_path_factory, data):
    file = tmp_path_factory.mktemp("log") / "a.frames"
    whole, sizes = write_log(file, 150)
    content = bytearray(file.read_bytes())
    place = data.draw(st.integers(sizes[0][0], len(content) - 1))
    content[place] ^= 1 << data.draw(st.integers(0, 7))
    file.write_bytes(content)
    records, log = read(file)
    assert whole.startswith(records.tobytes())
    assert len(records) < len(whole) // LAYOUT.size
    assert log.cut


def test_parts_are_read_as_one_log_and_each_has_the_head(tmp_path):
    names = ["run-a.frames", "run-a-part002.frames", "run-a-part003.frames"]
    wholes = [write_log(tmp_path / name, 100, seed=seed)[0] for seed, name in enumerate(names)]
    records, _ = read(tmp_path / names[0])
    assert records.tobytes() == b"".join(wholes)
    later, middle = read(tmp_path / names[1])
    assert later.tobytes() == b"".join(wholes[1:])
    assert (middle.head, middle.first_part) == (HEAD, False)


def test_nothing_is_read_beyond_a_damaged_part(tmp_path):
    """What follows a gap would look as if the controller had answered otherwise."""
    names = ["run-a.frames", "run-a-part002.frames"]
    whole, _ = [write_log(tmp_path / name, 300, seed=seed)[0] for seed, name in enumerate(names)]
    content = bytearray((tmp_path / names[0]).read_bytes())
    content[len(content) // 2] ^= 1
    (tmp_path / names[0]).write_bytes(content)
    records, log = read(tmp_path / names[0])
    assert 0 < len(records.tobytes()) < len(whole)
    assert whole.startswith(records.tobytes())
    assert log.cut.startswith("run-a.frames is damaged")


@pytest.mark.parametrize("begin", [b"", b"UTANK", bytes(100)])
def test_a_part_that_a_power_cut_left_without_its_beginning_costs_none_before_it(tmp_path, begin):
    whole, _ = write_log(tmp_path / "run-a.frames", 300)
    (tmp_path / "run-a-part002.frames").write_bytes(begin)
    noted = []
    log = FrameLog(tmp_path / "run-a.frames")
    assert b"".join(block.tobytes() for block in log.blocks(noted.append)) == whole
    assert noted == ["run-a-part002.frames is no frame log of this version; "
                     "what follows in it is left out"]  # fmt: skip


def test_another_file_is_refused_with_its_name(tmp_path):
    for content in (b"", b"time_s,roll_rad\n0,1\n"):
        (tmp_path / "a.frames").write_bytes(content)
        with pytest.raises(FrameLogError, match=r"a\.frames: is no frame log"):
            FrameLog(tmp_path / "a.frames")
    write_log(tmp_path / "b.frames", 1)
    (tmp_path / "b.frames").write_bytes((tmp_path / "b.frames").read_bytes()[:30])
    with pytest.raises(FrameLogError, match=r"b\.frames is cut at byte 30"):
        FrameLog(tmp_path / "b.frames")


def test_a_log_that_does_not_even_begin_is_named():
    with pytest.raises(OSError, match="No space left on device: '/dev/full'"):
        FrameLogWriter(Path("/dev/full"), {})


def test_a_log_that_does_not_fit_is_named_and_goes_on_in_the_next_part(tmp_path):
    file = tmp_path / "a.frames"
    with little_room(), pytest.raises(OSError, match=f"File too large: '{file}'"):
        write_log(file, 230)
    first, log = read(file)
    assert log.cut == ""
    second, _ = write_log(tmp_path / "a-part002.frames", 20, seed=1)
    records, _ = read(file)
    assert records.tobytes() == first.tobytes() + second
