"""Readers in a process of their own: items in order, and each of its ends in words."""

import os
import signal
import time
from pathlib import Path

import pytest

from utank_hil.base import apart as module
from utank_hil.base.apart import apart


def counted(count):
    print("not seen")
    yield from range(count)


def refused():
    yield 1
    raise KeyError("the file's words\nand more")


def killed(number):
    yield 1
    os.kill(os.getpid(), number)


def greedy():
    yield len(bytearray(1 << 33))


def slow(file):
    Path(file).write_text(str(os.getpid()))
    yield 1
    time.sleep(600)


def process_is_there(pid):
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return False
    return True


def test_items_come_in_their_order(capfd):
    assert list(apart(counted, 2000)) == list(range(2000))
    assert capfd.readouterr() == ("", "")


def test_an_exception_becomes_its_words():
    items = apart(refused)
    assert next(items) == 1
    with pytest.raises(ValueError, match=r"^KeyError: \"the file's words\\nand more\"$"):
        next(items)


def test_an_end_by_a_signal_is_said_after_the_items_before_it():
    items = apart(killed, int(signal.SIGSEGV))
    assert next(items) == 1
    with pytest.raises(ValueError, match="it is damaged: its reader ends by signal 11"):
        next(items)


def test_more_memory_than_allowed_is_refused():
    with pytest.raises(ValueError, match="MemoryError"):
        next(apart(greedy))


def test_a_reader_that_hangs_or_is_left_ends(tmp_path, monkeypatch):
    items = apart(slow, str(tmp_path / "pid"))
    next(items)
    pid = int((tmp_path / "pid").read_text())
    monkeypatch.setattr(module, "_LONGEST_S", 0.2)  # it has started
    with pytest.raises(ValueError, match=r"does not go on for 0\.2 s"):
        next(items)
    assert not process_is_there(pid)
    monkeypatch.undo()
    items = apart(slow, str(tmp_path / "pid"))
    next(items)
    pid = int((tmp_path / "pid").read_text())
    items.close()
    assert not process_is_there(pid)
