"""Branch coverage of the safety code by the tests that mutation uses: nothing may be left out.

    python -m tools.mutation.coverage [--json]

Exit code 1: a line or a branch is not run by any of these tests.
"""

import argparse
import json
import os
import subprocess
import sys
import tempfile
from pathlib import Path

from tools.evidence.sources import ROOT
from tools.mutation.targets import TARGETS


def measured() -> dict[str, dict[str, object]]:
    """What is missing of each file: lines, and branches as pairs of lines."""
    tests = sorted({test for target in TARGETS for test in (*target.tests, *target.behind)})
    packages = sorted({str(Path(target.file).parent) for target in TARGETS})
    with tempfile.TemporaryDirectory() as folder:
        report = Path(folder) / "coverage.json"
        environment = {
            **os.environ,
            "UTANK_HIL_COMPILED": "0",
            "COVERAGE_FILE": str(Path(folder) / "coverage"),
        }
        done = subprocess.run(
            [sys.executable, "-m", "pytest", "-p", "no:cacheprovider",
             "--hypothesis-profile=few", "-m", "not socketcan and not evidence",
             *(f"--cov={package}" for package in packages), "--cov-branch",
             f"--cov-report=json:{report}", *tests],
            cwd=ROOT, env=environment, stdout=sys.stderr, check=False,
        )  # fmt: skip
        if done.returncode:
            raise SystemExit("the tests fail: see above")
        files = json.loads(report.read_text(encoding="utf-8"))["files"]
    return {
        target.file: {
            "branches": files[target.file]["summary"]["num_branches"],
            "missing_lines": files[target.file]["missing_lines"],
            "missing_branches": files[target.file]["missing_branches"],
        }
        for target in TARGETS
    }


def main() -> int:
    """Measure, and say what is missing."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--json", action="store_true", help="print one JSON object")
    arguments = parser.parse_args()
    files = measured()
    missing = {
        name: found for name, found in files.items()
        if found["missing_lines"] or found["missing_branches"]
    }  # fmt: skip
    if arguments.json:
        sys.stdout.write(json.dumps({"files": files}) + "\n")
    for name, found in missing.items():
        sys.stderr.write(
            f"{name}: lines {found['missing_lines']}, branches {found['missing_branches']}\n"
        )
    return 1 if missing else 0


if __name__ == "__main__":
    sys.exit(main())
