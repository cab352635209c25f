"""Compile the modules that every tick runs through, with mypyc; see `utank_hil.base.compiled`.

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

from utank_hil.base.compiled import CODECS, ROOT, folder, modules_in
from utank_hil.canbus import enumerations, load_catalogue

PATTERNS: Final = (
    "firmware_sim/drive.py",
    "firmware_sim/drive_states.py",
    "firmware_sim/plant.py",
    "firmware_sim/sensors.py",
    "firmware_sim/truth.py",
    "firmware_sim/waves.py",
    "utank_hil/canbus/endpoints.py",
    "utank_hil/control/level_observer.py",
    "utank_hil/control/limiter.py",
    "utank_hil/safety/alarms.py",
    "utank_hil/runners/bus_model.py",
    "utank_hil/nodes/actuators.py",
    "utank_hil/nodes/controller.py",
    "utank_hil/nodes/drive_sequence.py",
    "utank_hil/safety/faults.py",
    "utank_hil/runners/group.py",
    "utank_hil/nodes/housekeeping.py",
    "utank_hil/nodes/inbox.py",
    "utank_hil/nodes/plausibility.py",
    "utank_hil/nodes/running_law.py",
    "utank_hil/safety/bus_load.py",
    "utank_hil/safety/judging.py",
    "utank_hil/runners/lockstep.py",
    "utank_hil/safety/monitoring.py",
    "utank_hil/safety/monitors/*.py",
    "utank_hil/nodes/orders.py",
    "utank_hil/safety/passive_twin.py",
    "utank_hil/base/periodic.py",
    "utank_hil/nodes/stations.py",
    "utank_hil/safety/supervisor.py",
    "utank_hil/runners/wire_time.py",
    "utank_hil/telemetry/memory_log.py",
)
NOT: Final = frozenset(["utank_hil/safety/monitors/thresholds.py"])
"""No file with a dataclass that a configuration holds: pydantic needs its `__dict__`, and pickle
can't fill a frozen one that is compiled.
"""

CODECS_HEAD: Final = """
from typing import Any, Final
from utank_hil.canbus.codec import COMMON

new: Final[Any] = COMMON["new"]
nan: Final[float] = COMMON["nan"]
clamp: Final[Any] = COMMON["clamp"]
members: Final[Any] = COMMON["members"]
A: Final[bytes] = COMMON["A"]
B: Final[bytes] = COMMON["B"]
C: Final[bytes] = COMMON["C"]

# compiled, these take less time than those of Python and `struct`
def round(number: float) -> int:
    return int(number + 6755399441055744.0 - 6755399441055744.0)  # 1.5 * 2**52: to even, too
def pack(crc: int, b1: int, w1: int, w2: int, w3: int) -> bytes:
    return (crc | b1 << 8 | w1 << 16 | w2 << 32).to_bytes(6, "little") + w3.to_bytes(2, "little")
def unpack(data: bytes) -> tuple[int, int, int, int, int]:
    w1, w2, w3 = (data[2] | data[3] << 8), (data[4] | data[5] << 8), (data[6] | data[7] << 8)
    return data[0], data[1], w1, w2, w3
"""


def codecs_source() -> str:
    """Text of one module with the codecs of all messages."""
    messages = load_catalogue().messages
    text = "\n".join(message.codec.source for message in messages)
    # by their names: mypyc has no `import *`
    kinds = sorted({message.kind.__name__ for message in messages})
    tables = sorted(name for name in vars(enumerations) if f" members({name}, " in text)
    functions = "\n".join(
        f"    {codec.source!r}: (encode_{codec.name}, decode_{codec.name}),"
        for codec in (message.codec for message in messages)
    )
    return f"""
from utank_hil.canbus.enumerations import {", ".join(tables)}
from utank_hil.canbus.messages import {", ".join(kinds)}
{CODECS_HEAD}
{text}
FUNCTIONS: dict[str, tuple[Any, Any]] = {{
{functions}
}}
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
        codecs = Path(scratch) / f"{CODECS}.py"
        codecs.write_text(codecs_source())
        extensions = mypycify(
            ["--config-file", "pyproject.toml", *files, str(codecs)],
            debug_level="0",
            target_dir=scratch,
        )
        done = Path(scratch) / "done"
        for extension in extensions:  # a product and a sum are two operations, as in plain Python
            extension.extra_compile_args.append("-ffp-contract=off")
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
