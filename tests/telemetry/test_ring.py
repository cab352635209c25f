"""The ring against a plain list, against another process, and against sudden death."""

import contextlib
import os
import signal
import subprocess
import sys
import time
from multiprocessing.shared_memory import SharedMemory
from pathlib import Path

import numpy as np
import pytest
from hypothesis import settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, invariant, rule

from utank_hil.telemetry.ring import (
    RingError,
    RingKind,
    RingReader,
    RingWriter,
    RowReader,
    RowWriter,
)

SHM = Path("/dev/shm")


@pytest.fixture(autouse=True)
def no_segment_left_behind():
    yield
    assert not list(SHM.glob(f"utank-{os.getpid()}-*"))


def rows_from(first, count, width):
    """Rows that carry their own number in every value."""
    return np.arange(first, first + count, dtype=float)[:, None] * np.arange(1, width + 1)


class BroadcastModel(RuleBasedStateMachine):
    """Two readers of a ring of five slots see what a list and a cursor each would show them."""

    CAPACITY = 5
    ROWS = 2

    def __init__(self):
        super().__init__()
        self.writer = RingWriter(RingKind.FRAMES, 16, self.ROWS, self.CAPACITY)
        self.written: list[np.ndarray] = []  # by slot
        self.readers: list[RingReader] = []
        self.cursors: list[int] = []
        self.lost: list[int] = []
        self.attach()

    @rule(values=st.lists(st.tuples(st.floats(), st.floats()), min_size=1, max_size=8))
    def write(self, values):
        rows = np.array(values)
        self.writer.write(rows)
        self.written += [rows[at : at + self.ROWS] for at in range(0, len(rows), self.ROWS)]

    @rule()
    def attach(self):
        if len(self.readers) < 2:
            self.readers.append(RingReader(self.writer.name))
            self.cursors.append(max(0, len(self.written) - self.CAPACITY))
            self.lost.append(0)

    @rule(which=st.integers(0, 1))
    def read(self, which):
        which = which % len(self.readers)
        oldest = max(self.cursors[which], len(self.written) - self.CAPACITY)
        self.lost[which] += oldest - self.cursors[which]
        self.cursors[which] = len(self.written)
        got = self.readers[which].read()
        assert got == [rows.tobytes() for rows in self.written[oldest:]]

    @invariant()
    def losses_are_counted(self):
        assert [reader.lost for reader in self.readers] == self.lost
        assert self.writer.count == len(self.written)

    def teardown(self):
        self.writer.close()
        assert all(reader.ended for reader in self.readers)
        for reader in self.readers:
            reader.close()


TestBroadcastModel = BroadcastModel.TestCase
TestBroadcastModel.settings = settings(stateful_step_count=30)


def test_reader_drains_a_ring_after_its_writer_closed_it():
    writer = RowWriter(["a", "b", "c"])
    with RowReader(writer.name) as reader:
        writer.write(np.array([1.0, np.nan, -np.inf]))
        writer.close()
        assert reader.columns == ("a", "b", "c")
        assert reader.ended
        np.testing.assert_array_equal(reader.read_rows(), [[1.0, np.nan, -np.inf]])


def test_rows_read_stay_valid_after_both_ends_are_closed():
    with RowWriter(["a"]) as writer, RowReader(writer.name) as reader:
        writer.write(np.array([7.0]))
        rows = reader.read_rows()
    np.testing.assert_array_equal(rows, [[7.0]])


def test_a_half_written_row_is_held_back_then_counted_as_lost():
    with RowWriter(["a", "b"], slots=4) as writer, RowReader(writer.name) as reader:
        for row in rows_from(0, 3, 2):
            writer.write(row)
        with (SHM / writer.name).open("r+b") as segment:  # the second value of row 1
            size = os.fstat(segment.fileno()).st_size
            segment.seek(size - 4 * 24 + 24 + 8)
            segment.write(b"\x01")
        np.testing.assert_array_equal(reader.read_rows(), rows_from(0, 1, 2))
        assert len(reader.read_rows()) == 0
        assert reader.lost == 0
        for row in rows_from(3, 2, 2):  # row 4 takes the place of row 0, row 5 would that of row 1
            writer.write(row)
        np.testing.assert_array_equal(reader.read_rows(), rows_from(2, 3, 2))
        assert reader.lost == 1


def test_a_row_of_the_previous_lap_is_not_taken_for_a_new_one():
    with RowWriter(["a"], slots=2) as writer, RowReader(writer.name) as reader:
        for value in (1.0, 2.0):
            writer.write(np.array([value]))
        slots = (SHM / writer.name).read_bytes()[-32:]
        assert len(reader.read_rows()) == 2
        for value in (3.0, 4.0):
            writer.write(np.array([value]))
        with (SHM / writer.name).open("r+b") as segment:  # new stores not visible yet
            segment.seek(-32, os.SEEK_END)
            segment.write(slots)
        assert len(reader.read_rows()) == 0


def test_a_reader_cannot_write():
    with RowWriter(["a"]) as writer, RowReader(writer.name) as reader:
        with pytest.raises(TypeError, match="read-only"):
            reader._words[0] = 0
        with pytest.raises(TypeError, match="readonly"):
            reader._map[0] = 0


def test_a_stalled_reader_does_not_hold_up_the_writer():
    with RowWriter(["a"], slots=8) as writer, RowReader(writer.name) as reader:
        for row in rows_from(0, 1000, 1):
            writer.write(row)
        np.testing.assert_array_equal(reader.read_rows(), rows_from(992, 8, 1))
        assert reader.lost == 992


@pytest.mark.parametrize("row", [np.zeros(2), np.zeros(4), np.zeros(0)])
def test_a_row_of_another_width_is_refused(row):
    with RowWriter(["a", "b", "c"]) as writer:
        with pytest.raises(ValueError, match="of 24 bytes each"):
            writer.write(row)
        assert writer.count == 0


def test_a_closed_ring_takes_no_rows():
    writer = RowWriter(["a"])
    writer.close()
    writer.close()
    with pytest.raises(ValueError, match="closed"):
        writer.write(np.zeros(1))


def test_a_missing_ring_and_a_foreign_segment_are_refused():
    with pytest.raises(RingError, match="is its writer running"):
        RowReader(f"utank-{os.getpid()}-none")
    foreign = SHM / f"utank-{os.getpid()}-foreign"
    for content in (b"short", bytes(4096)):
        foreign.write_bytes(content)
        with pytest.raises(RingError, match="telemetry ring"):
            RowReader(foreign.name)
        RowWriter(["a"]).close()
    foreign.unlink()


@pytest.mark.parametrize("word", [2, 3, 4, None])
def test_a_damaged_segment_is_refused_and_stops_no_writer(word):
    with RowWriter(["a", "b"]) as whole:
        content = bytearray((SHM / whole.name).read_bytes())
    if word is None:
        content = content.replace(b'{"kind"', b'}{kind"')
    else:
        content[8 * word : 8 * word + 8] = (-5).to_bytes(8, "little", signed=True)
    damaged = SHM / f"utank-{os.getpid()}-damaged"
    damaged.write_bytes(content)
    with pytest.raises(RingError, match="telemetry ring"):
        RowReader(damaged.name)
    RowWriter(["a"]).close()
    damaged.unlink()


def saying(text):
    """A segment that is whole, except for what it says of its content."""
    with RowWriter(["a"]) as whole:
        content = (SHM / whole.name).read_bytes()
    words = np.frombuffer(content[:128], dtype=np.int64).copy()
    words[3], words[4] = 2, len(text)
    return words.tobytes() + text + content[128 + len(text) :]


@pytest.mark.parametrize(
    "text",
    [
        *(b"5", b"null", b"{}", b'["a"]', b"[5,5]", b"\xff\xfe", b"[" * 100_000),
        *(b'{"kind": "x"}', b'{"kind": []}', b'{"kind": "events"}', b'{"kind": "rows"}'),
        *(b'{"kind": "rows", "columns": 5}', b'{"kind": "rows", "columns": ["a", "b"]}'),
    ],
    ids=lambda text: repr(text[:40]),
)
def test_a_segment_that_says_odd_things_of_itself_is_refused_and_stops_no_writer(text):
    """Any user may put a file there."""
    odd = SHM / f"utank-{os.getpid()}-odd"
    odd.write_bytes(saying(text))
    try:
        with pytest.raises(RingError, match="telemetry ring"):
            RowReader(odd.name)
        RowWriter(["a"]).close()
    finally:
        odd.unlink()


def test_what_others_own_or_may_write_to_is_left_alone(monkeypatch):
    """It may change while it is looked at: a file that is cut short ends its reader (SIGBUS)."""
    name = f"utank-{os.getpid()}-of-another"
    with RowWriter(["a"]) as ring:
        content = bytearray((SHM / ring.name).read_bytes())
    content[48:56] = bytes(8)  # no process started then: its writer is dead
    opened: list[str] = []
    real = RingReader.__init__
    monkeypatch.setattr(
        RingReader, "__init__", lambda self, name: (opened.append(name), real(self, name))[1]
    )
    (SHM / name).write_bytes(content)
    try:
        (SHM / name).chmod(0o666)
        RowWriter(["a"]).close()
        assert name not in opened
        (SHM / name).chmod(0o600)
        with monkeypatch.context() as patch:
            patch.setattr(os, "geteuid", lambda: os.getuid() + 1)
            RowWriter(["a"]).close()
        assert name not in opened
        RowWriter(["a"]).close()
        assert not (SHM / name).exists()
    finally:
        (SHM / name).unlink(missing_ok=True)


def test_a_link_is_not_followed(tmp_path):
    """To open a device may already do something."""
    link = SHM / f"utank-{os.getpid()}-link"
    link.symlink_to(tmp_path / "pipe")
    os.mkfifo(tmp_path / "pipe")
    try:
        with pytest.raises(OSError, match="symbolic links"):
            RowReader(link.name)
        RowWriter(["a"]).close()
    finally:
        link.unlink()


@pytest.mark.timeout(20)
def test_a_pipe_of_somebody_else_holds_nobody_up():
    pipe = SHM / f"utank-{os.getpid()}-pipe"
    os.mkfifo(pipe)
    with pytest.raises(RingError, match="no telemetry ring"):
        RowReader(pipe.name)
    RowWriter(["a"]).close()
    assert pipe.is_fifo()
    pipe.unlink()


WRITE_FOR_EVER = """
import sys, numpy as np
from utank_hil.telemetry.ring import RowWriter
writer = RowWriter([str(i) for i in range(14)], slots=64)
print(writer.name, flush=True)
sys.stdin.readline()
number, steps = 0, np.arange(1.0, 15.0)
row = np.empty(14)
while True:
    np.multiply(steps, number, out=row)
    writer.write(row)
    number += 1
"""


@contextlib.contextmanager
def python(code):
    """A process that prints the name of its ring first, and that name."""
    process = subprocess.Popen(
        [sys.executable, "-c", code],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,  # the tracker reports what a killed writer left behind
        text=True,
    )
    try:
        yield process, process.stdout.readline().strip()
    finally:
        process.kill()
        process.communicate()


def begin(process):
    process.stdin.write("\n")
    process.stdin.flush()


def wait_for(condition, seconds=10.0):
    deadline = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < deadline
        time.sleep(0.01)


@pytest.mark.slow
def test_no_torn_row_from_a_writer_at_full_speed():
    seen = 0
    last = -1.0
    with python(WRITE_FOR_EVER) as (process, name), RowReader(name) as reader:
        begin(process)
        deadline, rows = time.monotonic() + 1.5, ()
        # not after a read that found all overwritten: what it lost is behind no row yet
        while not len(rows) or (
            time.monotonic() < deadline and (seen < 200_000 or reader.lost == 0)
        ):
            rows = reader.read_rows()
            if len(rows):
                np.testing.assert_array_equal(rows, rows[:, :1] * np.arange(1, 15))
                assert rows[0, 0] > last
                assert (np.diff(rows[:, 0]) > 0).all()
                last = rows[-1, 0]
                seen += len(rows)
        assert last + 1 == seen + reader.lost  # every row was either handed out or counted
        assert seen > 1000
        assert reader.lost > 0
        process.kill()
        process.wait()
    wait_for(lambda: not (SHM / name).exists())


def test_a_killed_writer_is_noticed_even_as_a_zombie_and_its_segment_is_removed():
    with python(WRITE_FOR_EVER) as (process, name), RowReader(name) as reader:
        begin(process)
        wait_for(lambda: len(reader.read_rows()) > 0)
        assert not reader.ended
        os.kill(process.pid, signal.SIGKILL)
        wait_for(lambda: reader.ended)  # nobody has waited for the process yet
        wait_for(lambda: not (SHM / name).exists())


def test_segments_of_dead_writers_are_removed_by_the_next_whoever_it_is():
    untracked = "from multiprocessing import resource_tracker\n" + WRITE_FOR_EVER.replace(
        "print(", "resource_tracker.unregister('/' + writer.name, 'shared_memory'); print("
    )
    foreign = SHM / f"utank-{os.getpid()}-no-ring"
    foreign.write_bytes(bytes(1000))
    try:
        with python(untracked) as (process, name):
            with RowWriter(["a"]) as writer:
                assert (SHM / name).exists()  # its writer lives
            process.kill()
            process.wait()
        with RowWriter(["a"]) as writer, RowWriter(["b"]):
            assert not (SHM / name).exists()
            assert (SHM / writer.name).exists()
        assert foreign.exists()
    finally:
        foreign.unlink()


def test_a_ring_that_is_being_closed_is_not_removed_by_another_that_begins(monkeypatch):
    """Two controllers, or two benches: one begins between the other's last word and its unlink."""
    ring = RowWriter(["a"])
    close = SharedMemory.close

    def meanwhile(segment):
        monkeypatch.undo()
        RowWriter(["b"]).close()
        assert (SHM / ring.name).exists()
        close(segment)

    monkeypatch.setattr(SharedMemory, "close", meanwhile)
    ring.close()
    assert not (SHM / ring.name).exists()


def test_a_writer_may_have_any_name():
    """Linux cuts it after 15 bytes, in a letter too."""
    name = Path("/proc/self/comm")
    before = name.read_bytes()
    name.write_bytes(b") Schiff-Schl\xc3")
    try:
        with RowWriter(("a",)) as writer, RowReader(writer.name) as reader:
            assert reader.writer_lives
    finally:
        name.write_bytes(before.rstrip())


def test_a_ring_whose_segment_was_removed_meanwhile_closes_quietly():
    """systemd-logind removes those of a user who logs out, whatever still runs (RemoveIPC)."""
    code = """
import os
from utank_hil.telemetry.ring import RowWriter
with RowWriter(["a"]) as writer:
    os.unlink(f"/dev/shm/{writer.name}")
    writer.write(bytes(8))
"""
    done = subprocess.run([sys.executable, "-W", "error", "-c", code], capture_output=True)
    assert (done.returncode, done.stdout, done.stderr) == (0, b"", b"")


@pytest.mark.slow
def test_a_reader_process_that_exits_does_not_take_the_ring_with_it():
    code = """
import sys
from utank_hil.telemetry.ring import RowReader
reader = RowReader(sys.argv[1])
assert reader.read_rows().shape == (1, 1)
"""
    with RowWriter(["a"]) as writer:
        writer.write(np.zeros(1))
        for _ in range(2):
            subprocess.run([sys.executable, "-W", "error", "-c", code, writer.name], check=True)
        assert (SHM / writer.name).exists()


def test_ring_without_room_is_refused_instead_of_killing_its_writer_later(monkeypatch):
    def full(descriptor, offset, size):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "posix_fallocate", full)
    with pytest.raises(RingError, match=r"no room for .* No space left"):
        RowWriter(["a"])
