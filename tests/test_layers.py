"""The check of the layers is alive: it fails on the first wrong import of each kind."""

import shutil
import subprocess
import sys
from pathlib import Path

import pytest

pytestmark = pytest.mark.slow

ROOT = Path(__file__).resolve().parents[1]
LINT = Path(sys.executable).with_name("lint-imports")


@pytest.fixture(scope="module")
def copy(tmp_path_factory):
    folder = tmp_path_factory.mktemp("copy")
    for package in ("utank_hil", "firmware_sim"):
        shutil.copytree(
            ROOT / package, folder / package, ignore=shutil.ignore_patterns("__pycache__")
        )
    shutil.copy(ROOT / "pyproject.toml", folder)
    return folder


@pytest.mark.evidence(
    "utank_hil/telemetry/ring.py-import utank_hil.pictures-arrows point one way",
    "firmware_sim/report_page.py-import utank_hil.commands.run-but the command line imports",
    "utank_hil/commands/run.py-import firmware_sim.bench-knows nothing of the bench",
)
@pytest.mark.parametrize(
    ("file", "line", "contract"),
    [
        ("utank_hil/control/gain.py", "import utank_hil.runners.node", "arrows point one way"),
        ("utank_hil/telemetry/ring.py", "import utank_hil.pictures", "arrows point one way"),
        ("utank_hil/commands/run.py", "import firmware_sim.bench", "knows nothing of the bench"),
        (
            "utank_hil/control/optimal_tank.py",
            "import utank_hil.control.gain",
            "no circle of files",
        ),
        ("utank_hil/dynamics/tank.py", "import time", "know nothing of CAN, time or files"),
        (
            "firmware_sim/report_page.py",
            "import utank_hil.commands.run",
            "but the command line imports",
        ),
        ("firmware_sim/bench.py", "import firmware_sim.commands", "but the command line imports"),
        ("utank_hil/attic.py", "", "every room has its layer"),
    ],
)
def test_a_wrong_import_is_found(copy, file, line, contract):
    path = copy / file
    before = path.read_text(encoding="utf-8") if path.exists() else None
    path.write_text((before or '"""Nothing."""\n') + f"\n{line}\n", encoding="utf-8")
    try:
        done = subprocess.run(
            [LINT, "--no-cache", "--no-logo"],
            cwd=copy, env={"PYTHONPATH": str(copy)}, capture_output=True, text=True, check=False,
        )  # fmt: skip
    finally:
        if before is None:
            path.unlink()
        else:
            path.write_text(before, encoding="utf-8")
    assert done.returncode == 1, done.stdout + done.stderr
    broken = [each for each in done.stdout.splitlines() if each.endswith(" BROKEN")]
    assert any(contract in each for each in broken)
