"""The tutorial's command for a CAN bus, as it is written there."""

import re
import shlex
import subprocess
from pathlib import Path

import pytest
from two_processes import BIN, START_S

from utank_hil.console.exit_codes import ExitCode

pytestmark = [pytest.mark.socketcan, pytest.mark.evidence, pytest.mark.timeout(900)]

PAGE = Path("docs/tutorial.md").read_text(encoding="utf-8")


def test_it_works_on_the_bus(tmp_path):
    init, bench = (
        re.findall(rf"^(?:tools/vcan )?utank-hil ({command} .*)$", PAGE, re.M)[-1]
        for command in ("init", "bench patrol/scenario.yaml --realtime --bus")
    )
    for line in (init, bench):
        done = subprocess.run(
            [BIN / "utank-hil", *shlex.split(line)],
            cwd=tmp_path, capture_output=True, text=True, timeout=3 * START_S, check=False,
        )  # fmt: skip
        # a machine that is busy may leave the controller too seldom in charge
        assert done.returncode in (ExitCode.OK, ExitCode.NOT_RANKED), done.stdout + done.stderr
    assert "late" in done.stdout
    assert (tmp_path / "patrol" / "can" / "bench.rrd").exists()
