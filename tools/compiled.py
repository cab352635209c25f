"""Compile the modules that every tick runs through, with mypyc; see `utank_hil.base.compiled`.

Takes a minute of processor time and a C compiler; without one plain Python runs, with the same
result. Any change of the source puts the library out of use until the next time.

Example: python -m tools.compiled
"""

import argparse
import os
import shutil
import subprocess
import sysconfig
import tempfile
from concurrent.futures import ThreadPoolExecutor
from contextlib import redirect_stdout, suppress
from ctypes import CDLL
from io import StringIO
from pathlib import Path
from typing import Final

from utank_hil.base.compiled import (
    CODECS,
    FOLDER,
    GROUP,
    ROOT,
    SUFFIX,
    current_library,
    name_of_library,
    source_digest,
)
from utank_hil.base.whole_file import left_whole
from utank_hil.canbus import enumerations, load_catalogue

PATTERNS: Final = (
    "firmware_sim/drive.py",
    "firmware_sim/plant.py",
    "firmware_sim/sensors.py",
    "firmware_sim/truth.py",
    "firmware_sim/waves.py",
    "utank_hil/analysis/loop/loop_ticks.py",
    "utank_hil/canbus/endpoints.py",
    "utank_hil/canbus/measurements.py",
    "utank_hil/canbus/profiles/acting.py",
    "utank_hil/canbus/profiles/device.py",
    "utank_hil/canbus/profiles/field.py",
    "utank_hil/dynamics/pump_curve.py",
    "utank_hil/control/level_observer.py",
    "utank_hil/control/limiter.py",
    "utank_hil/control/pressure_loop.py",
    "utank_hil/safety/alarms.py",
    "utank_hil/runners/bus_model.py",
    "utank_hil/nodes/actuators.py",
    "utank_hil/nodes/canopen_drive.py",
    "utank_hil/nodes/canopen_setup.py",
    "utank_hil/nodes/controller.py",
    "utank_hil/safety/faults.py",
    "utank_hil/runners/group.py",
    "utank_hil/nodes/hardwired.py",
    "utank_hil/nodes/housekeeping.py",
    "utank_hil/nodes/actuators_heard.py",
    "utank_hil/nodes/inbox.py",
    "utank_hil/nodes/levels_heard.py",
    "utank_hil/nodes/nodes_heard.py",
    "utank_hil/nodes/routing.py",
    "utank_hil/nodes/plausibility.py",
    "utank_hil/nodes/running_law.py",
    "utank_hil/safety/judge.py",
    "utank_hil/safety/judging.py",
    "utank_hil/runners/lockstep.py",
    "utank_hil/safety/monitoring.py",
    "utank_hil/safety/monitors/*.py",
    "utank_hil/safety/passive_twin.py",
    "utank_hil/safety/situation.py",
    "utank_hil/base/tick.py",
    "utank_hil/nodes/stations.py",
    "utank_hil/safety/supervisor.py",
)
NOT: Final = frozenset(["utank_hil/safety/monitors/thresholds.py"])
"""No file with a dataclass that a configuration holds, as `scenario_sections.py` is one:
pydantic needs its `__dict__`, and pickle can't fill a frozen one that is compiled.
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

MYPY: Final = """[mypy]
explicit_package_bases = true
follow_imports_for_stubs = true
ignore_missing_imports = true
[mypy-numpy.*,scipy.*,pydantic.*,pydantic_core.*,annotated_types.*,rich.*,typer.*,click.*,can.*,\
cantools.*,control.*,yaml.*,daqp.*,numba.*,wavespectra.*,xarray.*,pandas.*,h5py.*]
follow_imports = skip
"""
"""`make check` has checked the types; reading those of other packages takes a minute."""

CC: Final = os.environ.get("CC", "cc")
# fused multiplication and addition, where the processor has it, would change the last digit
FLAGS: Final = ("-O1", "-g0", "-w", "-fPIC", "-fvisibility=hidden", "-ffp-contract=off")
START: Final = """extern PyObject *CPyInit_{0}(void);
PyMODINIT_FUNC PyInit_{0}(void) {{ return CPyInit_{0}(); }}
"""
PLAIN: Final = "the tick is not compiled, plain Python runs: the same result in 2.5 times the time"


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
    """Compile into the library of the present source, if there is none; return it."""
    made = current_library()
    if made is not None and made.stat().st_mtime > Path(__file__).stat().st_mtime:
        with suppress(OSError):  # one of a newer C library does not load here
            CDLL(str(made))
            return made
    source = source_digest()
    FOLDER.mkdir(exist_ok=True)
    with tempfile.TemporaryDirectory() as scratch:
        content = _compiled(*c_sources(Path(scratch)))
        new = FOLDER / name_of_library(source, content)
        with left_whole(whole := new.with_name(f".{os.getpid()}-{new.name}")):
            whole.write_bytes(content)
            CDLL(str(whole))
            whole.rename(new)
    for older in FOLDER.glob(f"*{SUFFIX}"):
        if older != new:
            older.unlink(missing_ok=True)
    return new


def c_sources(scratch: Path) -> tuple[list[Path], list[str]]:
    """Translate the modules to C files in an empty folder; return these and folders to include.

    Raises `SystemExit` if types are wrong.
    """
    from mypyc.build import mypycify  # takes a second

    found = [str(path.relative_to(ROOT)) for each in PATTERNS for path in sorted(ROOT.glob(each))]
    files = [file for file in found if file not in NOT and not file.endswith("__init__.py")]
    os.chdir(ROOT)  # mypyc names modules by their paths from here
    codecs, settings = scratch / f"{CODECS}.py", scratch / "mypy.ini"
    codecs.write_text(codecs_source())
    settings.write_text(MYPY)
    # no cache from before: a type error that it hides would show on another machine first
    options = ["--config-file", str(settings), "--cache-dir", str(scratch / "cache")]
    said = StringIO()
    try:
        with redirect_stdout(said):  # a warning of a construct that is slower is nothing to act on
            library = mypycify(
                [*options, *files, str(codecs)],
                multi_file=True, target_dir=str(scratch), group_name=GROUP,
            )[0]  # fmt: skip
    except SystemExit:
        print(said.getvalue(), end="")
        raise
    modules = [file.removesuffix(".py").replace("/", "___") for file in (*files, CODECS)]
    starts = scratch / "starts.c"
    starts.write_text("#include <Python.h>\n" + "\n".join(map(START.format, modules)))
    return [*map(Path, library.sources), starts], library.include_dirs


def _compiled(sources: list[Path], include: list[str]) -> bytes:
    """The library of C sources: as many compilers at once as there are cores.

    Each takes several sources as one text, since every one of them includes Python's headers.
    """
    scratch = sources[0].parent
    parts: list[list[Path]] = [[] for _ in range(2 * (os.cpu_count() or 1))]
    for source in sorted(sources, key=lambda path: -path.stat().st_size):
        min(parts, key=lambda part: sum(path.stat().st_size for path in part)).append(source)
    folders = [f"-I{folder}" for folder in (*include, sysconfig.get_path("include"))]
    objects = []
    for number, part in enumerate(parts):
        text = scratch / f"part{number}.c"
        text.write_text("".join(f'#include "{path}"\n' for path in part))
        objects.append(text.with_suffix(".o"))

    def compile_one(made: Path) -> None:
        _run([*FLAGS, *folders, "-c", str(made.with_suffix(".c")), "-o", str(made)])

    with ThreadPoolExecutor(os.cpu_count()) as pool:
        list(pool.map(compile_one, objects))
    made = scratch / "library.so"
    _run(["-shared", *map(str, objects), "-o", str(made)])
    return made.read_bytes()


def _run(arguments: list[str]) -> None:
    subprocess.run(
        [CC, *arguments], check=True, capture_output=True, text=True, errors="replace",
        env=os.environ | {"LC_ALL": "C"},  # in which an error is called one
    )  # fmt: skip


def main() -> None:
    """Compile and say what there is."""
    argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    ).parse_args()
    header = Path(sysconfig.get_path("include")) / "Python.h"
    if not (shutil.which(CC) and header.is_file()):
        print(f"{PLAIN}; to compile: apt-get install gcc python3-dev")
        return
    try:
        build()
    except (OSError, subprocess.CalledProcessError) as error:
        lines = (getattr(error, "stderr", None) or str(error)).splitlines()
        print(f"{PLAIN}: {next((line for line in lines if 'error' in line), error)}")


if __name__ == "__main__":
    main()
