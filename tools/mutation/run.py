"""Change the safety code in every small way and see whether a test fails.

    python -m tools.mutation.run                          # all files; hours
    python -m tools.mutation.run --file utank_hil/safety/supervisor.py
    python -m tools.mutation.run --changed main               # only lines that differ from it
    python -m tools.mutation.run --not-judged --within 60     # only what no evidence has judged
    python -m tools.mutation.run --json                       # as evidence

With `--within` the time is limited: it is shared out by the number of mutants, which are drawn by
the seed (that of the commit, unless it is given), and what was not tried is counted.

What was killed is kept in .cache/mutation: after Ctrl-C, or with more tests, the same command goes
on with what lives. Exit code 1: a mutant lives that `targets.py` does not explain.
"""

import argparse
import hashlib
import importlib
import json
import math
import os
import random
import sys
import time
import traceback
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from types import CodeType
from typing import Any

from tools.evidence.sources import ROOT
from tools.mutation.changes import blob_of, changed_since, git, not_judged
from tools.mutation.mutants import Mutant, mutants_of
from tools.mutation.targets import NO_DIFFERENCE, TARGETS, Target

CACHE = ROOT / ".cache" / "mutation"
# what the tests import and no mutant changes: not to be imported for each one anew
PRELOADED = ("numpy", "scipy.linalg", "scipy.signal", "scipy.optimize", "hypothesis.strategies",
             "cantools", "can", "pydantic", "yaml", "typer", "numba", "control")  # fmt: skip
QUICK_SHARE = 0.6
"""Of limited time: what the quick way may take, before the thorough one."""


class Kept:
    """Keys of the mutants of a file that were killed, in a file that grows."""

    def __init__(self, target: Target) -> None:
        digest = hashlib.sha256((ROOT / target.file).read_bytes()).hexdigest()[:16]
        self._file = CACHE / f"{Path(target.file).stem}-{digest}.txt"
        self._file.parent.mkdir(parents=True, exist_ok=True)
        self._file.touch()

    def read(self) -> set[str]:
        """All that is kept."""
        return set(self._file.read_text(encoding="utf-8").splitlines())

    def add(self, mutant: Mutant) -> None:
        """Keep one more, at once."""
        with self._file.open("a", encoding="utf-8") as kept:
            kept.write(f"{mutant.key}\n")


def in_child(work: Callable[[], bool]) -> bool:
    """Whether work in a fork says so; what it prints goes to standard error."""
    child = os.fork()
    if child:
        return os.waitpid(child, 0)[1] == 0
    said = False
    try:
        sys.stdout = sys.stderr
        os.dup2(2, 1)
        said = work()
    except BaseException:
        traceback.print_exc()
    finally:
        sys.stderr.flush()
        os._exit(0 if said else 1)


def survivors(
    target: Target, mutants: list[Mutant], unchanged: CodeType, within_s: float
) -> Iterator[tuple[Mutant, bool]]:
    """Mutants that no test kills; with False, that there was no time for."""
    from tools.mutation import session

    begin, file, kept = time.monotonic(), ROOT / target.file, Kept(target)
    tests = (*target.tests, *target.behind)

    def waiting() -> list[Mutant]:
        dead = kept.read()
        return [mutant for mutant in mutants if mutant.key not in dead]

    for way, chosen, share in (
        (session.QUICK, target.tests, QUICK_SHARE),
        (session.THOROUGH, tests, 1.0),
    ):
        left = [mutant for mutant in waiting() if not mutant.at_import]
        end_s = begin + share * within_s
        if not left or time.monotonic() > end_s:
            continue
        exchanged = partial(session.try_exchanged, way, file, unchanged, left, chosen)
        if not in_child(partial(exchanged, kept.add, end_s)):
            raise SystemExit(f"the tests of {target.file} fail on the code as it is: {chosen}")
    left, since, limit_s = waiting(), time.monotonic(), session.MOST_S
    if left and since < begin + within_s:
        failed = session.fail_anew(file, unchanged, tests, min(limit_s, begin + within_s - since))
        if failed and time.monotonic() < begin + within_s:
            raise SystemExit(f"the tests of {target.file} fail on the code as it is: {tests}")
        limit_s = session.patience_s(time.monotonic() - since)
    for mutant in left:
        if time.monotonic() > begin + within_s:
            yield mutant, False
        elif session.fail_anew(file, mutant.code, tests, limit_s):
            kept.add(mutant)
        else:
            yield mutant, True


def judged(
    target: Target, unchanged: CodeType, mutants: list[Mutant], within_s: float
) -> dict[str, Any]:
    """Try mutants of a file."""
    reasons = NO_DIFFERENCE.get(target.file, {})
    living, untried = [], []
    tried = [mutant for mutant in mutants if mutant.key not in reasons]
    for mutant, was_tried in survivors(target, tried, unchanged, within_s):
        if not was_tried:
            untried.append(mutant.key)
            continue
        living.append({"line": mutant.line, "change": mutant.key})
        sys.stderr.write(f"{target.file}:{mutant.line}: {mutant.key}\n")
    return {
        "file": target.file,
        "blob": blob_of(target.file),
        "mutants": len(mutants),
        "killed": len(tried) - len(living) - len(untried),
        "not_tried": untried,
        "no_difference": [
            {"change": mutant.key, "why": reasons[mutant.key]}
            for mutant in mutants
            if mutant.key in reasons
        ],
        "survived": living,
    }


def wanted(arguments: argparse.Namespace) -> Iterator[tuple[Target, CodeType, list[Mutant]]]:
    """Targets with those of their mutants that are asked for."""
    for target in TARGETS:
        if arguments.file and target.file not in arguments.file:
            continue
        unchanged, mutants = mutants_of(ROOT / target.file)
        if arguments.changed is not None:
            mutants = changed_since(arguments.changed, target.file, mutants)
        elif arguments.not_judged:
            mutants = not_judged(target.file, mutants)
        yield target, unchanged, mutants


def main() -> int:
    """Try what was asked for."""
    parser = argparse.ArgumentParser(
        prog="python -m tools.mutation.run",
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--file", action="append", choices=[target.file for target in TARGETS])
    lines = parser.add_mutually_exclusive_group()
    lines.add_argument("--changed", metavar="BASE", help="only lines that differ from this commit")
    lines.add_argument(
        "--not-judged", action="store_true",
        help="only lines that differ from what docs/evidence/mutation.json judged",
    )  # fmt: skip
    parser.add_argument("--within", type=float, default=math.inf, help="seconds to try")
    parser.add_argument("--seed", type=int, help="which are tried first where time is limited")
    parser.add_argument("--json", action="store_true", help="print one JSON object")
    arguments = parser.parse_args()
    os.chdir(ROOT)
    os.environ["UTANK_HIL_COMPILED"] = "0"  # compiled modules have no code to exchange
    end_s = time.monotonic() + arguments.within
    for name in PRELOADED:
        importlib.import_module(name)
    tasks = list(wanted(arguments))
    seed = arguments.seed
    if seed is None:
        seed = int(git("rev-parse", "--short=8", "HEAD")[:8] or "0", 16)
    if math.isfinite(end_s):
        for _, _, mutants in tasks:
            random.Random(seed).shuffle(mutants)
    results = []
    for index, (target, unchanged, mutants) in enumerate(tasks):
        begin = time.monotonic()
        to_come = sum(len(others) for _, _, others in tasks[index:])
        share = len(mutants) / max(to_come, 1)
        result = judged(target, unchanged, mutants, share * (end_s - begin) if share else 0.0)
        results.append(result)
        counts = {
            name: len(value) if isinstance(value, list) else value
            for name, value in result.items()
            if name not in ("file", "blob")
        }
        if mutants:
            said = ", ".join(f"{value} {name.replace('_', ' ')}" for name, value in counts.items())
            sys.stderr.write(f"{target.file}: {said}; {time.monotonic() - begin:.0f} s\n")
    total = sum(len(mutants) for _, _, mutants in tasks)
    untried = sum(len(result["not_tried"]) for result in results)
    sys.stderr.write(f"{total - untried} of {total} mutants tried, {untried} not (seed {seed})\n")
    if arguments.json:
        sys.stdout.write(json.dumps({"files": results}) + "\n")
        return 0
    return 1 if any(result["survived"] for result in results) else 0


if __name__ == "__main__":
    sys.exit(main())
