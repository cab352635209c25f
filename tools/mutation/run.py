"""Change the safety code in every small way and see whether a test fails.

    python -m tools.mutation.run                          # all files; hours
    python -m tools.mutation.run --file utank_hil/runtime/supervisor.py
    python -m tools.mutation.run --changed main               # only lines that differ from it
    python -m tools.mutation.run --json                       # as evidence

With `--within` the time is limited, and what was not tried is counted.

What was killed is kept in .cache/mutation: after Ctrl-C, or with more tests, the same command goes
on with what lives. Exit code 1: a mutant lives that `targets.py` does not explain.
"""

import argparse
import hashlib
import importlib
import json
import math
import os
import re
import subprocess
import sys
import time
import traceback
from collections.abc import Iterator
from pathlib import Path
from types import CodeType

from tools.evidence.sources import ROOT
from tools.mutation.mutants import Mutant, mutants_of
from tools.mutation.targets import NO_DIFFERENCE, TARGETS, Target

CACHE = ROOT / ".cache" / "mutation"
# what the tests import and no mutant changes: not to be imported for each one anew
PRELOADED = ("numpy", "scipy.linalg", "scipy.signal", "scipy.optimize", "hypothesis.strategies",
             "cantools", "can", "pydantic", "yaml", "typer", "numba", "control")  # fmt: skip
LIMIT_S = 300.0


def changed_lines(base: str, file: str) -> set[int]:
    """Lines of a file that are not as in the common ancestor with `base`."""
    ancestor = _git("merge-base", base, "HEAD").strip()
    hunks = re.findall(
        r"^@@ .* \+(\d+)(?:,(\d+))? @@", _git("diff", "-U0", ancestor, "--", file), re.M
    )
    return {int(first) + i for first, count in hunks for i in range(int(count or 1))}


def _is_known(base: str) -> bool:
    words = ["git", "rev-parse", "--quiet", "--verify", f"{base}^{{commit}}"]
    return subprocess.run(words, cwd=ROOT, stdout=subprocess.DEVNULL, check=False).returncode == 0


def _git(*words: str) -> str:
    return subprocess.run(
        ["git", *words], cwd=ROOT, check=True, stdout=subprocess.PIPE, text=True
    ).stdout


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

    def add(self, mutant: Mutant, killed: bool = True) -> None:
        """Keep one more, at once."""
        if killed:
            with self._file.open("a", encoding="utf-8") as kept:
                kept.write(f"{mutant.key}\n")


def survivors(
    target: Target, mutants: list[Mutant], unchanged: CodeType, end_s: float
) -> Iterator[Mutant | None]:
    """Those of the mutants that no test kills; None for one that there was no time for."""
    from tools.mutation import session

    file, kept = ROOT / target.file, Kept(target)
    dead = kept.read()
    waiting = [mutant for mutant in mutants if mutant.key not in dead]
    if not waiting:
        return
    child = os.fork()
    if not child:
        passed = False
        try:
            sys.stdout = sys.stderr
            os.dup2(2, 1)
            passed = session.try_exchanged(file, unchanged, waiting, target.tests, kept.add, end_s)
        except BaseException:
            traceback.print_exc()
        finally:
            sys.stderr.flush()
            os._exit(0 if passed else 1)
    if os.waitpid(child, 0)[1]:
        raise SystemExit(f"the tests of {target.file} fail on the code as it is")
    dead = kept.read()
    waiting = [mutant for mutant in waiting if mutant.key not in dead]
    tests = (*target.tests, *target.behind)
    if waiting and session.fail_anew(file, unchanged, tests, LIMIT_S):
        raise SystemExit(f"the tests of {target.file} fail on the code as it is: {tests}")
    for mutant in waiting:
        if time.monotonic() > end_s:
            yield None
        elif session.fail_anew(file, mutant.code, tests, LIMIT_S):
            kept.add(mutant)
        else:
            yield mutant


def judged(target: Target, base: str | None, end_s: float) -> dict[str, object]:
    """Try all mutants of a file, or of its changed lines."""
    unchanged, mutants = mutants_of(ROOT / target.file)
    if base is not None:
        lines = changed_lines(base, target.file)
        mutants = [mutant for mutant in mutants if mutant.line in lines]
    reasons = NO_DIFFERENCE.get(target.file, {})
    living, untried = [], 0
    explained = [
        {"change": mutant.key, "why": reasons[mutant.key]}
        for mutant in mutants
        if mutant.key in reasons
    ]
    tried = [mutant for mutant in mutants if mutant.key not in reasons]
    for mutant in survivors(target, tried, unchanged, end_s):
        if mutant is None:
            untried += 1
            continue
        living.append({"line": mutant.line, "change": mutant.key})
        sys.stderr.write(f"{target.file}:{mutant.line}: {mutant.key}\n")
    return {
        "file": target.file,
        "mutants": len(mutants),
        "killed": len(tried) - len(living) - untried,
        "not_tried": untried,
        "no_difference": explained,
        "survived": living,
    }


def main() -> int:
    """Try what was asked for."""
    parser = argparse.ArgumentParser(
        prog="python -m tools.mutation.run",
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--file", action="append", choices=[target.file for target in TARGETS])
    parser.add_argument("--changed", metavar="BASE", help="only lines that differ from this commit")
    parser.add_argument("--within", type=float, default=math.inf, help="seconds to try")
    parser.add_argument("--json", action="store_true", help="print one JSON object")
    arguments = parser.parse_args()
    os.chdir(ROOT)
    os.environ["UTANK_HIL_COMPILED"] = "0"  # compiled modules have no code to exchange
    end_s = time.monotonic() + arguments.within
    base = arguments.changed
    if base is not None and not _is_known(base):
        sys.stderr.write(f"there is no {base} to compare with: nothing counts as changed\n")
        return 0
    for name in PRELOADED:
        importlib.import_module(name)
    results = []
    for target in TARGETS:
        if arguments.file and target.file not in arguments.file:
            continue
        if base is not None and not changed_lines(base, target.file):
            continue
        begin = time.monotonic()
        result = judged(target, base, end_s)
        results.append(result)
        counts = {
            name: len(value) if isinstance(value, list) else value
            for name, value in result.items()
            if name != "file"
        }
        said = ", ".join(f"{value} {name.replace('_', ' ')}" for name, value in counts.items())
        sys.stderr.write(f"{target.file}: {said}; {time.monotonic() - begin:.0f} s\n")
    if arguments.json:
        sys.stdout.write(json.dumps({"files": results}) + "\n")
        return 0
    return 1 if any(result["survived"] for result in results) else 0


if __name__ == "__main__":
    sys.exit(main())
