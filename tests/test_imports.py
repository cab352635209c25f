"""What the controller's process loads: no plotting, no viewer, no compiler."""

import subprocess
import sys

import pytest

pytestmark = pytest.mark.slow

HEAVY = ("matplotlib", "numba", "rerun", "control", "pyarrow", "firmware_sim")

COMMAND = "import utank_hil.cli, utank_hil.commands.run, utank_hil.commands.panel"

LOOP = """
from pathlib import Path
from utank_hil.canbus import SocketCanPort
from utank_hil.commands.common import load
from utank_hil.commands.recording import RunRecording
from utank_hil.commands.run import run
from utank_hil.configuration import ControllerConfig
from utank_hil.runtime import RealTimeLoop, real_time_scheduling, stop_on_signals
from utank_hil.assembly import build_controller_node
from utank_hil.runtime.signals import SIGNALS
from utank_hil.telemetry import RingWriter

assert SocketCanPort
for path in sorted(Path("configs/controllers").glob("*.yaml")):
    with RingWriter(SIGNALS, capacity=64) as ring:
        node = build_controller_node(load(path, ControllerConfig), sink=ring.write)
        with stop_on_signals() as stop, real_time_scheduling():
            RealTimeLoop([node]).run(stop, 300_000_000)
        assert ring.count >= 10
"""

CHECK = """
import sys
loaded = sorted({{name.partition(".")[0] for name in sys.modules}} & set({heavy!r}))
print(*loaded)
"""


def loaded_by(source: str) -> str:
    """Heavy packages that a new interpreter holds after running `source`."""
    done = subprocess.run(
        [sys.executable, "-W", "error", "-c", source + CHECK.format(heavy=HEAVY)],
        capture_output=True,
        text=True,
        timeout=120,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    return done.stdout.strip()


@pytest.mark.parametrize("source", [COMMAND, LOOP], ids=["command line", "loop"])
def test_controllers_process_loads_nothing_heavy(source: str) -> None:
    assert loaded_by(source) == ""


def test_margins_are_judged_without_anything_heavy_because_run_does_it_first() -> None:
    source = """
from pathlib import Path
from utank_hil.commands.gate import admit
from utank_hil.configuration import ControllerConfig, load_config
path = Path("configs/controllers/gpc.yaml")
assert admit(load_config(path, ControllerConfig), path).linear is not None
"""
    assert loaded_by(source) == ""


def test_the_test_can_fail() -> None:
    assert loaded_by("import matplotlib") == "matplotlib"
