import subprocess
import sys

import pytest

pytestmark = pytest.mark.slow

PROGRAM = """
import sys
from utank_hil.canbus import load_catalogue
from utank_hil.configuration import ControllerConfig, load_config
from utank_hil.assembly import build_controller_node
from utank_hil.retuning import SimulatedRetuner

config = load_config("configs/controllers/adaptive_gpc.yaml", ControllerConfig)
node = build_controller_node(config, retuner=SimulatedRetuner(print, 1.0))
assert node.law.events == ()
print([name for name in ("matplotlib", "numba", "rerun", "control") if name in sys.modules])
"""


def test_adaptive_controller_brings_neither_plotting_nor_a_compiler() -> None:
    result = subprocess.run(
        [sys.executable, "-c", PROGRAM], capture_output=True, text=True, check=False
    )
    assert result.stdout.strip() == "[]", result.stdout + result.stderr
