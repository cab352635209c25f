"""What is said of the machine is what its libraries do."""

import json
import os
import subprocess
import sys

from utank_hil.base.provenance import kernels, machine


def test_kernels_of_an_older_processor_are_said() -> None:
    older = {"NPY_DISABLE_CPU_FEATURES": "X86_V3", "OPENBLAS_CORETYPE": "Nehalem"}
    code = (
        "import json; from utank_hil.base.provenance import machine; print(json.dumps(machine()))"
    )
    done = subprocess.run(
        [sys.executable, "-W", "ignore", "-c", code],
        env=os.environ | older, capture_output=True, text=True, check=True,
    )  # fmt: skip
    there = json.loads(done.stdout)
    assert there["processor"] == machine()["processor"]
    assert there["numpy"] == "baseline"
    assert there["blas"].endswith("openblas Nehalem")


def test_a_log_that_says_nothing_of_its_machine_is_none_of_another() -> None:
    assert kernels({"platform": "Linux", "cpus": 2}) == ""
    assert machine()["libm"] in kernels(machine())
