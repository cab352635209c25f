"""Compares the kept frame logs with what the cases give today, or accepts that as the new ones.

``python -m tools.reference_recordings`` replays each log, names the first difference and ends with
1 if there is one; with ``--accept [NAME ...]`` it records the cases anew, prints what was accepted,
and leaves a file that has not changed as it is.
"""

import argparse
import sys
import tempfile
from pathlib import Path

from tools.reference_recordings.cases import CASES, LOGS, Case, compare, record


def main() -> int:
    """Compare or accept; return the exit code."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--accept", action="store_true", help="record anew")
    parser.add_argument("names", nargs="*", metavar="NAME", help="cases; without any, all")
    arguments = parser.parse_args()
    known = {case.name: case for case in CASES}
    unknown = [name for name in arguments.names if name not in known]
    if unknown:
        parser.error(f"no case {', '.join(unknown)}; there are {', '.join(known)}")
    cases = [known[name] for name in arguments.names] or CASES
    different = 0
    for case in cases:
        said = _accepted(case) if arguments.accept else compare(LOGS / f"{case.name}.frames")
        different += bool(said)
        sys.stdout.write(f"{case.name}: {said or 'unchanged'}\n")
    if arguments.accept:
        for path in LOGS.glob("*.frames"):
            if path.stem not in known:
                path.unlink()
                sys.stdout.write(f"{path.stem}: removed, there is no such case\n")
        return 0
    return int(different > 0)


def _accepted(case: Case) -> str:
    """Record a case anew; what differs from the log that was kept, empty if nothing."""
    kept = LOGS / f"{case.name}.frames"
    with tempfile.TemporaryDirectory(dir=LOGS) as folder:
        content = record(case, Path(folder), LOGS).read_bytes()
    if not kept.exists():
        kept.write_bytes(content)
        return "new"
    if kept.read_bytes() == content:
        return ""
    said = compare(kept) or "another head, ship or trouble; the controller answers the same"
    kept.write_bytes(content)
    return said


if __name__ == "__main__":
    sys.exit(main())
