"""Compile the modules that every tick runs through, with mypyc; see `utank_hil.compiled`.

Takes a minute and a C compiler. Any change of the source puts them out of use until the next time.

Example: python -m tools.compiled
"""

import argparse
import os
import shutil
import sys
import tempfile
from pathlib import Path
from typing import Final

from mypyc.build import mypycify
from setuptools import Distribution

from utank_hil.compiled import ROOT, folder, modules_in

PATTERNS: Final = (
    "firmware_sim/drive.py",
    "firmware_sim/plant.py",
    "firmware_sim/sensors.py",
    "firmware_sim/truth.py",
    "utank_hil/canbus/endpoints.py",
    "utank_hil/control/level_observer.py",
    "utank_hil/runtime/alarms.py",
    "utank_hil/runtime/bus_model.py",
    "utank_hil/runtime/controller_node.py",
    "utank_hil/runtime/drive_sequence.py",
    "utank_hil/runtime/group.py",
    "utank_hil/runtime/housekeeping.py",
    "utank_hil/runtime/inbox.py",
    "utank_hil/runtime/judging.py",
    "utank_hil/runtime/lockstep.py",
    "utank_hil/runtime/monitoring.py",
    "utank_hil/runtime/monitors/*.py",
    "utank_hil/runtime/observations.py",
    "utank_hil/runtime/orders.py",
    "utank_hil/runtime/passive_twin.py",
    "utank_hil/runtime/periodic.py",
    "utank_hil/runtime/stations.py",
    "utank_hil/runtime/supervisor.py",
    "utank_hil/runtime/wire_time.py",
    "utank_hil/telemetry/memory_log.py",
)
NOT: Final = frozenset(["utank_hil/runtime/monitors/thresholds.py"])
"""No file with a dataclass that a configuration holds: pydantic needs its `__dict__`, and pickle
can't fill a frozen one that is compiled.
"""


def build() -> Path:
    """Compile into the folder of the present source; return it."""
    made = folder()
    if modules_in(made):
        return made
    found = [str(path.relative_to(ROOT)) for each in PATTERNS for path in sorted(ROOT.glob(each))]
    files = [file for file in found if file not in NOT]
    os.chdir(ROOT)  # mypyc names modules by their paths from here
    made.parent.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(dir=made.parent) as scratch:
        extensions = mypycify(
            ["--config-file", "pyproject.toml", *files], debug_level="0", target_dir=scratch
        )
        done = Path(scratch) / "done"
        command = Distribution({"name": "compiled", "ext_modules": extensions}).get_command_obj(
            "build_ext"
        )
        command.build_lib, command.build_temp = str(done), f"{scratch}/objects"
        command.parallel = os.cpu_count()
        command.ensure_finalized()
        command.run()
        for older in made.parent.glob("[0-9a-f]" * 16):
            shutil.rmtree(older)
        done.rename(made)
    return made


def main() -> None:
    """Compile and say what there is."""
    argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    ).parse_args()
    if not shutil.which(os.environ.get("CC", "cc")):
        sys.exit("a C compiler is missing: apt-get install gcc, then again")
    print(f"{len(modules_in(build())) - 1} modules compiled")


if __name__ == "__main__":
    main()
