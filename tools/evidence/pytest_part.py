"""Run tests as a part of the evidence: one JSON object with how each ended and what it printed.

    python -m tools.evidence.pytest_part -m evidence tests/control

Arguments are pytest's. What pytest prints goes to standard error.
"""

import contextlib
import json
import sys

import pytest


class Outcomes:
    """Keeps how each test ended."""

    def __init__(self) -> None:
        self.tests: dict[str, dict[str, object]] = {}

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        """Note the test itself, or that its setting up or tearing down failed."""
        if report.when == "call" or not report.passed:
            self.tests[report.nodeid] = {
                "outcome": report.outcome,
                "seconds": round(report.duration, 1),
                "printed": report.capstdout.splitlines(),
            }


def main() -> int:
    """Run pytest with the arguments of the command line."""
    outcomes = Outcomes()
    with contextlib.redirect_stdout(sys.stderr):
        code = int(pytest.main(sys.argv[1:], plugins=[outcomes]))
    sys.stdout.write(json.dumps({"tests": outcomes.tests}) + "\n")
    return code


if __name__ == "__main__":
    sys.exit(main())
