"""Run a tool within the test's own process: starting one costs seconds of imports."""

import importlib
import json
from typing import NamedTuple

import pytest


class Ended(NamedTuple):
    """How a tool ended, and what it printed."""

    code: int
    output: str
    errors: str

    @property
    def found(self):
        """The one JSON object of its standard output."""
        assert self.code == 0, self.errors
        return json.loads(self.output)


@pytest.fixture
def tool(monkeypatch, capsys):
    """Call as ``tool("studies.share_of_possible", "--seeds", "2")``."""

    def run(name, *arguments):
        module = importlib.import_module(f"tools.{name}")
        monkeypatch.setattr("sys.argv", [name, *arguments])
        try:
            code = module.main() or 0
        except SystemExit as ended:
            code = int(ended.code or 0)
        return Ended(code, *capsys.readouterr())

    return run
