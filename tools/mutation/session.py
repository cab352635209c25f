"""Tests against mutants, each in a process of its own that ends with the first failure.

A mutant is tried in forks of a session that has collected its tests: the code of the changed
functions is exchanged, which takes no import. First with few examples of the tests that mirror the
file, then with more, and with the tests behind them. What lives through that, or runs when the file
is imported, is tried in a session that imports the changed file.
"""

import gc
import importlib
import importlib.machinery
import importlib.util
import mmap
import os
import random
import resource
import signal
import struct
import sys
import time
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from types import CodeType, FunctionType

import pytest
from _pytest.main import pytest_runtestloop as run_tests

from tools.evidence.sources import ROOT
from tools.mutation.mutants import Mutant

FEW, MANY = 12, 60
"""Variants of each parametrized test."""
QUICK = (FEW, "few")
THOROUGH = (MANY, "same")
"""How many variants, and the profile of the property tests."""
MOST_S = 1800.0
"""What the tests may take on the code as it is."""
_MEMORY_BYTES = 4 << 30
_PLACE = struct.Struct("q")
_OPTIONS = [
    "-q", "-x", "-s", "-p", "no:cacheprovider", "-p", "no:xdist", "-p", "no:cov", "--timeout=0",
    "-m", "not socketcan and not evidence",
    "-W", "ignore::pytest.PytestAssertRewriteWarning",  # of what is imported already
]  # fmt: skip


def patience_s(seconds: float) -> float:
    """How long tests that took this long may take on a mutant, on a machine that is shared."""
    return 5 + 5 * seconds


def dotted(file: Path) -> str:
    """Name of a module of this repository."""
    return ".".join(file.relative_to(ROOT).with_suffix("").parts)


def in_fork(work: Callable[[], bool], limit_s: float) -> bool:
    """Whether work in a fork of this process says so; not if it dies or takes too long."""
    child = os.fork()
    if child:
        return os.waitpid(child, 0)[1] == 0
    said = False
    try:
        os.setsid()
        nowhere = os.open(os.devnull, os.O_RDWR)
        for stream in (0, 1, 2):
            os.dup2(nowhere, stream)
        resource.setrlimit(resource.RLIMIT_AS, (_MEMORY_BYTES, _MEMORY_BYTES))
        signal.signal(signal.SIGALRM, signal.SIG_DFL)
        signal.setitimer(signal.ITIMER_REAL, limit_s)
        said = work()
    finally:
        os._exit(0 if said else 1)


class Spread:
    """A pytest plugin that keeps some variants of each test, drawn the same way each time.

    Parameters
    ----------
    most : int
        Of each.
    """

    def __init__(self, most: int) -> None:
        self._most = most

    def pytest_collection_modifyitems(self, items: list[pytest.Item]) -> None:
        """Leave out the others."""
        variants: dict[str, list[int]] = {}
        for index, item in enumerate(items):
            variants.setdefault(item.nodeid.partition("[")[0], []).append(index)
        draw = random.Random(1)
        kept: set[int] = set()
        for places in variants.values():
            kept.update(draw.sample(places, min(self._most, len(places))))
        items[:] = [items[index] for index in sorted(kept)]


class Exchange:
    """A pytest plugin that runs the collected tests once for each mutant.

    Parameters
    ----------
    file : Path
        The file that is changed.
    unchanged : CodeType
        Of it.
    report : callable
        Takes a mutant as soon as a test fails.
    end_s : float
        Of the monotonic clock: no mutant is tried after it.
    """

    def __init__(
        self,
        file: Path,
        unchanged: CodeType,
        mutants: Sequence[Mutant],
        report: Callable[[Mutant], None],
        end_s: float,
    ) -> None:
        self._file, self._unchanged, self._mutants = file, unchanged, mutants
        self._end_s = end_s
        self._report = report
        self._started = 0

    def pytest_runtestloop(self, session: pytest.Session) -> bool:
        """Run them for every mutant that can be had by exchanging code."""
        killer = mmap.mmap(-1, _PLACE.size)  # seen from the fork

        def passes() -> bool:
            try:
                run_tests(session)
            finally:
                if session.testsfailed:
                    _PLACE.pack_into(killer, 0, self._started - 1)
            return not session.testsfailed

        begin = time.monotonic()
        if not in_fork(passes, min(MOST_S, self._end_s - begin)):
            session.testsfailed = int(time.monotonic() < self._end_s)
            return True
        limit_s = patience_s(time.monotonic() - begin)
        functions = _functions_of(self._file)
        for mutant in self._mutants:
            if time.monotonic() > self._end_s:
                break
            exchanged = {
                old: new
                for old, new in _pairs(self._unchanged, mutant.code)
                if old != new and old in functions
            }
            if not exchanged:
                continue

            def changed_passes(exchanged: dict[CodeType, CodeType] = exchanged) -> bool:
                for old, new in exchanged.items():
                    for function in functions[old]:
                        function.__code__ = new
                return passes()

            _PLACE.pack_into(killer, 0, 0)
            if not in_fork(changed_passes, limit_s):
                self._report(mutant)
                # what killed one may well kill the next
                place = _PLACE.unpack_from(killer)[0]
                session.items.insert(0, session.items.pop(place))
        return True

    def pytest_runtest_logstart(self) -> None:
        """Count the tests."""
        self._started += 1


def _functions_of(file: Path) -> dict[CodeType, list[FunctionType]]:
    found: dict[CodeType, list[FunctionType]] = {}
    for entry in gc.get_objects():
        if isinstance(entry, FunctionType) and entry.__code__.co_filename == str(file):
            found.setdefault(entry.__code__, []).append(entry)
    return found


def _pairs(old: CodeType, new: CodeType) -> Iterable[tuple[CodeType, CodeType]]:
    """Code within code that stands in the same place of both."""
    yield old, new
    inner = [[const for const in code.co_consts if isinstance(const, CodeType)]
             for code in (old, new)]  # fmt: skip
    if len(inner[0]) == len(inner[1]):
        for pair in zip(*inner, strict=True):
            yield from _pairs(*pair)


def try_exchanged(
    way: tuple[int, str],
    file: Path,
    unchanged: CodeType,
    mutants: Sequence[Mutant],
    tests: Sequence[str],
    report: Callable[[Mutant], None],
    end_s: float,
) -> bool:
    """Try mutants by exchanging code, in this process; reports those that are killed.

    Returns
    -------
    bool
        Whether the tests pass on the code as it is.
    """
    most, profile = way
    plugins = [Spread(most), Exchange(file, unchanged, mutants, report, end_s)]
    return not pytest.main([*_OPTIONS, f"--hypothesis-profile={profile}", *tests], plugins=plugins)


class _Changed(importlib.machinery.SourceFileLoader):
    """Loads a changed file, and finds it."""

    def __init__(self, name: str, file: Path, code: CodeType) -> None:
        super().__init__(name, str(file))
        self._code = code

    def get_code(self, fullname: str) -> CodeType:  # noqa: ARG002
        return self._code

    def find_spec(self, name: str, path: object = None, target: object = None) -> object:  # noqa: ARG002
        if name != self.name:
            return None
        return importlib.util.spec_from_file_location(name, self.path, loader=self)


def fail_anew(file: Path, code: CodeType, tests: Sequence[str], limit_s: float) -> bool:
    """Whether tests fail in a session, forked off this process, that imports this code."""
    name = dotted(file)
    assert name not in sys.modules, f"{name} is imported already"

    def passes() -> bool:
        sys.meta_path.insert(0, _Changed(name, file, code))  # type: ignore[arg-type]
        return pytest.main([*_OPTIONS, *tests], plugins=[Spread(MANY)]) == 0

    return not in_fork(passes, limit_s)
