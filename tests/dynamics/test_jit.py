"""Compiling where nothing can be kept."""

import fcntl
import importlib
import sys
from concurrent.futures import ThreadPoolExecutor
from concurrent.futures import TimeoutError as NotDone

import pytest
from numba.core.caching import CacheImpl, IndexDataCacheFile

from utank_hil.dynamics import jit
from utank_hil.dynamics.jit import njit


def twice(number):
    return 2 * number


@pytest.mark.parametrize("kept", [True, False])
def test_what_can_not_be_kept_is_compiled_all_the_same(monkeypatch, *, kept):
    if not kept:  # as in an installation that is not to be written, of a user without a home
        monkeypatch.setattr(CacheImpl, "_locator_classes", [])
    compiled = njit()(twice)
    assert compiled(21.0) == 42.0
    assert (compiled.stats.cache_path is not None) is kept


def test_a_cache_that_another_user_shares_with_nobody_is_none(monkeypatch):
    """As root leaves one with umask 077 in the folder of a checkout's owner."""

    def unreadable(cache):
        raise PermissionError(13, "Permission denied", cache._index_path)

    monkeypatch.setattr(IndexDataCacheFile, "_load_index", unreadable)
    compiled = njit()(lambda number: 7 * number)
    assert (compiled(3.0), compiled(3)) == (21.0, 21)


def test_a_kernel_is_compiled_anew_when_what_it_calls_has_changed(tmp_path, monkeypatch):
    monkeypatch.syspath_prepend(tmp_path)
    head = "from utank_hil.dynamics.jit import njit\n"
    (tmp_path / "calling.py").write_text(
        f"{head}from called_kernel import one\n@njit()\ndef two(): return 2 * one()\n"
    )
    found = []
    for value in (1, 1, 10):
        called = f"{head}@njit()\ndef one(): return {value}\n"
        if not found or value != 1:
            (tmp_path / "called_kernel.py").write_text(called)
        importlib.invalidate_caches()
        jit._digest.cache_clear()  # as in a new process
        for name in ("calling", "called_kernel"):
            sys.modules.pop(name, None)
        two = importlib.import_module("calling").two
        found.append((two(), sum(two.stats.cache_hits.values())))
    for name in ("calling", "called_kernel"):
        del sys.modules[name]
    assert found == [(2, 0), (2, 1), (20, 0)]


def test_a_kernel_waits_for_what_another_process_compiles():
    compiled = njit()(lambda number: 3 * number)
    with ThreadPoolExecutor(1) as thread, open(jit.__file__, "rb") as of_another:
        fcntl.flock(of_another, fcntl.LOCK_EX)
        waiting = thread.submit(compiled, 7.0)
        with pytest.raises(NotDone):
            waiting.result(timeout=0.5)
        fcntl.flock(of_another, fcntl.LOCK_UN)
        assert waiting.result(timeout=60.0) == 21.0


def test_a_lock_that_is_never_released_stops_no_kernel(monkeypatch):
    monkeypatch.setattr(jit, "MOST_WAITS", 4)
    compiled = njit()(lambda number: 5 * number)
    with ThreadPoolExecutor(1) as thread, open(jit.__file__, "rb") as of_another:
        fcntl.flock(of_another, fcntl.LOCK_EX)
        assert thread.submit(compiled, 7.0).result(timeout=60.0) == 35.0
